"""Where cells flip as l0 grows, sorted: what is occupied under any prior, by look-up.

A cell of n readings with log-odds `total` is occupied iff total + l0 < 0 under `bayes`, and iff
total - (n - 1) l0 < 0 under `paper`. So it flips at most once: without a reading, and always under
`bayes`, it is occupied below a threshold; with one reading it never flips under `paper`; with more
it is occupied above one. Sorted and added up, the cells of a class are a step function of l0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Evidence, Geometry, Update
from replay.tuning.cases import Cells, Floats, Ints


class Flips(NamedTuple):
    """Wall and space of the truth that are occupied in the map, by l0 of the class.

    Attributes:
        at: (m,) l0 at which something flips, ascending.
        tp, fp: (2 m + 1,) true and false positives: at 2 i below at[i], at 2 i + 1 exactly there,
            where a tie is empty, and at 2 m above them all.
    """

    at: Floats
    tp: Ints
    fp: Ints

    def piece(self, l0: npt.ArrayLike) -> Ints:
        """Index into tp and fp of each l0."""
        l0 = np.asarray(l0, dtype=np.float64)
        below = np.searchsorted(self.at, l0)
        there = np.searchsorted(self.at, l0, side="right") > below
        return 2 * below + there

    def counts(self, l0: npt.ArrayLike) -> tuple[Ints, Ints]:
        """True and false positives at each l0."""
        index = self.piece(l0)
        return self.tp[index], self.fp[index]


NOTHING = Flips(np.zeros(0), np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))


def flips(cells: Cells | None, p_levels: Sequence[float], update: Update) -> Flips:
    """The step function of a class.

    Args:
        cells: of one l0; None: there are none.
        p_levels: P(empty) of each level of a reading.
        update: "bayes" or "paper".
    """
    if cells is None:
        return NOTHING
    strip = Geometry(1, cells.counts.shape[1], 1.0, 0.0, 0.0)
    evidence = Evidence(strip, cells.counts[:, None, :].astype(np.uint32))
    total, visits = evidence.total(p_levels)[0], evidence.visits()[0]
    if update == "bayes":
        below, above = np.ones(len(total), dtype=np.bool_), np.zeros(len(total), dtype=np.bool_)
        always, at = above, -total  # occupied iff l0 < -total, which is exact in floating point
    else:
        below, above = visits == 0, visits > 1
        always = (visits == 1) & (total < 0.0)
        at = np.zeros(len(total))
        at[above] = last_empty(total[above], (visits[above] - 1).astype(np.float64))
    places, index = np.unique(at[below | above], return_inverse=True)
    place = np.zeros(len(total), dtype=np.int64)
    place[below | above] = index
    out = []
    for weight in (cells.wall, cells.space):
        change = np.zeros(2 * len(places) + 2, dtype=np.int64)
        change[0] = weight[always].sum() + weight[below].sum()
        np.subtract.at(change, 2 * place[below] + 1, weight[below])
        np.add.at(change, 2 * place[above] + 2, weight[above])
        out.append(np.cumsum(change[:-1]))
    return Flips(places, *out)


def last_empty(total: Floats, times: Floats) -> Floats:
    """The greatest l0 at which total - times * l0 < 0 is false, as floating point has it.

    The quotient alone misses it by a rounding; the map rounds the product.

    Args:
        total: (n,) finite.
        times: (n,) whole numbers of at least 1.
    """
    l0 = total / times
    while (low := times * l0 > total).any():
        l0[low] = np.nextafter(l0[low], -np.inf)
    while True:
        more = np.nextafter(l0, np.inf)
        if not (high := times * more <= total).any():
            return l0
        l0[high] = more[high]
