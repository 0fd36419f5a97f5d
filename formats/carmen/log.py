"""Read CARMEN text logs, and the `L` / `O` lines of CMU's Wean Hall, whole, cut or damaged.

Each laser line is a scan and, for the laser with most of them, also a transform to the robot's body
at that scan: exact where odometry would have to be interpolated. `PARAM/tf_static` has the lasers'
mountings. Poses are in `map` where a mapper has corrected them, else in `odom`.
"""

from __future__ import annotations

import mmap
import re
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.carmen.lines import LASERS, LIMIT, LINES, Line, Malformed, parse
from formats.carmen.nouns import ODOMETRY, POSE, SCAN, TF, to_ns, topic_of
from formats.carmen.poses import MOST, Columns, corrected, mount_by_parameters, mount_of
from formats.errors import FormatError, Notes
from formats.log import Container, Message, Topic

FEW = 20  # lines to one time, beyond which times say nothing
STEP_NS = 100_000_000  # between lines then
Times = npt.NDArray[np.int64]
LONGEST = 1 << 20  # bytes of a line; 1000 readings are 10 kB
OTHER = re.compile(rb"[A-Z][A-Z0-9_.-]*\Z")
HEADER = re.compile(rb"#.*(CARMEN|message formats defined)", re.IGNORECASE)
KINDS = list(LINES)
FRAMES = {b"FLASER": "front_laser", b"RLASER": "rear_laser", b"L": "front_laser"}
Sent = tuple[Topic, bytes | None]


def fits(path: Path, head: bytes) -> bool:
    """Whether the first lines are CARMEN's: a header of its own, or mostly words that it knows."""
    if not head or b"\0" in head:
        return False
    lines = [line for line in head.split(b"\n") if line.strip()][:40]
    if any(HEADER.match(line) for line in lines):
        return True
    known = sum(_is_record(line.split(None, 2)) for line in lines)
    return known > 0 and 2 * known >= sum(not line.startswith(b"#") for line in lines)


def _is_record(words: list[bytes]) -> bool:
    """A known word and something that looks like a number."""
    if len(words) < 2:
        return False
    return words[0] == b"PARAM" or (
        words[0] in LINES and re.match(rb"[-+.0-9]", words[1]) is not None
    )


def open_file(path: Path, notes: Notes, max_chunk: int = 0) -> CarmenLog:
    """Open a CARMEN log.

    Args:
        path: the file.
        notes: where lines that cannot be read are counted, with the first one's number.
        max_chunk: not needed here.

    Raises:
        FormatError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        raise FormatError(path, f"cannot be read: {error}") from error
    return CarmenLog(path, pages, notes)


def at_time(line: bytes, seconds: float) -> bytes:
    """The line with another stamp; those of Wean Hall have no host and no second time."""
    if line[:1] in (b"L", b"O") and line[1:2].isspace():
        return line.rsplit(None, 1)[0] + b" %.6f" % seconds
    return line.rsplit(None, 3)[0] + b" %.6f - 0" % seconds


class CarmenLog:
    """An opened CARMEN log; see `formats.log.Log`. It holds 29 bytes a line."""

    def __init__(self, path: Path, pages: mmap.mmap, notes: Notes) -> None:
        self.path, self._pages, self._notes = path, pages, notes
        self._times, self._stamps, self._starts = array("q"), array("q"), array("q")
        self._lengths, self._kinds = array("I"), array("B")
        self._columns: dict[bytes, Columns] = {}
        self._parameters: dict[bytes, float] = {}
        self._words: Counter[bytes] = Counter()
        self._state = "complete"
        self._index()
        self._sent = self._topics()
        times = np.frombuffer(self._times, dtype=np.int64)
        self._timeless = self._without_times(times)
        if self._timeless:
            times = times[0] + STEP_NS * np.arange(len(times), dtype=np.int64)
        self._logged = times
        self._order = np.argsort(times, kind="stable")
        ends = (int(times.min()), int(times.max())) if len(times) else (0, 0)
        whole = self._state == "complete"
        self.container = Container(
            "CARMEN log", "none", len(pages), *ends, whole=whole, state=self._state
        )

    def _index(self) -> None:
        """Look at every line once: where it is, when it was, what is wrong with it."""
        at, number, offset = 0, 0, None
        while at < len(self._pages):
            number += 1
            end = self._pages.find(b"\n", at)
            whole = end >= 0
            end = end if whole else len(self._pages)
            start, at = at, end + 1
            if end - start > LONGEST:
                self._lose(f"line of more than {LONGEST} bytes", number, whole)
                continue
            line = self._pages[start:end]
            words = line.split(None, 1)
            if not words or words[0].startswith(b"#"):
                continue
            if words[0] not in LINES:
                self._other(line, number, whole)
                continue
            try:
                found = parse(line)
            except Malformed as error:
                self._lose(str(error), number, whole, words[0].decode())
                continue
            if offset is None:
                offset = found.stamp - found.logged
            logged = found.logged + offset if whole else found.stamp
            self._keep(words[0], found, logged, start, end)

    def _keep(self, word: bytes, line: Line, logged: float, start: int, end: int) -> None:
        self._times.append(to_ns(logged))
        self._stamps.append(to_ns(line.stamp))
        self._starts.append(start)
        self._lengths.append(end - start)
        self._kinds.append(KINDS.index(word))
        self._words[word] += 1
        if line.laser is not None and line.robot is not None:
            columns = self._columns.setdefault(word, Columns())
            if len(columns) < MOST:
                columns.add(line)

    def _other(self, line: bytes, number: int, whole: bool) -> None:
        words = line.split(None, 3)
        if words[0] == b"PARAM" and len(words) > 2:
            with suppress(ValueError):
                self._parameters[words[1][:100]] = float(words[2])
        elif not OTHER.match(words[0]):
            self._lose("line that is no message of CARMEN", number, whole)
        elif len(self._words) < MOST:
            self._words[words[0]] += 1

    def _lose(self, problem: str, number: int, whole: bool, topic: str = "") -> None:
        if self._state == "complete":
            self._state = f"damaged at line {number}" if whole else f"cut at line {number}"
        self._notes.lose(self.path, problem, topic=topic, at=f"line {number}")

    def _without_times(self, times: Times) -> bool:
        """Whether times have lost their figures (1.13486e+09): then the order of lines counts."""
        if len(times) < FEW or len(np.unique(self._stamps)) * FEW > len(times):
            return False
        if len(np.unique(times)) * FEW > len(times):
            return False
        what = f"times say nothing: lines are taken as {STEP_NS / 1e9:g} s apart"
        self._notes.warn(self.path, what, count=len(times))
        return True

    def _topics(self) -> dict[bytes, list[Sent]]:
        """Word -> topics of its lines; the mountings, which have no line, under b""."""
        counts = {word: self._words[word] for word in LINES if self._words[word]}
        for word in list(counts):
            if word.startswith(b"RAW") and word.replace(b"RAW", b"ROBOT") in counts:
                del counts[word]  # the same readings, without poses
        mounts: dict[str, Any] = {}
        sent: dict[bytes, list[Topic]] = {word: [] for word in counts}
        carrier = max(self._columns, key=lambda word: counts[word], default=None)
        limit = self._parameters.get(b"robot_front_laser_max", LIMIT)
        limit = limit if 0 < limit < 1e3 else LIMIT
        for word, count in counts.items():
            name, frame = word.decode(), FRAMES.get(word, word.decode().lower()[-6:])
            if word in LASERS:
                columns = self._columns.get(word)
                mount = mount_of(columns) if columns else None
                mount = mount or mount_by_parameters(self._parameters, frame)
                if mount is not None:
                    mounts.setdefault(frame, mount)
                if word == carrier and columns is not None:
                    says = {"mount": mounts.get(frame, (0, 0, 0)), "frame": self._frame(columns)}
                    sent[word].append(topic_of(f"{name}/tf", TF, count, **says))
                sent[word].append(topic_of(name, SCAN, count, frame=frame, limit=limit))
            elif word == b"TRUEPOS":
                sent[word].append(topic_of(name, POSE, count, frame="map"))
            else:
                # Between a mapper's corrections its odometry goes on from the last, and jumps.
                own = "map" if self._words[b"NEFF"] else "odom"
                sent[word].append(topic_of(name, ODOMETRY, count, frame=own))
        found: dict[bytes, list[Sent]] = {
            word: [(topic, None) for topic in topics] for word, topics in sent.items()
        }
        if mounts:
            static = topic_of("PARAM/tf_static", TF, 1, latched=True, mounts=mounts)
            found[b""] = [(static, b"")]
        return found

    def _frame(self, columns: Columns) -> str:
        """The frame of the lasers' poses: map where they are corrected."""
        why = corrected(columns, by_mapper=self._words[b"NEFF"] > 0, name=self.path.name)
        if why:
            self._notes.info(self.path, f"poses of the laser lines are corrected: {why}")
        return "map" if why else "odom"

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name and type."""
        found = [topic for sent in self._sent.values() for topic, _ in sent]
        return sorted(found, key=lambda topic: (topic.name, topic.type))

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics (None: all), sorted by log time, file order where equal."""
        names = None if topics is None else {topic.name for topic in topics}
        wanted = [
            [topic for topic, _ in self._sent.get(word, ()) if names is None or topic.name in names]
            for word in KINDS
        ]
        for topic, data in self._sent.get(b"", ()):
            if data is not None and (names is None or topic.name in names):
                yield Message(topic, self.container.start_ns, data)
        for row in self._order.tolist():
            if topics_here := wanted[self._kinds[row]]:
                start, time_ns = self._starts[row], int(self._logged[row])
                line = self._pages[start : start + self._lengths[row]]
                if self._timeless:
                    line = at_time(line, time_ns / 1e9)
                for topic in topics_here:
                    yield Message(topic, time_ns, line)

    def close(self) -> None:
        """Give the file back."""
        with suppress(BufferError):
            self._pages.close()
