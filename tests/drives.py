"""Drives for tests of the frame stream, and what is asked of them again and again."""

from __future__ import annotations

from typing import Any

import numpy as np

from formats.errors import Notes
from formats.frame import Frame
from formats.stream import survey
from formats.streaming.drive import Drive
from tests.ros_logs import RosLog

BEAMS = [1.0, 2.0, 3.0, 4.0, 5.0]


def drive(
    steps: int = 20, mount: tuple[float, ...] = (0.2, 0.0, 0.0), speed: float = 0.5, **scan: Any
) -> RosLog:
    """A robot that drives along x at 10 Hz from t = 0, its poses one step longer than its scans."""
    log = RosLog()
    log.static("base_link", "laser", mount)
    for k in range(steps):
        log.tf(k / 10, "odom", "base_link", (speed * k / 10, 0.0, 0.0))
        log.scan(k / 10, BEAMS, **scan)
    log.tf(steps / 10, "odom", "base_link", (speed * steps / 10, 0.0, 0.0))
    return log


def surveyed(log: RosLog, **options: Any) -> tuple[Drive, list[str]]:
    notes = Notes()
    found = survey(log.opened(), notes, **options)
    return found, [str(note) for note in notes if note.kind != "info"]


def problems(log: RosLog, **options: Any) -> list[str]:
    """Notes but for infos and the warning that this is odometry."""
    return [note for note in surveyed(log, **options)[1] if "odometry alone" not in note]


def points(frame: Frame) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Where the beams end, (n, 2) in the map frame."""
    r, b = frame.scan.ranges.astype(np.float64), frame.scan.bearings
    return frame.pose.apply(np.stack([r * np.cos(b), r * np.sin(b)], axis=1))
