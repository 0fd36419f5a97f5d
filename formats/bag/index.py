"""The connections and chunks of a ROS 1 bag, by its index section."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from formats.bag.chunks import ENTRY, Chunk
from formats.bag.records import (
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    Connection,
    Record,
    connection,
    read_record,
    release,
)

MAGIC = b"#ROSBAG V2.0\n"
COUNT = np.dtype([("conn", "<u4"), ("count", "<u4")])


@dataclass
class Survey:
    """Where everything lies.

    Attributes:
        chunks: in file order.
        connections: by `part << 32 | number`.
        lost: messages of chunks that are gone, by the same keys.
        state: "complete", "no index", "cut at byte 81920", "damaged at byte 4711".
    """

    chunks: list[Chunk] = field(default_factory=list)
    connections: dict[int, Connection] = field(default_factory=dict)
    lost: Counter[int] = field(default_factory=Counter)
    state: str = "complete"

    def say(self, state: str) -> None:
        """Keep the first thing that is wrong."""
        if self.state == "complete":
            self.state = state

    def keep(self, part: int, record: Record, buffer: memoryview) -> None:
        """One more connection; the first of a number wins."""
        said = connection(record.fields, bytes(buffer[record.data : record.end]))
        self.connections.setdefault(part << 32 | record.number(b"conn"), said)


def records(buffer: memoryview, pos: int) -> Iterator[Record]:
    """Whole records, one after the other."""
    while (record := read_record(buffer, pos, len(buffer))) and record.end <= len(buffer):
        yield record
        pos = record.end


def chunk_info(buffer: memoryview, record: Record) -> Counter[int]:
    """Messages by connection, as a chunk info says."""
    count = min(record.number(b"count"), (record.end - record.data) // COUNT.itemsize)
    table = np.frombuffer(buffer, COUNT, count, record.data)
    return Counter(dict(zip(table["conn"].tolist(), table["count"].tolist(), strict=True)))


def index_entry(record: Record) -> tuple[int, int, int] | None:
    """Connection, entries and their place of an index record; None where it is odd."""
    count = record.number(b"count")
    if record.number(b"ver") != 1 or count * ENTRY.itemsize != record.end - record.data:
        return None
    return record.number(b"conn"), count, record.data


def by_index_section(
    buffer: memoryview, base: int, head: Record | None, part: int, found: Survey
) -> int | None:
    """Fill `found` from the index; the part's end, or None where the index is not sound."""
    if head is None or not head.number(b"index_pos"):
        return None
    want = Counter(
        {CONNECTION: head.number(b"conn_count"), CHUNK_INFO: head.number(b"chunk_count")}
    )
    connections: list[Record] = []
    infos: list[Record] = []
    end = start = base + head.number(b"index_pos")
    for record in records(buffer, start) if sum(want.values()) else ():
        (connections if record.op == CONNECTION else infos).append(record)
        want[record.op] = want.get(record.op, 0) - 1
        end = record.end
        if want[record.op] < 0 or not any(want.values()):
            break
    if any(want.values()) or end > len(buffer):
        return None
    chunks: list[Chunk] = []
    for info in sorted(infos, key=lambda record: record.number(b"chunk_pos")):
        chunk = _indexed_chunk(buffer, base + info.number(b"chunk_pos"), chunk_info(buffer, info))
        if chunk is None or (chunks and chunk.pos < chunks[-1].end) or chunk.end > start:
            return None
        chunk.part = part
        chunk.start, chunk.end_ns = info.time(b"start_time"), info.time(b"end_time")
        chunks.append(chunk)
        release(buffer, chunk.pos, chunk.end)
    known = {record.number(b"conn") for record in connections}
    if any(conn not in known for chunk in chunks for conn, _, _ in chunk.index):
        return None
    for record in connections:
        found.keep(part, record, buffer)
    found.chunks += chunks
    return end


def chunk_of(record: Record) -> Chunk:
    """What a chunk's record says."""
    compression = record.text(b"compression")
    return Chunk(record.pos, record.data, record.end, compression, record.number(b"size"))


def _indexed_chunk(buffer: memoryview, pos: int, expected: Counter[int]) -> Chunk | None:
    """The chunk at `pos` and the index records behind it, where they hold `expected`."""
    record = read_record(buffer, pos, len(buffer))
    if record is None or record.op != CHUNK or record.end > len(buffer):
        return None
    chunk = chunk_of(record)
    chunk.expected = expected
    if expected.total():
        for record in records(buffer, chunk.end):
            entry = index_entry(record) if record.op == INDEX else None
            if entry is None or expected[entry[0]] != entry[1]:
                return None
            chunk.index.append(entry)
            if len(chunk.index) == len(expected):
                break
    if chunk.compression == "none" and chunk.size != chunk.end - chunk.data:
        return None
    chunk.indexed = len(chunk.index) == len(+expected)
    return chunk if chunk.indexed else None
