"""MCAP files made byte by byte, whole or faulty, by a writer that shares nothing with ours."""

from __future__ import annotations

import struct
import sys
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import Any
from zlib import crc32

import lz4.frame

from formats.mcap import records as r

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

# Letters: B H I Q numbers, s text, b bytes, L long bytes, r the rest, m texts, c counts, p pairs.
CODES: dict[type, tuple[int, str]] = {
    r.Header: (1, "ss"),
    r.Footer: (2, "QQI"),
    r.Schema: (3, "Hssb"),
    r.Channel: (4, "HHssm"),
    r.RawMessage: (5, "HIQQr"),
    r.Chunk: (6, "QQQIsL"),
    r.MessageIndex: (7, "Hp"),
    r.ChunkIndex: (8, "QQQQcQsQQ"),
    r.Attachment: (9, "QQssLI"),
    r.AttachmentIndex: (10, "QQQQQss"),
    r.Statistics: (11, "QHIIIIQQc"),
    r.Metadata: (12, "sm"),
    r.MetadataIndex: (13, "QQs"),
    r.SummaryOffset: (14, "BQQ"),
    r.DataEnd: (15, "I"),
}
# chunks, message index, chunk index, repeated schemas and channels, statistics, attachment index,
# metadata index, summary offsets: the features of the conformance suite.
ALL = frozenset(["ch", "mx", "chx", "rsh", "rch", "st", "ax", "mdx", "sum"])


def _field(letter: str, value: Any) -> bytes:
    if letter in "BHIQ":
        return struct.pack("<" + letter, value)
    if letter == "r":
        return bytes(value)
    if letter == "L":
        return struct.pack("<Q", len(value)) + bytes(value)
    if letter == "s":
        value = value if isinstance(value, bytes) else value.encode()
    elif letter == "m":
        value = b"".join(_field("s", k) + _field("s", v) for k, v in value.items())
    elif letter == "c":
        value = b"".join(struct.pack("<HQ", k, v) for k, v in value.items())
    elif letter == "p":
        value = b"".join(struct.pack("<QQ", *pair) for pair in value)
    return struct.pack("<I", len(value)) + bytes(value)


def raw(opcode: int, content: bytes = b"", length: int | None = None) -> bytes:
    """A record of any opcode, which may claim another length than it has."""
    return struct.pack("<BQ", opcode, len(content) if length is None else length) + content


def encode(record: Any) -> bytes:
    """A record as bytes."""
    opcode, letters = CODES[type(record)]
    content = b"".join(_field(a, value) for a, value in zip(letters, record, strict=True))
    if isinstance(record, r.Attachment) and record.crc:
        content = content[:-4] + struct.pack("<I", crc32(content[:-4]))
    return raw(opcode, content)


def compress(kind: str, data: bytes) -> bytes:
    """As chunks are compressed; unknown kinds leave the data as they are."""
    if kind == "zstd":
        return zstd.compress(data)
    return bytes(lz4.frame.compress(data)) if kind == "lz4" else data


def chunk(
    records: Iterable[bytes],
    times: tuple[int, int] = (0, 0),
    compression: str = "zstd",
    size: int | None = None,
    crc: int | None = None,
) -> bytes:
    """A chunk record of encoded records, which may lie about its size and CRC."""
    data = b"".join(records)
    packed = compress(compression, data)
    size, crc = len(data) if size is None else size, crc32(data) if crc is None else crc
    return encode(r.Chunk(*times, size, crc, compression, packed))


def message(channel: int, time: int, data: bytes = b"", sequence: int = 0) -> bytes:
    """An encoded message."""
    return encode(r.RawMessage(channel, sequence, time, time, data))


def scan_definitions(count: int = 1, encoding: str = "cdr", first: int = 1) -> list[Any]:
    """A LaserScan schema and channels of it, /scan1, /scan2, ..."""
    kind = "ros1msg" if encoding == "ros1" else "ros2msg"
    name = "sensor_msgs/LaserScan" if encoding == "ros1" else "sensor_msgs/msg/LaserScan"
    found: list[Any] = [r.Schema(first, name, kind, b"float32[] ranges")]
    for number in range(first, first + count):
        found.append(r.Channel(number, first, f"/scan{number}", encoding, {}))
    return found


@dataclass
class McapBytes:
    """Puts an MCAP file together from records; `chunk_messages` messages go into each chunk."""

    profile: str = "ros2"
    compression: str = "zstd"
    chunk_messages: int = 10
    features: Collection[str] = ALL
    chunk_crc: bool = True
    data_crc: bool = True
    summary_crc: bool = True
    library: str = ""
    out: bytearray = field(default_factory=bytearray)
    chunks: list[tuple[int, int]] = field(default_factory=list)  # (first byte, behind the last)
    ends: list[int] = field(default_factory=list)  # of messages outside chunks

    def __post_init__(self) -> None:
        self.out += r.MAGIC + encode(r.Header(self.profile, self.library))
        self.repeated: dict[int, list[bytes]] = {opcode: [] for opcode in (3, 4)}
        self.indexes: dict[int, list[bytes]] = {opcode: [] for opcode in (8, 10, 13)}
        self.counts: Counter[int] = Counter()
        self.numbers: Counter[int] = Counter()
        self.times: list[int] = []
        self.open: list[Any] = []

    def add(self, *records: Any) -> McapBytes:
        """Write records in their order, into chunks where they belong."""
        for record in records:
            opcode = CODES[type(record)][0]
            self.numbers[opcode] += 1
            if opcode in self.repeated and (encoded := encode(record)) not in self.repeated[opcode]:
                self.repeated[opcode].append(encoded)
            if isinstance(record, r.RawMessage):
                self.counts[record.channel_id] += 1
                self.times.append(record.log_time)
            if opcode in (3, 4, 5) and "ch" in self.features:
                self.open.append(record)
                if sum(isinstance(x, r.RawMessage) for x in self.open) == self.chunk_messages:
                    self.close_chunk()
            else:
                self._outside(record)
        return self

    def messages(self, channel: int, times: Iterable[int], size: int = 20) -> McapBytes:
        """Messages whose payload tells their channel and time."""
        for number, time in enumerate(times):
            body = struct.pack("<HQ", channel, time).ljust(size, b"\x5a")
            self.add(r.RawMessage(channel, number, time, time, body))
        return self

    def _outside(self, record: Any) -> None:
        at = len(self.out)
        self.out += encode(record)
        size = len(self.out) - at
        if isinstance(record, r.RawMessage):
            self.ends.append(len(self.out))
        if isinstance(record, r.Attachment) and "ax" in self.features:
            index: Any = r.AttachmentIndex(at, size, *record[:2], len(record.data), *record[2:4])
            self.indexes[10].append(encode(index))
        elif isinstance(record, r.Metadata) and "mdx" in self.features:
            self.indexes[13].append(encode(r.MetadataIndex(at, size, record.name)))

    def close_chunk(self) -> None:
        """Write the open records as a chunk."""
        if not self.open:
            return
        index: dict[int, list[tuple[int, int]]] = {}
        data = b""
        for record in self.open:
            if isinstance(record, r.RawMessage):
                index.setdefault(record.channel_id, []).append((record.log_time, len(data)))
            data += encode(record)
        stamps = [time for pairs in index.values() for time, _ in pairs] or [0]
        times = (min(stamps), max(stamps))
        at, packed = len(self.out), compress(self.compression, data)
        crc = crc32(data) if self.chunk_crc else 0
        self.out += encode(r.Chunk(*times, len(data), crc, self.compression, packed))
        behind = len(self.out)
        self.chunks.append((at, behind))
        offsets = {}
        if "mx" in self.features:
            for channel, pairs in index.items():
                offsets[channel] = len(self.out)
                self.out += encode(r.MessageIndex(channel, pairs))
        if "chx" in self.features:
            entry = r.ChunkIndex(
                *times,
                chunk_start_offset=at,
                chunk_length=behind - at,
                message_index_offsets=offsets,
                message_index_length=len(self.out) - behind,
                compression=self.compression,
                compressed_size=len(packed),
                uncompressed_size=len(data),
            )
            self.indexes[8].append(encode(entry))
        self.open = []

    def finish(self) -> bytes:
        """The whole file."""
        self.close_chunk()
        self.out += encode(r.DataEnd(crc32(self.out) if self.data_crc else 0))
        start, offsets = len(self.out), b""
        count = len(self.repeated[3]), len(self.repeated[4])
        numbers = (self.numbers[9], self.numbers[12], len(self.chunks))
        times = (min(self.times, default=0), max(self.times, default=0))
        stats = encode(r.Statistics(self.counts.total(), *count, *numbers, *times, self.counts))
        groups = {
            3: self.repeated[3] if "rsh" in self.features else [],
            4: self.repeated[4] if "rch" in self.features else [],
            11: [stats] if "st" in self.features else [],
            **self.indexes,
        }
        for opcode, records in groups.items():
            if records:
                at = len(self.out)
                self.out += b"".join(records)
                offsets += encode(r.SummaryOffset(opcode, at, len(self.out) - at))
        summary = start if len(self.out) > start else 0
        offset_start = len(self.out) if summary and "sum" in self.features else 0
        self.out += offsets if offset_start else b""
        footer_at = len(self.out)
        self.out += encode(r.Footer(summary, offset_start, 0))[:-4]
        crc = crc32(self.out[summary or footer_at :]) if self.summary_crc else 0
        self.out += struct.pack("<I", crc) + r.MAGIC
        return bytes(self.out)
