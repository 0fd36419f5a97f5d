"""Blocks of an MCAP file: its chunks, and runs of messages outside chunks, loaded and indexed."""

from __future__ import annotations

import mmap
import os
import struct
from array import array
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.buffers import Buffers
from formats.compression import crc32, inflate
from formats.mcap.parse import HEAD
from formats.mcap.records import CHUNK, DATA_END, FOOTER, HEADER, MESSAGE, Buffer

CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, size, CRC, length of the compression's name
MESSAGE_HEAD = 22  # bytes of a message before its payload
SHRUNK = "the file was cut while it was read"
LARGEST_MESSAGE = 1 << 32
TOP = frozenset({HEADER, FOOTER, CHUNK, DATA_END})  # where a run of plain records ends
RUN_BYTES = 4 << 20
WORTHWHILE = 16  # messages in a row of one size
MOST_OTHERS = 1_000_000  # records that are no messages; more in one block are a trap
AHEAD = 4  # blocks that are loaded ahead of the reader
THREADS = min(2, os.cpu_count() or 1)  # that load them; the reader takes what one of them leaves
AHEAD_BYTES = 32 << 20  # larger blocks are loaded one at a time

HEADS = np.dtype([("opcode", "u1"), ("size", "<u8")])
# A message's record as it lies in the file, opcode and length included.
RAW = np.dtype(
    [
        ("opcode", "u1"),
        ("size", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("time", "<u8"),
        ("publish", "<u8"),
    ]
)
# What is kept of each message of the wanted topics: 26 bytes; `block` is its place in a list.
ENTRY = np.dtype(
    [("time", "u8"), ("start", "u8"), ("size", "u4"), ("channel", "u2"), ("block", "u4")]
)
Entries = npt.NDArray[np.void]
START = np.uint64(RAW.itemsize)  # of the payload in its record
LATEST = np.uint64(2**63 - 1)
PIECE = 1 << 16  # messages that are indexed at a time


@dataclass(slots=True)
class Block:
    """A chunk, or a run of records that stand outside chunks.

    Attributes:
        at: the file's byte where it begins.
        start, stop: the bytes of its records in the file, perhaps compressed.
        part: which of several files glued together.
        first_ns, last_ns: its earliest and latest log time.
        channels: of its messages; None where not known.
        compression, size, crc: as the chunk says; size in bytes when decompressed, crc 0: none.
        cut: the file ends inside it.
        run: it stands outside chunks.
    """

    at: int
    start: int
    stop: int
    part: int
    first_ns: int = 0
    last_ns: int = 0
    channels: frozenset[int] | None = None
    compression: str = ""
    size: int = 0
    crc: int = 0
    cut: bool = False
    run: bool = False


class Loaded(NamedTuple):
    """A block's records, what was wrong with them, and whether that lost messages."""

    data: Buffer
    problem: str = ""
    lost: bool = False


def load(data: memoryview, block: Block, max_chunk: int, buffers: Buffers | None = None) -> Loaded:
    """The decompressed, checked records of a block, in memory of `buffers` where these are given.

    A chunk whose CRC does not match gives nothing; one that is cut, or damaged without a CRC to
    tell, gives what comes before the damage.
    """
    if isinstance(data.obj, mmap.mmap) and data.obj.size() < block.stop:
        return Loaded(b"", SHRUNK, lost=True)  # to touch its pages would end the process
    packed = data[block.start : block.stop]
    if block.run:
        return Loaded(packed)
    plain = block.compression in ("", "none")
    inner: Buffer = packed
    sound = len(packed) == block.size
    if not plain:
        try:
            inner, sound = inflate(block.compression, packed, block.size, max_chunk, buffers)
        except ValueError:
            name = block.compression[:20]
            return Loaded(b"", f"chunk with unknown compression '{name}'", lost=True)
    if block.cut:
        return Loaded(inner, "cut in a chunk", lost=True)
    if block.crc and crc32(inner) == block.crc:
        return Loaded(inner, "" if sound else "chunk of another size than it says")
    if not plain and not sound and len(inner) == max_chunk:
        return Loaded(b"", f"chunk of more than {max_chunk} bytes (--max-chunk)", lost=True)
    if block.crc:
        return Loaded(b"", "chunk whose CRC does not match", lost=True)
    if plain and len(inner) != block.size:
        return Loaded(inner, "chunk of another size than it says")
    return Loaded(inner) if sound else Loaded(inner, "damaged chunk", lost=True)


def loaded(data: memoryview, blocks: Iterable[Block], max_chunk: int) -> Iterator[Loaded]:
    """Each block's records in turn; decompression and CRC run ahead in threads of their own."""
    waiting: deque[Future[Loaded] | Block] = deque()
    source, buffers = iter(blocks), Buffers()
    with ThreadPoolExecutor(THREADS) as pool:
        for block in source:
            small = max(block.size, block.stop - block.start) <= AHEAD_BYTES
            work = small and block.compression not in ("", "none")
            job = pool.submit(load, data, block, max_chunk, buffers) if work else block
            waiting.append(job)
            if len(waiting) > AHEAD:
                yield _ready(data, waiting.popleft(), max_chunk)
        while waiting:
            yield _ready(data, waiting.popleft(), max_chunk)


def _ready(data: memoryview, item: Future[Loaded] | Block, max_chunk: int) -> Loaded:
    return load(data, item, max_chunk) if isinstance(item, Block) else item.result()


def release(data: memoryview) -> None:
    """Let go of the mapped pages of a file; they come back from the file when touched again.

    Without this, pages that were read once count as the process's memory until the log is closed.
    """
    if isinstance(data.obj, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        data.obj.madvise(mmap.MADV_DONTNEED)


class Walked(NamedTuple):
    """Where records lie: messages, others as (opcode, start, stop) of the content, and the end."""

    messages: array[int]
    others: list[tuple[int, int, int]]
    end: int


def walk_block(
    data: Buffer, at: int, stop: int, ends: frozenset[int] = frozenset(), enough: int = 1 << 63
) -> Walked:
    """Walk the records of data[at:stop] that follow each other whole.

    Args:
        data: a file or a decompressed chunk.
        at: where to begin.
        stop: where to end.
        ends: opcodes before which the walk ends.
        enough: bytes after which no other record is begun.
    """
    unpack = HEAD.unpack_from
    messages: array[int] = array("Q")
    others: list[tuple[int, int, int]] = []
    add = messages.append
    last = min(stop - HEAD.size, at + enough)
    before, hopeful = 0, True
    while at <= last:
        opcode, size = unpack(data, at)
        after = at + 9 + size
        if after > stop:
            break
        if opcode == MESSAGE and MESSAGE_HEAD <= size < LARGEST_MESSAGE:
            if hopeful and size == before:  # two of a size: perhaps a long row of them
                step = after - at
                most = min((stop - at) // step, (last - at) // step + 1, PIECE)
                more = row(data, at, size, most)
                after = at + more * step
                messages.extend(range(at, after, step))
                hopeful = more >= WORTHWHILE
            else:
                add(at)
            before = size
        elif opcode == 0 or opcode in ends or len(others) == MOST_OTHERS:
            break
        else:
            others.append((opcode, at + 9, after))
        at = after
    return Walked(messages, others, at)


def row(data: Buffer, at: int, size: int, most: int) -> int:
    """How many messages of one size follow each other, of `most` that would fit."""
    heads = np.ndarray((most,), HEADS, data, at, (HEAD.size + size,))
    same = (heads["opcode"] == MESSAGE) & (heads["size"] == size)
    return most if same.all() else int(same.argmin())


def entries(data: Buffer, messages: array[int]) -> Entries:
    """The index of the messages at these offsets of `data`."""
    found = np.empty(len(messages), dtype=ENTRY)
    if not len(messages):
        return found
    # The bytes of a record from each place on.
    windows = np.ndarray((len(data) - RAW.itemsize + 1, RAW.itemsize), np.uint8, data, 0, (1, 1))
    offsets = np.frombuffer(messages, dtype="u8")
    for begin in range(0, len(found), PIECE):
        part, piece = found[begin : begin + PIECE], offsets[begin : begin + PIECE]
        raw = windows[piece].view(RAW)[:, 0]
        part["time"] = np.minimum(raw["time"], LATEST)
        part["start"] = piece + START
        part["size"] = raw["size"] - np.uint64(MESSAGE_HEAD)
        part["channel"] = raw["channel"]
    return found


def channel_counts(index: Entries) -> Counter[int]:
    """Messages by channel."""
    ids, counts = np.unique(index["channel"], return_counts=True)
    return Counter(dict(zip(ids.tolist(), counts.tolist(), strict=True)))
