"""A slow, obvious version of the continuous sensor models: cell by cell, beam by beam."""

from __future__ import annotations

from math import atan2, exp, floor, hypot, inf, log, pi
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.frame import Pose, Scan
from formats.grid import Geometry
from replay.sensors.observer import MODELS, Model

Cells = npt.NDArray[np.int64]
UNSURE, NOTHING = -2, -1
CLOSE = 1e-9


def rounded(weight: float, steps: int) -> tuple[int, bool]:
    """The nearest of so many steps, and whether it is on a rounding border."""
    exact = weight * steps + 0.5
    return floor(exact), abs(exact - round(exact)) < 1e-7


def level_of(
    model: Model, d: float, off: float, near: float, free: float, hit: float | None, side: float
) -> tuple[int, bool]:
    """Level of a cell at d m, `off` (-1..1) from the axis of its beam; and whether it is unsure."""
    n = model.steps
    if model.profile == "gaussian":
        if hit is None:
            return (2 * n if d < free else NOTHING), abs(d - free) < CLOSE
        sigma = hypot(model.spread + model.growth * hit**2, side / 2)
        q, unsure = rounded(exp(-((d - hit) ** 2) / (2 * sigma**2)), n)
        if q == n:
            return 0, unsure
        if d <= hit:
            return 2 * n - q, unsure
        return (n - q if q else NOTHING), unsure
    inner, band = 1 - off**2, max(model.spread, side)
    end = free if hit is None else hit - band
    unsure = abs(d - end) < CLOSE or (hit is not None and abs(d - hit - band) < CLOSE)
    if d < end:
        along = max(d - near, 0.0) / (end - near)
        q, border = rounded(inner * (1 - along**2), n)
        return (n + q if q else NOTHING), unsure or border
    if hit is None or d > hit + band:
        return NOTHING, unsure
    q, border = rounded(inner * (1 - ((d - hit) / band) ** 2), n)
    return (n - q if q else NOTHING), unsure or border


def polar(
    name: str,
    geometry: Geometry,
    pose: Pose,
    scan: Scan,
    *,
    max_range: float = inf,
    no_return: str = "near",
    **_: Any,
) -> Cells:
    """Level of each cell, (rows, cols): NOTHING where none, UNSURE at a rounding border."""
    from tests.oracles import cleaned

    model, g = MODELS[name], geometry
    said = [cleaned(float(r), scan, max_range, no_return, 0.0) for r in scan.ranges]
    near = max(scan.min_range, 1e-3)
    sectors = []
    for b, w, one in zip(scan.bearings.tolist(), scan.widths.tolist(), said, strict=True):
        if np.isfinite(b) and np.isfinite(w) and w > 0:
            wide = min(w, 2 * pi)
            sectors.append(((b - wide / 2) % (2 * pi), wide, one))
    sectors.sort(key=lambda sector: sector[0])
    quiet = {k for k, p in enumerate(model.p_levels()) if abs(log(p / (1 - p))) < 0.02}
    out = np.full(g.shape, NOTHING, dtype=np.int64)
    for row, col in np.ndindex(*g.shape):
        x, y = g.x + (col + 0.5) * g.resolution, g.y + (row + 0.5) * g.resolution
        bearing = (atan2(y - pose.y, x - pose.x) - pose.yaw) % (2 * pi)
        if not sectors:
            continue
        begun = [sector for sector in sectors if sector[0] <= bearing] or sectors
        start, wide, (free, hit) = begun[-1]
        after = (bearing - start) % (2 * pi)
        border = min(abs(bearing - s[0]) for s in sectors) < CLOSE
        border |= abs(after - wide * 1.1) < CLOSE
        if after >= wide * 1.1 or (hit is None and free <= 0):
            out[row, col] = UNSURE if border else NOTHING
            continue
        off = max(-1.0, min(1.0, 2 * after / wide - 1))
        d = hypot(x - pose.x, y - pose.y)
        level, unsure = level_of(model, d, off, near, free, hit, g.resolution)
        level = NOTHING if level in quiet else level
        out[row, col] = UNSURE if unsure or border else level
    return out
