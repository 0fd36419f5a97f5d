"""The compiled part of depth: nearest returns by bearing bin."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.jit import njit

Floats = npt.NDArray[np.float64]
Ranges = npt.NDArray[np.float32]


SIDEWAYS = 5.67  # tangent of 80 degrees: what a camera sees farther aside is left out


@njit
def see_slab(
    lens: tuple[float, float, float, float],
    level: Floats,
    slab: tuple[float, float],
    limits: tuple[float, float],
    unit: float,
    whole: bool,
    low: npt.NDArray[Any],
    high: npt.NDArray[Any],
    away: Ranges,
    tangent: Floats,
) -> float:
    """The depths at which each pixel of a camera sees into a slab above the floor.

    Args:
        lens: fx, fy, cx, cy in px.
        level: (3, 4), the optical frame in the scan's level frame, whose z = 0 is the floor.
        slab: m above the floor.
        limits: m, horizontal distances that count.
        unit: m of one unit of depth.
        whole: depths are whole numbers up to 65535.
        low, high: (rows, columns) filled in, in units of depth; low > high where never.
        away: (rows, columns) filled in: m of horizontal distance for one unit of depth.
        tangent: (rows, columns) filled in: of the bearing.

    Returns:
        The least m ahead for one m of depth among pixels that see into the slab; inf for none.
    """
    fx, fy, cx, cy = lens
    height = level[2, 3]
    least, per_px, per_unit = math.inf, 1.0 / fx, 1.0 / unit
    for v in range(low.shape[0]):
        down = (v - cy) / fy
        for u in range(low.shape[1]):
            right = (u - cx) * per_px
            ahead = level[0, 0] * right + level[0, 1] * down + level[0, 2]
            left = level[1, 0] * right + level[1, 1] * down + level[1, 2]
            up = level[2, 0] * right + level[2, 1] * down + level[2, 2]
            flat = math.sqrt(ahead * ahead + left * left)
            start, end = 1.0, 0.0
            if ahead > 0.0 and abs(left) <= SIDEWAYS * ahead:
                per_m = per_unit / flat
                start, end = limits[0] * per_m, limits[1] * per_m
                if up != 0.0:
                    per_rise = per_unit / up
                    one, other = (slab[0] - height) * per_rise, (slab[1] - height) * per_rise
                    start, end = max(start, min(one, other)), min(end, max(one, other))
                elif not slab[0] <= height <= slab[1]:
                    end = 0.0
                start = max(start, 1e-6)
                if whole:
                    start, end = max(math.ceil(start), 1.0), min(math.floor(end), 65535.0)
            if start <= end:
                least = min(least, ahead)
            else:
                start, end = 1.0, 0.0
            low[v, u], high[v, u] = start, end
            away[v, u] = flat * unit
            tangent[v, u] = left / ahead if start <= end else 0.0
    return least


@njit
def nearest_by_table(
    depth: npt.NDArray[Any],
    low: npt.NDArray[Any],
    high: npt.NDArray[Any],
    away: Ranges,
    bins: npt.NDArray[np.int32],
    ranges: Ranges,
) -> None:
    """The nearest horizontal distance by bin, nan where there is none.

    Args:
        depth: (n,) uint16 or float32, as recorded.
        low, high: (n,) of the same type: the depths at which the pixel sees into the slab.
        away: (n,) horizontal distance of one unit of depth.
        bins: (n,) bin of the pixel.
        ranges: (beams,) filled in.
    """
    ranges[:] = np.float32(math.inf)
    for i in range(len(depth)):
        z = depth[i]
        if low[i] <= z <= high[i]:
            r = np.float32(z) * away[i]
            if r < ranges[bins[i]]:
                ranges[bins[i]] = r
    for k in range(len(ranges)):
        if ranges[k] == math.inf:
            ranges[k] = math.nan


@njit
def nearest_of_points(
    points: npt.NDArray[Any],
    level: Floats,
    low: float,
    high: float,
    near: float,
    far: float,
    ranges: Ranges,
) -> None:
    """The nearest horizontal distance of points by bins of equal angle, nan where there is none.

    Args:
        points: (n, 3) m, in the sensor's frame; what is not finite is no point.
        level: (3, 4), the sensor in the scan's level frame, whose z = 0 is the floor.
        low, high: m above the floor.
        near, far: m, horizontal distances that count.
        ranges: (beams,) filled in, from -pi to pi.
    """
    count = len(ranges)
    ranges[:] = np.float32(math.inf)
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        height = level[2, 0] * x + level[2, 1] * y + level[2, 2] * z + level[2, 3]
        if not low <= height <= high:
            continue
        ahead = level[0, 0] * x + level[0, 1] * y + level[0, 2] * z
        left = level[1, 0] * x + level[1, 1] * y + level[1, 2] * z
        r = math.sqrt(ahead * ahead + left * left)
        if not near <= r <= far:
            continue
        k = int((math.atan2(left, ahead) / (2.0 * math.pi) + 0.5) * count)
        k = min(k, count - 1)
        if r < ranges[k]:
            ranges[k] = np.float32(r)
    for k in range(count):
        if ranges[k] == math.inf:
            ranges[k] = math.nan
