"""Rows 41 to 59: what clocks, transforms and poses can be."""

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
    definitions,
    drive,
    messages,
    path,
    ranges_at,
    ray,
    scans,
    transforms,
)
from tests.mcap_files import McapBytes
from tests.ros_logs import SECOND, START_NS, RosLog, stamp

table = Table()
HOUR = 3600 * SECOND
ZERO = {"sec": 0, "nanosec": 0}


def put(d: Path, log: RosLog, name: str = "drive.mcap") -> Path:
    return log.write(d / name)


def stamps(log: RosLog) -> list[dict[str, Any]]:
    """The header of every message that has one, in the order of the log."""
    found = []
    for _, _, _, _, fields in log.happened:
        parts = fields.get("transforms", [fields])
        found += [part["header"] for part in parts]
    return found


def shifted(log: RosLog, ns: int, *, header: bool = True, recorded: bool = True) -> RosLog:
    """Another clock for headers, recording, or both."""
    if header:
        for head in stamps(log):
            time = head["stamp"]["sec"] * SECOND + head["stamp"]["nanosec"] + ns
            head["stamp"] = stamp(time)
    if recorded:
        log.happened = [(row[0] + ns, *row[1:]) for row in log.happened]
    return log


def halves(log: RosLog, ns: int, *, recorded: bool) -> RosLog:
    """The clock changes in the middle of the drive."""
    middle = log.ns(0.55)
    late = RosLog(log.start_ns, [row for row in log.happened if row[0] >= middle])
    log.happened = [row for row in log.happened if row[0] < middle]
    log.happened += shifted(late, ns, recorded=recorded).happened
    return log


def logged_at(d: Path, times: Any) -> Path:
    """The drive with log times of its own."""
    log = drive()
    rows = [
        row._replace(log_time=times(k), publish_time=times(k))
        for k, row in enumerate(messages(log))
    ]
    made = McapBytes(chunk_messages=8).add(*definitions(log)[0], *rows)
    (d / "drive.mcap").write_bytes(made.finish())
    return d / "drive.mcap"


# ---------------------------------------------------------------------------- 41 to 49: clocks


@table(41, "header stamps all 0", "stamps are all 0")
def _(d: Path) -> Path:
    log = drive()
    for head in stamps(log):
        head["stamp"] = ZERO
    return put(d, log)


@table(41, "stamps of scans all 0", map="part", least=0.9)
def _(d: Path) -> Path:
    log = drive()
    for fields in scans(log):
        fields["header"]["stamp"] = ZERO
    return put(d, log)


@table(42, "two scans swapped", "out of order")
def _(d: Path) -> Path:
    log = drive()
    a, b = scans(log)[4], scans(log)[5]
    first, second = dict(a), dict(b)
    a.update(second)
    b.update(first)
    return put(d, log)


def _jump(d: Path, ns: int, *, recorded: bool) -> Path:
    return put(d, halves(drive(), ns, recorded=recorded))


for name, ns, recorded, words in (
    ("+1 h", HOUR, True, "no scans for 360"),
    ("-1 h", -HOUR, True, ""),
    ("headers alone -1 h", -HOUR, False, "goes back by"),
    ("headers alone +1 h", HOUR, False, ""),
):
    table(43, f"clock {name}", words, map="part", least=0.8)(
        partial(_jump, ns=ns, recorded=recorded)
    )

table(44, "headers a day after the log times", quiet=True)(
    lambda d: put(d, shifted(drive(), 24 * HOUR, recorded=False))
)


@table(44, "scans a day after the transforms", "--pose-delay 86400", code=1)
def _(d: Path) -> Path:
    log = drive()
    for k, fields in enumerate(scans(log)):
        fields["header"]["stamp"] = stamp(log.ns(k / 10) + 24 * HOUR)
    return put(d, log)


@table(45, "scans recorded 200 ms late", quiet=True)
def _(d: Path) -> Path:
    log = drive()
    late = [
        (t + 200_000_000 * (topic == "/scan"), topic, *rest) for t, topic, *rest in log.happened
    ]
    log.happened = sorted(late, key=lambda row: row[0])  # type: ignore[arg-type]
    return put(d, log)


@table(46, "nanosec of a second and more", "nanosec")
def _(d: Path) -> Path:
    log = drive()
    for fields in scans(log):
        time = fields["header"]["stamp"]
        fields["header"]["stamp"] = {"sec": time["sec"] - 1, "nanosec": time["nanosec"] + SECOND}
    return put(d, log)


@table(46, "negative seconds in some", "2 x stamp before 1970", map="part", least=0.7)
def _(d: Path) -> Path:
    log = drive()
    for k in (3, 7):
        scans(log)[k]["header"]["stamp"] = {"sec": -5, "nanosec": 0}
    return put(d, log)


table(46, "the last seconds of ROS 2", quiet=True)(
    lambda d: put(d, shifted(drive(), (2**31 - 4) * SECOND - START_NS))
)
table(47, "simulated time from 0", quiet=True)(lambda d: put(d, shifted(drive(), -START_NS)))
table(47, "simulated headers, recorded by the wall clock", quiet=True)(
    lambda d: put(d, shifted(drive(), -START_NS, recorded=False))
)
table(47, "log times all 0")(lambda d: logged_at(d, lambda k: 0))
table(47, "log times at their maximum")(lambda d: logged_at(d, lambda k: (1 << 64) - 1))
table(47, "log times before the stamps", quiet=True)(
    lambda d: logged_at(d, lambda k: START_NS - HOUR + k * 1_000_000)
)


@table(48, "the drive twice with the same stamps", "goes back by", map="own", least=3.0)
def _(d: Path) -> Given:
    """Recorded one after the other: every reading counts twice, and none between two places."""
    log, again = drive(25), shifted(drive(25), 3 * SECOND, header=False)
    log.happened += again.happened

    def check(evidence: Evidence) -> None:
        assert not (evidence.counts % 2).any()

    return Given(put(d, log), check=check)


@table(49, "60 s gap", "no scans for 60")
def _(d: Path) -> Path:
    log = drive()
    middle = log.ns(0.55)
    late = RosLog(log.start_ns, [row for row in log.happened if row[0] >= middle])
    log.happened = [row for row in log.happened if row[0] < middle]
    log.tf(0.54, "odom", "base_link", path(0.54))
    log.happened += shifted(late, 60 * SECOND).happened
    return put(d, log)


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
table(56, "odometry alone", "odometry alone")(lambda d: put(d, drive(poses="odom")))


@table(56, "odometry's topic alone", "odometry alone")
def _(d: Path) -> Path:
    log = drive(poses="none")
    for k in range(STEPS + 1):
        log.odometry(k / 10, path(k / 10))
    return put(d, log)


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
