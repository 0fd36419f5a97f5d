"""Without any truth: how well the map foretells each scan before it is inserted.

A beam runs through cells that stop it at random: over a way s in a cell it goes on with probability
P(empty)^(s / side), so that P(empty) of a cell is that of crossing it once (the decay rate model of
Schaefer, Luft and Burgard 2017). A hit at z has the density of ending within a band around z, a
beam without a return the probability of getting as far as it clears; a share RANDOM of the beams
may do anything (the mixture of Thrun, Burgard and Fox 2005, Table 6.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, floor, inf, isfinite, log, log1p

import numpy as np

from formats.frame import Frame
from formats.grid import Counted, Evidence, Floats
from formats.jit import njit
from formats.result import Curve
from replay.scoring.kernels import Ints, value
from replay.scoring.scorer import joined
from replay.sensors.observer import Observer

BEAMS = 60  # of a scan, evenly chosen
BAND = 1.5  # cells to either side of a hit: the sensor's noise and the lattice's
RANDOM = 0.05


@njit
def softplus(x: float) -> float:
    """Logarithm of 1 + exp(x), without overflow: -log P(empty) where x is -l."""
    return x + log1p(exp(-x)) if x > 0.0 else log1p(exp(x))


@njit
def survivals(
    x: float,
    y: float,
    u: float,
    v: float,
    near: float,
    far: float,
    shape: tuple[int, int],
    counts: Counted,
    curve: tuple[Floats, bool, Floats, Ints],
) -> tuple[float, float]:
    """Log-probabilities of a beam to get as far as `near` and `far`, cells; outside nothing stops.

    Args:
        x, y: start, in cells from the lattice's corner; u, v: direction.
        counts: (levels, cells).
        curve: l0 (cells,), by the paper's update, sizes and signs.
    """
    prior, paper, sizes, signs = curve
    col, row, t = floor(x), floor(y), 0.0
    first = 0.0
    total = 0.0
    while t < far:
        across = (col + (1 if u > 0.0 else 0) - x) / u if u != 0.0 else inf
        along = (row + (1 if v > 0.0 else 0) - y) / v if v != 0.0 else inf
        leave = min(across, along, far)
        if 0 <= col < shape[1] and 0 <= row < shape[0] and leave > t:
            cell = row * shape[1] + col
            rate = softplus(-value(counts, cell, prior[cell], paper, sizes, signs))
            if t < near:
                first -= rate * (min(leave, near) - t)
            total -= rate * (leave - t)
        t = max(t, leave)
        if across <= along:
            col += 1 if u > 0.0 else -1
        else:
            row += 1 if v > 0.0 else -1
    return first, total


@njit
def foretell(
    place: tuple[float, float, float],
    bearings: Floats,
    ranges: Floats,
    limits: Floats,
    side: float,
    widest: float,
    shape: tuple[int, int],
    counts: Counted,
    curve: tuple[Floats, bool, Floats, Ints],
) -> tuple[float, int]:
    """Sum of log-likelihoods of the beams, nats, and how many say anything.

    Args:
        place: of the sensor: cells, cells, rad.
        bearings: (n,) rad; ranges: (n,) m.
        limits: m, as of `sensor_kernels.clean`.
        side: m, a cell's; widest: m, over which a random hit may lie.
    """
    nearest, nothing, farthest, clear = limits[0], limits[1], limits[2], limits[3]
    x, y, yaw = place
    total, n = 0.0, 0
    for i in range(bearings.size):
        r, angle = ranges[i], yaw + bearings[i]
        if not (r >= nearest and isfinite(angle)):
            continue
        u, v = np.cos(angle), np.sin(angle)
        if r >= nothing or r > farthest:
            reach = clear if r >= nothing else farthest
            if reach <= 0.0:
                continue
            _, last = survivals(x, y, u, v, 0.0, reach / side, shape, counts, curve)
            likely = (1.0 - RANDOM) * exp(last) + RANDOM
        else:
            near, far = max(r / side - BAND, 0.0), r / side + BAND
            first, last = survivals(x, y, u, v, near, far, shape, counts, curve)
            ends = (exp(first) - exp(last)) / ((far - near) * side)
            likely = (1.0 - RANDOM) * ends + RANDOM / widest
        total += log(likely)
        n += 1
    return total, n


class Predictor:
    """The mean log-likelihood of the beams of each scan under the maps before it.

    Args:
        curves: by name.
        observe: the mapper's observer, whose limits hold.

    Attributes:
        scans: so far, of those with a beam that says anything.
    """

    def __init__(self, curves: Mapping[str, Curve], observe: Observer) -> None:
        self._observe, self._names = observe, list(curves)
        joint = joined(curves)
        self._curves = [
            (joint.priors[joint.places[k]], bool(joint.paper[k]), joint.sizes[k], joint.signs[k])
            for k in range(len(curves))
        ]
        self._sums = np.zeros(len(curves))
        self.scans = 0

    def see(self, frame: Frame, evidence: Evidence) -> None:
        """A scan that is not yet in the evidence; its pose is in the lattice's frame."""
        g, scan = evidence.geometry, frame.scan
        step = -(-scan.ranges.size // BEAMS)
        ranges = np.asarray(scan.ranges[::step], dtype=np.float64)
        bearings = np.ascontiguousarray(scan.bearings[::step], dtype=np.float64)
        x, y = (frame.pose.x - g.x) / g.resolution, (frame.pose.y - g.y) / g.resolution
        if not all(isfinite(number) and abs(number) < 1e9 for number in (x, y, frame.pose.yaw)):
            return
        limits = self._observe.limits(scan)
        widest = float(min(limits[1], limits[2]))
        counts = evidence.counts.reshape(evidence.counts.shape[0], -1)
        place, used = (x, y, float(frame.pose.yaw)), 0
        for k, curve in enumerate(self._curves):
            total, used = foretell(
                place, bearings, ranges, limits, g.resolution, widest, g.shape, counts, curve
            )
            self._sums[k] += total / used if used else 0.0
        self.scans += used > 0

    def scores(self) -> dict[str, float]:
        """Nats a beam, the mean over the scans, by curve; nan before the first."""
        return dict(zip(self._names, (self._sums / (self.scans or np.nan)).tolist(), strict=True))
