"""Whether a plan is that of the place: a particle filter gathers on the plan of any building.

On the right plan beams end at walls, or before them at what is not drawn; on another one they go
through walls, and where they end is chance.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, floor, pi, sin
from typing import NamedTuple

import numpy as np

from formats.frame import Floats
from formats.jit import njit
from replay.localise.field import Field
from replay.localise.likelihood import Reading, Singles, expected_range

AT = 0.2  # m from a wall's face, within which a beam ends at it
PAST, SHARE = 0.3, 0.02  # m, and of its range, that a beam goes on behind a wall to be through it
ASIDE = 0.035  # rad to each side that a beam may go instead: along a wall little leads through it
# Of the beams, by which those that end at walls must outnumber those that go through: 0.29 (a lidar
# near the floor of a full laboratory) to 0.84 on the right plan, -0.60 to 0.23 on others' on which
# the particles stayed together.
MORE = 0.25
STAYED = 0.25  # of the updates, at which the particles must agree: 0.5 to 1 on the right plan


class Fit(NamedTuple):
    """How the beams of a drive lie on the plan.

    Attributes:
        at: share of them that end at a wall, and pass none before.
        through: share that pass a wall.
    """

    at: float
    through: float

    @property
    def doubt(self) -> str:
        """What speaks against the plan, "" where nothing does."""
        if self.at - self.through >= MORE:
            return ""
        return f"{self.at:.0%} of the beams end at its walls, {self.through:.0%} go through them"


def fit_of(field: Field, poses: Floats, readings: Iterable[Reading]) -> Fit:
    """How the beams of readings, taken from body poses (k, 3) on the plan, lie on it."""
    found, beams = np.zeros(2), 0
    for (x, y, yaw), reading in zip(poses, readings, strict=True):
        mount, g = reading.origin, field.geometry
        beams += reading.ranges.size
        at = np.array(
            [
                (x + cos(yaw) * mount.x - sin(yaw) * mount.y - g.x) / g.resolution,
                (y + sin(yaw) * mount.x + cos(yaw) * mount.y - g.y) / g.resolution,
                yaw,
            ]
        )
        _count(field.distance, g.resolution, at, reading.bearings, reading.ranges, found)
    return Fit(float(found[0]) / beams, float(found[1]) / beams) if beams else Fit(1.0, 0.0)


def unsure(field: Field, poses: Floats) -> Floats:
    """(k, 3, 3) covariances about poses (k, 3) of being anywhere in the free space."""
    rows, cols = np.divmod(field.free, field.geometry.cols)
    g, half = field.geometry, 0.5
    places = np.stack([g.x + (cols + half) * g.resolution, g.y + (rows + half) * g.resolution])
    off = places.mean(axis=1) - poses[:, :2]
    found = np.zeros((len(poses), 3, 3))
    found[:, :2, :2] = np.cov(places, bias=True) + off[:, :, None] * off[:, None, :]
    found[:, 2, 2] = pi * pi / 3.0
    return found


@njit
def _behind(
    distance: Singles, resolution: float, x: float, y: float, yaw: float, longest: float
) -> float:
    """How far a ray from x, y (in cells) is out of the first wall again, m; at most `longest`."""
    r = expected_range(distance, resolution, x, y, yaw, longest)
    while r < longest:
        col, row = floor(x + r * cos(yaw) / resolution), floor(y + r * sin(yaw) / resolution)
        if not (0 <= row < distance.shape[0] and 0 <= col < distance.shape[1]):
            break
        if distance[row, col] >= 0.5 * resolution:
            break
        r += 0.5 * resolution
    return min(r, longest)


@njit
def _count(
    distance: Singles,
    resolution: float,
    at: Floats,
    bearings: Floats,
    ranges: Floats,
    found: Floats,
) -> None:
    """Add the beams that end at walls, and those that pass them."""
    for k in range(bearings.size):
        heading, r = at[2] + bearings[k], ranges[k]
        face = 0.0
        for side in range(-1, 2):
            turned = heading + side * ASIDE
            face = max(face, _behind(distance, resolution, at[0], at[1], turned, r))
        if r > face + PAST + SHARE * r:
            found[1] += 1.0
            continue
        col = floor(at[0] + r * cos(heading) / resolution)
        row = floor(at[1] + r * sin(heading) / resolution)
        on = 0 <= row < distance.shape[0] and 0 <= col < distance.shape[1]
        if on and abs(distance[row, col]) < AT:
            found[0] += 1.0
