"""The compiled part of sensing: imported only where a scan was taken on the move."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from formats.jit import njit

Floats = npt.NDArray[np.float64]
Ranges = npt.NDArray[np.float32]


@njit
def deskew(
    bearings: Floats,
    ranges: Ranges,
    x0: float,
    y0: float,
    yaw0: float,
    x1: float,
    y1: float,
    yaw1: float,
) -> tuple[Floats, Ranges]:
    """End points of beams as seen from the middle pose.

    Args:
        bearings: (n,) rad of the beams, each in the sensor's frame at its own time.
        ranges: (n,) m.
        x0, y0, yaw0: pose of the sensor at beam 0, in its pose at the middle beam.
        x1, y1, yaw1: likewise at beam n - 1; in between the motion is taken as even.
    """
    n = len(bearings)
    turned, moved = np.empty(n), np.empty(n, dtype=np.float32)
    middle = (n - 1) / 2.0
    for i in range(n):
        if i < middle:
            share = 1.0 - i / middle
            x, y, yaw = share * x0, share * y0, share * yaw0
        else:
            share = i / middle - 1.0 if middle > 0 else 0.0
            x, y, yaw = share * x1, share * y1, share * yaw1
        angle, r = bearings[i] + yaw, float(ranges[i])
        turned[i], moved[i] = angle, ranges[i]
        if math.isfinite(r) and r > 0.0:
            c, s = math.cos(angle), math.sin(angle)
            ahead, aside = r + x * c + y * s, y * c - x * s
            turned[i] = angle + math.atan2(aside, ahead)
            moved[i] = math.hypot(ahead, aside)
    return turned, moved
