"""Chunks of ROS 1 bags: their messages by the index where it holds, else record by record."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import permutations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.bag.records import (
    HEADER,
    U32,
    Connection,
    scan,
)
from formats.compression import inflate

Ints = npt.NDArray[np.int64]
ENTRY = np.dtype([("sec", "<u4"), ("nsec", "<u4"), ("offset", "<u4")])
BLOCK = 1 << 15  # messages compared with the index at a time


class Layout(NamedTuple):
    """One order of the fields in a message's header: the numbers, and the bytes between them."""

    numbers: np.dtype[np.void]
    fixed: npt.NDArray[np.intp]
    template: npt.NDArray[np.uint8]


def _layout(order: tuple[str, ...]) -> Layout:
    raw, places = b"\x26\0\0\0", {}
    for name in order:
        size = {"op": 1, "conn": 4, "time": 8}[name]
        raw += U32.pack(len(name) + 1 + size) + name.encode() + b"="
        places[name] = len(raw)
        raw += b"\x02" if name == "op" else bytes(size)
    offsets = [places["conn"], places["time"], places["time"] + 4, len(raw)]
    numbers = np.dtype(
        {
            "names": ["conn", "sec", "nsec", "size"],
            "formats": ["<u4"] * 4,
            "offsets": offsets,
            "itemsize": HEADER,
        }
    )
    filled = [i for at in offsets for i in range(at, at + 4)]
    fixed = np.setdiff1d(np.arange(HEADER), filled)
    return Layout(numbers, fixed, np.frombuffer(raw + bytes(4), np.uint8)[fixed])


LAYOUTS = [_layout(order) for order in permutations(("conn", "op", "time"))]


class Rows(NamedTuple):
    """Messages of one chunk, (n,) each: log time in ns, connection, first and last + 1 byte."""

    times: Ints
    conns: Ints
    starts: Ints
    ends: Ints

    def take(self, which: npt.NDArray[np.integer] | npt.NDArray[np.bool_] | slice) -> Rows:
        """Some of the messages, in the order given."""
        return Rows(*(column[which] for column in self))

    def sorted(self) -> Rows:
        """By time, and as in the file where that is equal."""
        if (self.times[1:] >= self.times[:-1]).all() and (
            self.starts[1:] >= self.starts[:-1]
        ).all():
            return self
        return self.take(np.lexsort((self.starts, self.times)))


NONE = Rows(*(np.zeros(0, dtype=np.int64) for _ in range(4)))


@dataclass(slots=True)
class Chunk:
    """Where a chunk lies in the file and what its index says of it.

    Attributes:
        pos, data, end: bytes in the file: its record, its (compressed) data, their end.
        compression: "none", "lz4" or "bz2".
        size: bytes, decompressed.
        part: of the file: its connections' namespace.
        index: (connection, entries, place of the entries in the file) of each index record.
        expected: messages by connection, as far as the file says.
        start, end_ns: first and last log time in ns.
        indexed: the index records agree with the file.
        complaint: what is wrong with the chunk's record, "" for nothing.
    """

    pos: int
    data: int
    end: int
    compression: str
    size: int
    part: int = 0
    index: list[tuple[int, int, int]] = field(default_factory=list)
    expected: Counter[int] = field(default_factory=Counter)
    start: int = 0
    end_ns: int = 0
    indexed: bool = False
    complaint: str = ""


def index_entries(buffer: memoryview, chunk: Chunk) -> Rows:
    """The chunk's index as rows, in file order; `ends` are not known yet and 0."""
    tables = [np.frombuffer(buffer, ENTRY, count, place) for _, count, place in chunk.index]
    if not tables:
        return NONE
    table = np.concatenate(tables)
    conns = np.repeat([conn for conn, _, _ in chunk.index], [len(t) for t in tables])
    starts = table["offset"].astype(np.int64)
    order = np.argsort(starts, kind="stable")
    return Rows(nanoseconds(table), conns, starts, np.zeros_like(starts)).take(order)


def nanoseconds(table: npt.NDArray[np.void]) -> Ints:
    """Fields `sec` and `nsec` as one number."""
    return table["sec"].astype(np.int64) * 1_000_000_000 + table["nsec"]


def contents(buffer: memoryview, chunk: Chunk, limit: int) -> tuple[memoryview, str]:
    """The chunk's decompressed bytes (a view on the file where it can be), and what is wrong."""
    raw = buffer[chunk.data : chunk.end]
    if chunk.compression == "none":
        return raw, chunk.complaint
    try:
        data, sound = inflate(chunk.compression, raw, chunk.size, limit)
    except ValueError:
        return memoryview(b""), f"compression {chunk.compression!r} is not known"
    if chunk.size > limit and len(data) == limit:
        return memoryview(data), f"chunk of more than {limit} bytes (--max-chunk)"
    damage = "" if sound else f"{chunk.compression} data of a chunk are cut or damaged"
    return memoryview(data), chunk.complaint or damage


def by_index(data: memoryview, index: Rows) -> tuple[Rows, dict[int, Connection]] | None:
    """The index's messages with their extents, where each of them agrees with the chunk.

    Returns:
        Rows, and the connections that stand between the messages; None where the index and the
        chunk disagree anywhere.
    """
    size, starts = len(data), index.starts
    if not len(starts) or starts[-1] + HEADER > size:
        return None
    first = np.frombuffer(data, np.uint8, HEADER, int(starts[0]))
    layout = next((one for one in LAYOUTS if (first[one.fixed] == one.template).all()), None)
    if layout is None:
        return None
    following = np.append(starts[1:], size)
    ends = np.empty_like(starts)
    for at in range(0, len(starts), BLOCK):
        block = slice(at, at + BLOCK)
        lengths = _lengths(data, index.take(block), layout)
        if lengths is None:
            return None
        ends[block] = starts[block] + HEADER + lengths
    if (ends > following).any():
        return None
    connections: dict[int, Connection] = {}
    gaps = [(0, int(starts[0]))] if starts[0] else []
    wide = np.flatnonzero(ends < following)
    gaps += zip(ends[wide].tolist(), following[wide].tolist(), strict=True)
    for pos, end in gaps:
        between = scan(data, pos, end)
        if between.gaps or between.messages:
            return None
        connections |= between.connections
    return Rows(index.times, index.conns, starts + HEADER, ends), connections


def _lengths(data: memoryview, index: Rows, layout: Layout) -> Ints | None:
    """Bytes of each message, by its header; None where a header is not what the index says."""
    raw = np.frombuffer(data, np.uint8)
    heads = raw[index.starts[:, np.newaxis] + np.arange(HEADER)]
    if not (heads[:, layout.fixed] == layout.template).all():
        return None
    head = heads.view(layout.numbers)[:, 0]
    agree = (head["conn"] == index.conns) & (nanoseconds(head) == index.times)
    return head["size"].astype(np.int64) if agree.all() else None


class Loaded(NamedTuple):
    """A chunk's bytes and messages, sorted by time, and what is wrong with it.

    Attributes:
        data: decompressed bytes, on which the rows' extents stand.
        rows: the messages.
        connections: connection records inside.
        missing: messages lost, by connection.
        damage: what made for a loss, "" for nothing.
        odd: what is wrong without a loss.
    """

    data: memoryview
    rows: Rows
    connections: dict[int, Connection]
    missing: Counter[int]
    damage: str
    odd: str = ""


def load(buffer: memoryview, chunk: Chunk, limit: int) -> Loaded:
    """Read a chunk: by its index where that agrees with it, else record by record.

    Args:
        buffer: the file.
        chunk: which.
        limit: bytes, the most to decompress.
    """
    data, damage = contents(buffer, chunk, limit)
    index = index_entries(buffer, chunk) if chunk.indexed else NONE
    if (agreed := by_index(data, index)) is not None:
        rows, connections = agreed
        return Loaded(data, rows.sorted(), connections, Counter(), damage)
    messages, connections, gaps, missing = scan(data, 0, len(data), set(index.starts.tolist()))
    rows = Rows(*np.array(messages, dtype=np.int64).reshape(-1, 4).T)
    lost: Counter[int] = Counter()
    odd = ""
    if chunk.indexed:
        rows, lost, odd = _within(rows, index, chunk)
    if chunk.expected:
        missing = (chunk.expected - Counter(rows.conns.tolist())) | lost
    if missing or (gaps and not chunk.expected):
        damage = damage or "damaged messages"
    elif gaps:
        odd = odd or "damaged bytes between messages"
    return Loaded(data, rows.sorted(), connections, missing, damage, odd)


def _within(rows: Rows, index: Rows, chunk: Chunk) -> tuple[Rows, Counter[int], str]:
    """Times of messages whose index says otherwise: whichever lies within the chunk's times.

    A message that has none such is lost, since its place in the log is not known.
    """
    known = dict(zip(index.starts.tolist(), index.times.tolist(), strict=True))
    indexed = np.array([known.get(at, -1) for at in (rows.starts - HEADER).tolist()], np.int64)
    own = (rows.times >= chunk.start) & (rows.times <= chunk.end_ns)
    placed = own | (indexed >= 0)
    lost = Counter(rows.conns[~placed].tolist())
    odd = "index and messages disagree" if (rows.times != indexed).any() else ""
    return Rows(np.where(own, rows.times, indexed), *rows[1:]).take(placed), lost, odd
