"""What re-scoring needs of a result, without reading the rest of the file."""

from __future__ import annotations

import mmap
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from formats.compression import crc32
from formats.errors import Notes
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.grid import Evidence, Geometry
from formats.mcap import records as r
from formats.mcap.blocks import Block, load
from formats.mcap.parse import HEAD, MAX_CHUNK, MalformedError, parse, walk
from formats.mcap.summary import FOOTER_SIZE
from formats.results import messages as ros
from formats.results.contents import DATA_END, RECORD, must_be_file, read_record
from formats.results.groups import KINDS, Groups, grouped, scored_cells
from formats.results.keyframes import Change
from formats.results.reading import read_through_time


@dataclass(slots=True)
class Kept:
    """A result as far as scores depend on it.

    Attributes:
        path: of the file.
        settings: every option that had effect.
        facts: what the run says of itself.
        curves: names of its curves.
        main: the curve that is the run's map.
        groups: the scored cells after the last frame; None where the run scored nothing.
        geometry, levels: of the evidence.
        map_to_plan: pose of the plan's frame in the frame of the poses.
        layers: name -> (rows, cols); empty where only the end was read.
        changes: (time in ns, change of the evidence) keyframe by keyframe; likewise.
        attachments: name -> bytes; likewise.
    """

    path: Path
    settings: dict[str, Any]
    facts: dict[str, Any]
    curves: list[str]
    main: str
    groups: Groups | None
    geometry: Geometry
    levels: int
    map_to_plan: Pose
    layers: dict[str, npt.NDArray[Any]] = field(default_factory=dict)
    changes: list[tuple[int, Change]] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)

    def evidence(self) -> Evidence:
        """All readings of the run, where changes were read."""
        evidence = Evidence.empty(self.geometry, self.levels)
        for _, change in self.changes:
            change.add_to(evidence)
        return evidence


def read_kept(path: AnyPath, notes: Notes | None = None, *, whole: bool = False) -> Kept:
    """Read what a result keeps for other priors; a millisecond where it was written with groups.

    Args:
        path: of a result file, of any version.
        notes: takes what was odd.
        whole: layers and evidence through time, too.

    Raises:
        FormatError: it is not a result, of a newer format, cut or damaged.
    """
    path = Path(path)
    must_be_file(path)
    found = None
    if not whole:
        try:
            found = _quickly(path)
        except (OSError, MalformedError, ValueError, LookupError, TypeError, AttributeError):
            found = None  # whatever is odd about it is said by those who read it whole
    return found or _whole(path, notes)


def _whole(path: Path, notes: Notes | None) -> Kept:
    """By layers and evidence, from a file of any version."""
    record, layers, changes, attachments = read_through_time(path, notes)
    kept = _kept(path, record, None)
    kept.layers, kept.changes, kept.attachments = layers, changes, attachments
    cells = scored_cells(layers, kept.evidence().counts)
    kept.groups = cells and grouped(cells)
    return kept


def _kept(path: Path, record: dict[str, Any], groups: Groups | None) -> Kept:
    return Kept(
        path,
        dict(record["settings"]),
        dict(record["facts"]),
        list(record["curves"]),
        str(record["main"]),
        groups,
        Geometry(*record["geometry"]),
        int(record["levels"]),
        Pose(*record["map_to_plan"]),
    )


def _quickly(path: Path) -> Kept | None:
    """By the summary: one metadata record and the first chunk; None where it cannot be."""
    with (
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as pages,
        memoryview(pages) as data,
    ):
        spots = _spots(data)
        if spots is None:
            return None
        record, chunk = spots
        with record, chunk:
            found = cast("r.Metadata", parse(r.METADATA, record))
            fields = read_record(path, found.metadata)
            groups = _groups(chunk, int(fields["levels"]))
    return groups and _kept(path, fields, groups)


def _spots(data: memoryview) -> tuple[memoryview, memoryview] | None:
    """Contents of the record "replay" and of the first chunk, of a file whose checksums hold."""
    end = len(data) - FOOTER_SIZE
    if end < 0 or data[: len(r.MAGIC)] != r.MAGIC or data[-len(r.MAGIC) :] != r.MAGIC:
        return None
    if HEAD.unpack_from(data, end) != (r.FOOTER, 20):
        return None
    start = int.from_bytes(data[end + 9 : end + 17], "little")
    crc = int.from_bytes(data[end + 25 : end + 29], "little")
    data_end = start - DATA_END
    if data_end < 0 or start > end or crc32(data[start : end + 25]) != crc:
        return None
    if HEAD.unpack_from(data, data_end) != (r.DATA_END, 4):
        return None
    if crc32(data[:data_end]) != int.from_bytes(data[data_end + 9 : start], "little"):
        return None
    record = chunk = -1
    for opcode, a, b in walk(data, start, end):
        if opcode == r.METADATA_INDEX:
            index = cast("r.MetadataIndex", parse(opcode, data[a:b]))
            record = index.offset if index.name == RECORD else record
        elif opcode == r.CHUNK_INDEX:
            at = int.from_bytes(data[a + 16 : a + 24], "little")
            chunk = at if chunk < 0 else min(at, chunk)
    if record < 0 or chunk < 0:
        return None
    return _content(data, record, r.METADATA), _content(data, chunk, r.CHUNK)


def _content(data: memoryview, at: int, expected: int) -> memoryview:
    opcode, size = HEAD.unpack_from(data, at)
    if opcode != expected or at + HEAD.size + size > len(data):
        raise MalformedError("an index that points elsewhere")
    return data[at + HEAD.size : at + HEAD.size + size]


def _groups(content: memoryview, levels: int) -> Groups | None:
    """The groups in a chunk; None where it holds something else."""
    chunk = cast("r.Chunk", parse(r.CHUNK, content))
    packed = memoryview(chunk.records)
    block = Block(0, 0, len(packed), 0)
    block.compression, block.size = chunk.compression, chunk.uncompressed_size
    block.crc = chunk.uncompressed_crc
    inner = load(packed, block, MAX_CHUNK)
    if inner.problem:
        return None
    topics: dict[int, str] = {}
    for opcode, a, b in walk(inner.data):
        if opcode == r.CHANNEL:
            channel = cast("r.Channel", parse(opcode, inner.data[a:b]))
            topics[channel.id] = channel.topic
        elif opcode == r.MESSAGE:
            raw = cast("r.RawMessage", parse(opcode, inner.data[a:b]))
            if topics.get(raw.channel_id) == ros.GROUPS_TOPIC:
                return _checked(ros.decode(raw.data, ros.GROUPS), levels)
    return None


def _checked(message: Any, levels: int) -> Groups:
    """Groups of a message; ValueError where they do not fit together."""
    kind = np.asarray(message.kind, dtype=np.uint8)
    if message.levels != levels or len(message.cells) != len(kind):
        raise ValueError(f"groups of {message.levels} levels, {len(kind)} kinds")
    if kind.max(initial=0) >= KINDS:
        raise ValueError("cells of an unknown kind")
    return Groups(kind, message.counts.reshape(levels, len(kind)), message.cells)
