"""Sensor models with continuous values: each cell by its distance and bearing from the sensor.

A cell's centre lies in the sector of one beam, the last that begins before it (counter-clockwise);
how far before or behind the beam's range it lies gives its level. Weights are split into `steps`
levels; what rounds to nothing, and levels that say next to nothing, are no visit.
"""

from __future__ import annotations

from math import atan2, ceil, cos, exp, floor, hypot, pi, sin
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.frame import Scan
from formats.grid import Counted, Geometry
from formats.jit import njit
from replay.sensors.fan import JOIN
from replay.sensors.kernels import Floats, Ints, Place, clean
from replay.sensors.models import CONE, Model
from replay.sensors.observer import Observer

BINS = 4096  # of bearing, where the search for a beam begins
NONE = -1
FAR = 4.0  # standard deviations about a hit that are looked at
WIDE = 0.2  # rad, of the steps along the end of a wide beam: an arc bulges by half a per cent


@njit
def gaussian(d: float, z: float, side: float, spread: float, growth: float, steps: int) -> int:
    """Level of a cell at d before or behind a hit at z, m; NONE where it says nothing."""
    sigma = hypot(spread + growth * z * z, 0.5 * side)
    if abs(d - z) > FAR * sigma:
        return 2 * steps if d <= z else NONE
    q = floor(steps * exp(-0.5 * ((d - z) / sigma) ** 2) + 0.5)
    if q == steps:
        return 0
    if d <= z:
        return 2 * steps - q
    return steps - q if q > 0 else NONE


@njit
def conical(d: float, off: float, near: float, z: float, hit: bool, band: float, steps: int) -> int:
    """Level of a cell in a cone.

    Args:
        d: m, of the cell; off: its bearing from the axis, 1 at the cone's edge.
        near: m, the sensor's least range.
        z: m, the range, or how far a cone without a return is clear; hit: whether it returned.
        band: m to either side of a hit.
    """
    inner, end = 1.0 - off * off, z - band if hit else z
    if d < end:
        along = (d - near) / (end - near) if d > near else 0.0
        q = floor(steps * inner * (1.0 - along * along) + 0.5)
        return steps + q if q > 0 else NONE
    if not hit or d > z + band:
        return NONE
    along = (d - z) / band
    q = floor(steps * inner * (1.0 - along * along) + 0.5)
    return steps - q if q > 0 else NONE


@njit
def within(low: float, high: float, n: int) -> tuple[int, int]:
    """Cells from `low` to `high`, a little more, that are on the lattice."""
    slack = 1.0 + 0.01 * (high - low)
    start = min(max(floor(low - slack), 0.0), float(n))
    return int(start), int(min(max(ceil(high + slack), 0.0), float(n)))


@njit
def polar(
    starts: Floats,
    widths: Floats,
    beams: Ints,
    first: Ints,
    ranges: Floats,
    depths: Floats,
    limits: Floats,
    place: Place,
    side: float,
    shape: tuple[bool, float, float, int],
    silent: npt.NDArray[np.bool_],
    counts: Counted,
    runs: Ints,
) -> int:
    """Count one reading in the cells that it shows.

    Args:
        starts, widths, beams: (k,) sectors by where they begin, rad from 0 to 2 pi.
        first: (BINS,) the sector to begin the search at for each bin of bearing.
        ranges, depths, limits: as of `kernels.clean`.
        place: of the sensor from the lattice's corner: cells, cells, rad.
        side: m, a cell's.
        shape: whether it is the cone, spread (m), growth (1/m), steps.
        silent: (levels,) that are no visit.
        counts: (levels, rows, columns).
        runs: out, as of `fill.read`.

    Returns:
        how many runs were written.
    """
    cone, spread, growth, steps = shape
    clean(ranges, limits, 1.0, depths)
    band, x, y, turn = max(spread, side), place[0], place[1], place[2]
    # The box of all that may be touched: far less than the circle about the longest range.
    left, right, low, high = x, x, y, y
    for k in range(starts.size):
        z = max(depths[0, beams[k]], depths[1, beams[k]])
        tail = band if cone else FAR * hypot(spread + growth * z * z, 0.5 * side)
        reach = (z + tail) / side if z > 0.0 else 0.0
        for part in range(ceil(widths[k] / WIDE) + 1):
            angle = turn + starts[k] + min(part * WIDE, widths[k])
            u, v = reach * cos(angle), reach * sin(angle)
            left, right = min(left, x + u), max(right, x + u)
            low, high = min(low, y + v), max(high, y + v)
    rows, columns = counts.shape[1], counts.shape[2]
    row0, row1 = within(low, high, rows)
    column0, column1 = within(left, right, columns)
    turn = turn % (2.0 * pi)
    found = 0
    for row in range(row0, row1):
        dy = row + 0.5 - y
        for column in range(column0, column1):
            dx = column + 0.5 - x
            angle = atan2(dy, dx) - turn
            angle += 2.0 * pi if angle < 0.0 else 0.0
            angle += 2.0 * pi if angle < 0.0 else 0.0
            k = first[min(int(angle * (BINS / (2.0 * pi))), BINS - 1)]
            while k + 1 < starts.size and starts[k + 1] <= angle:
                k += 1
            k = k if k >= 0 else starts.size - 1
            off = angle - starts[k]
            off += 2.0 * pi if off < 0.0 else 0.0
            if off >= widths[k] * (1.0 + JOIN):
                continue
            free, z = depths[0, beams[k]], depths[1, beams[k]]
            if free <= 0.0 and z <= 0.0:
                continue
            d, hit = (dx * dx + dy * dy) ** 0.5 * side, z > 0.0
            if cone:
                axis = min(abs(2.0 * off / widths[k] - 1.0), 1.0)
                level = conical(d, axis, limits[0], z if hit else free, hit, band, steps)
            elif hit:
                level = gaussian(d, z, side, spread, growth, steps)
            else:
                level = 2 * steps if d < free else NONE
            if level < 0 or silent[level]:
                continue
            counts[level, row, column] += 1
            flat = row * columns + column
            if found > 0 and runs[found - 1, 1] == flat and runs[found - 1, 2] == level:
                runs[found - 1, 1] = flat + 1
            else:
                runs[found, 0], runs[found, 1], runs[found, 2] = flat, flat + 1, level
                found += 1
    return found


class PolarObserver(Observer):
    """A model with continuous values at work on one lattice; arguments as of Observer."""

    def __init__(self, geometry: Geometry, model: Model, **options: Any) -> None:
        super().__init__(geometry, model, **options)
        self._starts, self._wide = np.empty(0), np.empty(0)
        self._order, self._first = np.empty(0, np.int32), np.full(BINS, -1, np.int32)
        self._silent = model.silent

    def _aim(self, scan: Scan) -> None:
        """Sectors by where they begin; those of the last scan where they are the same."""
        before = self._bearings, self._widths
        super()._aim(scan)
        if all(map(np.array_equal, before, (scan.bearings, scan.widths))):
            return
        usable = np.isfinite(scan.bearings) & np.isfinite(scan.widths) & (scan.widths > 0.0)
        beams = np.flatnonzero(usable)
        widths = np.minimum(scan.widths[beams], 2.0 * pi)
        starts = (scan.bearings[beams] - 0.5 * widths) % (2.0 * pi)
        order = np.argsort(starts, kind="stable")
        self._starts, self._wide = starts[order], widths[order]
        self._order = beams[order].astype(np.int32)
        edges = np.arange(BINS) * (2.0 * pi / BINS)
        found = np.searchsorted(self._starts, edges, side="right") - 1
        self._first = found.astype(np.int32)

    def _read(self, place: Place, limits: Floats, counts: Counted) -> int:
        if not self._starts.size:
            return 0
        model = self.model
        return polar(
            self._starts,
            self._wide,
            self._order,
            self._first,
            self._ranges,
            self._depths,
            limits,
            place,
            self.geometry.resolution,
            (model.profile == CONE, model.spread, model.growth, model.steps),
            self._silent,
            counts,
            self._runs,
        )


def observer(geometry: Geometry, model: Model, **options: Any) -> Observer:
    """The observer of a model."""
    return (PolarObserver if model.steps else Observer)(geometry, model, **options)
