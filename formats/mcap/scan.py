"""What is in an MCAP file: by its summary where that holds, else by opening every chunk."""

from __future__ import annotations

from collections import Counter, deque

from formats.compression import crc32
from formats.errors import Kind, Notes, Path
from formats.log import Container
from formats.mcap.blocks import (
    channel_counts,
    entries,
    loaded,
    release,
    walk_block,
)
from formats.mcap.contents import Contents, define
from formats.mcap.losses import UNDEFINED, note_chunk
from formats.mcap.parse import MalformedError, parse
from formats.mcap.records import SCHEMA, Record
from formats.mcap.summary import Summary, read_summary
from formats.mcap.top import Top

PIECE = 16 << 20


def scan(
    path: Path, data: memoryview, notes: Notes, max_chunk: int
) -> tuple[Contents, Container, bool]:
    """Everything in an MCAP file, what the file is, and whether chunks are still to be opened.

    Args:
        path: the name to give in notes.
        data: the whole file, from its magic on.
        notes: where losses and oddities are counted.
        max_chunk: the most bytes that a chunk may decompress to.
    """
    summary = read_summary(data)
    before = notes.total("lost")
    outer = Notes()
    contents = Top(path, data, outer).walk()
    indexed = not list(outer) and _agrees(data, contents, summary)
    if indexed:
        _use(contents, summary)
    else:
        _survey(path, data, notes, max_chunk, contents)
        complete = _complete(contents, summary)
        for note in outer:
            kind: Kind = "warning" if complete and note.kind == "lost" else note.kind
            notes.add(kind, path, note.problem, at=note.at, count=note.count)
        _compare(path, notes, contents, summary, notes.total("lost") - before)
    if notes.total("lost") == before:
        _check_data(path, data, notes, contents)
    _say_cut(path, notes, contents)
    if summary.state in ("CRC wrong", "malformed"):
        notes.warn(path, f"summary not used: {summary.state}; read from end to end")
    return contents, _container(data, contents, summary, indexed), indexed


def _agrees(data: memoryview, contents: Contents, summary: Summary) -> bool:
    """Whether the summary tells all about the records that are really there."""
    if not summary.complete or contents.cut or contents.damaged is not None:
        return False
    for opcode, start, stop, _ in contents.definitions:
        told = summary.schemas if opcode == SCHEMA else summary.channels
        if told.get(int.from_bytes(data[start : start + 2], "little")) != _parsed(
            opcode, data[start:stop]
        ):
            return False
    if not contents.parts[0].counts.keys() <= summary.channels.keys():
        return False
    chunks = [block for block in contents.blocks if not block.run]
    if len(chunks) != len(summary.chunks):
        return False
    for block in chunks:
        index = summary.chunks.get(block.at)
        if index is None or (
            index.message_start_time,
            index.message_end_time,
            index.compression,
            index.compressed_size,
            index.uncompressed_size,
        ) != (
            block.first_ns,
            block.last_ns,
            block.compression,
            block.stop - block.start,
            block.size,
        ):
            return False
    return True


def _parsed(opcode: int, content: memoryview) -> Record | None:
    try:
        return parse(opcode, content)
    except MalformedError:
        return None


def _use(contents: Contents, summary: Summary) -> None:
    part = contents.parts[0]
    part.schemas |= summary.schemas
    part.channels |= summary.channels
    assert summary.statistics is not None
    part.counts = Counter(summary.statistics.channel_message_counts)
    for block in contents.blocks:
        if not block.run and (ids := summary.chunks[block.at].message_index_offsets):
            block.channels = frozenset(ids)


def _survey(path: Path, data: memoryview, notes: Notes, max_chunk: int, contents: Contents) -> None:
    """Open every chunk, in the order of the file, for its channels, counts and times."""
    chunks = [block for block in contents.blocks if not block.run]
    seen = 0
    definitions = deque(contents.definitions)

    def define_until(at: int) -> None:
        while definitions and definitions[0][1] < at:
            opcode, start, stop, number = definitions.popleft()
            define(path, notes, contents.parts[number], opcode, data[start:stop], start)

    chunks_loaded = loaded(data, chunks, max_chunk)
    for block in chunks:
        chunk = next(chunks_loaded)
        define_until(block.at)
        part = contents.parts[block.part]
        walked = walk_block(chunk.data, 0, len(chunk.data))
        for opcode, start, stop in walked.others:
            define(path, notes, part, opcode, chunk.data[start:stop], block.at, inside=True)
        index = entries(chunk.data, walked.messages)
        found = channel_counts(index)
        part.counts += found
        block.channels = frozenset(found)
        if len(index):
            block.first_ns, block.last_ns = int(index["time"].min()), int(index["time"].max())
        lost = note_chunk(path, data, notes, part, block, chunk, index, walked)
        if lost and contents.damaged is None:
            contents.damaged = block.at
        del chunk  # before the next one is loaded, which may be large
        seen += block.stop - block.start
        if seen > 64 << 20:
            release(data)
            seen = 0
    define_until(len(data))
    _check_channels(path, notes, contents)


def _check_channels(path: Path, notes: Notes, contents: Contents) -> None:
    for part in contents.parts:
        for channel in sorted(part.counts.keys() - part.channels.keys()):
            place = f"channel {channel}"
            notes.lose(path, UNDEFINED, at=place, count=part.counts.pop(channel))


def _complete(contents: Contents, summary: Summary) -> bool:
    """Whether sound statistics show that damage between records took no data with it."""
    stats = summary.statistics
    if summary.state != "ok" or stats is None or len(contents.parts) > 1:
        return False
    counts = contents.parts[0].counts
    return (stats.channel_message_counts, stats.attachment_count, stats.metadata_count) == (
        {channel: count for channel, count in counts.items() if count},
        len(contents.attachments),
        len(contents.metadata),
    )


def _compare(path: Path, notes: Notes, contents: Contents, summary: Summary, lost: int) -> None:
    """Count messages that sound statistics speak of and nothing else has missed."""
    if summary.state != "ok" or summary.statistics is None or len(contents.parts) > 1:
        return
    part = contents.parts[0]
    missing = Counter(summary.statistics.channel_message_counts) - part.counts
    if missing.total() <= lost:
        return
    for channel, count in missing.items():
        known = part.channels.get(channel) or summary.channels.get(channel)
        topic = known.topic if known else f"channel {channel}"
        notes.lose(path, "messages that the statistics count are missing", topic=topic, count=count)


def _check_data(path: Path, data: memoryview, notes: Notes, contents: Contents) -> None:
    """Check the data section's CRC where messages have no CRC of their own."""
    for number, part in enumerate(contents.parts):
        at, crc = part.data_end
        bare = any(not block.crc for block in contents.blocks if block.part == number)
        if not crc or not bare:
            continue
        value = 0
        for begin in range(part.begin, at, PIECE):
            value = crc32(data[begin : min(begin + PIECE, at)], value)
            release(data)
        if value != crc:
            contents.damaged = part.begin
            notes.lose(path, "the data section's CRC does not match: some message is damaged")


def _say_cut(path: Path, notes: Notes, contents: Contents) -> None:
    if contents.cut is None:
        return
    kind, problem, at = contents.cut
    place = f"byte {at}"
    times = [(block.first_ns, block.last_ns) for block in contents.blocks if block.channels]
    if times:
        seconds = (max(last for _, last in times) - min(first for first, _ in times)) / 1e9
        place += f", {seconds:.2f} s after its start"
    notes.add(kind, path, problem, at=place)


def _container(data: memoryview, contents: Contents, summary: Summary, indexed: bool) -> Container:
    kinds = {block.compression or "none" for block in contents.blocks}
    filled = [block for block in contents.blocks if block.channels]
    start = min((block.first_ns for block in filled), default=0)
    end = max((block.last_ns for block in filled), default=0)
    if indexed and summary.statistics is not None:
        start, end = summary.statistics[6:8]
    profile = contents.parts[0].profile
    if contents.cut:
        state = f"cut at byte {contents.cut[2]}"
    elif contents.damaged is not None:
        state = f"damaged at byte {contents.damaged}"
    elif indexed:
        state = "complete (CRC ok)"
    else:
        reasons = {"none": "no summary", "no CRC": "summary without CRC", "ok": "no index"}
        state = f"complete ({reasons.get(summary.state, summary.state)})"
    return Container(
        kind=f"MCAP {profile}".strip(),
        compression=", ".join(sorted(kinds)) or "none",
        size=len(data),
        start_ns=start,
        end_ns=end,
        whole=not contents.cut and contents.damaged is None,
        state=state,
    )
