"""Records of ROS 1 bags (format 2.0), and where the next one begins behind damage.

A record is: header length (u32), header fields (u32 length, `name=value`), data length (u32), data.
Source: http://wiki.ros.org/Bags/Format/2.0.
"""

from __future__ import annotations

import mmap
import re
from array import array
from collections import Counter
from collections.abc import Collection, Container, Iterator
from struct import Struct
from typing import NamedTuple

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
# The fields that each kind must have, and their lengths where these are fixed.
FIELDS: dict[int, dict[bytes, int | None]] = {
    MESSAGE: {b"conn": 4, b"time": 8},
    BAG_HEADER: {b"index_pos": 8, b"conn_count": 4, b"chunk_count": 4},
    INDEX: {b"ver": 4, b"conn": 4, b"count": 4},
    CHUNK: {b"compression": None, b"size": 4},
    CHUNK_INFO: {b"ver": 4, b"chunk_pos": 8, b"start_time": 8, b"end_time": 8, b"count": 4},
    CONNECTION: {b"conn": 4, b"topic": None},
}
OUTSIDE_CHUNKS = (BAG_HEADER, INDEX, CHUNK, CHUNK_INFO)
RELEASED = 32 << 20  # bytes of the file between two releases of its pages
LONGEST_HEADER = 1 << 20
HEADER = 46  # bytes from a message's start to its data: 4 + 38 + 4
OP_FIELD = 8  # bytes: u32 length and "op=" and the code

U32, U64 = Struct("<I"), Struct("<Q")
u32, u64, message_numbers = U32.unpack_from, U64.unpack_from, Struct("<IIII").unpack
# A message's header in any order of its fields, and the length of its data.
message_header = re.compile(
    rb"\x26\0{3}(?:\x04\0{3}op=\x02|\x09\0{3}conn=(.{4})|\x0d\0{3}time=(.{8})){3}(.{4})", re.DOTALL
).match
header_start = re.compile(
    rb".{2}[\0-\x0f]\0[\x04-\xff].{3}(?:op|conn|time|topic)=", re.DOTALL
).match
find_op = re.compile(rb"\x04\0{3}op=[\x02-\x07]").search


class Record(NamedTuple):
    """One record of a buffer: header at `pos`, data from `data` to `end`, which may lie outside."""

    op: int
    fields: dict[bytes, bytes]
    pos: int
    data: int
    end: int

    def number(self, name: bytes) -> int:
        """A field of 4 or 8 bytes, as an unsigned number."""
        return int.from_bytes(self.fields[name], "little")

    def time(self, name: bytes) -> int:
        """A field of seconds and nanoseconds, in ns."""
        sec, nsec = divmod(self.number(name), 1 << 32)[::-1]
        return sec * 1_000_000_000 + nsec

    def text(self, name: bytes) -> str:
        """A field of text; bytes that are not UTF-8 are escaped."""
        return self.fields[name].decode("utf-8", "backslashreplace")


def release(buffer: memoryview, pos: int, end: int) -> None:
    """Let go of mapped pages when the bytes from `pos` to `end` pass a step of the file.

    Pages that were read once would count as the process's memory; touched again, they come back.
    """
    pages = buffer.obj
    passed = pos // RELEASED != end // RELEASED
    if passed and isinstance(pages, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        pages.madvise(mmap.MADV_DONTNEED)


def header_fields(raw: bytes) -> dict[bytes, bytes] | None:
    """`name=value` fields, the last of equal names; None where the bytes are no such fields."""
    fields, pos = {}, 0
    while pos < len(raw):
        if pos + 4 > len(raw):
            return None
        size = u32(raw, pos)[0]
        field = raw[pos + 4 : pos + 4 + size]
        name, equals, value = field.partition(b"=")
        if len(field) != size or not equals:
            return None
        fields[name] = value
        pos += 4 + size
    return fields


def read_record(buffer: memoryview, pos: int, end: int) -> Record | None:
    """The record that begins at `pos`, or None where the bytes before `end` are none."""
    if pos + 8 > end:
        return None
    length = u32(buffer, pos)[0]
    data = pos + 8 + length
    if not OP_FIELD <= length <= LONGEST_HEADER or data > end:
        return None
    fields = header_fields(bytes(buffer[pos + 4 : data - 4]))
    op = (fields or {}).get(b"op", b"")
    if fields is None or len(op) != 1:
        return None
    for name, size in FIELDS.get(op[0], {}).items():
        if name not in fields or size not in (None, len(fields[name])):
            return None
    return Record(op[0], fields, pos, data, data + u32(buffer, data - 4)[0])


def _places_of_op() -> dict[int, list[int]]:
    """By kind: how far into the header fields the op field can stand, in any order of fields."""
    places = {}
    for op, names in FIELDS.items():
        sizes = [[5 + len(name) + (size or 0)] for name, size in names.items() if size is not None]
        if op == CHUNK:
            sizes.append([5 + len("compression") + len(kind) for kind in ("none", "lz4", "bz2")])
        sums = {0}
        for size in sizes:
            sums |= {a + b for a in sums for b in size}
        places[op] = sorted(sums)
    return places


PLACES = _places_of_op()


def find_record(
    buffer: memoryview, pos: int, end: int, ops: Collection[int] = tuple(FIELDS)
) -> Record | None:
    """The first plausible record of these kinds that begins at or after `pos`, behind damage."""
    place = pos
    while hit := find_op(buffer, place, end):
        op = buffer[hit.end() - 1]
        if op in ops:
            for back in _distances(buffer, hit.start(), op):
                start = hit.start() - back - 4
                record = read_record(buffer, start, end) if start >= pos else None
                if record is not None and record.op == op:
                    return record
        place = hit.start() + 1
    return None


def _distances(buffer: memoryview, op_at: int, op: int) -> Iterator[int]:
    yield from PLACES[op]
    if op == CONNECTION:  # its topic, of any length, may come before the op
        before = bytes(buffer[max(0, op_at - 300) : op_at])
        topic = before.rfind(b"topic=")
        if topic >= 4:
            yield from (len(before) - topic + 4, len(before) - topic + 4 + 13)


class Connection(NamedTuple):
    """What a connection record says."""

    topic: str
    type: str
    definition: bytes
    latched: bool


def connection(fields: dict[bytes, bytes], data: bytes) -> Connection:
    """A connection record's fields and data; of damaged data, what the record's header says."""
    inner = header_fields(data) or {}
    topic = fields[b"topic"].decode("utf-8", "backslashreplace")
    kind = inner.get(b"type", b"").decode("utf-8", "backslashreplace")
    if kind.count("/") == 1:
        kind = kind.replace("/", "/msg/")
    definition = inner.get(b"message_definition", b"")
    return Connection(topic, kind, definition, inner.get(b"latching") == b"1")


class Found(NamedTuple):
    """What a scan of a chunk's bytes gave.

    Attributes:
        messages: time in ns, connection, first and last + 1 byte of each, one after the other.
        connections: by number.
        gaps: damaged stretches (first, last + 1 byte).
        dropped: messages whose header was found but not their whole data, by connection.
    """

    messages: array[int]
    connections: dict[int, Connection]
    gaps: list[tuple[int, int]]
    dropped: Counter[int]


def scan(data: memoryview, pos: int, end: int, known: Container[int] = ()) -> Found:
    """Messages and connections record by record, going on behind damage.

    A record counts when a plausible one, or the end, follows it. Where none does, the search goes
    on inside it: a damaged length must not swallow the messages behind it. Where what follows does
    not even look like a spoilt header, the length is taken to be too short.

    Args:
        data: a chunk's bytes.
        pos, end: the part of them to read.
        known: where records begin, as far as an index says.
    """
    found = Found(array("q"), {}, [], Counter())
    messages, connections, gaps, dropped = found
    last = (-1, pos, pos)  # connection (-1: no message), start and data of the last record
    while pos < end:
        conn, time, first, stop = _inner(data, pos, end, connections)
        if stop <= end:
            if conn >= 0:
                messages.extend((time, conn, first, stop))
            last, pos = (conn, pos, first), stop
            continue
        whole = first > pos  # its header is there, its data are not
        again = find_record(data, first if whole else last[2], end, (MESSAGE, CONNECTION))
        resume = again.pos if again else end
        if whole and conn >= 0:
            dropped[conn] += 1
        short = not whole and pos not in known and not _like_header(data, pos, end, last[2])
        wrong = resume < pos or short  # the last record's length, that is
        if wrong and last[0] >= 0:
            dropped[last[0]] += 1
            del messages[-4:]
        gaps.append((last[1] if wrong else pos, resume))
        last, pos = (-1, resume, resume), resume
    return found


def _like_header(data: memoryview, pos: int, end: int, last: int) -> bool:
    """Whether the bytes at `pos` are a header with some damage, as that before `last` was."""
    if header_start(data, pos, end):
        return True
    header = data[max(0, last - HEADER) : last]
    here = data[pos : min(pos + HEADER, end)]
    same = sum(a == b for a, b in zip(header, here, strict=False))
    return 2 * same >= len(here)


def _inner(
    data: memoryview, pos: int, end: int, connections: dict[int, Connection]
) -> tuple[int, int, int, int]:
    """Connection (-1: no message), time, data and end of a record inside a chunk.

    `pos` as the data's place and an end outside say that there is none.
    """
    if head := message_header(data, pos, end):
        conn, sec, nsec, size = message_numbers(head[1] + head[2] + head[3])
        return conn, sec * 1_000_000_000 + nsec, head.end(), head.end() + size
    record = read_record(data, pos, end)
    if record is None or record.op not in (MESSAGE, CONNECTION):
        return -1, 0, pos, end + 1
    conn = record.number(b"conn")
    if record.op == MESSAGE:
        return conn, record.time(b"time"), record.data, record.end
    if record.end <= end:
        said = connection(record.fields, bytes(data[record.data : record.end]))
        connections.setdefault(conn, said)
    return -1, 0, record.data, record.end
