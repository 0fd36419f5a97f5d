"""The records of an MCAP file, one class each, fields in the order of the file (mcap.dev/spec)."""

from __future__ import annotations

from typing import NamedTuple

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET = range(9, 15)
DATA_END = 15

Buffer = bytes | memoryview


class Header(NamedTuple):
    """The first record: who wrote what."""

    profile: str
    library: str


class Footer(NamedTuple):
    """The last record: where the summary starts (0: none) and its CRC (0: none)."""

    summary_start: int
    summary_offset_start: int
    summary_crc: int


class Schema(NamedTuple):
    """A message definition."""

    id: int
    name: str
    encoding: str
    data: bytes


class Channel(NamedTuple):
    """One publisher's topic; schema 0 is none."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: dict[str, str]


class RawMessage(NamedTuple):
    """One message; times in ns."""

    channel_id: int
    sequence: int
    log_time: int
    publish_time: int
    data: Buffer


class Chunk(NamedTuple):
    """A batch of schemas, channels and messages, perhaps compressed; times in ns."""

    message_start_time: int
    message_end_time: int
    uncompressed_size: int
    uncompressed_crc: int
    compression: str
    records: Buffer


class MessageIndex(NamedTuple):
    """(log time, offset in the chunk) of a channel's messages in the chunk before."""

    channel_id: int
    records: list[tuple[int, int]]


class ChunkIndex(NamedTuple):
    """Where a chunk lies and what is in it."""

    message_start_time: int
    message_end_time: int
    chunk_start_offset: int
    chunk_length: int
    message_index_offsets: dict[int, int]
    message_index_length: int
    compression: str
    compressed_size: int
    uncompressed_size: int


class Attachment(NamedTuple):
    """A file inside the file."""

    log_time: int
    create_time: int
    name: str
    media_type: str
    data: Buffer
    crc: int


class AttachmentIndex(NamedTuple):
    """Where an attachment lies."""

    offset: int
    length: int
    log_time: int
    create_time: int
    data_size: int
    name: str
    media_type: str


class Statistics(NamedTuple):
    """Counts of the whole file."""

    message_count: int
    schema_count: int
    channel_count: int
    attachment_count: int
    metadata_count: int
    chunk_count: int
    message_start_time: int
    message_end_time: int
    channel_message_counts: dict[int, int]


class Metadata(NamedTuple):
    """A named set of key-value pairs."""

    name: str
    metadata: dict[str, str]


class MetadataIndex(NamedTuple):
    """Where a metadata record lies."""

    offset: int
    length: int
    name: str


class SummaryOffset(NamedTuple):
    """Where one kind of record lies in the summary."""

    group_opcode: int
    group_start: int
    group_length: int


class DataEnd(NamedTuple):
    """The end of the data section and its CRC (0: none)."""

    data_section_crc: int


Record = (Header | Footer | Schema | Channel | RawMessage | Chunk | MessageIndex | ChunkIndex) | (
    Attachment | AttachmentIndex | Statistics | Metadata | MetadataIndex | SummaryOffset | DataEnd
)
