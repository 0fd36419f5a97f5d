"""The summary at the end of an MCAP file, believed only where its CRC holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

from formats.compression import crc32
from formats.mcap import records as r
from formats.mcap.parse import HEAD, MalformedError, parse, walk

FOOTER_SIZE = 37  # opcode, length, 20 bytes, magic


@dataclass
class Summary:
    """What the summary says.

    Attributes:
        state: "ok", or why it cannot be used: "none", "no CRC", "CRC wrong", "no footer".
        schemas, channels: by id.
        chunks: chunk indexes by the chunk's first byte.
        statistics: None where not recorded.
    """

    state: str
    schemas: dict[int, r.Schema] = field(default_factory=dict)
    channels: dict[int, r.Channel] = field(default_factory=dict)
    chunks: dict[int, r.ChunkIndex] = field(default_factory=dict)
    statistics: r.Statistics | None = None

    @property
    def complete(self) -> bool:
        """Whether chunks need not be opened to know every channel and count."""
        stats = self.statistics
        if self.state != "ok" or stats is None or len(self.chunks) != stats.chunk_count:
            return False
        if len(self.channels) != stats.channel_count:
            return False
        if sum(stats.channel_message_counts.values()) != stats.message_count:
            return False
        named = set(stats.channel_message_counts).union(
            *(chunk.message_index_offsets for chunk in self.chunks.values())
        )
        schemas = {channel.schema_id for channel in self.channels.values()} - {0}
        return named <= self.channels.keys() and schemas <= self.schemas.keys()


def read_summary(data: memoryview) -> Summary:
    """The summary of a file that ends whole; its state says what it is good for."""
    footer_at = len(data) - FOOTER_SIZE
    if footer_at < len(r.MAGIC) or data[-len(r.MAGIC) :] != r.MAGIC:
        return Summary("no footer")
    if HEAD.unpack_from(data, footer_at) != (r.FOOTER, 20):
        return Summary("no footer")
    footer = cast("r.Footer", parse(r.FOOTER, data[footer_at + HEAD.size :]))
    if footer.summary_start == 0:
        return Summary("none")
    if not len(r.MAGIC) <= footer.summary_start <= footer_at:
        return Summary("malformed")
    if footer.summary_crc == 0:
        return Summary("no CRC")
    if crc32(data[footer.summary_start : len(data) - 12]) != footer.summary_crc:
        return Summary("CRC wrong")
    found = Summary("ok")
    try:
        for opcode, start, stop in walk(data, footer.summary_start, footer_at):
            _keep(found, opcode, data[start:stop])
    except MalformedError:
        return Summary("malformed")
    return found


def _keep(found: Summary, opcode: int, content: memoryview) -> None:
    if opcode not in (r.SCHEMA, r.CHANNEL, r.CHUNK_INDEX, r.STATISTICS):
        return
    record = parse(opcode, content)
    if isinstance(record, r.Schema):
        found.schemas.setdefault(record.id, record)
    elif isinstance(record, r.Channel):
        found.channels.setdefault(record.id, record)
    elif isinstance(record, r.ChunkIndex):
        found.chunks[record.chunk_start_offset] = record
    elif isinstance(record, r.Statistics):
        found.statistics = record
