"""ROS 1 bags (format 2.0), whole, unindexed, cut or damaged.

The index is used where it agrees with the chunks; anything else is read record by record, on to
the next plausible record behind damage, and losses are counted by topic. Bags have no checksums
of their own (bz2 data have, lz4 frames may have): a changed byte inside an uncompressed payload
cannot be seen. Source: http://wiki.ros.org/Bags/Format/2.0. Modules, from the bottom: compression,
bag_records, bag_chunks, bag_index, bag_walk, bag.
"""

from __future__ import annotations

import mmap
import re
from collections import Counter, OrderedDict
from collections.abc import Collection, Iterator
from contextlib import suppress
from heapq import heappop, heappush
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.bag.chunks import NONE, Chunk, Loaded, contents, index_entries, load
from formats.bag.index import MAGIC
from formats.bag.records import release
from formats.bag.walk import survey
from formats.errors import FormatError, Notes, printable
from formats.log import Container, Message, Topic

MAX_CHUNK = 256 << 20
VERSION = re.compile(rb"#ROS(?:BAG|RECORD) V([0-9.]{1,9})")
CACHE = 128 << 20  # bytes, decompressed, of chunks whose messages wait for their turn
ROWS = 4096  # messages turned into Python numbers at a time
WHOLE = ("complete", "no index")
LATEST = 1 << 63
END = (LATEST, 0)  # later than every (time, chunk)
Rows = npt.NDArray[np.int64]  # (n, 5): time, connection, first and last + 1 byte, chunk


def fits(path: Path, head: bytes) -> bool:
    """Whether a file's first bytes are those of a ROS 1 bag of any version."""
    return VERSION.match(head) is not None


def open_file(path: Path, notes: Notes, max_chunk: int = MAX_CHUNK) -> Bag:
    """Open a bag.

    Args:
        path: the file.
        notes: where losses and oddities are counted.
        max_chunk: bytes, the most that one chunk may hold.

    Raises:
        FormatError: not a bag of format 2.0, encrypted, or without one readable record.
    """
    return Bag(path, notes, max_chunk)


class Bag:
    """An opened ROS 1 bag: a Log."""

    def __init__(self, path: Path, notes: Notes, max_chunk: int = MAX_CHUNK) -> None:
        self.path, self._notes, self._max_chunk = path, notes, max_chunk
        try:
            with path.open("rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise FormatError(path, f"cannot be read: {error}") from error
        self._buffer = memoryview(self._map)
        self._cache: OrderedDict[int, memoryview] = OrderedDict()
        self._told: set[int] = set()
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        version = VERSION.match(self._buffer[:32])
        if self._buffer[: len(MAGIC)] != MAGIC:
            said = version[1].decode() if version else "unknown"
            hint = "convert it with ROS's `rosbag fix` or `rosbag reindex`"
            raise FormatError(self.path, f"is a bag of version {said}, not 2.0", hint=hint)
        found = survey(self.path, self._buffer, self._notes)
        self._connections, self._state, self._chunks = found.connections, found.state, found.chunks
        empty = not self._chunks and not self._connections
        if empty and self._state not in WHOLE:
            raise FormatError(self.path, f"holds no readable record ({self._state})")
        counts: Counter[int] = Counter()
        for number, chunk in enumerate(self._chunks):
            self._measure(number, chunk)
            release(self._buffer, chunk.pos, chunk.end)
            counts.update(self._keyed(chunk, chunk.expected))
        for key, count in found.lost.items():
            topic = self._name(key)
            self._notes.lose(
                self.path, "messages of a chunk that is gone", topic=topic, count=count
            )
        for key in counts.keys() - self._connections.keys():
            problem = "messages of an unknown connection"
            self._notes.lose(self.path, problem, count=counts[key])
        self._topics = self._by_connection(counts)

    def _measure(self, number: int, chunk: Chunk) -> None:
        """Set a chunk's first and last time, by its index or else by reading it."""
        known = all(key in self._connections for key in self._keyed(chunk, chunk.expected))
        times = index_entries(self._buffer, chunk).times if chunk.indexed else NONE.times
        if len(times):  # the chunk's info may say otherwise: either may be damaged
            chunk.start = min(chunk.start or LATEST, int(times.min()))
            chunk.end_ns = max(chunk.end_ns, int(times.max()))
        if known and chunk.indexed:
            return
        loaded = self._load(number)
        times = loaded.rows.times
        chunk.start, chunk.end_ns = (int(times[0]), int(times[-1])) if len(times) else (0, 0)
        chunk.expected = Counter(loaded.rows.conns.tolist())

    @staticmethod
    def _keyed(chunk: Chunk, counts: Counter[int]) -> dict[int, int]:
        return {chunk.part << 32 | conn: count for conn, count in counts.items()}

    def _name(self, key: int) -> str:
        said = self._connections.get(key)
        return said.topic if said else f"connection {key & 0xFFFFFFFF}"

    def _by_connection(self, counts: Counter[int]) -> dict[int, Topic]:
        """Each connection's topic; connections of one name and type share theirs."""
        groups: dict[tuple[str, str], list[int]] = {}
        for key, said in self._connections.items():
            groups.setdefault((said.topic, said.type), []).append(key)
        topics: dict[int, Topic] = {}
        for (name, kind), keys in groups.items():
            group = [self._connections[key] for key in keys]
            definition = next((said.definition for said in group if said.definition), b"")
            topic = Topic(
                name,
                kind,
                "ros1",
                definition,
                "ros1msg" if definition else "",
                sum(counts[key] for key in keys),
                any(said.latched for said in group),
            )
            topics |= dict.fromkeys(keys, topic)
        return topics

    @property
    def container(self) -> Container:
        """Kind, compression, times and state; a loss met while reading shows from then on."""
        used = [chunk for chunk in self._chunks if chunk.expected.total()]
        kinds = sorted({printable(chunk.compression, 20) for chunk in self._chunks})
        return Container(
            "ROS 1 bag",
            ", ".join(kinds) or "none",
            len(self._buffer),
            min((chunk.start for chunk in used), default=0),
            max((chunk.end_ns for chunk in used), default=0),
            self._state == "complete",
            self._state,
        )

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name and type."""
        return sorted(set(self._topics.values()), key=lambda topic: (topic.name, topic.type))

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics (None: all), sorted by log time, file order where equal.

        Chunks are opened in the order of their first messages, and a message is given once no
        chunk still closed can hold an earlier one.
        """
        names = None if topics is None else {(topic.name, topic.type) for topic in topics}
        wanted: dict[int, dict[int, Topic]] = {}
        for key, topic in self._topics.items():
            if names is None or (topic.name, topic.type) in names:
                wanted.setdefault(key >> 32, {})[key & 0xFFFFFFFF] = topic
        order = [
            (chunk.start, number)
            for number, chunk in enumerate(self._chunks)
            if chunk.expected.keys() & wanted.get(chunk.part, {}).keys()
        ]
        order.sort()
        pending: list[tuple[int, int, Rows]] = []  # a heap: next time, chunk, rows
        for (_, number), closed in pairwise([*order, END]):
            chunk = self._chunks[number]
            rows = self._rows(number, wanted[chunk.part])
            if len(rows):
                heappush(pending, (int(rows[0, 0]), number, rows))
            for ready in _before(pending, closed):
                yield from self._given(ready, wanted)
            release(self._buffer, chunk.pos, chunk.end)
            self._forget({number for _, number, _ in pending})

    def _rows(self, number: int, conns: Collection[int]) -> Rows:
        data, rows, *_ = self._load(number)
        if self._chunks[number].compression != "none":
            self._hold(number, data)
        table = np.column_stack([*rows, np.full(len(rows.times), number)])
        return table[np.isin(rows.conns, list(conns))]

    def _given(self, rows: Rows, wanted: dict[int, dict[int, Topic]]) -> Iterator[Message]:
        number, view, conns = -1, self._buffer, {}
        for at in range(0, len(rows), ROWS):
            for time, conn, start, end, chunk in rows[at : at + ROWS].tolist():
                if chunk != number:
                    number, view = chunk, self._data(chunk)
                    conns = wanted[self._chunks[chunk].part]
                yield Message(conns[conn], time, view[start:end])

    def _data(self, number: int) -> memoryview:
        """A chunk's bytes, decompressed again where they have left the cache."""
        chunk = self._chunks[number]
        if chunk.compression == "none":
            return self._buffer[chunk.data : chunk.end]
        if number not in self._cache:
            self._hold(number, contents(self._buffer, chunk, self._max_chunk)[0])
        self._cache.move_to_end(number)
        return self._cache[number]

    def _hold(self, number: int, data: memoryview) -> None:
        self._cache[number] = data
        held = sum(len(one) for one in self._cache.values())
        while held > CACHE and len(self._cache) > 1:
            held -= len(self._cache.popitem(last=False)[1])

    def _forget(self, waiting: Collection[int]) -> None:
        """Drop what is decompressed of chunks whose messages have all been given."""
        for number in self._cache.keys() - waiting:
            del self._cache[number]

    def _load(self, number: int) -> Loaded:
        loaded = load(self._buffer, self._chunks[number], self._max_chunk)
        if number not in self._told:
            self._told.add(number)
            self._tell(self._chunks[number], loaded)
        return loaded

    def _tell(self, chunk: Chunk, loaded: Loaded) -> None:
        """Count once what is wrong with a chunk, and keep the connections inside."""
        at = f"byte {chunk.pos}"
        for conn, said in loaded.connections.items():
            known = self._connections.setdefault(chunk.part << 32 | conn, said)
            if known != said:
                problem = "connection records disagree"
                self._notes.warn(self.path, problem, topic=said.topic, at=at)
        for key, count in self._keyed(chunk, loaded.missing).items():
            name = self._name(key)
            self._notes.lose(self.path, loaded.damage, topic=name, at=at, count=count)
        if loaded.damage and not loaded.missing:
            self._notes.lose(self.path, loaded.damage, at=at)
        if loaded.odd:
            self._notes.warn(self.path, loaded.odd, at=at)
        if (loaded.damage or loaded.missing) and self._state in WHOLE:
            self._state = f"damaged at byte {chunk.pos}"

    def close(self) -> None:
        """Unmap the file; payloads on its pages that are still held keep it until they go."""
        self._cache.clear()
        with suppress(BufferError):
            self._buffer.release()
            self._map.close()


def _before(pending: list[tuple[int, int, Rows]], closed: tuple[int, int]) -> list[Rows]:
    """Take from a heap of chunks' rows those that come before (time, chunk), in order."""
    ready: list[Rows] = []
    while pending and pending[0][:2] < closed:
        _, number, rows = heappop(pending)
        side: Literal["left", "right"] = "right" if number < closed[1] else "left"
        first = int(np.searchsorted(rows[:, 0], closed[0], side))
        ready.append(rows[:first])
        if first < len(rows):
            heappush(pending, (int(rows[first, 0]), number, rows[first:]))
    if len(ready) > 1:
        together = np.concatenate(ready)
        ready = [together[np.lexsort((together[:, 2], together[:, 4], together[:, 0]))]]
    return ready
