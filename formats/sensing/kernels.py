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
    near: float,
    far: float,
) -> tuple[Floats, Ranges]:
    """End points of evenly spaced beams as seen from the middle pose.

    Args:
        bearings: (n >= 2,) rad of the beams, each in the sensor's frame at its own time.
        ranges: (n,) m.
        x0, y0, yaw0: pose of the sensor at beam 0, in its pose at the middle beam.
        x1, y1, yaw1: likewise at beam n - 1; from each to the middle the motion is even.
        near, far: m; ranges below `near`, and from `far` on, are codes and no distances: kept.
    """
    n = len(bearings)
    turned, moved = np.empty(n), np.empty(n, dtype=np.float32)
    middle = (n - 1) / 2.0
    step = (bearings[n - 1] - bearings[0]) / (n - 1)
    second = (n - 1) // 2 + (n - 1) % 2
    c, s, dc, ds = 1.0, 0.0, 1.0, 0.0
    for i in range(n):
        if i < second:
            share = 1.0 - i / middle
            x, y, yaw, rate = share * x0, share * y0, share * yaw0, -yaw0 / middle
        else:
            share = i / middle - 1.0
            x, y, yaw, rate = share * x1, share * y1, share * yaw1, yaw1 / middle
        angle, r = bearings[i] + yaw, float(ranges[i])
        if i == 0 or i == second:
            c, s = math.cos(angle), math.sin(angle)
            dc, ds = math.cos(step + rate), math.sin(step + rate)
        else:  # turn on by one beam: many times as fast as a cosine and a sine
            c, s = c * dc - s * ds, s * dc + c * ds
        turned[i], moved[i] = angle, ranges[i]
        if r > 0.0 and r >= near and r < far:
            ahead, aside = r + x * c + y * s, y * c - x * s
            slope = aside / ahead
            if ahead > 0.0 and abs(slope) < 0.1:  # the series is exact to 2e-10 rad
                square = slope * slope
                turned[i] += slope * (1.0 - square * (1.0 / 3 - square * (0.2 - square / 7)))
            else:
                turned[i] += math.atan2(aside, ahead)
            moved[i] = math.sqrt(ahead * ahead + aside * aside)
    return turned, moved
