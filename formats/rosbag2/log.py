"""rosbag2: folders with parts in SQLite or MCAP files, and single .db3 files.

metadata.yaml says which parts there are, but nothing depends on it: a part is what its first bytes
say. Modules, from the bottom: sqlite_pages, sqlite_salvage, sqlite_rows, sqlite_log, mcap_log,
rosbag2_metadata, rosbag2.
"""

from __future__ import annotations

import heapq
import re
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import IO

from formats.compression import DAMAGE, DECOMPRESSORS, open_stream, wrapper
from formats.errors import FormatError, Notes, printable
from formats.log import Container, Log, Message, Topic
from formats.mcap import log as mcap_log
from formats.rosbag2.metadata import NAME, Metadata, read_metadata
from formats.rosbag2.sqlite_log import BESIDE, MAGIC, SqliteLog, left_beside

MAX_CHUNK = 256 << 20
MOST_FILES = 10_000  # in a folder
ZSTD = b"\x28\xb5\x2f\xfd"
SPLIT = re.compile(r"(.+)_\d+(\.[^.]+){1,2}")
Key = tuple[str, str, str]  # name, type, encoding
IGNORED = (*BESIDE, "-shm")


def fits(path: Path, head: bytes) -> bool:
    """Whether this is a folder of rosbag2's, with or without metadata.yaml, or an SQLite file.

    A folder without metadata.yaml fits where its parts are those of one recording: one part, or
    several that differ in the number behind their names only.
    """
    if not path.is_dir():
        return head.startswith(MAGIC)
    if (path / NAME).is_file():
        return True
    stems = set()
    for name in _parts(path):
        split = SPLIT.fullmatch(name)
        stems.add(split[1] if split else name)
    return len(stems) == 1


def open_file(path: Path, notes: Notes, max_chunk: int = MAX_CHUNK) -> Rosbag2:
    """Open a folder or a .db3 file.

    Args:
        path: folder or file.
        notes: where losses and oddities are counted.
        max_chunk: bytes, the most that one chunk or message may hold.

    Raises:
        FormatError: nothing of it can be read.
    """
    return Rosbag2(path, notes, max_chunk)


def _key(topic: Topic) -> Key:
    return topic.name, topic.type, topic.encoding


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(16)
    except OSError:
        return b""


def _parts(folder: Path) -> list[str]:
    """Names of the files in a folder that are parts by their first bytes, sorted."""
    try:
        places = list(islice(folder.iterdir(), MOST_FILES))
    except OSError:
        return []
    names = []
    for place in places:
        if place.is_file() and not place.name.endswith(IGNORED):
            head = _head(place)
            if head.startswith(MAGIC) or mcap_log.fits(place, head) or _packed(place, head):
                names.append(place.name)
    return sorted(names)


def _packed(path: Path, head: bytes) -> bool:
    """Whether a file is a compressed part by its name and first bytes."""
    return bool(wrapper(head)) and any(end in (".db3", ".mcap") for end in path.suffixes)


class Rosbag2:
    """An opened recording of rosbag2's: a Log."""

    def __init__(self, path: Path, notes: Notes, max_chunk: int = MAX_CHUNK) -> None:
        self.path, self._notes, self._max_chunk = path, notes, max_chunk
        self._logs: list[Log] = []
        self._streams: list[IO[bytes]] = []
        self._meta = Metadata()
        self._remarks: list[str] = []
        self._packed = ""
        self._told: set[tuple[str, int]] = set()
        try:
            if path.is_dir():
                self._open_folder()
            else:
                self._logs.append(SqliteLog(path, notes, max_chunk))
        except BaseException:
            self.close()
            raise
        self._join()

    def _open_folder(self) -> None:
        present = _parts(self.path)
        meta = read_metadata(self.path / NAME, self._notes)
        names = present
        if meta is None:
            self._remarks.append(f"no {NAME}")
        else:
            self._meta = meta
            stems = {name.partition(".")[0] for name in meta.parts}
            extra = [name for name in present if name.partition(".")[0] not in stems]
            for name in extra:
                self._notes.warn(self.path, f"part {name} is not in {NAME}; read too")
            names = [*dict.fromkeys(meta.parts), *extra]
        errors = []
        for name in names:
            try:
                self._logs.append(self._part(name))
            except FormatError as error:
                errors.append(error)
                count = self._meta.counts.get(name, 1)
                self._notes.lose(error.path, error.problem, count=max(1, count))
                self._remarks.append(f"part {printable(name)} {error.problem}")
        if not self._logs:
            raise errors[0] if errors else FormatError(self.path, "holds no part of a recording")
        self._compare()

    def _part(self, name: str) -> Log:
        place = self.path / name
        if not place.is_file():
            # A part is named without its compression while it is being compressed.
            place = next((p for p in [self.path / f"{name}.zstd"] if p.is_file()), place)
        if not place.is_file():
            raise FormatError(place, "is missing")
        head, unpacked = _head(place), None
        if wrapper(head):
            stream = open_stream(place, self._notes)
            self._streams.append(stream)
            self._packed = wrapper(head)
            unpacked = Path(stream.name)
            head = _head(unpacked)
        if head.startswith(MAGIC) or (not head and left_beside(place)):
            return SqliteLog(place, self._notes, self._max_chunk, unpacked)
        if mcap_log.fits(place, head):
            return mcap_log.open_file(place, self._notes, self._max_chunk, unpacked)
        what = "is neither an SQLite nor an MCAP file" if head else "is empty"
        raise FormatError(place, what)

    def _compare(self) -> None:
        """Say where metadata.yaml and the parts differ; the parts are believed."""
        kinds = {log.container.kind for log in self._logs}
        storage = self._meta.storage
        if storage and not any(storage in kind.lower() for kind in kinds):
            said = ", ".join(sorted(kinds))
            self._notes.warn(self.path, f"{NAME} says storage {storage!r}; its parts are {said}")
        counts = [topic.count for log in self._logs for topic in log.topics()]
        there = sum(count for count in counts if count is not None)
        if self._meta.total not in (None, there) and None not in counts:
            said = f"{NAME} says {self._meta.total} messages; {there} are there"
            self._notes.warn(self.path, said)

    def _join(self) -> None:
        """The recording's topics; parts share those of one name, type and encoding."""
        groups: dict[Key, list[Topic]] = {}
        for log in self._logs:
            for topic in log.topics():
                groups.setdefault(_key(topic), []).append(topic)
        self._topics: dict[Key, Topic] = {}
        for key, group in groups.items():
            counts = [topic.count for topic in group if topic.count is not None]
            count = sum(counts) if len(counts) == len(group) else None
            best = next((topic for topic in group if topic.definition), group[0])
            kept = key[:2] in self._meta.latched or any(topic.latched for topic in group)
            self._topics[key] = replace(best, count=count, latched=kept)

    @property
    def container(self) -> Container:
        """Kind, compression, times and state over all parts."""
        parts = [log.container for log in self._logs]
        timed = [part for part in parts if part.start_ns or part.end_ns]
        kinds = {"sqlite3" if "sqlite3" in part.kind else "mcap" for part in parts}
        packed = {part.compression for part in parts} - {"none"} | {self._packed} - {""}
        states = [part.state for part in parts if not part.whole]
        remarks = [*states, *self._remarks]
        whole = not states and self._remarks in ([], [f"no {NAME}"])
        size = sum(log.path.stat().st_size for log in self._logs)
        return Container(
            f"rosbag2 {', '.join(sorted(kinds))}",
            ", ".join(sorted(packed)) or "none",
            size,
            min((part.start_ns for part in timed), default=0),
            max((part.end_ns for part in timed), default=0),
            whole,
            "; ".join(remarks) or "complete",
        )

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name and type."""
        return [self._topics[key] for key in sorted(self._topics)]

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics (None: all), sorted by log time, then by part."""
        wanted = set(self._topics) if topics is None else {_key(topic) for topic in topics}
        always = self._meta.compressed == "message"
        joined: dict[int, tuple[Topic, Topic]] = {}  # by identity, which the part's topic keeps
        for message in self._merged(wanted):
            part, time, data = message
            if id(part) not in joined:
                joined[id(part)] = part, self._topics[_key(part)]
            topic = joined[id(part)][1]
            # No CDR payload begins with zstd's magic number.
            if data[:4] == ZSTD and (always or topic.encoding == "cdr"):
                self._packed = "zstd"
                unpacked = _inflated(data, self._max_chunk)
                if unpacked is None:
                    self._lose(topic, time)
                    continue
                data = unpacked
            yield Message(topic, time, data)

    def _merged(self, wanted: Collection[Key]) -> Iterator[Message]:
        """The parts' messages; parts that follow each other in time are not compared."""
        logs = sorted(self._logs, key=lambda log: log.container.start_ns)
        spans = [log.container for log in logs]
        apart = all(a.end_ns <= b.start_ns for a, b in pairwise(spans))
        streams = [
            log.messages([topic for topic in log.topics() if _key(topic) in wanted]) for log in logs
        ]
        if apart and all(span.whole for span in spans):
            return chain.from_iterable(streams)
        return heapq.merge(*streams, key=lambda message: message.time_ns)

    def _lose(self, topic: Topic, time: int) -> None:
        """Count a message once, however many passes meet it."""
        if (topic.name, time) not in self._told:
            self._told.add((topic.name, time))
            problem = "message's zstd data are damaged or too long"
            self._notes.lose(self.path, problem, topic=topic.name, at=f"{time / 1e9:.3f} s")

    def close(self) -> None:
        """Close the parts and remove temporary copies."""
        for log in self._logs:
            log.close()
        for stream in self._streams:
            with suppress(OSError):
                stream.close()


def _inflated(data: bytes | memoryview, limit: int) -> bytes | None:
    machine = DECOMPRESSORS["zstd"]()
    try:
        found: bytes = machine.decompress(data, limit + 1)
    except DAMAGE:
        return None
    return found if machine.eof and len(found) <= limit else None
