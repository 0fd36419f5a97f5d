"""What a damaged chunk of an MCAP file lost, by topic."""

from __future__ import annotations

from collections import Counter

from formats.errors import Notes, Path
from formats.mcap.blocks import Block, Entries, Loaded, Walked, channel_counts
from formats.mcap.contents import Part
from formats.mcap.parse import HEAD, MalformedError, parse
from formats.mcap.records import MESSAGE_INDEX, MessageIndex

UNDEFINED = "messages on channels that are not defined"


def note_chunk(
    path: Path,
    data: memoryview,
    notes: Notes,
    part: Part,
    block: Block,
    chunk: Loaded,
    index: Entries,
    walked: Walked,
) -> bool:
    """Count what a chunk lost, by topic where the message index behind it tells; whether it did.

    Args:
        path: the file.
        data: its bytes.
        notes: where to count.
        part: the chunk's.
        block: the chunk.
        chunk: what could be had of it.
        index: of the messages that were read from it.
        walked: how far its records go.
    """
    place = f"byte {block.at}"
    if chunk.problem and not chunk.lost:
        notes.warn(path, chunk.problem, at=place)
    if block.run or (not chunk.lost and walked.end == len(chunk.data)):
        return False
    problem = chunk.problem if chunk.lost else "records inside a chunk that cannot be read"
    if block.cut and block.stop == len(data):
        return False  # said once, as the end of the file
    missing = _indexed(data, block.stop) - channel_counts(index)
    for channel, count in missing.items():
        known = part.channels.get(channel)
        topic = known.topic if known else f"channel {channel}"
        notes.lose(path, f"{problem}: messages lost", topic=topic, at=place, count=count)
    if not missing:
        notes.lose(path, problem, at=place)
    return True


def _indexed(data: memoryview, at: int) -> Counter[int]:
    """Messages by channel, as the message indexes behind a chunk say."""
    counts: Counter[int] = Counter()
    while at + HEAD.size <= len(data):
        opcode, size = HEAD.unpack_from(data, at)
        at += HEAD.size
        if opcode != MESSAGE_INDEX or size > len(data) - at:
            break
        try:
            index = parse(opcode, data[at : at + size])
        except MalformedError:
            break
        assert isinstance(index, MessageIndex)
        counts[index.channel_id] += len(index.records)
        at += size
    return counts
