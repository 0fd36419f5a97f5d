"""MCAP logs, whole, cut or damaged (mcap.dev/spec): everything readable, every loss counted."""

from __future__ import annotations

import mmap
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import numpy.typing as npt

from formats.compression import crc32
from formats.errors import FormatError, Notes
from formats.log import Message, Topic
from formats.mcap.blocks import SHRUNK, Block, Entries, Loaded, entries, walk_block
from formats.mcap.losses import UNDEFINED, note_chunk
from formats.mcap.merge import merged
from formats.mcap.parse import MAX_CHUNK, MalformedError, parse
from formats.mcap.records import ATTACHMENT, MAGIC, METADATA, Attachment, Metadata
from formats.mcap.scan import scan
from formats.mcap.topics import topics_of

CHANNELS = 1 << 16
LFS = b"version https://git-lfs"


def fits(path: Path, head: bytes) -> bool:
    """Whether the first bytes are an MCAP file's, of any version."""
    return head[1:5] == MAGIC[1:5]


def open_file(
    path: Path, notes: Notes, max_chunk: int = MAX_CHUNK, unpacked: Path | None = None
) -> McapLog:
    """Open an MCAP log.

    Args:
        path: the file, as the user names it.
        notes: where losses and oddities are counted, now and while messages are read.
        max_chunk: the most bytes that one chunk may decompress to.
        unpacked: where its bytes lie, if `path` itself is compressed.

    Raises:
        FormatError: not an MCAP file, or of a major version that nobody has defined.
    """
    try:
        with (unpacked or path).open("rb") as file:
            head = file.read(len(MAGIC))
            _refuse(path, head, file.read(len(LFS)))
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error
    if head != MAGIC:
        notes.warn(path, "its first bytes are damaged", at="byte 0")
    return McapLog(path, pages, notes, max_chunk)


def _refuse(path: Path, head: bytes, more: bytes) -> None:
    if not head:
        raise FormatError(path, "is empty")
    if (head + more).startswith(LFS):
        hint = "get the file itself with `git lfs pull`"
        raise FormatError(path, "is a Git LFS pointer, not the log", hint=hint)
    if not fits(path, head):
        raise FormatError(path, "is not an MCAP file")
    version = head[5:6]
    if version != MAGIC[5:6] and head[6:] == MAGIC[6:]:
        name = version.decode("ascii", "backslashreplace")
        hint = "convert it with a tool that reads it"
        raise FormatError(path, f"is of MCAP version {name}; only version 0 is known", hint=hint)


class McapLog:
    """An opened MCAP file; see `formats.log.Log`."""

    def __init__(self, path: Path, pages: mmap.mmap, notes: Notes, max_chunk: int) -> None:
        self.path, self._pages, self._notes, self._max_chunk = path, pages, notes, max_chunk
        self._data = memoryview(pages)
        self._contents, self.container, indexed = scan(path, self._data, notes, max_chunk)
        found = self._contents
        if not (found.ended or found.blocks or found.definitions or found.attachments):
            self.close()
            raise FormatError(path, "holds no records; its recording ended at once")
        self._tables = topics_of(path, notes, self._contents.parts)
        self._known = [_mask(table) for table in self._tables]
        # Blocks that have not been opened yet: their losses are not in the notes.
        self._unseen = {block.at for block in self._contents.blocks} if indexed else set()

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name and type; publishers of one topic are taken together."""
        found = {topic for table in self._tables for topic in table.values()}
        return sorted(found, key=_kind)

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics (None: all), sorted by log time, file order where equal.

        Chunks without any of the topics are not opened where the file has an index.
        """
        chosen = {_kind(topic) for topic in (self.topics() if topics is None else topics)}
        tables = [
            {channel: topic for channel, topic in table.items() if _kind(topic) in chosen}
            for table in self._tables
        ]
        blocks = [
            block
            for block in self._contents.blocks
            if block.channels is None or block.channels & tables[block.part].keys()
        ]
        blocks.sort(key=lambda block: (block.first_ns, block.at))
        masks = [_mask(table) for table in tables]

        def index(block: Block, chunk: Loaded) -> Entries:
            found = self._index(block, chunk)
            wanted = masks[block.part][found["channel"]]
            return found if wanted.all() else found[wanted]

        return merged(self._data, blocks, index, tables, self._max_chunk)

    def _index(self, block: Block, chunk: Loaded) -> Entries:
        """All messages of a block; what it lost is counted when it is opened first."""
        if chunk.problem == SHRUNK:
            self._notes.lose(self.path, SHRUNK, at=f"byte {block.at}")
        walked = walk_block(chunk.data, 0, len(chunk.data))
        found = entries(chunk.data, walked.messages)
        if block.at in self._unseen and chunk.problem != SHRUNK:
            self._unseen.remove(block.at)
            part = self._contents.parts[block.part]
            lost = note_chunk(self.path, self._data, self._notes, part, block, chunk, found, walked)
            known = self._known[block.part][found["channel"]]
            if not known.all():
                count, place = int((~known).sum()), f"byte {block.at}"
                self._notes.lose(self.path, UNDEFINED, at=place, count=count)
            times = found["time"]
            if len(found) and (times.min() < block.first_ns or times.max() > block.last_ns):
                problem = "chunk with other times than it says; order may suffer"
                self._notes.warn(self.path, problem, at=f"byte {block.at}")
            if lost or not known.all():
                state = f"damaged at byte {block.at}"
                self.container = replace(self.container, whole=False, state=state)
        return found

    def attachments(self) -> Iterator[tuple[str, str, memoryview]]:
        """Name, media type and bytes of each attachment; names are as recorded, so never paths.

        The bytes are views on the file, valid while the log is open.
        """
        for start, stop in self._contents.attachments:
            try:
                found = cast("Attachment", parse(ATTACHMENT, self._data[start:stop]))
            except MalformedError:
                self._notes.lose(self.path, "damaged attachment", at=f"byte {start}")
                continue
            content = self._data[start:stop]
            if found.crc and crc32(content[: _checked(content)]) != found.crc:
                problem = "attachment whose CRC does not match"
                self._notes.lose(self.path, problem, at=f"byte {start}")
                continue
            yield found.name, found.media_type, cast("memoryview", found.data)

    def metadata(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Name and pairs of each metadata record."""
        for start, stop in self._contents.metadata:
            try:
                found = cast("Metadata", parse(METADATA, self._data[start:stop]))
            except MalformedError:
                self._notes.lose(self.path, "damaged metadata", at=f"byte {start}")
                continue
            yield found.name, found.metadata

    def close(self) -> None:
        """Give the file back; views on it that are still held keep its pages until they go."""
        with suppress(BufferError):
            self._data.release()
            self._pages.close()


def _kind(topic: Topic) -> tuple[str, str, str]:
    """What makes a topic one: another reader may know other counts of it."""
    return topic.name, topic.type, topic.encoding


def _checked(content: memoryview) -> int:
    """How many bytes of an attachment's record its CRC is of: all fields before it."""
    at = 16
    for size in (4, 4, 8):  # name, media type, data
        at += size + int.from_bytes(content[at : at + size], "little")
    return at


def _mask(table: dict[int, Topic]) -> npt.NDArray[np.bool_]:
    mask = np.zeros(CHANNELS, dtype=np.bool_)
    mask[list(table)] = True
    return mask
