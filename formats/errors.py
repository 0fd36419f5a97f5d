"""The one error a user sees from a file, and the counted notes of what was odd or lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from typing import Literal

Kind = Literal["info", "warning", "skipped", "lost"]
Path = str | PathLike[str]
LONGEST = 200


def printable(text: object, longest: int = LONGEST) -> str:
    """Text that is safe on a terminal: control characters escaped, cut at `longest` characters."""
    raw = str(text)
    cut = raw if len(raw) <= longest else raw[:longest] + "..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in cut)


def one_line(path: Path, problem: str, topic: str = "", at: str = "", hint: str = "") -> str:
    """`file: topic: problem at place; what to do`, the form of every message of ours."""
    parts = [printable(path), printable(topic)] if topic else [printable(path)]
    text = ": ".join([part for part in parts if part] + [printable(problem, 2000)])
    if at:
        text += f" at {printable(at)}"
    return f"{text}; {printable(hint, 2000)}" if hint else text


class FormatError(Exception):
    """Something is wrong with an input or an output: said in one line, exit code 1.

    Args:
        path: the file or folder that it is about.
        problem: what is wrong.
        topic: the topic, where there is one.
        at: the place: "byte 81920" or "12.30 s".
        hint: what the user can do.
    """

    exit_code = 1

    def __init__(
        self, path: Path, problem: str, *, topic: str = "", at: str = "", hint: str = ""
    ) -> None:
        super().__init__(one_line(path, problem, topic, at, hint))
        self.path, self.problem, self.topic, self.at, self.hint = path, problem, topic, at, hint


class UsageError(FormatError):
    """The user must choose or correct an option: exit code 2."""

    exit_code = 2


@dataclass
class Note:
    """One distinct remark and how often it held; `at` is the place of the first."""

    kind: Kind
    path: str
    problem: str
    topic: str
    at: str
    count: int

    def __str__(self) -> str:
        times = f"{self.count} x " if self.count > 1 else ""
        place = f" (first at {self.at})" if self.at and self.count > 1 else ""
        place = place or (f" at {self.at}" if self.at else "")
        return one_line(self.path, f"{times}{self.problem}{place}", self.topic)


class Notes:
    """What reading found odd, skipped or lost: one line for each distinct problem, counted.

    `info` explains a choice, `warning` is odd but harmless or handled, `skipped` counts readable
    data that could not be used (exit stays 0), `lost` counts unreadable data (exit 3).
    """

    def __init__(self) -> None:
        self._notes: dict[tuple[str, str, str, str], Note] = {}

    def add(
        self,
        kind: Kind,
        path: Path,
        problem: str,
        *,
        topic: str = "",
        at: str = "",
        count: int = 1,
    ) -> None:
        """Count `problem` of `topic` in `path`; the first place is kept."""
        key = (kind, str(path), topic, problem)
        note = self._notes.get(key)
        if note is None:
            self._notes[key] = Note(kind, str(path), problem, topic, at, count)
        else:
            note.count += count

    def info(self, path: Path, problem: str, *, topic: str = "", at: str = "") -> None:
        """Say why something was chosen."""
        self.add("info", path, problem, topic=topic, at=at)

    def warn(
        self, path: Path, problem: str, *, topic: str = "", at: str = "", count: int = 1
    ) -> None:
        """Count something odd that was handled."""
        self.add("warning", path, problem, topic=topic, at=at, count=count)

    def skip(
        self, path: Path, problem: str, *, topic: str = "", at: str = "", count: int = 1
    ) -> None:
        """Count readable data that could not be used."""
        self.add("skipped", path, problem, topic=topic, at=at, count=count)

    def lose(
        self, path: Path, problem: str, *, topic: str = "", at: str = "", count: int = 1
    ) -> None:
        """Count data that could not be read."""
        self.add("lost", path, problem, topic=topic, at=at, count=count)

    def of(self, kind: Kind) -> list[Note]:
        """The notes of one kind, in the order in which they came up."""
        return [note for note in self._notes.values() if note.kind == kind]

    def total(self, kind: Kind) -> int:
        """How many times a kind was counted in all."""
        return sum(note.count for note in self.of(kind))

    def __iter__(self) -> Iterator[Note]:
        return iter(self._notes.values())
