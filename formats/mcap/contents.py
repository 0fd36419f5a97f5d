"""What lies where in an MCAP file: its parts, blocks, definitions and the rest."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from formats.errors import Kind, Notes, Path
from formats.mcap import records as r
from formats.mcap.blocks import Block
from formats.mcap.parse import MalformedError, parse
from formats.mcap.records import Buffer

PRIVATE = 0x80  # opcodes from here on are for extensions, and skipped
NAMES = {r.SCHEMA: "schema", r.CHANNEL: "channel"}


@dataclass
class Part:
    """One MCAP file; several may be glued together.

    Attributes:
        begin: its first byte.
        profile: "ros1", "ros2", ... or "".
        schemas, channels: by id, the first definition of each.
        counts: messages by channel id.
        data_end: where its data section ends, and its CRC (0: none).
    """

    begin: int = 0
    profile: str = ""
    schemas: dict[int, r.Schema] = field(default_factory=dict)
    channels: dict[int, r.Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    data_end: tuple[int, int] = (0, 0)


@dataclass
class Contents:
    """Everything in a file.

    Attributes:
        parts: one for each of the files that are glued together.
        blocks: in the order of the file.
        definitions: (opcode, start, stop, part) of schemas and channels outside chunks.
        attachments, metadata: (start, stop) of the contents of their records.
        cut: (kind of note, what is cut, byte) where the file ends too early.
        damaged: the first byte that is no record.
        ended: the last part has its footer and end magic.
    """

    parts: list[Part]
    blocks: list[Block] = field(default_factory=list)
    definitions: list[tuple[int, int, int, int]] = field(default_factory=list)
    attachments: list[tuple[int, int]] = field(default_factory=list)
    metadata: list[tuple[int, int]] = field(default_factory=list)
    cut: tuple[Kind, str, int] | None = None
    damaged: int | None = None
    ended: bool = False


def define(
    path: Path,
    notes: Notes,
    part: Part,
    opcode: int,
    content: Buffer,
    at: int,
    inside: bool = False,
) -> None:
    """Keep a schema or a channel, the first of its id; count what should not be here.

    Args:
        path: the file.
        notes: where oddities are counted.
        part: what to keep it in.
        opcode: of the record.
        content: its content.
        at: the byte to name.
        inside: the record lies in a chunk.
    """
    place = f"byte {at}"
    if opcode == r.MESSAGE:
        notes.lose(path, "message of a wrong length", at=place)
    elif inside and opcode == r.CHUNK:
        notes.warn(path, "chunk inside a chunk skipped", at=place)
    elif r.DATA_END < opcode < PRIVATE:
        notes.warn(path, f"record of unknown kind {opcode} skipped", at=place)
    elif opcode in (r.SCHEMA, r.CHANNEL):
        try:
            record = parse(opcode, content)
        except MalformedError:
            notes.warn(path, f"damaged {NAMES[opcode]}", at=place)
            return
        kept: r.Record
        if isinstance(record, r.Schema):
            kept = part.schemas.setdefault(record.id, record)
        else:
            assert isinstance(record, r.Channel)
            kept = part.channels.setdefault(record.id, record)
        if kept != record:
            problem = f"{NAMES[opcode]} redefined; the first definition of an id holds"
            notes.warn(path, problem, at=place)
