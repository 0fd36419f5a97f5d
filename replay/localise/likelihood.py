"""How well a reading fits the plan from a pose: the likelihood-field and the beam model.

Thrun, Burgard and Fox, "Probabilistic Robotics" (2005), Tables 6.1 and 6.3; parameters have
nav2_amcl's names. Costs are whole numbers, 1 / UNIT nats below the likelihood of a beam that fits
perfectly: sums of integers are the same in any order.
"""

from __future__ import annotations

from math import cos, inf, sin
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Pose, Scan
from formats.jit import njit
from replay.localise.field import Field

Costs = npt.NDArray[np.int32]
Singles = npt.NDArray[np.float32]
UNIT = 4096  # a cost of 1 nat
LONGEST = 100.0  # m, nav2's laser_max_range


class Reading(NamedTuple):
    """The beams of a scan that count, as seen from the robot's body.

    Attributes:
        origin: of the sensor on the body.
        bearings: (b,) rad in the body's frame.
        ranges: (b,) m.
        longest: m, at which the sensor sees nothing more.
    """

    origin: Pose
    bearings: Floats
    ranges: Floats
    longest: float

    @property
    def points(self) -> Floats:
        """(2, b) m where the beams end, in the body's frame."""
        u, v = np.cos(self.bearings), np.sin(self.bearings)
        x, y, _ = self.origin
        return np.stack([x + self.ranges * u, y + self.ranges * v])


def pick(
    scan: Scan,
    mount: Pose,
    max_beams: int,
    *,
    laser_min_range: float = -1.0,
    laser_max_range: float = LONGEST,
) -> Reading:
    """At most `max_beams` beams, spread evenly over those that hit something (REP-117).

    Args:
        scan: as recorded.
        mount: pose of its sensor on the body.
        max_beams: how many.
        laser_min_range, laser_max_range: m; -1 for the sensor's own.
    """
    ranges = scan.ranges.astype(np.float64)
    near = max(scan.min_range, 1e-3, laser_min_range)
    own = scan.max_range if scan.max_range > 0.0 else inf
    far = min(own, laser_max_range if laser_max_range > 0.0 else inf, LONGEST)
    good = np.flatnonzero((ranges >= near) & (ranges < far * (1.0 - 1e-6)))
    if good.size > max_beams:
        good = good[(np.arange(max_beams) * good.size) // max_beams]
    return Reading(mount, scan.bearings[good] + mount.yaw, ranges[good], far)


class Model(Protocol):
    """What a filter asks of a sensor model."""

    def costs(self, particles: Floats, reading: Reading) -> Costs:
        """(n,) costs of a reading from body poses (n, 3) in the plan's own frame."""
        ...


class LikelihoodField:
    """Ends of beams near walls are likely: `z_hit * N(d; sigma_hit) + z_rand / range`.

    Only the end point counts, so that beams may pass through walls; it is smooth, and fast. As in
    nav2_amcl the normal's peak is 1.

    Args:
        field: distances on the plan.
        z_hit, z_rand: shares of beams that hit what is drawn, and anything else.
        sigma_hit: m.
        laser_likelihood_max_dist: m, beyond it all distances are the same.
    """

    def __init__(
        self,
        field: Field,
        *,
        z_hit: float = 0.5,
        z_rand: float = 0.5,
        sigma_hit: float = 0.1,
        laser_likelihood_max_dist: float = 2.0,
    ) -> None:
        self.field = field
        self._weights = z_hit, z_rand, sigma_hit, laser_likelihood_max_dist
        self._longest, self._table = 0.0, np.empty(0, dtype=np.int32)

    def costs(self, particles: Floats, reading: Reading) -> Costs:
        """(n,) costs of a reading from body poses (n, 3) in the plan's own frame."""
        if reading.longest != self._longest:
            self._longest, self._table = reading.longest, self._build(reading.longest)
        g = self.field.geometry
        # Counted from the border of one cell: its cells stand for all that lies beyond.
        x = ((particles[:, 0] - g.x) / g.resolution + 1.0).astype(np.float32)
        y = ((particles[:, 1] - g.y) / g.resolution + 1.0).astype(np.float32)
        c, s = (
            np.cos(particles[:, 2]).astype(np.float32),
            np.sin(particles[:, 2]).astype(np.float32),
        )
        u, v = (reading.points / g.resolution).astype(np.float32)
        costs = np.empty(len(particles), dtype=np.int32)
        _look_up(self._table, np.int32(g.cols + 1), np.int32(g.rows + 1), x, y, c, s, u, v, costs)
        return costs

    def _build(self, longest: float) -> Costs:
        """Flat costs by cell with a border of one cell around."""
        z_hit, z_rand, sigma, most = self._weights
        distance = np.pad(np.minimum(np.abs(self.field.distance), most), 1, constant_values=most)
        rand = z_rand / min(longest, LONGEST)
        p = z_hit * np.exp(-0.5 * np.square(distance / sigma)) + rand
        nats = np.log(z_hit + rand) - np.log(p)
        return np.round(nats * UNIT).astype(np.int32).ravel()


@njit
def _look_up(
    table: Costs,
    last_col: np.int32,
    last_row: np.int32,
    x: Singles,
    y: Singles,
    c: Singles,
    s: Singles,
    u: Singles,
    v: Singles,
    costs: Costs,
) -> None:
    """Sum the table under the ends of all beams, from every particle; lengths in cells.

    All of 32 bits and without a branch, so that eight beams go at a time.
    """
    for i in range(x.size):
        xi, yi, ci, si = x[i], y[i], c[i], s[i]
        total = np.int32(0)
        for k in range(u.size):
            col = np.int32(xi + ci * u[k] - si * v[k])
            row = np.int32(yi + si * u[k] + ci * v[k])
            col = min(max(col, np.int32(0)), last_col)
            row = min(max(row, np.int32(0)), last_row)
            total += table[row * (last_col + np.int32(1)) + col]
        costs[i] = total


class BeamModel:
    """Ranges as a ray would measure them: hit, short (people), max and random.

    Args:
        field: distances on the plan.
        z_hit, z_short, z_max, z_rand: shares of beams.
        sigma_hit: m.
        lambda_short: 1/m.
    """

    def __init__(
        self,
        field: Field,
        *,
        z_hit: float = 0.5,
        z_short: float = 0.05,
        z_max: float = 0.05,
        z_rand: float = 0.5,
        sigma_hit: float = 0.1,
        lambda_short: float = 0.1,
    ) -> None:
        self.field = field
        self._weights = np.array([z_hit, z_short, z_max, z_rand, sigma_hit, lambda_short])

    def costs(self, particles: Floats, reading: Reading) -> Costs:
        """(n,) costs of a reading from body poses (n, 3) in the plan's own frame."""
        g, mount = self.field.geometry, reading.origin
        c, s = np.cos(particles[:, 2]), np.sin(particles[:, 2])
        x = particles[:, 0] + c * mount.x - s * mount.y
        y = particles[:, 1] + s * mount.x + c * mount.y
        at = np.stack([(x - g.x) / g.resolution, (y - g.y) / g.resolution, particles[:, 2]])
        costs = np.empty(len(particles), dtype=np.int32)
        _cast(
            self.field.distance,
            g.resolution,
            at,
            reading.bearings,
            reading.ranges,
            min(reading.longest, LONGEST),
            self._weights,
            costs,
        )
        return costs


@njit
def expected_range(
    distance: Singles, resolution: float, x: float, y: float, yaw: float, longest: float
) -> float:
    """How far a ray from x, y (in cells) goes until it is in a wall's cell, m; at most `longest`.

    It strides by the distance to the nearest wall, which it cannot pass.
    """
    rows, cols = distance.shape
    u, v, r = cos(yaw), sin(yaw), 0.0
    while r < longest:
        col, row = int(x + r * u / resolution), int(y + r * v / resolution)
        if col < 0 or col >= cols or row < 0 or row >= rows:
            return longest
        d = distance[row, col]
        if d < 0.5 * resolution:
            return r
        r += max(d - 0.5 * resolution, 0.5 * resolution)
    return longest


@njit
def _cast(
    distance: Singles,
    resolution: float,
    at: Floats,
    bearings: Floats,
    ranges: Floats,
    longest: float,
    weights: Floats,
    costs: Costs,
) -> None:
    """Table 6.1 with the sum of log p; a hit's peak is 1 as in nav2_amcl."""
    z_hit, z_short, z_max, z_rand, sigma, rate = weights
    best = np.log(z_hit + z_short * rate + z_rand / longest)
    for i in range(at.shape[1]):
        total = 0.0
        for k in range(bearings.size):
            x, y, yaw = at[0, i], at[1, i], at[2, i]
            wanted = expected_range(distance, resolution, x, y, yaw + bearings[k], longest)
            r = ranges[k]
            p = z_hit * np.exp(-0.5 * ((r - wanted) / sigma) ** 2) + z_rand / longest
            if r < wanted:
                p += z_short * rate * np.exp(-rate * r)
            if r >= longest:
                p += z_max
            total += best - np.log(p)
        costs[i] = np.int32(min(round(total * UNIT), 2e9))
