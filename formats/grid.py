"""Geometry, Grid and Evidence: counts by level, joined with every probability afterwards.

Log-odds are of EMPTY inside (the paper's sign, Equations 6, 9, 23). A cell is occupied iff its
P(empty) < 0.5, that is iff its log-odds are strictly negative: a tie is empty.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor, log
from typing import Literal

import numpy as np
import numpy.typing as npt

Update = Literal["bayes", "paper"]
Floats = npt.NDArray[np.float64]
Counted = npt.NDArray[np.uint32]
P_MIN, P_MAX = 0.001, 0.999
SAME = 1e-12  # log-odds that differ by less are equal: 1 - 0.9 is not 0.1 to the last bit


def logit(p: float) -> float:
    """Log-odds of a probability (Equation 6); its value at 1 - p is minus that at p, to the bit.

    Raises:
        ValueError: p is not strictly between 0 and 1.
    """
    if not 0.0 < p < 1.0:
        raise ValueError(f"a probability strictly between 0 and 1 is needed, not {p}")
    if p == 0.5:
        return 0.0
    return log(p / (1.0 - p)) if p > 0.5 else -logit(1.0 - p)


def probability(log_odds: npt.ArrayLike) -> Floats:
    """P of what the log-odds are of: 1 - 1 / (1 + exp(l)), without overflow (Equation 9)."""
    half = np.tanh(0.5 * np.asarray(log_odds, dtype=np.float64))
    return np.asarray(0.5 + 0.5 * half, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Geometry:
    """A lattice of square cells, axis-aligned in the plan's frame; row 0 has the lowest y.

    Attributes:
        rows, cols: cells.
        resolution: m, a cell's side.
        x, y: m, the lower left corner of cell (0, 0); whole multiples of the resolution.
    """

    rows: int
    cols: int
    resolution: float
    x: float
    y: float

    @classmethod
    def covering(cls, x0: float, y0: float, x1: float, y1: float, resolution: float) -> Geometry:
        """The smallest lattice over a rectangle (m) with its origin on whole cells."""
        tiny = 1e-6  # a corner that misses a cell's edge by rounding must not add a row
        left, low = floor(x0 / resolution + tiny), floor(y0 / resolution + tiny)
        right, high = ceil(x1 / resolution - tiny), ceil(y1 / resolution - tiny)
        return cls(
            max(1, high - low),
            max(1, right - left),
            resolution,
            left * resolution,
            low * resolution,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return self.rows, self.cols

    def window(self, rows: slice, cols: slice) -> Geometry:
        """The part of the lattice within rows and cols (start and stop given)."""
        return Geometry(
            rows.stop - rows.start,
            cols.stop - cols.start,
            self.resolution,
            self.x + cols.start * self.resolution,
            self.y + rows.start * self.resolution,
        )

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in m."""
        return (
            self.x,
            self.y,
            self.x + self.cols * self.resolution,
            self.y + self.rows * self.resolution,
        )


@dataclass(slots=True)
class Grid:
    """Log-odds of EMPTY by cell: values (rows, cols) float64."""

    geometry: Geometry
    values: Floats

    def occupied(self) -> npt.NDArray[np.bool_]:
        """Cells whose P(empty) < 0.5, strictly (PAPER A11)."""
        return self.values < 0.0

    def p_occupied(self) -> Floats:
        """P(occupied) by cell, as every file of ours has it."""
        return probability(-self.values)


def terms(p_levels: Sequence[float]) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Log-odds magnitudes in ascending order, and each level's sign under each magnitude.

    Levels whose log-odds are equal or opposite (to 1e-12) join as integers before they are
    multiplied, so that ties are exactly 0 and sums have one order.

    Args:
        p_levels: P(empty) of each level.

    Returns:
        magnitudes (m,) and signs (m, levels) of -1, 0 or 1.
    """
    weights = [logit(p) for p in p_levels]
    sizes: list[float] = []
    for size in sorted({abs(weight) for weight in weights}):
        if size > SAME and (not sizes or size > sizes[-1] * (1.0 + SAME)):
            sizes.append(size)
    signs = np.zeros((len(sizes), len(weights)), dtype=np.int64)
    for level, weight in enumerate(weights):
        m = bisect_right(sizes, abs(weight)) - 1
        if m >= 0:
            signs[m, level] = 1 if weight > 0 else -1
    return np.array(sizes, dtype=np.float64), signs


@dataclass(slots=True)
class Evidence:
    """How often readings showed each cell at each level: counts (levels, rows, cols) uint32.

    Evidence of several logs on one lattice adds up, in any order, to the same bits.
    """

    geometry: Geometry
    counts: Counted

    @classmethod
    def empty(cls, geometry: Geometry, levels: int) -> Evidence:
        """Nothing seen yet. The pages of zeros are not resident until they are written."""
        return cls(geometry, np.zeros((levels, *geometry.shape), dtype=np.uint32))

    def __add__(self, other: Evidence) -> Evidence:
        if self.geometry != other.geometry or self.counts.shape != other.counts.shape:
            raise ValueError("evidence adds up on one lattice and one set of levels only")
        return Evidence(self.geometry, self.counts + other.counts)

    def visits(self) -> npt.NDArray[np.int64]:
        """Readings of each cell, (rows, cols)."""
        return self.counts.sum(axis=0, dtype=np.int64)

    def total(self, p_levels: Sequence[float]) -> Floats:
        """Sum of the readings' log-odds of empty by cell, (rows, cols).

        Args:
            p_levels: P(empty) that a reading of each level stands for.
        """
        sizes, signs = terms(p_levels)
        out = np.zeros(self.geometry.shape)
        for size, row in zip(sizes, signs, strict=True):
            net = np.zeros(self.geometry.shape, dtype=np.int64)
            for level in np.flatnonzero(row):
                net += row[level] * self.counts[level].astype(np.int64)
            out += size * net
        return out

    def on(self, prior: Grid, p_levels: Sequence[float], update: Update = "bayes") -> Grid:
        """The map: this evidence over a prior.

        `bayes`: total + l0 (the consistent step, from Equation 20). `paper`: total -
        (visits - 1) * l0, which is Equation 5 applied once a reading (Equation 12), and l0 where
        there was none.

        Args:
            prior: l0 by cell, on the same geometry.
            p_levels: P(empty) of each level.
            update: "bayes" or "paper".
        """
        if prior.geometry != self.geometry:
            raise ValueError("prior and evidence lie on different lattices")
        total = self.total(p_levels)
        if update == "bayes":
            return Grid(self.geometry, total + prior.values)
        return Grid(self.geometry, total - (self.visits() - 1) * prior.values)
