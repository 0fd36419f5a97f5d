"""The exact Pareto front of precision and recall over the prior's probabilities.

Within a class only pieces of l0 that no other piece beats (as many true positives, no more false
ones) can be part of it; the sums of two such staircases are few enough to try them all. Two or
more classes join one after the other, so p_door is one more class.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from formats.grid import probability
from formats.jit import njit
from replay.tuning.cases import Floats, Ints
from replay.tuning.flips import Flips
from replay.tuning.surfaces import Scores, Tables, Values

LOW, HIGH = 0.1, 1.0  # of p as it is printed: Equation 7, with 1 as the paper's tables have it
ACCEPTABLE = 2.5  # 1 / precision and 1 / recall lie below it in C (Equation 7)


class Pieces(NamedTuple):
    """Choices of one or more probabilities and what they make of their cells.

    Attributes:
        tp, fp: (n,) true and false positives; tp ascends, and fp with it.
        spans: (n, probabilities, 3): least, middle and greatest p that give the same.
    """

    tp: Ints
    fp: Ints
    spans: Floats


class Front(NamedTuple):
    """Points that no other beats, by recall, ascending.

    Attributes:
        scores: their counts, (n,).
        spans: (n, probabilities, 3): least, middle and greatest p; all between give the same.
    """

    scores: Scores
    spans: Floats

    @property
    def points(self) -> Floats:
        """(n, probabilities): a p in the middle of each span."""
        return np.asarray(self.spans[:, :, 1])

    @property
    def acceptable(self) -> Front:
        """The points within C: precision and recall above 40 %."""
        kept = (self.scores.objectives() < ACCEPTABLE).all(axis=1)
        scores = self.scores
        return Front(Scores(scores.tp[kept], scores.fp[kept], scores.walls), self.spans[kept])


def pieces(steps: Flips, values: Values, low: float = LOW, high: float = HIGH) -> Pieces:
    """The unbeaten pieces of one class for p from `low` to `high`.

    A piece counts if a floating-point p lies in it: pieces that are narrower than that cannot be
    chosen by anybody.
    """
    least, most = values.l0([low, high]).tolist()
    inside = steps.at[(steps.at > least) & (steps.at < most)]
    edges = np.concatenate([[least], inside, [most]])
    asked = np.concatenate([[low], probability(edges[1:-1]) / values.prior_scale, [high]])
    starts = np.minimum(np.maximum(asked[:-1], low), high)
    ends = np.minimum(np.maximum(asked[1:], low), high)
    middle = probability((edges[:-1] + edges[1:]) / 2) / values.prior_scale
    middle = np.minimum(np.maximum(middle, starts), ends)
    # The two ends belong to the range, and a tie may be a piece of its own.
    p = np.concatenate([middle, asked])
    spans = np.stack([np.concatenate([starts, asked]), p, np.concatenate([ends, asked])], axis=1)
    tp, fp = steps.counts(values.l0(np.clip(p, low, high)))
    return unbeaten(tp, fp, spans[:, None, :])


def unbeaten(tp: Ints, fp: Ints, spans: Floats) -> Pieces:
    """Those that no other beats, the widest of equal ones."""
    width = (spans[:, :, 2] - spans[:, :, 0]).prod(axis=1)
    order = np.lexsort((-width, fp, -tp))  # most true positives first, then fewest false ones
    fp_sorted = fp[order]
    before = np.minimum.accumulate(np.concatenate([[np.iinfo(np.int64).max], fp_sorted[:-1]]))
    kept = order[fp_sorted < before][::-1]
    return Pieces(tp[kept], fp[kept], spans[kept])


@njit
def sums(
    tp_a: Ints, fp_a: Ints, tp_b: Ints, fp_b: Ints, width_a: Floats, width_b: Floats, best: Ints
) -> None:
    """The fewest false positives for every number of true positives of two classes together.

    Args:
        tp_a, fp_a, width_a: (n,) pieces of the one class and how wide they are.
        tp_b, fp_b, width_b: (m,) of the other.
        best: (most + 1, 3) out: fp, index in a, index in b; fp starts at -1, which is none.
    """
    for i in range(tp_a.size):
        for j in range(tp_b.size):
            tp, fp = tp_a[i] + tp_b[j], fp_a[i] + fp_b[j]
            old = best[tp, 0]
            if old >= 0 and fp > old:
                continue
            if old == fp:
                k, m = best[tp, 1], best[tp, 2]
                if width_a[i] * width_b[j] <= width_a[k] * width_b[m]:
                    continue
            best[tp, 0], best[tp, 1], best[tp, 2] = fp, i, j


def joined(a: Pieces, b: Pieces) -> Pieces:
    """Unbeaten choices for two groups of cells together."""
    best = np.full((int(a.tp[-1] + b.tp[-1]) + 1, 3), -1, dtype=np.int64)
    wide, high = ((part.spans[:, :, 2] - part.spans[:, :, 0]).prod(axis=1) for part in (a, b))
    sums(a.tp, a.fp, b.tp, b.fp, wide, high, best)
    tp = np.flatnonzero(best[:, 0] >= 0)
    fp, i, j = best[tp].T
    return unbeaten(tp, fp, np.concatenate([a.spans[i], b.spans[j]], axis=1))


def exact_front(tables: Tables, low: float = LOW, high: float = HIGH) -> Front:
    """The exact front over (p_wall, p_space).

    Raises:
        ValueError: an l0 depends on both (`fraction`): there is no such table.
    """
    if tables.mixtures:
        raise ValueError("cells whose l0 depends on p_wall and p_space at once have no exact front")
    return front_of([tables.wall, tables.space], tables, low, high)


def front_of(classes: Sequence[Flips], tables: Tables, low: float, high: float) -> Front:
    """The exact front over one probability for each class; all else is fixed."""
    whole = pieces(classes[0], tables.values, low, high)
    for steps in classes[1:]:
        whole = joined(whole, pieces(steps, tables.values, low, high))
    tp, fp = whole.tp + tables.fixed[0], whole.fp + tables.fixed[1]
    return pareto(Scores(tp, fp, tables.walls), whole.spans)


def pareto(scores: Scores, spans: Floats) -> Front:
    """Of any points, those that none beats in precision and recall; of equals the first."""
    precision, recall = scores.precision, scores.recall
    found = np.flatnonzero(scores.tp > 0)
    order = found[np.lexsort((-precision[found], -recall[found]))]
    ordered = precision[order]
    before = np.maximum.accumulate(np.concatenate([[-1.0], ordered[:-1]]))
    kept = order[ordered > before][::-1]
    return Front(Scores(scores.tp[kept], scores.fp[kept], scores.walls), spans[kept])


def grid_front(tables: Tables, p: Floats) -> Front:
    """The front among all pairs of a grid of probabilities, where there is no exact one."""
    scores = tables.surface(p, p)
    pairs = np.stack(np.meshgrid(p, p, indexing="ij"), axis=-1).reshape(-1, 2)
    flat = Scores(scores.tp.ravel(), scores.fp.ravel(), scores.walls)
    return pareto(flat, np.repeat(pairs[:, :, None], 3, axis=2))


def hypervolume(objectives: Floats, reference: float = ACCEPTABLE) -> float:
    """Area between points (n, 2), to be minimised, and (reference, reference)."""
    inside = objectives[(objectives < reference).all(axis=1)]
    area, ceiling = 0.0, reference
    for x, y in inside[np.lexsort((inside[:, 1], inside[:, 0]))].tolist():
        if y < ceiling:
            area += (reference - x) * (ceiling - y)
            ceiling = y
    return area
