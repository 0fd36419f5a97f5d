"""What the writer writes is read by others, and is what others would have written."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from formats.errors import Notes
from formats.mcap import records as r
from formats.mcap.log import open_file
from formats.mcap.write_records import block
from formats.mcap.writing import CHUNK_SIZE, McapWriter

LIBRARY = "mcap-python/1.6.0"
TIMES = np.array([1_664_000_000_123_456_789, 5, 0, 2**62, 7], dtype=np.int64)  # in no order
# What the features of the conformance suite stand for.
FEATURES = {
    "ch": r.CHUNK,
    "mx": r.MESSAGE_INDEX,
    "chx": r.CHUNK_INDEX,
    "rsh": r.SCHEMA,
    "rch": r.CHANNEL,
    "st": r.STATISTICS,
    "ax": r.ATTACHMENT_INDEX,
    "mdx": r.METADATA_INDEX,
    "sum": r.SUMMARY_OFFSET,
}


class Call(NamedTuple):
    """One message: channel, sequence, log time, publish time, payload."""

    channel: int
    sequence: int
    log: int
    publish: int
    data: bytes


def messages(count: int, size: int) -> list[Call]:
    """Random messages on two channels, in no order of time."""
    random = np.random.default_rng(count)
    stamps = random.integers(0, 2**62, (count, 2)).tolist()
    numbers = random.integers(1, 3, count).tolist()
    sizes = random.integers(0, size, count).tolist()
    return [
        Call(numbers[i], i, stamps[i][0], stamps[i][1], random.bytes(sizes[i]))
        for i in range(count)
    ]


def ours(calls: Sequence[Call], compression: str = "zstd") -> bytes:
    file = BytesIO()
    writer = McapWriter(file, "ros2", LIBRARY, compression=compression)
    writer.metadata("written", {"time": "now", "\N{GREEK SMALL LETTER PI}": "3.14"})
    writer.attachment("plan.png", "image/png", b"\x89PNG not really", 3, 4)
    assert writer.schema("a/msg/A", "ros2msg", b"float64 x") == 1
    assert writer.channel("/a", "cdr", 1, {"offered_qos_profiles": "- history: 1\n"}) == 1
    assert writer.channel("/b", "", 0) == 2
    for channel, sequence, log, publish, data in calls:
        writer.message(channel, log, data, publish, sequence)
    writer.finish()
    return file.getvalue()


def theirs(calls: Sequence[Call], compression: str = "zstd") -> bytes:
    """The same calls of mcap's own writer."""
    from mcap.writer import CompressionType, Writer

    file = BytesIO()
    kind = CompressionType.ZSTD if compression else CompressionType.NONE
    writer = Writer(file, compression=kind, enable_data_crcs=True, chunk_size=CHUNK_SIZE)
    writer.start("ros2", LIBRARY)
    writer.add_metadata("written", {"time": "now", "\N{GREEK SMALL LETTER PI}": "3.14"})
    writer.add_attachment(4, 3, "plan.png", "image/png", b"\x89PNG not really")
    writer.register_schema("a/msg/A", "ros2msg", b"float64 x")
    writer.register_channel("/a", "cdr", 1, {"offered_qos_profiles": "- history: 1\n"})
    writer.register_channel("/b", "", 0)
    for channel, sequence, log, publish, data in calls:
        writer.add_message(channel, log, data, publish, sequence)
    writer.finish()
    return file.getvalue()


@pytest.mark.parametrize(("count", "size"), [(1, 1), (10, 50), (300, 30_000)])
def test_mcaps_own_writer_writes_the_same_bytes(count: int, size: int) -> None:
    calls = messages(count, size)
    assert ours(calls, "") == theirs(calls, "")


def told(data: bytes) -> tuple[Any, ...]:
    """All that mcap's reader finds by way of the summary, its checksums checked."""
    from mcap.reader import make_reader

    reader = make_reader(BytesIO(data), validate_crcs=True)
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    return (
        reader.get_header(),
        list(reader.iter_messages()),
        list(reader.iter_attachments()),
        list(reader.iter_metadata()),
        (summary.schemas, summary.channels, vars(summary.statistics)),
        [vars(index) for index in summary.metadata_indexes + summary.attachment_indexes],
        [(index.message_start_time, index.message_end_time) for index in summary.chunk_indexes],
        [sorted(index.message_index_offsets) for index in summary.chunk_indexes],
        [index.uncompressed_size for index in summary.chunk_indexes],
    )


def told_in_order(data: bytes) -> list[Any]:
    """The messages that mcap's reader finds in the order of the file, without the summary."""
    from mcap.reader import NonSeekingReader

    reader = NonSeekingReader(BytesIO(data), validate_crcs=True)
    return list(reader.iter_messages(log_time_order=False))


def test_compressed_chunks_say_what_mcaps_own_say() -> None:
    calls = messages(300, 30_000)
    assert len(told(ours(calls))[6]) > 3
    assert told(ours(calls)) == told(theirs(calls))
    assert told_in_order(ours(calls)) == told_in_order(theirs(calls))
    assert [message.sequence for _, _, message in told_in_order(ours(calls))] == list(range(300))


def test_our_reader_finds_every_message_whole(tmp_path: Path) -> None:
    calls = messages(300, 30_000)
    path = tmp_path / "a.mcap"
    path.write_bytes(ours(calls))
    log = open_file(path, Notes())
    found = [(topic.name, time, bytes(data)) for topic, time, data in log.messages()]
    log.close()
    assert log.container.whole
    in_time = sorted(calls, key=lambda call: call.log)
    assert found == [(f"/{'ab'[c.channel - 1]}", c.log, c.data) for c in in_time]


def blocks(
    frames: int, size: int, pieces: int
) -> tuple[BytesIO, list[tuple[int, np.ndarray[Any, Any]]]]:
    """A file of frames on two channels, given in pieces, and the payloads of each."""
    random = np.random.default_rng(frames)
    kinds = [(2, np.dtype([("n", "<u4"), ("x", f"V{size}")])), (1, np.dtype("<f8"))]
    streams = [
        (number, np.frombuffer(random.bytes(frames * kind.itemsize), dtype=kind))
        for number, kind in kinds
    ]
    file = BytesIO()
    writer = McapWriter(file, compression="")
    writer.channel("/a", "", 0)
    writer.channel("/b", "", 0)
    whole = block(times(frames), 40, streams)
    for part in np.array_split(np.arange(frames), pieces):
        writer.block(whole[part])
    writer.finish()
    return file, streams


def times(frames: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    return np.resize(TIMES, frames)


def test_a_block_is_the_same_bytes_as_its_messages_one_by_one() -> None:
    written, streams = blocks(100, 500, 7)
    file = BytesIO()
    writer = McapWriter(file, compression="")
    writer.channel("/a", "", 0)
    writer.channel("/b", "", 0)
    for i, time in enumerate(times(100).tolist()):
        for number, payloads in streams:
            writer.message(number, time, payloads[i].tobytes(), time, 40 + i)
    writer.finish()
    assert written.getvalue() == file.getvalue()


@pytest.mark.parametrize("pieces", [1, 3])
def test_blocks_go_over_many_chunks(pieces: int) -> None:
    frames = 700
    file, streams = blocks(frames, 6_000, pieces)
    _, found, _, _, (_, _, statistics), _, _, indexed, sizes = told(file.getvalue())
    assert len(sizes) == 5  # 4.2 MB
    assert all(CHUNK_SIZE < size <= CHUNK_SIZE + 7_000 for size in sizes[:-1])
    assert indexed == [[1, 2]] * 5
    assert statistics["channel_message_counts"] == {1: frames, 2: frames}
    assert (statistics["message_start_time"], statistics["message_end_time"]) == (0, 2**62)
    assert len(found) == 2 * frames
    in_order = [message for _, _, message in told_in_order(file.getvalue())]
    for at, (number, payloads) in enumerate(streams):
        mine = in_order[at::2]
        assert {message.channel_id for message in mine} == {number}
        assert [message.sequence for message in mine] == list(range(40, 40 + frames))
        assert [message.log_time for message in mine] == times(frames).tolist()
        assert [message.publish_time for message in mine] == times(frames).tolist()
        assert b"".join(message.data for message in mine) == payloads.tobytes()
    by_index = sorted((message.log_time, message.sequence) for _, _, message in found)
    assert by_index == sorted(2 * list(zip(times(frames).tolist(), range(40, 740), strict=True)))


def test_a_large_message_ends_its_chunk_and_definitions_alone_are_kept() -> None:
    file = BytesIO()
    writer = McapWriter(file)
    writer.channel("/a", "", 0)
    for size in (CHUNK_SIZE * 3, 5):
        writer.message(1, size, bytes(size), 0)
    writer.channel("/b", "", 0)
    writer.finish()
    assert told(file.getvalue())[6] == [(CHUNK_SIZE * 3, CHUNK_SIZE * 3), (5, 5)]
    file = BytesIO()
    writer = McapWriter(file)
    writer.channel("/a", "", 0)
    writer.finish()
    header, found, _, _, (_, channels, statistics), *_ = told(file.getvalue())
    assert (header.profile, found) == ("", [])
    assert [channel.topic for channel in channels.values()] == ["/a"]
    assert (statistics["channel_count"], statistics["message_end_time"]) == (1, 0)


def test_conformance_files_without_padding_are_written_byte_for_byte(shared_data: Path) -> None:
    files = sorted((shared_data / "mcap_conformance").rglob("*.mcap"))
    plain = [path for path in files if "-pad" not in path.name]
    assert len(plain) == 208
    for path in plain:
        document = json.loads(path.with_suffix(".json").read_text())
        features = document["meta"]["variant"]["features"]
        without = {opcode for name, opcode in FEATURES.items() if name not in features}
        file = BytesIO()
        writer = McapWriter(file, compression="", without=without)
        for item in document["records"]:
            if item["type"] == "DataEnd":
                break
            write(writer, item["type"], dict(item["fields"]))
        writer.finish()
        assert file.getvalue() == path.read_bytes(), path.name


def write(writer: McapWriter, kind: str, fields: dict[str, Any]) -> None:
    """One record as the suite describes it: numbers as strings, bytes as lists of them."""
    number = {key: int(value) for key, value in fields.items() if str(value).isdecimal()}
    data = bytes(map(int, fields.get("data", ())))
    if kind == "Schema":
        assert writer.schema(fields["name"], fields["encoding"], data) == number["id"]
    elif kind == "Channel":
        encoding, metadata = fields["message_encoding"], fields["metadata"]
        channel = writer.channel(fields["topic"], encoding, number["schema_id"], metadata)
        assert channel == number["id"]
    elif kind == "Message":
        times = number["log_time"], number["publish_time"]
        writer.message(number["channel_id"], times[0], data, times[1], number["sequence"])
    elif kind == "Attachment":
        times = number["log_time"], number["create_time"]
        writer.attachment(fields["name"], fields["media_type"], data, *times)
    elif kind == "Metadata":
        writer.metadata(fields["name"], fields["metadata"])
    else:
        assert kind == "Header"


def test_other_compressions_are_refused_before_anything_is_written() -> None:
    file = io.BytesIO()
    with pytest.raises(ValueError, match="zstd or plain"):
        McapWriter(file, compression="lz4")
    assert file.getvalue() == b""
