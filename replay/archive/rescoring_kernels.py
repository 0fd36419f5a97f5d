"""Scores of many curves over groups of cells in one pass."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formats.grid import Counted, Floats
from formats.jit import njit
from formats.results.groups import TRUTH, Kinds

Ints = npt.NDArray[np.int64]


@njit
def sums(counts: Counted, sizes: Floats, signs: Ints, totals: Floats, visits: Ints) -> None:
    """Log-odds that the readings add up to, and how many there were, by `Evidence.on`'s additions.

    Args:
        counts: (levels, n).
        sizes, signs: (m,) and (m, levels), `formats.grid.terms`.
        totals, visits: (n,) results.
    """
    for g in range(counts.shape[1]):
        total, seen = 0.0, np.int64(0)
        for level in range(counts.shape[0]):
            seen += np.int64(counts[level, g])
        for m in range(sizes.size):
            net = np.int64(0)
            for level in range(counts.shape[0]):
                net += signs[m, level] * np.int64(counts[level, g])
            total += sizes[m] * net
        totals[g], visits[g] = total, seen


@njit
def tally(
    kind: Kinds,
    cells: Counted,
    totals: Floats,
    visits: Ints,
    sensor: Ints,
    l0: Floats,
    paper: npt.NDArray[np.bool_],
    out: Ints,
) -> None:
    """Count the cells of every curve by what they are and what its map says.

    Args:
        kind, cells: (n,) of the groups.
        totals: (sensors, n), `sums` of each set of levels.
        visits: (n,).
        sensor: (curves,) which of the totals.
        l0: (curves, kinds) the prior's log-odds of empty.
        paper: (curves,) by the paper's update.
        out: (curves, 2, 4) observed and unobserved: tp, fp, fn, tn; added to.
    """
    for c in range(sensor.size):
        readings = totals[sensor[c]]
        for g in range(kind.size):
            prior = l0[c, kind[g]]
            log_odds = readings[g] - (visits[g] - 1) * prior if paper[c] else readings[g] + prior
            said = 0 if log_odds < 0.0 else 2
            real = 0 if kind[g] & TRUTH else 1
            out[c, 0 if visits[g] > 0 else 1, said + real] += cells[g]
