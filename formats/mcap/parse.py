"""Parsers of MCAP records, bounded by what is there (mcap.dev/spec)."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any, cast

from formats.compression import inflate
from formats.mcap import records as r
from formats.mcap.records import Buffer, Record

HEAD = struct.Struct("<BQ")  # opcode, length of what follows
MAX_CHUNK = 256 << 20


class MalformedError(ValueError):
    """A record does not hold what its kind must hold."""


class _Fields:
    """Reads one field after another from a record's content, never beyond its end."""

    def __init__(self, data: Buffer) -> None:
        self.data, self.at = data, 0

    def _bytes(self, size: int) -> Buffer:
        self.at += size
        if self.at > len(self.data):
            raise MalformedError(f"{self.at - len(self.data)} bytes too short")
        return self.data[self.at - size : self.at]

    def _number(self, size: int) -> int:
        return int.from_bytes(self._bytes(size), "little")

    def op(self) -> int:
        return self._number(1)

    def u16(self) -> int:
        return self._number(2)

    def u32(self) -> int:
        return self._number(4)

    def u64(self) -> int:
        return self._number(8)

    def text(self) -> str:
        """Bad UTF-8 is kept apart from good: as escaped bytes."""
        return str(self._bytes(self.u32()), "utf-8", "backslashreplace")

    def blob(self) -> bytes:
        return bytes(self._bytes(self.u32()))

    def long_blob(self) -> Buffer:
        return self._bytes(self.u64())

    def rest(self) -> Buffer:
        return self._bytes(len(self.data) - self.at)

    def _inner(self) -> _Fields:
        return _Fields(self._bytes(self.u32()))

    def texts(self) -> dict[str, str]:
        inner, found = self._inner(), {}
        while inner.at < len(inner.data):
            key = inner.text()
            found[key] = inner.text()
        return found

    def counts(self) -> dict[int, int]:
        inner, found = self._inner(), {}
        while inner.at < len(inner.data):
            key = inner.u16()
            found[key] = inner.u64()
        return found

    def pairs(self) -> list[tuple[int, int]]:
        numbers = self.blob()
        if len(numbers) % 16:
            raise MalformedError("an index that is not made of pairs")
        return [cast("tuple[int, int]", pair) for pair in struct.iter_unpack("<QQ", numbers)]


F = _Fields
# Each kind's class and its fields as they lie in the file; bytes behind them are padding.
LAYOUT: dict[int, tuple[type[Any], tuple[Callable[[_Fields], Any], ...]]] = {
    r.HEADER: (r.Header, (F.text, F.text)),
    r.FOOTER: (r.Footer, (F.u64, F.u64, F.u32)),
    r.SCHEMA: (r.Schema, (F.u16, F.text, F.text, F.blob)),
    r.CHANNEL: (r.Channel, (F.u16, F.u16, F.text, F.text, F.texts)),
    r.MESSAGE: (r.RawMessage, (F.u16, F.u32, F.u64, F.u64, F.rest)),
    r.CHUNK: (r.Chunk, (F.u64, F.u64, F.u64, F.u32, F.text, F.long_blob)),
    r.MESSAGE_INDEX: (r.MessageIndex, (F.u16, F.pairs)),
    r.CHUNK_INDEX: (
        r.ChunkIndex,
        (F.u64, F.u64, F.u64, F.u64, F.counts, F.u64, F.text, F.u64, F.u64),
    ),
    r.ATTACHMENT: (r.Attachment, (F.u64, F.u64, F.text, F.text, F.long_blob, F.u32)),
    r.ATTACHMENT_INDEX: (r.AttachmentIndex, (F.u64, F.u64, F.u64, F.u64, F.u64, F.text, F.text)),
    r.STATISTICS: (
        r.Statistics,
        (F.u64, F.u16, F.u32, F.u32, F.u32, F.u32, F.u64, F.u64, F.counts),
    ),
    r.METADATA: (r.Metadata, (F.text, F.texts)),
    r.METADATA_INDEX: (r.MetadataIndex, (F.u64, F.u64, F.text)),
    r.SUMMARY_OFFSET: (r.SummaryOffset, (F.op, F.u64, F.u64)),
    r.DATA_END: (r.DataEnd, (F.u32,)),
}


def parse(opcode: int, content: Buffer) -> Record:
    """The record of a known opcode.

    Raises:
        MalformedError: the content is too short or a length inside it points outside.
        KeyError: the opcode is not known.
    """
    kind, fields = LAYOUT[opcode]
    reader = _Fields(content)
    return cast("Record", kind(*[field(reader) for field in fields]))


def walk(data: Buffer, at: int = 0, stop: int | None = None) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, stop) of each record's content, as far as they follow each other whole."""
    end = len(data) if stop is None else min(stop, len(data))
    while at + HEAD.size <= end:
        opcode, size = HEAD.unpack_from(data, at)
        at += HEAD.size
        if opcode == 0 or size > end - at:
            return
        yield opcode, at, at + size
        at += size


def records(data: Buffer, max_chunk: int = MAX_CHUNK) -> Iterator[Record]:
    """Every record of a sound MCAP file in the order of the file, chunks opened.

    Chunks and message indexes themselves are left out, as are unknown opcodes. This is the plain
    reading of the standard; damaged files are the business of mcap_log.

    Args:
        data: the whole file.
        max_chunk: the most bytes that a chunk may decompress to.

    Raises:
        MalformedError: a record does not hold what it must, or a chunk cannot be decompressed.
    """
    for opcode, start, stop in walk(data, len(r.MAGIC)):
        if opcode == r.CHUNK:
            chunk = cast("r.Chunk", parse(opcode, data[start:stop]))
            size = chunk.uncompressed_size
            inner, sound = inflate(chunk.compression, chunk.records, size, max_chunk)
            if not sound:
                raise MalformedError(f"the chunk before byte {stop} does not decompress")
            for kind, a, b in walk(inner):
                if kind in LAYOUT:
                    yield parse(kind, inner[a:b])
        elif opcode in LAYOUT and opcode != r.MESSAGE_INDEX:
            yield parse(opcode, data[start:stop])
