"""More axes than two: what doors and the sensor's own probabilities do. No replay either."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from replay.tuning.cases import DOOR, Case, Floats
from replay.tuning.flips import flips
from replay.tuning.front import HIGH, LOW, Front, exact_front, front_of
from replay.tuning.surfaces import Tables, Values

HITS = tuple(round(0.5 + 0.05 * i, 2) for i in range(1, 10))  # 0.55 .. 0.95
MISSES = tuple(round(0.05 * i, 2) for i in range(1, 10))  # 0.05 .. 0.45


def door_front(case: Case, values: Values) -> Front | None:
    """The exact front over (p_wall, p_space, p_door); None where no doors are known."""
    doors = case.of(DOOR)
    if doors is None or case.mixed:
        return None
    fixed = Tables(case, replace(values, p_door=0.5))  # takes the doors out of space
    steps = flips(doors, values.p_levels, values.update)
    at_half = steps.counts(values.l0(0.5))
    fixed.fixed = fixed.fixed[0] - int(at_half[0]), fixed.fixed[1] - int(at_half[1])
    return front_of([fixed.wall, fixed.space, steps], fixed, LOW, HIGH)


class Sensors(NamedTuple):
    """The best that any prior gives with each sensor.

    Attributes:
        p_hit, p_miss: P(occupied).
        f2: (hits, misses) the best F2 over all (p_wall, p_space).
        points: (hits, misses, 2) where.
        none: (hits, misses) F2 without a prior.
    """

    p_hit: Floats
    p_miss: Floats
    f2: Floats
    points: Floats
    none: Floats

    @property
    def best(self) -> tuple[int, int]:
        """Index of the sensor with the highest F2."""
        i, j = np.unravel_index(int(np.argmax(self.f2)), self.f2.shape)
        return int(i), int(j)


def sensors(
    case: Case,
    values: Values,
    p_levels: Callable[[float, float], Sequence[float]],
    hits: Sequence[float] = HITS,
    misses: Sequence[float] = MISSES,
) -> Sensors:
    """The exact best prior for every sensor of a grid.

    Args:
        case: what is tuned for.
        values: its sensor is replaced.
        p_levels: P(empty) of each level, given p_hit and p_miss.
        hits, misses: P(occupied) of a hit and of a miss.
    """
    f2, none = np.zeros((len(hits), len(misses))), np.zeros((len(hits), len(misses)))
    points = np.zeros((len(hits), len(misses), 2))
    for i, p_hit in enumerate(hits):
        for j, p_miss in enumerate(misses):
            tables = Tables(case, replace(values, p_levels=tuple(p_levels(p_hit, p_miss))))
            front = exact_front(tables)
            none[i, j] = float(tables.without_prior().f2)
            if len(front.scores.tp):
                k = int(np.argmax(front.scores.f2))
                f2[i, j], points[i, j] = front.scores.f2[k], front.points[k]
    return Sensors(np.array(hits), np.array(misses), f2, points, none)
