"""Parts of a log to put together in tests of what is chosen: each adds its message of a time."""

from __future__ import annotations

from collections.abc import Callable

from formats.errors import Notes
from formats.stream import survey
from formats.streaming.drive import Drive
from tests.ros_logs import RosLog

RANGES = [1.0, 2.0, 3.0]
Add = Callable[[RosLog, float, float], None]  # log, time, metres driven


def scans(log: RosLog, _t: float, _x: float) -> None:
    log.scan(_t, RANGES)


def mount(log: RosLog, t: float, _x: float) -> None:
    if t == 0:
        log.static("base_link", "laser", (0.2, 0.0, 0.0))


def odom(log: RosLog, t: float, x: float) -> None:
    log.tf(t, "odom", "base_link", (x, 0.0, 0.0))


def map_odom(log: RosLog, t: float, _x: float) -> None:
    log.tf(t, "map", "odom", (100.0, 0.0, 0.0))


def vicon(log: RosLog, t: float, x: float) -> None:
    log.tf(t, "lab_origin", "base_link", (200.0 + x, 0.0, 0.0))


def truth(log: RosLog, t: float, x: float) -> None:
    log.pose(t, "/truth", (300.0 + x, 0.0, 0.0))


def amcl(log: RosLog, t: float, x: float) -> None:
    log.amcl_pose(t, (400.0 + x, 0.0, 0.0))


def odometry(log: RosLog, t: float, x: float) -> None:
    log.odometry(t, (500.0 + x, 0.0, 0.0))


def global_odometry(log: RosLog, t: float, x: float) -> None:
    log.odometry(t, (600.0 + x, 0.0, 0.0), topic="/global", frame="map")


def seldom_goal(log: RosLog, t: float, _x: float) -> None:
    if t in (0.0, 2.5):
        log.pose(t, "/goal", (900.0, 0.0, 0.0))


def slashed(log: RosLog, t: float, x: float) -> None:
    log.tf(t, "/map", "/odom", (100.0, 0.0, 0.0))
    log.tf(t, "/odom", "/base_link", (x, 0.0, 0.0))


def reversed_map(log: RosLog, t: float, _x: float) -> None:
    log.tf(t, "odom", "map", (-100.0, 0.0, 0.0))


def brief_map(log: RosLog, t: float, _x: float) -> None:
    if t < 0.5:
        log.tf(t, "map", "odom", (100.0, 0.0, 0.0))


def drive(*adds: Add, steps: int = 30) -> RosLog:
    log = RosLog()
    for k in range(steps):
        for add in adds:
            add(log, k / 10, 0.05 * k)
    return log


def opened(log: RosLog, **options: object) -> tuple[Drive, Notes]:
    notes = Notes()
    return survey(log.opened(), notes, **options), notes  # type: ignore[arg-type]


def second_scan(log: RosLog, t: float, _x: float) -> None:
    log.scan(t, RANGES, topic="/rear", frame="rear")


def second_mount(log: RosLog, t: float, _x: float) -> None:
    if t == 0:
        log.static("base_link", "rear", (-0.2, 0.0, 3.0))


def few_scans(log: RosLog, t: float, _x: float) -> None:
    if t < 0.2:
        log.scan(t, RANGES, topic="/seldom")
