"""Rows 41 to 49: what clocks can be."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from formats.grid import Evidence
from tests.faults_case import Given, Table
from tests.faults_world import (
    definitions,
    drive,
    messages,
    path,
    scans,
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
