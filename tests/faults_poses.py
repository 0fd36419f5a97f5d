"""Rows 50 to 59: what transforms and poses can be."""

from __future__ import annotations

from functools import partial
from math import nan, pi, radians, sin
from pathlib import Path
from typing import Any

import numpy as np

from formats.grid import Evidence
from tests.faults_case import Given, Table
from tests.faults_world import (
    BEAMS,
    MOUNT,
    STEPS,
    drive,
    path,
    ranges_at,
    ray,
    scans,
    transforms,
)
from tests.ros_logs import SECOND, START_NS, RosLog, stamp

table = Table()


def put(d: Path, log: RosLog) -> Path:
    return log.write(d / "drive.mcap")


# ---------------------------------------------------------------------------- 50 to 55: transforms

table(50, "no pose source at all", "no pose source", "looked for", code=1)(
    lambda d: put(d, drive(poses="none", mount=None))
)
table(50, "static transforms only", "no pose source", code=1)(lambda d: put(d, drive(poses="none")))


def without_tf(d: Path, gone: Any) -> Path:
    log = drive()
    log.happened = [
        row for row in log.happened if not (row[1] == "/tf" and gone((row[0] - START_NS) / SECOND))
    ]
    return put(d, log)


table(51, "tf late", "before 0.40 s", map="part", least=0.5)(
    lambda d: without_tf(d, lambda t: t < 0.35)
)
table(51, "tf ends early", "after 0.80 s", map="part", least=0.5)(
    lambda d: without_tf(d, lambda t: t > 0.85)
)


@table(51, "tf has a gap", "within its gaps", map="own")
def _(d: Path) -> Path:
    """Scans go on for 5 s while the transforms are away."""
    log, more = drive(), RosLog()
    for k in range(50):
        more.scan(1.2 + k / 10, ranges_at(0.0), angle_min=-pi, increment=2 * pi / BEAMS)
    for k in range(3):
        more.tf(6.2 + k / 10, "map", "odom", (0.0, 0.0, 0.0))
        more.tf(6.2 + k / 10, "odom", "base_link", path(1.2))
    log.happened += more.happened
    return put(d, log)


table(52, "no base_link <- laser", "base_link <- laser", "--sensor-pose", code=1)(
    lambda d: put(d, drive(mount=None))
)
table(52, "--sensor-pose stands in", quiet=True)(
    lambda d: Given(put(d, drive(mount=None)), options=["--sensor-pose", "0.1,0,0"])
)


@table(52, "tf_static at the end", quiet=True)
def _(d: Path) -> Path:
    log = drive()
    log.happened = [*log.happened[1:], (log.ns(1.3), *log.happened[0][1:])]
    return put(d, log)


@table(52, "the second split alone", "--sensor-pose", code=1)
def _(d: Path) -> Path:
    log = drive()
    log.happened = [row for row in log.happened if row[0] >= log.ns(0.6)]
    return put(d, log)


@table(53, "loop", "loop", code=1)
def _(d: Path) -> Path:
    log = drive()
    for k in range(STEPS):
        log.tf(k / 10, "base_link", "map", (0.0, 0.0, 0.0))
    return put(d, log)


@table(53, "two parents", "two parents")
def _(d: Path) -> Path:
    log = drive()
    log.tf(0.05, "elsewhere", "base_link", (3.0, 3.0, 0.0))
    return put(d, log)


@table(53, "self-transform", "2 x")
def _(d: Path) -> Path:
    log = drive()
    for t in (0.0, 0.5):
        log.tf(t, "base_link", "base_link", (1.0, 0.0, 0.0))
    return put(d, log)


def odd_transform(d: Path, which: int, values: dict[str, dict[str, float]]) -> Path:
    """One transform odom > base_link with other numbers."""
    log = drive()
    moved = [each for each in transforms(log) if each["child_frame_id"] == "base_link"]
    moved[which]["transform"] = {
        name: {**moved[which]["transform"][name], **values.get(name, {})}
        for name in ("translation", "rotation")
    }
    return put(d, log)


for name, values in (
    ("quaternion 0", {"rotation": dict.fromkeys("xyzw", 0.0)}),
    ("quaternion NaN", {"rotation": {"w": nan}}),
    ("translation NaN", {"translation": {"x": nan}}),
    ("translation 1e9", {"translation": {"x": 1e9}}),
    ("translation 1e300", {"translation": {"y": -1e300}}),
):
    # Between its neighbours the pose is interpolated, along a path that is nearly straight.
    table(54, name, "base_link", map="own", least=0.9)(
        partial(odd_transform, which=5, values=values)
    )


@table(54, "norm 1.1", "normalised")
def _(d: Path) -> Path:
    log = drive()
    for each in transforms(log):
        turn = each["transform"]["rotation"]
        each["transform"]["rotation"] = {axis: 1.1 * turn[axis] for axis in "xyzw"}
    return put(d, log)


@table(54, "every transform is 1e9 m away", code=1)
def _(d: Path) -> Path:
    log = drive()
    for each in transforms(log):
        each["transform"]["translation"]["x"] = 1e9
    return put(d, log)


@table(55, "'/laser' with a slash", quiet=True)
def _(d: Path) -> Path:
    log = drive()
    for fields in scans(log):
        fields["header"]["frame_id"] = "/laser"
    return put(d, log)


@table(55, "the frame changes", "another frame")
def _(d: Path) -> Path:
    log = drive()
    log.static("base_link", "other", MOUNT)
    for fields in scans(log)[6:]:
        fields["header"]["frame_id"] = "other"
    return put(d, log)


@table(55, "frame ''", "name no frame", map="own")
def _(d: Path) -> Path:
    log = drive()
    for fields in scans(log):
        fields["header"]["frame_id"] = ""
    return put(d, log)


@table(55, "frame of 60 kB", code=1)
def _(d: Path) -> Path:
    log = drive()
    for fields in scans(log):
        fields["header"]["frame_id"] = "x\x1b[31m" * 9000
    return put(d, log)


# ---------------------------------------------------------------------------- 56 to 59: sources


def amcl(log: RosLog) -> RosLog:
    for k in range(STEPS + 1):
        log.amcl_pose(k / 10, path(k / 10))
    return log


def elsewhere(log: RosLog) -> RosLog:
    """Poses that are wrong, on topics that must not be taken."""
    for k in range(STEPS + 1):
        log.amcl_pose(k / 10, (0.3, 0.0, 1.0))
        log.odometry(k / 10, (0.0, 0.3, 2.0))
    return log


table(56, "tf comes before amcl", quiet=True)(lambda d: put(d, elsewhere(drive())))
table(56, "amcl alone", quiet=True)(lambda d: put(d, amcl(drive(poses="none"))))


@table(56, "odometry alone", "odometry alone")
def _(d: Path) -> Given:
    return Given(put(d, drive(poses="odom")), options=("--poses", "log"))


@table(56, "odometry alone, a plan that is placed", map="own", least=0.9)
def _(d: Path) -> Path:
    return put(d, drive(poses="odom"))


@table(56, "odometry's topic alone", "odometry alone")
def _(d: Path) -> Given:
    log = drive(poses="none")
    for k in range(STEPS + 1):
        log.odometry(k / 10, path(k / 10))
    return Given(put(d, log), options=("--poses", "log"))


@table(57, "teleport of 3 m", "jumps by 3.1 m", map="own", least=0.9)
def _(d: Path) -> Given:
    """From then on everything is 3 m farther on; one scan lies in the jump."""
    log = drive()
    moved = [each for each in transforms(log) if each["child_frame_id"] == "base_link"]
    for each in moved[6:]:
        each["transform"]["translation"]["x"] += 3.0
    for k, fields in enumerate(scans(log)):
        fields["header"]["stamp"] = stamp(log.ns(k / 10 + 0.05))

    def check(evidence: Evidence) -> None:
        hits = evidence.counts[0]
        xs = evidence.geometry.x + np.nonzero(hits)[1] * evidence.geometry.resolution
        assert not np.any((xs > 1.3) & (xs < 1.7)), "a scan was placed on the way of the jump"

    return Given(put(d, log), check=check)


@table(58, "two robots", "--scan /a/scan or --scan /b/scan", code=2)
def _(d: Path) -> Path:
    log = drive()
    more = []
    for row in log.happened:
        if row[1] == "/scan":
            more.append((row[0], "/b/scan", *row[2:]))
            row = (row[0], "/a/scan", *row[2:])
        more.append(row)
    log.happened = more
    return put(d, log)


@table(58, "two robots, one chosen", quiet=True)
def _(d: Path) -> Given:
    log = drive()
    log.happened += [(row[0], "/b", *row[2:]) for row in log.happened if row[1] == "/scan"]
    return Given(put(d, log), options=["--scan", "/scan"])


@table(58, "renamed", quiet=True)
def _(d: Path) -> Path:
    log = drive()
    names = {"/scan": "/front/lidar/points_maybe", "/tf": "/robot/tf"}
    log.happened = [(row[0], names.get(row[1], row[1]), *row[2:]) for row in log.happened]
    return put(d, log)


@table(59, "pitched 30 deg", "tilted by up to 30 deg", map="own", least=0.01)
def _(d: Path) -> Path:
    """What it sees beside itself is level; ahead and behind it sees the floor and above."""
    pitch = radians(30.0)
    log = drive(mount=(*MOUNT[:2], 1.0, 0.0, pitch, 0.0))
    for k, fields in enumerate(scans(log)):
        x, y, yaw = path(k / 10)
        found = []
        for i in range(BEAMS):
            angle = -pi + 2 * pi / BEAMS * i
            ahead, aside = np.cos(angle) * np.cos(pitch), np.sin(angle)
            flat = float(np.hypot(ahead, aside))
            wall = ray(x + 0.1 * np.cos(yaw), y + 0.1 * np.sin(yaw), yaw + np.arctan2(aside, ahead))
            floor = 1.0 / max(np.cos(angle) * sin(pitch), 1e-9)
            found.append(min(wall / flat, floor))
        fields["ranges"] = found
    return put(d, log)
