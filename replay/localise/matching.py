"""Correlative scan matching: the pose from which a reading fits a map best.

Olson, "Real-Time Correlative Scan Matching" (ICRA 2009): every pose of a window is tried, but where
a coarse table, which is never below the fine one, says that a block of them cannot win. The best
one is polished by Gauss-Newton on the interpolated likelihood, as Hector SLAM does (Kohlbrecher et
al. 2011), with the motion as a prior.

A pose's worth is TRUST x the mean likelihood of the beams, less half the squared deviations from
where the motion says that it ought to be.
"""

from __future__ import annotations

from math import cos, floor, hypot, sin
from typing import NamedTuple

import numpy as np

from formats.frame import Floats
from formats.jit import njit
from replay.localise.tiles import BLOCK, CELL, FULL, SIDE, Bytes, Ints, Maps, Pool

TRUST = 60.0  # nats that a reading which fits perfectly says more than one that fits nowhere
STEPS = 12  # of Gauss-Newton, at most


class Match(NamedTuple):
    """A reading's best pose.

    Attributes:
        pose: (3,) of the body.
        fit: mean likelihood of the beams, 0 to 1.
        worth: TRUST x fit, less half the squared deviations from the guess.
        information: (3, 3) inverse of its covariance, of map and motion together.
    """

    pose: Floats
    fit: float
    worth: float
    information: Floats


def match(
    maps: Maps,
    particle: int,
    guess: Floats,
    ends: Floats,
    spread: Floats,
    window: float,
    angle: float,
) -> Match:
    """Where a reading fits the map of a particle best, around a guess.

    Args:
        maps: of particles.
        particle: whose.
        guess: (3,) pose of the body, m, m, rad.
        ends: (2, b) m where the beams end, in the body's frame.
        spread: (3,) standard deviations of the guess along x, y and in yaw; m, m, rad.
        window: m to each side that is searched; 0: the guess is only polished.
        angle: rad to each side.
    """
    pose, information = guess.copy(), np.diag(spread**-2.0)
    corner = np.array([maps.x, maps.y])
    if window > 0.0:
        far = max(float(np.hypot(*ends).max(initial=0.0)), 1.0)
        step = max(CELL / far, 0.004)  # at its end a beam moves by a cell
        count = floor(angle / step)
        turns = np.arange(-count, count + 1, dtype=np.float64) * step
        _search(maps.pool, particle, pose, ends, corner, spread, round(window / CELL), turns)
    fit, worth = _polish(maps.pool, particle, guess, pose, ends, corner, spread, information)
    return Match(pose, fit, worth, information)


@njit
def likelihood(likely: Bytes, tables: Ints, particle: int, row: int, col: int) -> int:
    """Of a beam that ends in a cell, 0 to FULL."""
    if row < 0 or col < 0:
        return 0
    r, c = row // SIDE, col // SIDE
    if r >= tables.shape[1] or c >= tables.shape[2]:
        return 0
    return likely[tables[particle, r, c], row % SIDE, col % SIDE]


@njit
def _bound(coarse: Bytes, tables: Ints, particle: int, row: int, col: int) -> int:
    """At least the likelihood of the cells from here to BLOCK - 1 further up and right."""
    best = 0
    for i in range(2):
        for j in range(2):
            a, b = row + i * (BLOCK - 1), col + j * (BLOCK - 1)
            if a < 0 or b < 0:
                continue
            r, c = a // SIDE, b // SIDE
            if r < tables.shape[1] and c < tables.shape[2]:
                tile = tables[particle, r, c]
                best = max(best, coarse[tile, a % SIDE // BLOCK, b % SIDE // BLOCK])
    return best


@njit
def _nearest(low: float, high: float) -> float:
    """The least of the absolute values from low to high."""
    return max(low, -high, 0.0)


@njit
def _search(
    pool: Pool,
    particle: int,
    pose: Floats,
    ends: Floats,
    corner: Floats,
    spread: Floats,
    reach: int,
    turns: Floats,
) -> None:
    """Put the best pose of the window into `pose`, which is the guess."""
    beams, blocks = ends.shape[1], (2 * reach + BLOCK) // BLOCK
    count = turns.size * blocks * blocks
    bounds = np.empty(count)
    rows = np.empty((turns.size, beams), dtype=np.int64)
    cols = np.empty((turns.size, beams), dtype=np.int64)
    likely, coarse, tables = pool.likely, pool.coarse, pool.tables
    unit = TRUST / (FULL * max(beams, 1))
    x, y, yaw = (pose[0] - corner[0]) / CELL, (pose[1] - corner[1]) / CELL, pose[2]
    for t in range(turns.size):
        c, s = cos(yaw + turns[t]) / CELL, sin(yaw + turns[t]) / CELL
        turned = 0.5 * (turns[t] / spread[2]) ** 2
        for k in range(beams):
            cols[t, k] = floor(x + c * ends[0, k] - s * ends[1, k])
            rows[t, k] = floor(y + s * ends[0, k] + c * ends[1, k])
        for i in range(blocks):
            for j in range(blocks):
                row, col = i * BLOCK - reach, j * BLOCK - reach
                total = 0
                for k in range(beams):
                    a, b = rows[t, k] + row, cols[t, k] + col
                    total += _bound(coarse, tables, particle, a, b)
                dy = _nearest(row * CELL, (row + BLOCK - 1) * CELL) / spread[1]
                dx = _nearest(col * CELL, (col + BLOCK - 1) * CELL) / spread[0]
                bounds[(t * blocks + i) * blocks + j] = (
                    unit * total - 0.5 * (dx * dx + dy * dy) - turned
                )
    best, winner = -1e300, (0, 0, 0)
    for n in np.argsort(-bounds, kind="mergesort"):
        if bounds[n] <= best:
            break
        t, i, j = n // (blocks * blocks), n // blocks % blocks, n % blocks
        turned = 0.5 * (turns[t] / spread[2]) ** 2
        for row in range(i * BLOCK - reach, min((i + 1) * BLOCK - reach, reach + 1)):
            for col in range(j * BLOCK - reach, min((j + 1) * BLOCK - reach, reach + 1)):
                total = 0
                for k in range(beams):
                    a, b = rows[t, k] + row, cols[t, k] + col
                    total += likelihood(likely, tables, particle, a, b)
                dx, dy = col * CELL / spread[0], row * CELL / spread[1]
                worth = unit * total - 0.5 * (dx * dx + dy * dy) - turned
                if worth > best:
                    best, winner = worth, (t, row, col)
    pose[0] += winner[2] * CELL
    pose[1] += winner[1] * CELL
    pose[2] += turns[winner[0]]


@njit
def _fit(
    pool: Pool, particle: int, pose: Floats, ends: Floats, corner: Floats, gradient: Floats
) -> float:
    """Mean interpolated likelihood; `gradient` (b, 4) gets each beam's value and derivatives."""
    c, s = cos(pose[2]), sin(pose[2])
    likely, tables, total = pool.likely, pool.tables, 0.0
    for k in range(ends.shape[1]):
        u, v = c * ends[0, k] - s * ends[1, k], s * ends[0, k] + c * ends[1, k]
        x, y = (pose[0] + u - corner[0]) / CELL - 0.5, (pose[1] + v - corner[1]) / CELL - 0.5
        col, row = floor(x), floor(y)
        p, q = x - col, y - row
        a = likelihood(likely, tables, particle, row, col) / FULL
        b = likelihood(likely, tables, particle, row, col + 1) / FULL
        d = likelihood(likely, tables, particle, row + 1, col) / FULL
        e = likelihood(likely, tables, particle, row + 1, col + 1) / FULL
        value = (1 - q) * ((1 - p) * a + p * b) + q * ((1 - p) * d + p * e)
        gx = ((1 - q) * (b - a) + q * (e - d)) / CELL
        gy = ((1 - p) * (d - a) + p * (e - b)) / CELL
        gradient[k, 0], gradient[k, 1], gradient[k, 2] = value, gx, gy
        gradient[k, 3] = -gx * v + gy * u
        total += value
    return total / max(ends.shape[1], 1)


@njit
def _worth(fit: float, pose: Floats, guess: Floats, spread: Floats) -> float:
    total = TRUST * fit
    for i in range(3):
        total -= 0.5 * ((pose[i] - guess[i]) / spread[i]) ** 2
    return total


@njit
def _polish(
    pool: Pool,
    particle: int,
    guess: Floats,
    pose: Floats,
    ends: Floats,
    corner: Floats,
    spread: Floats,
    information: Floats,
) -> tuple[float, float]:
    """Gauss-Newton with damping on sum (1 - likelihood)² and the motion; fit and worth.

    `pose` is improved in place, `information` becomes the curvature there.
    """
    beams = ends.shape[1]
    slopes, tried = np.empty((beams, 4)), np.empty((beams, 4))
    fit = _fit(pool, particle, pose, ends, corner, slopes)
    worth, damping = _worth(fit, pose, guess, spread), 1e-3
    each = TRUST / max(beams, 1)
    prior = np.diag(spread**-2.0)
    information[:] = prior
    again = True
    for _ in range(STEPS):
        if again:
            curve, pull = prior.copy(), np.empty(3)
            for i in range(3):
                pull[i] = (guess[i] - pose[i]) / spread[i] ** 2
            for k in range(beams):
                for i in range(3):
                    pull[i] += each * (1.0 - slopes[k, 0]) * slopes[k, 1 + i]
                    for j in range(3):
                        curve[i, j] += each * slopes[k, 1 + i] * slopes[k, 1 + j]
            information[:] = curve
        damped = curve.copy()
        for i in range(3):
            damped[i, i] *= 1.0 + damping
        step = np.linalg.solve(damped, pull)
        far = max(hypot(step[0], step[1]) / (2 * CELL), abs(step[2]) / 0.1)
        if far > 1.0:
            step /= far
        moved = pose + step
        now = _fit(pool, particle, moved, ends, corner, tried)
        value = _worth(now, moved, guess, spread)
        again = value > worth
        if again:
            pose[:] = moved
            slopes, tried = tried, slopes
            fit, worth, damping = now, value, damping * 0.3
            if far < 0.01:
                break
        else:
            damping *= 10.0
            if damping > 1e4:
                break
    return fit, worth
