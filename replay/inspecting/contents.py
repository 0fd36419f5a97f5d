"""inspect(): what a log holds, what `run` would take of it and why, and whether that is sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite
from os import PathLike
from typing import Any, Unpack

from formats.errors import FormatError, Notes, UsageError
from formats.log import Container, Log
from formats.stream import Options, open_log, survey
from formats.streaming.drive import Drive
from replay.inspecting.checks import Check, checks_of, damage
from replay.inspecting.tallying import Tallied, Tally, described

Source = str | PathLike[str]


@dataclass(eq=False)
class Inspection:
    """What a log holds.

    Attributes:
        path: as the user names it.
        container: what it is.
        topics: every topic with what passed on it.
        problem: why `run` would end with an error; None where it would not.
        scan, pose: the topics that `run` would take; "" for none, "tf" for transforms.
        in_map: whether the poses are in a map, not odometry.
        reasons: why these, in lines for people.
        checks: what was looked at.
        notes: what was odd, skipped or lost.
    """

    path: str
    container: Container
    topics: list[Tally]
    problem: FormatError | None
    scan: str = ""
    pose: str = ""
    in_map: bool = True
    reasons: list[str] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)

    @property
    def usable(self) -> bool:
        """Whether `run` would map it, perhaps after a choice that the user has to make."""
        return self.problem is None or isinstance(self.problem, UsageError)

    @property
    def seconds(self) -> float:
        """From the first log time to the last."""
        return (self.container.end_ns - self.container.start_ns) / 1e9

    def facts(self) -> dict[str, Any]:
        """The same for --json."""
        box = self.container
        return {
            "path": self.path,
            "container": {name: getattr(box, name) for name in Container.__slots__},
            "seconds": self.seconds,
            "topics": [_topic(tally) for tally in self.topics],
            "usable": self.usable,
            "problem": None if self.problem is None else str(self.problem),
            "scan": self.scan or None,
            "pose": self.pose or None,
            "reasons": self.reasons,
            "checks": {
                check.name: {"ok": check.ok, "text": check.text, **_numbers(check.numbers)}
                for check in self.checks
            },
            "notes": [
                {"kind": note.kind, "text": str(note), "topic": note.topic, "count": note.count}
                for note in self.notes
                if note.kind != "info"
            ],
        }


def inspect(
    log: Source | Sequence[Source] | Log, notes: Notes | None = None, **options: Unpack[Options]
) -> Inspection:
    """Read a log from end to end and say what it holds and what `run` would do with it.

    Args:
        log: a file or folder; several are one run, merged by time.
        notes: gets what was odd, skipped or lost.
        options: as for `run`; see formats.stream.Options.

    Raises:
        FormatError: it cannot be opened, or is not a log.
    """
    notes = Notes() if notes is None else notes
    if not isinstance(log, str | PathLike | Sequence):
        return _inspected(Tallied(log), notes, options)
    opened = open_log(log, notes)
    try:
        return _inspected(Tallied(opened), notes, options)
    finally:
        opened.close()


def _inspected(log: Tallied, notes: Notes, options: Options) -> Inspection:
    drive: Drive | None = None
    problem: FormatError | None = None
    try:
        drive = survey(log, notes, **options)
    except FormatError as error:
        problem = error
    topics = log.count()
    if drive is None:
        found = Inspection(str(log.path), log.container, topics, problem, notes=notes)
        found.checks = [damage(found.container, notes)]
        return found
    checks = checks_of(drive)  # reads once more: what it loses belongs to the container's state
    choice = drive.choice
    return Inspection(
        str(log.path),
        log.container,
        topics,
        None,
        scan=choice.scan.name,
        pose=choice.source.topic.name if choice.source.topic else "tf",
        in_map=choice.in_map,
        reasons=choice.reasons,
        checks=[*checks, damage(log.container, notes)],
        notes=notes,
    )


def _topic(tally: Tally) -> dict[str, Any]:
    return {
        "name": tally.topic.name,
        "type": tally.topic.type,
        "encoding": tally.topic.encoding,
        "count": tally.count,
        "rate": tally.rate,
        "longest_gap": tally.longest_ns / 1e9,
        "says": described(tally),
        **_numbers(tally.facts or {}),
        **({"transforms": [[*edge, n] for edge, n in tally.edges.items()]} if tally.edges else {}),
    }


def _numbers(found: dict[str, Any]) -> dict[str, Any]:
    """JSON has no inf and no nan."""
    return {
        name: None if isinstance(value, float) and not isfinite(value) else value
        for name, value in found.items()
    }
