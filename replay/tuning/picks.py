"""One prior out of a front: by F2, by weights, at the knee, the paper's, the most robust."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay.prior import P_SPACE, P_WALL
from replay.tuning.cases import Floats
from replay.tuning.front import Front
from replay.tuning.surfaces import Tables, worst

# What each pick is, in the order of the tables.
PICKS = {
    "paper": "the paper's (0.2, 0.9)",
    "f2": "best F2",
    "weights": "by pseudo-weights",
    "knee": "at the knee",
    "robust": "best worst F2 of all runs",
    "early": "best mean F2 over what was explored",
    "shortlist": "best F2 in the paper's shortlist (E11)",
}
PAPER = (P_WALL, P_SPACE)


def best_f2(front: Front) -> int:
    """The point of the front with the highest F2 (which is that of all priors); -1 for none."""
    return int(np.argmax(front.scores.f2)) if len(front.scores.tp) else -1


def by_weights(objectives: Floats, recall_weight: float = 0.5) -> int:
    """The point whose pseudo-weights (Deb 2001, section 9.6) are nearest to those asked for.

    Args:
        objectives: (n, 2) of 1 / precision, 1 / recall on a front.
        recall_weight: 0..1; that of precision is the rest.
    """
    if not len(objectives):
        return -1
    low, high = objectives.min(axis=0), objectives.max(axis=0)
    gain = (high - objectives) / np.where(high > low, high - low, 1.0)
    whole = gain.sum(axis=1, keepdims=True)
    weights = np.divide(gain, whole, out=np.full_like(gain, 0.5), where=whole > 0)
    off = np.abs(weights - [1.0 - recall_weight, recall_weight]).sum(axis=1)
    return int(np.argmin(off))


def knee(objectives: Floats) -> int:
    """The point farthest below the line between the front's ends (Das 1999), both scaled to 1."""
    if not len(objectives):
        return -1
    low, high = objectives.min(axis=0), objectives.max(axis=0)
    scaled = (objectives - low) / np.where(high > low, high - low, 1.0)
    return int(np.argmin(scaled.sum(axis=1)))


def robust(tables: Sequence[Tables], p: Floats) -> tuple[float, float, float]:
    """p_wall, p_space with the best worst F2 of all runs, and that F2, on a grid of p.

    Of equal pairs the middle one of its row and column of equals.
    """
    least = worst([table.surface(p, p).f2 for table in tables])
    i, j = middle_of_best(least)
    return float(p[i]), float(p[j]), float(least[i, j])


def middle_of_best(surface: Floats) -> tuple[int, int]:
    """Of the cells with the highest value the one nearest to the middle of them all."""
    best = np.argwhere(surface >= surface.max())
    k = int(np.argmin(((best - best.mean(axis=0)) ** 2).sum(axis=1)))
    return int(best[k, 0]), int(best[k, 1])


def in_shortlist(
    p_wall: Floats, p_space: Floats
) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Which priors the paper's shortlist holds (Equation 11), after rounding to tenths."""
    wall, space = np.round(p_wall, 1), np.round(p_space, 1)
    low = (wall == 0.2) & (space >= 0.6)
    return np.asarray(low | ((wall >= 0.4) & (wall <= 0.5) & (space >= 0.7) & (space <= 0.8)))
