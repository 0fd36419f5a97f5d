"""What `replay info` prints of one log."""

from __future__ import annotations

import shlex
from datetime import UTC, datetime
from fnmatch import fnmatchcase

from formats.errors import printable
from replay.inspecting.checks import Check
from replay.inspecting.contents import Inspection
from replay.inspecting.tallying import Tally, described

WIDTH = 100
NAME, TYPE = 40, 28  # columns that are aligned; longer texts push the rest of their line
SIMULATED_NS = 10**18 // 2  # before 1985: a clock that starts at 0


def info_report(found: Inspection) -> str:
    """Lines that a person reads, without the last line break."""
    lines = [_container(found), *_topics(found)]
    lines += [
        f"  {'use' if i == 0 else '':<8}{printable(line, 400)}"
        for i, line in enumerate(found.reasons)
    ]
    if found.problem is not None:
        word = "choose" if found.usable else "cannot"
        lines.append(f"  {word:<8}{_without_path(found)}")
    lines += _checks(found.checks)
    return "\n".join(lines)


def next_step(found: Inspection) -> str:
    """The hint below."""
    name = shlex.quote(printable(found.path))
    if found.problem is not None:
        return "next: see above what `replay run` would need"
    how = "" if found.in_map else "  (finds where on the plan the robot was, by AMCL)"
    return f"next: replay run {name} --prior plan.png{how}"


def amount(size: int) -> str:
    """Bytes for people."""
    value = float(size)
    for unit in ("bytes", "kB", "MB", "GB"):
        if value < 1000 or unit == "GB":
            break
        value /= 1000
    return f"{size} bytes" if unit == "bytes" else f"{value:.1f} {unit}"


def when(time_ns: int) -> str:
    """A log time as UTC; seconds where it counts from a start of its own."""
    if time_ns < SIMULATED_NS:
        return f"from {time_ns / 1e9:.2f} s of its own clock"
    try:
        return f"{datetime.fromtimestamp(time_ns // 10**9, UTC):%Y-%m-%dT%H:%M:%SZ}"
    except (OverflowError, OSError, ValueError):
        return f"at {time_ns} ns"


def _container(found: Inspection) -> str:
    box = found.container
    words = [box.kind, box.compression, amount(box.size)]
    if any(tally.count for tally in found.topics):
        words += [f"{found.seconds:.1f} s", when(box.start_ns)]
    return f"{printable(found.path)}   {', '.join(map(printable, words))}, {printable(box.state)}"


def _topics(found: Inspection) -> list[str]:
    rows = []
    for tally in found.topics:
        rate = "" if tally.rate is None or tally.count < 3 else f"{tally.rate:.1f} Hz"
        kind = printable(tally.topic.type.rsplit("/", 1)[-1], 60)
        rows.append([printable(tally.topic.name), str(tally.count), rate, kind])
    widths = [max((min(len(row[i]), NAME) for row in rows), default=0) for i in range(4)]
    lines = []
    for (name, count, rate, kind), tally in zip(rows, found.topics, strict=True):
        a, b, c, d = widths
        line = f"  {name:<{a}}  {count:>{b}}  {rate:>{c}}  {kind:<{d}}  {described(tally)}"
        lines.append(line.rstrip() + _mark(found, tally))
    return lines


def _mark(found: Inspection, tally: Tally) -> str:
    marks = []
    if fnmatchcase(tally.topic.name, found.scan) and "frame" in (tally.facts or {}):
        marks.append("scans")
    if tally.topic.name == found.pose or (found.pose == "tf" and tally.edges):
        marks.append("poses")
    return f"   <- {', '.join(marks)}" if marks else ""


def _without_path(found: Inspection) -> str:
    text = str(found.problem)
    return text.removeprefix(f"{printable(found.path)}: ")


def _checks(checks: list[Check]) -> list[str]:
    """The good ones in few lines, each of the others in one of its own."""
    lines, line = [], ""
    for text in (printable(str(check)) for check in checks if check.ok):
        if line and len(line) + 3 + len(text) > WIDTH - 10:
            lines.append(line)
            line = ""
        line += ("   " if line else "") + text
    lines += [line] if line else []
    lines += [f"! {printable(str(check))}" for check in checks if not check.ok]
    return [f"  {'checks' if i == 0 else '':<8}{text}" for i, text in enumerate(lines)]
