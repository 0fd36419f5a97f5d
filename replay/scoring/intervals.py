"""How sure a score is: bootstrap intervals, and a paired test of one map against another.

The units that are drawn are rows of counts: blocks of a map, since neighbouring cells err together,
or logs of an archive. Seeded: the same rows give the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Floats
from formats.result import Counts

Bools = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int64]
Metric = Callable[[Counts], float]
BLOCK = 1.0  # m: longer than a sensor's error, shorter than a room
ROUNDS = 2000
SEED = 2017


class Interval(NamedTuple):
    """A score and the middle `level` of its bootstrap distribution."""

    value: float
    low: float
    high: float


class Paired(NamedTuple):
    """A difference of scores on the same units.

    Attributes:
        difference: first less second.
        low, high: bootstrap interval of it.
        p: two-sided, of a difference as large by chance (approximate randomisation).
    """

    difference: float
    low: float
    high: float
    p: float


def block_counts(
    occupied: Bools, wall: Bools, scored: Bools, resolution: float, side: float = BLOCK
) -> Ints:
    """Counts by square block of a map: (n, 4) tp, fp, fn, tn of the blocks with scored cells.

    Args:
        occupied, wall, scored: (rows, cols) as for `scoring.count`.
        resolution: m, a cell's side; side: m, a block's.
    """
    n = max(1, round(side / resolution))
    rows, cols = occupied.shape
    wide = -(-cols // n)
    block = (np.arange(rows) // n)[:, None] * wide + np.arange(cols) // n
    kind = np.where(occupied, np.where(wall, 0, 1), np.where(wall, 2, 3))
    key = block[scored] * 4 + kind[scored]
    table = np.bincount(key, minlength=4 * wide * (-(-rows // n))).reshape(-1, 4)
    return np.asarray(table[table.sum(axis=1) > 0], dtype=np.int64)


def _scores(metric: Metric, sums: Ints) -> npt.NDArray[np.float64]:
    return np.array([metric(Counts(*row)) for row in sums.tolist()], dtype=np.float64)


def _draws(units: int, rounds: int, rng: np.random.Generator) -> Ints:
    """How often each unit is drawn, (rounds, units)."""
    return np.asarray(
        rng.multinomial(units, np.full(units, 1.0 / units), size=rounds), dtype=np.int64
    )


def _middle(values: npt.NDArray[np.float64], level: float) -> tuple[float, float]:
    low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def interval(
    metric: Metric, table: Ints, *, rounds: int = ROUNDS, level: float = 0.95, seed: int = SEED
) -> Interval:
    """The percentile bootstrap of a metric of summed counts (Efron and Tibshirani 1993, ch. 13).

    Args:
        metric: one of `count_metrics.METRICS`.
        table: (n, 4) counts of each unit.

    Raises:
        ValueError: no units.
    """
    if not len(table):
        raise ValueError("an interval needs at least one unit")
    draws = _draws(len(table), rounds, np.random.default_rng(seed))
    value = metric(Counts(*table.sum(axis=0).tolist()))
    return Interval(value, *_middle(_scores(metric, draws @ table), level))


def paired(
    metric: Metric,
    first: Ints,
    second: Ints,
    *,
    rounds: int = ROUNDS,
    level: float = 0.95,
    seed: int = SEED,
) -> Paired:
    """Whether one map scores better than another on the same units.

    The interval draws units, both maps together; p swaps the two maps in each unit by the toss of a
    coin and counts differences at least as large (Noreen 1989), the observed one among them.

    Args:
        metric: one of `count_metrics.METRICS`.
        first, second: (n, 4) counts of the same units in the same order.

    Raises:
        ValueError: no units, or not the same number.
    """
    return _paired(lambda sums: _scores(metric, sums), first, second, rounds, level, seed)


def paired_means(
    first: Floats,
    second: Floats,
    *,
    rounds: int = ROUNDS,
    level: float = 0.95,
    seed: int = SEED,
) -> Paired:
    """The same of a score that each unit has of its own, (n,): of its mean over the units.

    Raises:
        ValueError: no units, or not the same number.
    """

    def mean(sums: Any) -> Floats:
        return np.asarray(sums[:, 0] / len(first), dtype=np.float64)

    return _paired(mean, first[:, None], second[:, None], rounds, level, seed)


def _paired(
    score: Callable[[Any], Floats], first: Any, second: Any, rounds: int, level: float, seed: int
) -> Paired:
    """Both, where `score` turns sums over units (k, m) into k scores."""
    if not len(first) or first.shape != second.shape:
        raise ValueError("a paired test needs the same units of both, and at least one")
    rng = np.random.default_rng(seed)
    difference = float(np.subtract(*score(np.stack((first.sum(axis=0), second.sum(axis=0))))))
    draws = _draws(len(first), rounds, rng)
    low, high = _middle(score(draws @ first) - score(draws @ second), level)
    swapped = rng.integers(0, 2, size=(rounds, len(first)), dtype=np.int64)
    moved = swapped @ (second - first)
    by_chance = score(first.sum(axis=0) + moved) - score(second.sum(axis=0) - moved)
    as_large = int(np.count_nonzero(np.abs(by_chance) >= abs(difference) - 1e-12))
    return Paired(difference, low, high, (as_large + 1) / (rounds + 1))
