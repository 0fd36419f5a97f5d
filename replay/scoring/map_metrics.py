"""Metrics of a map's probabilities and places; those of counts are in `count_metrics`.

Each is a function of a map, the cells that are wall in truth and the cells that count. Occupied is
positive, as everywhere; probabilities are of occupied, taken from the log-odds so that a cell that
is nearly sure keeps its order among others. Where a metric has no value (no cell counts, or there
is no wall, or nothing but wall), it is nan.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan

import numpy as np
import numpy.typing as npt

from formats.grid import Floats, Grid

Bools = npt.NDArray[np.bool_]
TOLERANCE = 0.1  # m, of the boundary F: two cells of 5 cm
BINS = 10


def _cells(grid: Grid, wall: Bools, scored: Bools) -> tuple[Floats, Bools]:
    """Log-odds of OCCUPIED of the cells that count, and which of them are wall."""
    return -grid.values[scored], wall[scored]


def brier(grid: Grid, wall: Bools, scored: Bools) -> float:
    """Mean of (P(occupied) - truth)^2, 0 to 1, 0 is best (Brier 1950)."""
    p, real = grid.p_occupied()[scored], wall[scored]
    return float(np.mean((p - real) ** 2)) if p.size else nan


def cross_entropy(grid: Grid, wall: Bools, scored: Bools) -> float:
    """Mean of -log P(what is true) in nats a cell, 0 is best; log 2 = 0.693 knows nothing."""
    odds, real = _cells(grid, wall, scored)
    return float(np.mean(np.logaddexp(0.0, np.where(real, -odds, odds)))) if odds.size else nan


def roc_auc(grid: Grid, wall: Bools, scored: Bools) -> float:
    """P(a wall is more occupied than a free cell), ties half (Mann and Whitney); 0.5 is chance."""
    odds, real = _cells(grid, wall, scored)
    walls = int(np.count_nonzero(real))
    pairs = walls * (odds.size - walls)
    if not pairs:
        return nan
    _, where, sizes = np.unique(odds, return_inverse=True, return_counts=True)
    ranks = np.cumsum(sizes) - (sizes - 1) / 2  # from 1; those of a tie share their mean
    above = float(ranks[where[real]].sum()) - walls * (walls + 1) / 2
    return above / pairs


def pr_auc(grid: Grid, wall: Bools, scored: Bools) -> float:
    """Average precision, the mean over steps of recall; the share of walls is chance.

    The sum of (recall_n - recall_{n-1}) precision_n over all thresholds, without interpolation.
    """
    odds, real = _cells(grid, wall, scored)
    walls = int(np.count_nonzero(real))
    if not walls:
        return nan
    _, where = np.unique(-odds, return_inverse=True)  # the most occupied first
    found = np.cumsum(np.bincount(where, real))
    taken = np.cumsum(np.bincount(where))
    return float(np.sum(np.diff(found, prepend=0.0) * found / taken) / walls)


def reliability_curve(grid: Grid, wall: Bools, scored: Bools, bins: int = BINS) -> Floats:
    """What a probability turns out to be worth (DeGroot and Fienberg 1983).

    Returns:
        (bins, 3): mean P(occupied), share of wall, and cells of each of `bins` equal bins of
        P(occupied); nan where a bin is empty.
    """
    p, real = grid.p_occupied()[scored], wall[scored]
    which = np.minimum((p * bins).astype(np.int64), bins - 1)
    cells = np.bincount(which, minlength=bins).astype(np.float64)
    with np.errstate(invalid="ignore"):
        said, seen = (np.bincount(which, v, minlength=bins) / cells for v in (p, real))
    return np.stack((said, seen, cells), axis=1)


def calibration(grid: Grid, wall: Bools, scored: Bools) -> float:
    """Expected calibration error: mean gap of the reliability curve, 0 is best (Naeini 2015)."""
    said, seen, cells = reliability_curve(grid, wall, scored).T
    full = cells > 0
    if not full.any():
        return nan
    return float(np.sum(np.abs(said - seen)[full] * cells[full]) / cells.sum())


def _edges(mask: Bools) -> Bools:
    """Cells of a mask beside one that is not in it; the border of the grid is no edge."""
    padded = np.pad(mask, 1, mode="edge")
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return mask & ~inner


def _away(mask: Bools, resolution: float) -> Floats:
    """Distance in m of each cell to the nearest of a mask; inf where there is none."""
    from scipy.ndimage import distance_transform_edt

    if not mask.any():
        return np.full(mask.shape, np.inf)
    return np.asarray(distance_transform_edt(~mask), dtype=np.float64) * resolution


def boundary_f(grid: Grid, wall: Bools, scored: Bools, tolerance: float = TOLERANCE) -> float:
    """F1 of the edges of occupied regions, matched within `tolerance` m (Csurka et al. 2013).

    Precision: share of the map's edge cells with one of the truth's within the tolerance; recall:
    the other way round. 0 to 1; 0/0 is 0.
    """
    found, real = _edges(grid.occupied() & scored), _edges(wall & scored)
    reach = tolerance + 1e-9
    resolution = grid.geometry.resolution
    hits = int(np.count_nonzero(_away(real, resolution)[found] <= reach))
    met = int(np.count_nonzero(_away(found, resolution)[real] <= reach))
    if not hits or not met:
        return 0.0
    precision = hits / int(np.count_nonzero(found))
    recall = met / int(np.count_nonzero(real))
    return 2.0 * precision * recall / (precision + recall)


def chamfer(grid: Grid, wall: Bools, scored: Bools) -> float:
    """Mean distance in m to the nearest of the others, of occupied cells and of walls, halved sum.

    0 is best; nan where one of them has no cell (Barrow et al. 1977, both ways).
    """
    found, real = grid.occupied() & scored, wall & scored
    if not found.any() or not real.any():
        return nan
    resolution = grid.geometry.resolution
    there, back = _away(real, resolution)[found], _away(found, resolution)[real]
    return float(0.5 * (there.mean() + back.mean()))


MapMetric = Callable[[Grid, Bools, Bools], float]
ERRORS: dict[str, MapMetric] = {
    "brier": brier,
    "cross_entropy": cross_entropy,
    "calibration": calibration,
    "chamfer": chamfer,
}
"""The less, the better."""
GAINS: dict[str, MapMetric] = {"roc_auc": roc_auc, "pr_auc": pr_auc, "boundary_f": boundary_f}
"""The more, the better."""
MAP_METRICS = ERRORS | GAINS
"""Name -> function of a map, the cells that are wall in truth and the cells that count."""
