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
from replay.localise.pool import CELL, Pool
from replay.localise.searching import TRUST, likelihood, search
from replay.localise.tile_kernels import FULL
from replay.localise.tiles import Maps

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
        search(maps.pool, particle, pose, ends, corner, spread, round(window / CELL), turns)
    fit, worth = _polish(maps.pool, particle, guess, pose, ends, corner, spread, information)
    return Match(pose, fit, worth, information)


class Matches(NamedTuple):
    """Best poses of a reading in the maps of all particles, as Match has them.

    Attributes:
        poses: (n, 3).
        fits, worths: (n,).
        information: (n, 3, 3).
    """

    poses: Floats
    fits: Floats
    worths: Floats
    information: Floats


def polish(maps: Maps, guesses: Floats, ends: Floats, spread: Floats) -> Matches:
    """Where a reading fits the map of each particle best, close to its guess (n, 3)."""
    n = len(guesses)
    found = Matches(guesses.copy(), np.empty(n), np.empty(n), np.empty((n, 3, 3)))
    _polish_all(maps.pool, guesses, *found, ends, np.array([maps.x, maps.y]), spread)
    return found


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


@njit
def _polish_all(
    pool: Pool,
    guesses: Floats,
    poses: Floats,
    fits: Floats,
    worths: Floats,
    information: Floats,
    ends: Floats,
    corner: Floats,
    spread: Floats,
) -> None:
    for p in range(len(guesses)):
        fits[p], worths[p] = _polish(
            pool, p, guesses[p], poses[p], ends, corner, spread, information[p]
        )
