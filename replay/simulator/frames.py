"""The simulator's core: a site, a drive and a sensor in; frames out. It knows no file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formats.frame import Frame, Pose
from replay.simulator.driving import Way
from replay.simulator.sensors import SCANS, Planar
from replay.simulator.site import Site

SECOND = 1_000_000_000


def moments(way: Way, rate: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Times (n,) s of the readings; a drive of no length has one."""
    return np.arange(0.0, way.seconds + 1e-9, 1.0 / rate)


def frames(
    site: Site,
    way: Way,
    sensor: Planar,
    *,
    seed: int = 2017,
    readings: int = 1,
    start_ns: int = 0,
) -> Iterator[Frame]:
    """What a sensor measures along a drive; the same arguments give the same bits.

    Args:
        site: what stands there, in the frame of the poses.
        way: true poses of the base.
        sensor: with its mount, rate and noise.
        seed: of the noise.
        readings: at each pose (the paper takes 3 or 1).
        start_ns: time of the drive's start.

    Yields:
        frames whose pose is the sensor's own.
    """
    rng = np.random.default_rng(seed)
    scan, times = SCANS[type(sensor)], moments(way, sensor.rate)
    for t, row in zip(times.tolist(), way.at(times).tolist(), strict=True):
        pose = Pose(*row) @ sensor.mount
        for _ in range(readings):
            yield Frame(start_ns + round(t * SECOND), pose, scan(sensor, site, pose, rng))
