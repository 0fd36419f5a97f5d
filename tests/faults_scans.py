"""Rows 24 to 40: what a scan and its recorded definition can be."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import numpy as np

from formats.grid import Evidence
from formats.mcap import records as r
from tests.faults_case import Given, Table
from tests.faults_world import (
    BEAMS,
    MOUNT,
    SCAN,
    STEPS,
    definitions,
    drive,
    messages,
    ranges_at,
    scans,
)
from tests.mcap_files import McapBytes
from tests.ros_logs import RosLog, build, store

table = Table()
FEW = (3, 7)
ALL = range(STEPS)
Row = tuple[int, str, Collection[int]]


def bytes_changed(
    d: Path, change: Callable[[bytes], bytes], which: Collection[int] = FEW, topic: str = "/scan"
) -> Path:
    """The drive with other bytes in some of its scans."""
    log = drive()
    channels = definitions(log)[1]
    wanted = {number for (name, _), number in channels.items() if name == topic}
    rows, count = [], 0
    for row in messages(log):
        if row.channel_id in wanted:
            row = row._replace(data=change(bytes(row.data))) if count in which else row
            count += 1
        rows.append(row)
    out = d / "drive.mcap"
    out.write_bytes(McapBytes(chunk_messages=8).add(*definitions(log)[0], *rows).finish())
    return out


def with_fields(which: Collection[int] = ALL, **fields: Any) -> RosLog:
    """The drive with other values in some of its scans."""
    log = drive()
    for k in which:
        scans(log)[k].update(fields)
    return log


def with_ranges(value: float, which: Collection[int] = ALL, every: int = 3, **scan: Any) -> RosLog:
    """The drive with every n-th range of some scans at a value."""
    log = drive(**scan)
    for k in which:
        scans(log)[k]["ranges"] = [
            value if i % every == 0 else at for i, at in enumerate(scans(log)[k]["ranges"])
        ]
    return log


def put(d: Path, log: RosLog, name: str = "drive.mcap") -> Path:
    return log.write(d / name)


def like(d: Path, log: RosLog, other: RosLog) -> Given:
    """A log that must give what another gives."""
    return Given(put(d, log), like=put(d, other, "like.mcap"))


# ---------------------------------------------------------------------------- 24 to 27: payloads

table(24, "some scans without ranges", "2 x no ranges", map="part", least=0.7)(
    lambda d: put(d, with_fields(FEW, ranges=[]))
)
table(24, "no scan has ranges", "no ranges", code=1)(lambda d: put(d, with_fields(ranges=[])))


def counted(number: int) -> Callable[[bytes], bytes]:
    """The count of a scan's ranges replaced."""

    def change(data: bytes) -> bytes:
        at = len(data) - 4 - 4 * BEAMS - 4
        assert struct.unpack_from("<I", data, at) == (BEAMS,)
        return data[:at] + struct.pack("<I", number) + data[at + 4 :]

    return change


CUTS: list[tuple[int, str, str, Callable[[bytes], bytes]]] = [
    (25, "2^31 ranges", "impossible number of ranges", counted(1 << 31)),
    (25, "2^32 - 1 ranges", "impossible number of ranges", counted((1 << 32) - 1)),
    (26, "payload cut", "cut short", lambda data: data[:99]),
    (26, "payload empty", "empty payload", lambda data: b""),
    (
        26,
        "unknown encapsulation",
        "unknown encapsulation 0x0063",
        lambda data: b"\0\x63" + data[2:],
    ),
    (26, "8 bytes more", "longer", lambda data: data + bytes(8)),
]
for row, name, words, change in CUTS:
    table(
        row, f"{name}, some", f"2 x message not readable: {words}", code=3, map="part", least=0.7
    )(lambda d, change=change: bytes_changed(d, change))
    table(row, f"{name}, all", words, code=1)(
        lambda d, change=change: bytes_changed(d, change, ALL)
    )
table(26, "a transform cut", "/tf: message not readable", code=3, map="part", least=0.5)(
    lambda d: bytes_changed(d, lambda data: data[:40], (6,), "/tf")
)
table(27, "3 bytes of padding", quiet=True)(lambda d: bytes_changed(d, lambda b: b + bytes(3), ALL))


@table(27, "big-endian", quiet=True)
def _(d: Path) -> Path:
    log, types = drive(), store()
    made = iter([build(types, SCAN, fields) for fields in scans(log)])
    return bytes_changed(
        d, lambda _: bytes(types.serialize_cdr(next(made), SCAN, little_endian=False)), ALL
    )


# ---------------------------------------------------------------------------- 28 to 30: ranges

table(28, "some scans all NaN", "2 x all ranges are nan", map="part", least=0.7)(
    lambda d: put(d, with_ranges(nan, FEW, 1))
)
table(28, "every scan all NaN", "all ranges are nan", code=1)(
    lambda d: put(d, with_ranges(nan, every=1))
)
table(28, "some NaN", quiet=True, map="part", least=0.4)(lambda d: put(d, with_ranges(nan)))


def clears(metres: float) -> Callable[[Evidence], None]:
    """No hit at all; empty as far as this to the left of where the laser began, at x = -0.51."""

    def check(evidence: Evidence) -> None:
        hits, misses = evidence.counts
        left = evidence.geometry.x + misses.any(axis=0).argmax() * evidence.geometry.resolution
        assert hits.sum() == 0
        assert abs(left - (-0.513 - metres)) < 0.15  # beams and cells, and the margin of a miss

    return check


for name, far, metres in (("to range_max", 4.0, 4.0), ("5 m at most", 30.0, 5.0)):
    # The plan's own walls are cleared: that much is said.
    table(28, f"all +inf clears {name}", "that were seen are not there", map="own")(
        lambda d, far=far, metres=metres: Given(
            put(d, with_ranges(inf, every=1, range_max=far)), check=clears(metres)
        )
    )
for name, value in (("-inf", -inf), ("0.0", 0.0), ("negative", -2.5), ("below range_min", 0.05)):
    table(28, f"{name} is no reading", quiet=True)(
        lambda d, value=value: like(d, with_ranges(value), with_ranges(nan))
    )
for name, value in (("range_max", 4.0), ("range_max + 1", 5.0)):
    table(29, f"no return said as {name}: no ring of walls", quiet=True)(
        lambda d, value=value: like(d, with_ranges(value), with_ranges(inf))
    )
table(30, "1e38", quiet=True)(lambda d: like(d, with_ranges(1e38), with_ranges(inf)))
table(30, "denormal", quiet=True)(lambda d: like(d, with_ranges(1e-42), with_ranges(nan)))
table(30, "range_max inf", "range_max")(lambda d: put(d, drive(range_max=inf)))
table(30, "range_max 1e38", quiet=True)(lambda d: put(d, drive(range_max=1e38)))
table(30, "range_max NaN", "range_max", code=1)(lambda d: put(d, drive(range_max=nan)))

# ---------------------------------------------------------------------------- 31 to 37: fields

for name, value in (("0", 0.0), ("NaN", nan), ("inf", inf), ("1e-30", 1e-30)):
    table(31, f"angle_increment {name}", "angle_increment", code=1)(
        lambda d, value=value: put(d, with_fields(angle_increment=value))
    )
table(31, "angle_increment 0 in some", "2 x angle_increment", map="part", least=0.7)(
    lambda d: put(d, with_fields(FEW, angle_increment=0.0))
)
table(31, "angle_min NaN", "angle_min", code=1)(lambda d: put(d, with_fields(angle_min=nan)))


def mirrored(d: Path, mount: tuple[float, ...], increment: float, turn: float) -> Path:
    """The same drive with a laser that is mounted otherwise; its beams hit the same places."""
    step = 2 * pi / BEAMS
    log = drive(mount=mount, angle_min=-pi if increment > 0 else pi - step, increment=increment)
    for k, fields in enumerate(scans(log)):
        beams = ranges_at(k / 10)  # beam i at bearing -pi + i * step of a laser that looks ahead
        angles = fields["angle_min"] + increment * np.arange(BEAMS)
        bearings = turn + (angles if len(mount) == 3 or mount[3] == 0 else -angles)
        fields["ranges"] = [beams[round((b + pi) / step) % BEAMS] for b in bearings.tolist()]
    return put(d, log)


STEP = 2 * pi / BEAMS
table(32, "increment negative", quiet=True)(lambda d: mirrored(d, MOUNT, -STEP, 0.0))
table(32, "upside down", quiet=True)(lambda d: mirrored(d, (*MOUNT, pi, 0.0, 0.0), STEP, 0.0))
table(32, "looks back", quiet=True)(lambda d: mirrored(d, (*MOUNT[:2], pi), STEP, pi))
table(32, "upside down, looks back, counts down", quiet=True)(
    lambda d: mirrored(d, (*MOUNT, pi, 0.0, pi), -STEP, pi)
)
for extra in (-1, 1):

    @table(33, f"{extra:+d} range", quiet=True, map="own", least=0.9)
    def _(d: Path, extra: int = extra) -> Path:
        log = drive()
        for fields in scans(log):
            fields["ranges"] = [*fields["ranges"], fields["ranges"][0]][: BEAMS + extra]
        return put(d, log)


@table(33, "the count varies", quiet=True, map="own", least=0.7)
def _(d: Path) -> Path:
    log = drive()
    for k, fields in enumerate(scans(log)):
        if k % 2:
            half = BEAMS // 2
            fields |= {"ranges": ranges_at(k / 10, beams=half), "angle_increment": 2 * pi / half}
    return put(d, log)


table(34, "range_min above range_max", "range_min", code=1)(
    lambda d: put(d, with_fields(range_min=5.0, range_max=4.0))
)
table(34, "both limits 0", "range_max is 0", code=0)(
    lambda d: put(d, with_fields(range_min=0.0, range_max=0.0))
)
table(35, "intensities of another length", quiet=True)(
    lambda d: put(d, with_fields(intensities=[1.0, 2.0, 3.0]))
)
table(36, "time_increment of 153333 s", "not de-skewed")(
    lambda d: put(d, with_fields(time_increment=153333.0))
)
table(36, "time_increment NaN")(lambda d: put(d, with_fields(time_increment=nan)))


@table(37, "every scan twice", "12 x same stamp")
def _(d: Path) -> Path:
    log = drive()
    log.happened = [row for row in log.happened for _ in range(1 + (row[1] == "/scan"))]
    return put(d, log)


# ---------------------------------------------------------------------------- 38 to 40: types


@table(38, "/scan is an Odometry", "no scans", code=1)
def _(d: Path) -> Path:
    log = drive()
    log.happened = [row for row in log.happened if row[1] != "/scan"]
    log.odometry(0.5, (0.0, 0.0, 0.0), topic="/scan")
    return put(d, log)


@table(38, "LaserScan's schema on text", "not readable", code=1)
def _(d: Path) -> Path:
    return bytes_changed(d, lambda _: b"\0\1\0\0" + struct.pack("<I", 6) + b"hello\0", ALL)


@table(38, "two types on one topic", quiet=True)
def _(d: Path) -> Path:
    log = drive()
    for k in range(STEPS):
        log.pose(k / 10, "/scan", (0.0, 0.0, 0.0))
    return put(d, log)


RULE = "\n" + "=" * 80 + "\n"
DEEP = "".join(f"{RULE}MSG: a/T{i}\nT{i + 1} x" for i in range(3000))
CODE = "float32 x'+__import__('os').system('touch owned')+'\n__import__('os') y\n"
HOSTILE = (
    (39, "recursive", "LaserScan header\n"),
    (39, "3000 deep", "T0 x" + DEEP),
    (39, "giant array", "float64[999999999999] x\n"),
    (39, "5 MB", "float32 a\n" * 500_000),
    (40, "code", CODE),
)


def defined(d: Path, text: str, *, side: bool) -> Path:
    """The drive with a hostile definition, of a side topic or of the scans."""
    log = drive()
    head, _ = definitions(log)
    name = SCAN if side else "hostile/msg/Type"
    if side:
        head = [row._replace(data=text.encode()) if row[1] == SCAN else row for row in head]
    made = McapBytes(chunk_messages=8).add(*head)
    if not side:
        made.add(r.Schema(70, name, "ros2msg", text.encode()), r.Channel(70, 70, "/x", "cdr", {}))
    made.add(*messages(log), *([] if side else [r.RawMessage(70, 0, log.ns(0), log.ns(0), b"?")]))
    (d / "drive.mcap").write_bytes(made.finish())
    return d / "drive.mcap"


for row, name, text in HOSTILE:
    table(row, f"definition beside: {name}", quiet=True)(
        lambda d, text=text: defined(d, text, side=False)
    )
    table(row, f"definition of the scans: {name}", "definition", code=1)(
        lambda d, text=text: defined(d, text, side=True)
    )
