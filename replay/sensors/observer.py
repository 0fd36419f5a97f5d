"""Sensor models: what a reading shows of which cell, in levels.

A beam is the sector of its width; gaps and overlaps of neighbours under a tenth of it, as
de-skewing leaves them, are closed. `beam`: a cell is missed iff its centre lies in a sector, nearer
than the range less a margin, and hit iff it contains an end point; hit beats miss. `eq10` and
`eq15`: the same sectors seen by n x n sub-samples of a cell, with a hit band one cell deep, and
the level is the empty share of the samples that were observed (PAPER A10, A33). What models there
are and what their levels are worth is in `models`.
"""

from __future__ import annotations

from math import isfinite
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Pose, Scan
from formats.grid import Counted, Geometry
from replay.sensors.fan import Shape, fan
from replay.sensors.fill import by_truth, read
from replay.sensors.kernels import Floats, Ints
from replay.sensors.models import MODELS, Model

__all__ = ["CLEAR", "HORIZON", "MODELS", "Model", "NoReturn", "Observer", "Touched"]

NoReturn = Literal["near", "clear", "ignore"]

TOUCHING = 1e-3  # m, nearer than any reading
HORIZON = 1e4  # m, farther than any range sensor sees: 1e38 stands for nothing
AT_MOST = 1.0 - 1e-6  # of range_max: what is clipped to it has seen nothing
CLEAR = {"near": 5.0, "clear": HORIZON, "ignore": 0.0}  # m that a no-return clears at most


class Touched(NamedTuple):
    """Cells that a reading showed: a view on a buffer that the next reading reuses.

    Attributes:
        runs: (k, 3) int32: first flat index, one after the last, level. A hit cell may also lie
            in a run of misses, and come more than once.
    """

    runs: Ints

    def shown(self) -> tuple[npt.NDArray[np.int64], Ints]:
        """Flat indices of the cells in ascending order, each once, and their levels, (n,)."""
        starts, sizes = self.runs[:, 0].astype(np.int64), self.runs[:, 1] - self.runs[:, 0]
        before = np.cumsum(sizes) - sizes
        cells = np.repeat(starts - before, sizes) + np.arange(sizes.sum())
        levels = np.repeat(self.runs[:, 2], sizes)
        order = np.lexsort((levels, cells))  # the hit comes first
        cells, levels = cells[order], levels[order]
        first = np.diff(cells, prepend=-1) > 0
        return cells[first], levels[first]

    @property
    def cells(self) -> npt.NDArray[np.int64]:
        """Flat indices, (n,)."""
        return self.shown()[0]

    @property
    def levels(self) -> Ints:
        """The level of each of `cells`, (n,)."""
        return self.shown()[1]


class Observer:
    """A model at work on one lattice, with its buffers; called once a reading.

    Args:
        geometry: of the cells.
        model: what a reading shows.
        max_range: m, farther returns clear up to it and hit nothing; None: the sensor's own.
        no_return: what +inf, and ranges at or above the sensor's greatest, clear: "near" 5 m at
            most, "clear" up to the sensor's greatest range, "ignore" nothing.
        margin: cells before the hit that are not shown empty; None: the model's.
        min_observed: share of a cell's samples that makes a visit.
        shape: see `fan.fan`.
        truth: (rows, cols) the level of each cell as it really is, for a model `of_truth`.

    Raises:
        ValueError: such a model without the truth, or levels of another shape.
    """

    def __init__(
        self,
        geometry: Geometry,
        model: Model,
        *,
        max_range: float | None = None,
        no_return: NoReturn = "near",
        margin: float | None = None,
        min_observed: float = 0.5,
        shape: Shape = "sectors",
        truth: npt.NDArray[np.integer] | None = None,
    ) -> None:
        if model.of_truth and (truth is None or truth.shape != geometry.shape):
            raise ValueError("this model shows the truth: it needs the level of every cell")
        self.truth = np.ascontiguousarray(truth, np.int32).ravel() if model.of_truth else None
        self.geometry, self.model, self.shape = geometry, model, shape
        self.no_return = no_return
        self.max_range = HORIZON if max_range is None else min(max_range, HORIZON)
        self.margin = (model.margin if margin is None else margin) * geometry.resolution
        self.least = min_observed * model.samples**2
        self.scale = model.samples / geometry.resolution
        rows, cols = geometry.rows * model.samples, geometry.cols
        self._room(rows, 64)
        self._filled = np.empty((3, rows), dtype=np.int32)
        self._shares = np.zeros((2, cols), dtype=np.int32)
        self._bearings = self._widths = np.empty(0)
        self._fan = fan(self._bearings, self._widths, shape)
        self._scratch(0)

    def __call__(self, pose: Pose, scan: Scan, counts: Counted) -> Touched:
        """Count one reading in the cells that it shows.

        Args:
            pose: of the sensor in the lattice's frame; a pose that is not finite shows nothing.
            scan: as recorded.
            counts: (levels, rows, cols) uint32, counted up in place.
        """
        self._aim(scan)
        self._ranges[:] = scan.ranges
        g, touched = self.geometry, 0
        place = ((pose.x - g.x) * self.scale, (pose.y - g.y) * self.scale, float(pose.yaw))
        if all(isfinite(v) and abs(v) < 1e12 for v in place):
            limits = self.limits(scan)
            touched = self._read(place, limits, counts)
            if touched < 0:  # a row of the lattice met more borders than there was room for
                self._room(self._events.shape[0], -2 * touched)
                touched = self._read(place, limits, counts)
        if self.truth is not None:
            touched = by_truth(self.truth, counts, self._runs, touched)
        return Touched(self._runs[:touched])

    def limits(self, scan: Scan) -> Floats:
        """What `clean` needs, in m, all of it finite."""
        greatest = scan.max_range if scan.max_range > 0.0 else HORIZON  # 0 and nan: not stated
        nearest = scan.min_range if scan.min_range > TOUCHING else TOUCHING
        nothing = min(greatest * AT_MOST, HORIZON)
        clear = min(CLEAR[self.no_return], greatest, self.max_range)
        band = self.geometry.resolution
        shadow = min(greatest, self.max_range) if self.model.shadowed else 0.0
        return np.array([nearest, nothing, self.max_range, clear, self.margin, band, shadow])

    def _read(self, place: tuple[float, float, float], limits: Floats, counts: Counted) -> int:
        return read(
            *self._fan,
            self._ranges,
            self._depths,
            self._points,
            self._edges,
            limits,
            place,
            self.scale,
            self.model.samples,
            self.model.banded,
            self.least,
            self._events,
            self._filled,
            self._spare,
            self._shares,
            self._held,
            counts,
            self._runs,
        )

    def _room(self, rows: int, room: int) -> None:
        """Buffers for so many events a row."""
        self._events = np.empty((rows, room), dtype=np.int32)
        self._spare = np.empty(room, dtype=np.int32)

    def _scratch(self, beams: int) -> None:
        """Buffers for a scan of so many beams."""
        self._ranges, self._depths = np.empty(beams), np.empty((3, beams))
        self._held = np.empty((beams, 2), dtype=np.uint32)
        # Room for a run a cell and a beam: pages that are never written cost nothing.
        self._runs = np.empty(
            (self.geometry.rows * self.geometry.cols + beams + 1, 3), dtype=np.int32
        )
        most = max(beams, self._fan.links.shape[1])
        self._points, self._edges = np.empty((6, most)), np.empty(2 * most + 1, dtype=np.int32)

    def _aim(self, scan: Scan) -> None:
        """Directions of the borders: those of the last scan where the bearings are the same."""
        if scan.bearings is self._bearings and scan.widths is self._widths:
            return
        if not (
            np.array_equal(scan.bearings, self._bearings)
            and np.array_equal(scan.widths, self._widths)
        ):
            bearings = np.ascontiguousarray(scan.bearings, dtype=np.float64)
            widths = np.ascontiguousarray(scan.widths, dtype=np.float64)
            self._fan = fan(bearings, widths, self.shape)
            self._scratch(scan.bearings.size)
        self._bearings, self._widths = scan.bearings, scan.widths
