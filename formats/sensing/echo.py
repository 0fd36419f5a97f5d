"""One echo a beam out of a scanner that hears several."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from formats.messages import LaserScan, MultiEchoLaserScan

Echo = Literal["first", "last", "strongest"]
ECHOES: tuple[Echo, ...] = get_args(Echo)


def single_echo(reading: MultiEchoLaserScan, which: Echo = "first") -> LaserScan:
    """The scan of the first, last or strongest echoes; nan where a beam has none.

    Where a beam has not as many intensities as echoes, the strongest is the first.

    Args:
        reading: echoes and intensities of each beam, as recorded.
        which: of the echoes of a beam.
    """
    ranges = np.full(len(reading.echoes), np.nan, dtype=np.float32)
    for k, echoes in enumerate(reading.echoes):
        if not len(echoes):
            continue
        best = -1 if which == "last" else 0
        if which == "strongest" and k < len(reading.intensities):
            bright = reading.intensities[k]
            if len(bright) == len(echoes) and not np.isnan(bright).all():
                best = int(np.nanargmax(bright))
        ranges[k] = echoes[best]
    return LaserScan(*reading[:7], ranges)
