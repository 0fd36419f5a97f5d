"""MCAP files: chunks, indexes, checksums and summary, from single messages or whole blocks."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from typing import IO

import numpy as np
import numpy.typing as npt

from formats.compression import crc32, zstd
from formats.mcap import records as r
from formats.mcap.parse import HEAD
from formats.mcap.records import Buffer
from formats.mcap.write_records import encode, encode_index, encode_message, u32

CHUNK_SIZE = 1 << 20  # bytes; whoever goes beyond it closes the chunk
PAIR = struct.Struct("<QQ")  # in a message index: log time, offset in the chunk
GROUPS = (r.SCHEMA, r.CHANNEL, r.STATISTICS, r.CHUNK_INDEX, r.ATTACHMENT_INDEX, r.METADATA_INDEX)


class McapWriter:
    """Writes one MCAP file, front to back; the same calls give the same bytes.

    Schemas, channels and messages go into chunks in the order of the calls; attachments and
    metadata are written at once, so before the chunk that is open.

    Args:
        file: open for writing, at its start; it stays open.
        profile: what the whole file keeps to: "ros2", or "".
        library: what wrote it.
        compression: of chunks: "zstd", or "" for none.
        without: opcodes of records that the standard does not ask for and this file shall not
            have: chunks, all indexes, and what the summary repeats, counts or points to.
    """

    def __init__(
        self,
        file: IO[bytes],
        profile: str = "",
        library: str = "",
        *,
        compression: str = "zstd",
        without: Collection[int] = (),
    ) -> None:
        if compression not in ("", "zstd"):
            raise ValueError(f"chunks are written as zstd or plain, not {compression!r}")
        self._file, self._compression, self._without = file, compression, frozenset(without)
        self._at, self._crc = 0, 0  # bytes written, and their checksum
        self._chunk = bytearray()  # the open one
        self._index: defaultdict[int, bytearray] = defaultdict(bytearray)  # of it, by channel
        self._counts: Counter[int] = Counter()  # messages by channel, and their times by chunk
        self._times: list[int] = []
        self._groups: dict[int, list[bytes]] = {opcode: [] for opcode in GROUPS}  # of the summary
        self._write(r.MAGIC + encode(r.Header(profile, library)))

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Define a type; its number, from 1."""
        number = len(self._groups[r.SCHEMA]) + 1
        self._define(r.SCHEMA, encode(r.Schema(number, name, encoding, data)))
        return number

    def channel(
        self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Define a topic with messages of a schema (0: none); its number, from 1."""
        number = len(self._groups[r.CHANNEL]) + 1
        record = r.Channel(number, schema, topic, encoding, dict(metadata or {}))
        self._define(r.CHANNEL, encode(record))
        return number

    def message(
        self, channel: int, log_time: int, data: Buffer, publish_time: int, sequence: int = 0
    ) -> None:
        """Add one message; times in ns."""
        self._index[channel] += PAIR.pack(log_time, len(self._chunk))
        self._add(encode_message(channel, sequence, log_time, publish_time, data))

    def block(self, rows: npt.NDArray[np.void]) -> None:
        """Add many messages of fixed sizes: see `mcap_write_records.block`."""
        while len(rows):
            room = max(CHUNK_SIZE - len(self._chunk), 0) // rows.itemsize + 1
            part, rows = rows[:room], rows[room:]
            starts = len(self._chunk) + np.arange(len(part)) * rows.itemsize
            for name, (_, offset, *_) in (rows.dtype.fields or {}).items():
                pairs = np.empty((len(part), 2), dtype="<u8")
                pairs[:, 0], pairs[:, 1] = part[name]["log_time"], starts + offset
                self._index[int(name)] += pairs.tobytes()
            self._add(part.tobytes())

    def attachment(
        self, name: str, media_type: str, data: Buffer, log_time: int = 0, create_time: int = 0
    ) -> None:
        """Add a file; times in ns."""
        blank = encode(r.Attachment(log_time, create_time, name, media_type, data, 0))[:-4]
        size = len(blank) + 4
        index = r.AttachmentIndex(
            self._at, size, log_time, create_time, len(data), name, media_type
        )
        self._groups[r.ATTACHMENT_INDEX].append(encode(index))
        self._write(blank + u32(crc32(blank[HEAD.size :])))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a named set of keys and values."""
        record = encode(r.Metadata(name, dict(values)))
        self._groups[r.METADATA_INDEX].append(encode(r.MetadataIndex(self._at, len(record), name)))
        self._write(record)

    def finish(self) -> None:
        """Write what is left, the summary and the footer."""
        self.close_chunk()
        self._write(encode(r.DataEnd(self._crc)))
        self._groups[r.STATISTICS] = [encode(self._statistics())]
        start, summary, offsets = self._at, b"", b""
        for opcode, records in self._groups.items():
            if records and opcode not in self._without:
                group = b"".join(records)
                offsets += encode(r.SummaryOffset(opcode, start + len(summary), len(group)))
                summary += group
        if r.SUMMARY_OFFSET in self._without:
            offsets = b""
        footer = r.Footer(start if summary else 0, start + len(summary) if offsets else 0, 0)
        checked = summary + offsets + encode(footer)[:-4]
        self._write(checked + u32(crc32(checked)) + r.MAGIC)

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._crc = crc32(data, self._crc)
        self._at += len(data)

    def _define(self, opcode: int, record: bytes) -> None:
        self._groups[opcode].append(record)
        self._add(record)

    def _add(self, records: bytes) -> None:
        """Records go into the open chunk, which their end may close."""
        self._chunk += records
        if len(self._chunk) > CHUNK_SIZE:
            self.close_chunk()

    @property
    def counts(self) -> list[int]:
        """Messages of each channel, from the first on, in the chunks that are closed."""
        return [self._counts[i + 1] for i in range(len(self._groups[r.CHANNEL]))]

    @property
    def span(self) -> tuple[int, int]:
        """First and last log time (ns) in the chunks that are closed; zeros where there is none."""
        return min(self._times, default=0), max(self._times, default=0)

    def close_chunk(self) -> None:
        """Write the open chunk and its message indexes."""
        if not self._chunk:
            return
        data, index = bytes(self._chunk), self._index
        self._chunk, self._index = bytearray(), defaultdict(bytearray)
        stamps = np.frombuffer(b"".join(index.values()), dtype="<u8")[::2]
        times = (int(stamps.min()), int(stamps.max())) if len(stamps) else (0, 0)
        self._times += times if len(stamps) else ()
        self._counts.update({channel: len(pairs) // PAIR.size for channel, pairs in index.items()})
        if r.CHUNK in self._without:
            self._write(data)
            return
        packed = zstd.compress(data) if self._compression else data
        start = self._at
        self._write(encode(r.Chunk(*times, len(data), crc32(data), self._compression, packed)))
        behind, offsets = self._at, {}
        for channel, pairs in index.items() if r.MESSAGE_INDEX not in self._without else ():
            offsets[channel] = self._at
            self._write(encode_index(channel, bytes(pairs)))
        entry = r.ChunkIndex(
            *times,
            chunk_start_offset=start,
            chunk_length=behind - start,
            message_index_offsets=offsets,
            message_index_length=self._at - behind,
            compression=self._compression,
            compressed_size=len(packed),
            uncompressed_size=len(data),
        )
        self._groups[r.CHUNK_INDEX].append(encode(entry))

    def _statistics(self) -> r.Statistics:
        number = {opcode: len(records) for opcode, records in self._groups.items()}
        return r.Statistics(
            message_count=self._counts.total(),
            schema_count=number[r.SCHEMA],
            channel_count=number[r.CHANNEL],
            attachment_count=number[r.ATTACHMENT_INDEX],
            metadata_count=number[r.METADATA_INDEX],
            chunk_count=number[r.CHUNK_INDEX],
            message_start_time=min(self._times, default=0),
            message_end_time=max(self._times, default=0),
            channel_message_counts=dict(self._counts),
        )
