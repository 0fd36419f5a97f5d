"""Metrics of counts: occupied is positive (paper, section 3.2). The more, the better."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

from formats.result import Counts


def precision(counts: Counts) -> float:
    """Share of the occupied cells that are walls; 0 where nothing is occupied (PAPER A13)."""
    return counts.tp / (counts.tp + counts.fp) if counts.tp else 0.0


def recall(counts: Counts) -> float:
    """Share of the walls that are occupied cells; 0 where there is no wall (PAPER A13)."""
    return counts.tp / (counts.tp + counts.fn) if counts.tp else 0.0


def f_beta(counts: Counts, beta: float) -> float:
    """(1 + b^2) pre rec / (b^2 pre + rec), from the counts; 0/0 is 0 (Equation 14 for b = 2)."""
    weight = beta * beta
    hits = (1.0 + weight) * counts.tp
    return hits / (hits + weight * counts.fn + counts.fp) if counts.tp else 0.0


def f2(counts: Counts) -> float:
    """5 pre rec / (4 pre + rec): recall counts more than precision (Equation 14)."""
    return f_beta(counts, 2.0)


def f1(counts: Counts) -> float:
    """2 pre rec / (pre + rec): both count alike (also called Dice)."""
    return f_beta(counts, 1.0)


def iou(counts: Counts) -> float:
    """Intersection of occupied cells and walls over their union, 0 to 1 (Jaccard 1901)."""
    return counts.tp / (counts.tp + counts.fp + counts.fn) if counts.tp else 0.0


def mcc(counts: Counts) -> float:
    """Correlation of map and truth, -1 to 1, 0 is chance (Matthews 1975); 0/0 is 0."""
    tp, fp, fn, tn = counts
    square = (tp + fp) * (tp + fn) * (tn + fp) * (tn + fn)
    return (tp * tn - fp * fn) / sqrt(square) if square else 0.0


METRICS: dict[str, Callable[[Counts], float]] = {
    "precision": precision,
    "recall": recall,
    "f2": f2,
    "f1": f1,
    "iou": iou,
    "mcc": mcc,
}
"""Name -> function of counts; those of probabilities and distances: `map_metrics.MAP_METRICS`."""
