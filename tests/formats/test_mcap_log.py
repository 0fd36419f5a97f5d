from __future__ import annotations

import json
import os
import random
from collections.abc import Iterable
from pathlib import Path

import pytest
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from formats.errors import Notes
from formats.log import Log
from formats.mcap import merge as mcap_merge
from formats.mcap import records as r
from formats.mcap.log import McapLog, fits, open_file
from tests.mcap_files import ALL, McapBytes, chunk, message, scan_definitions

Read = list[tuple[str, int, bytes]]
BASE = 1_600_000_000_000_000_000


def save(folder: Path, data: bytes, name: str = "log.mcap") -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def read(log: Log) -> Read:
    return [(m.topic.name, m.time_ns, bytes(m.data)) for m in log.messages()]


def by_mcap(path: Path) -> Read:
    """What mcap's own streaming reader finds, sorted by time, file order where equal."""
    channels: dict[int, str] = {}
    found: Read = []
    with path.open("rb") as file:
        for record in StreamReader(file).records:
            if type(record).__name__ == "Channel":
                channels[record.id] = record.topic
            elif type(record).__name__ == "Message":
                found.append((channels[record.channel_id], record.log_time, record.data))
    return sorted(found, key=lambda item: item[1])


def file_of(times: Iterable[int], **options: object) -> McapBytes:
    """Two topics, /scan1 at these times and /scan2 3 ns later."""
    file = McapBytes(**options).add(*scan_definitions(2))  # type: ignore[arg-type]
    for time in times:
        file.messages(1, [time]).messages(2, [time + 3])
    return file


def test_conformance_files_give_their_messages_in_time_order(shared_data: Path) -> None:
    files = sorted((shared_data / "mcap_conformance").rglob("*.mcap"))
    assert len(files) == 416
    for path in files:
        records = json.loads(path.with_suffix(".json").read_text())["records"]
        fields = [dict(item["fields"]) for item in records if item["type"] == "Message"]
        expected = [("example", int(f["log_time"]), bytes(map(int, f["data"]))) for f in fields]
        notes = Notes()
        log = open_file(path, notes)
        assert read(log) == sorted(expected, key=lambda item: item[1]), path.name
        assert not list(notes), path.name
        assert log.container.whole
        written = [dict(item["fields"]) for item in records if item["type"] == "Attachment"]
        assert [(name, kind, list(data)) for name, kind, data in log.attachments()] == [
            (f["name"], f["media_type"], [int(byte) for byte in f["data"]]) for f in written
        ]
        written = [dict(item["fields"]) for item in records if item["type"] == "Metadata"]
        assert list(log.metadata()) == [(f["name"], f["metadata"]) for f in written]
        log.close()


@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
@pytest.mark.parametrize("features", [ALL, ALL - {"mx"}, ALL - {"chx"}, {"ch"}, set()])
@pytest.mark.parametrize("order", ["sorted", "jumbled", "reversed", "overlapping"])
def test_equal_to_mcaps_own_reader(
    compression: str, features: set[str], order: str, tmp_path: Path
) -> None:
    times = list(range(BASE, BASE + 1000, 10))
    if order == "jumbled":
        random.Random(3).shuffle(times)
    elif order == "reversed":
        times.reverse()
    elif order == "overlapping":  # every message a bit off, so that neighbouring chunks overlap
        times = [time + random.Random(time).randrange(60) for time in times]
    path = save(tmp_path, file_of(times, compression=compression, features=features).finish())
    notes = Notes()
    log = open_file(path, notes)
    assert read(log) == by_mcap(path)
    assert len(read(log)) == 200  # a second pass
    assert not list(notes)
    assert log.container.whole
    assert log.container.compression == ("none" if not compression or not features else compression)


@pytest.mark.parametrize("compression", ["", "zstd"])
def test_equal_to_rosbags(compression: str, tmp_path: Path) -> None:
    path = save(tmp_path, file_of(range(BASE, BASE + 500, 10), compression=compression).finish())
    with AnyReader([path]) as reader:
        expected = [(c.topic, time, bytes(data)) for c, time, data in reader.messages()]
    assert read(open_file(path, Notes())) == expected


def test_random_chunks_merge_in_little_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # So small that chunks are dropped and opened again, and payloads are copied out.
    monkeypatch.setattr(mcap_merge, "KEPT_BYTES", 3000)
    monkeypatch.setattr(mcap_merge, "PIECE_BYTES", 500)
    rng = random.Random(7)
    for _ in range(20):
        times = [BASE + rng.randrange(rng.choice([5, 300, 5000])) for _ in range(150)]
        file = file_of(times, chunk_messages=rng.choice([1, 7, 40]))
        path = save(tmp_path, file.finish())
        assert read(open_file(path, Notes())) == by_mcap(path)


def test_ties_keep_the_order_of_the_file_across_chunks(tmp_path: Path) -> None:
    # The second chunk begins before the first and ends with it.
    file = McapBytes(chunk_messages=3).add(*scan_definitions(1))
    for body, time in enumerate([5, 9, 9, 1, 9, 9, 9, 9, 9]):
        file.add(r.RawMessage(1, body, time, time, bytes([body])))
    log = open_file(save(tmp_path, file.finish()), Notes())
    assert [m.data[0] for m in log.messages()] == [3, 0, 1, 2, 4, 5, 6, 7, 8]


def test_only_chunks_with_the_wanted_topics_are_opened(tmp_path: Path) -> None:
    file = McapBytes(chunk_messages=5).add(*scan_definitions(2))
    file.messages(1, range(5)).messages(2, range(5, 10)).messages(1, range(10, 15))
    data = bytearray(file.finish())
    begin, end = file.chunks[1]
    data[begin + 60 : end] = bytes(end - begin - 60)  # the chunk of /scan2 is unreadable
    notes = Notes()
    log = open_file(save(tmp_path, bytes(data)), notes)
    assert log.container.state == "complete (CRC ok)"
    one, two = log.topics()
    assert [m.time_ns for m in log.messages([one])] == [*range(5), *range(10, 15)]
    assert not list(notes)
    assert list(log.messages([two])) == []
    assert [(n.kind, n.topic, n.count) for n in notes] == [("lost", "/scan2", 5)]
    assert not log.container.whole
    list(log.messages())
    assert notes.total("lost") == 5  # counted once


def test_topics_types_and_encodings(tmp_path: Path) -> None:
    file = McapBytes(profile="").add(
        r.Schema(1, "sensor_msgs/LaserScan", "ros1msg", b"float32[] ranges"),
        r.Schema(2, "sensor_msgs/msg/LaserScan", "ros2msg", b"float32[] ranges"),
        r.Schema(3, "foxglove.LaserScan", "protobuf", b"\x0a"),
        r.Schema(4, "Anything", "jsonschema", b"{}"),
        r.Schema(5, "std_srvs/srv/Trigger_Event", "ros2msg", b"service_msgs/ServiceEventInfo info"),
        r.Channel(1, 1, "/a", "ros1", {"latching": "1"}),
        r.Channel(2, 2, "/b", "cdr", {"offered_qos_profiles": "- durability: 1\n  depth: 10"}),
        r.Channel(3, 3, "/c", "protobuf", {"offered_qos_profiles": "- durability: 2"}),
        r.Channel(4, 4, "/d", "json", {"offered_qos_profiles": "- durability: transient_local"}),
        r.Channel(5, 5, "/e/_service_event", "cdr", {}),
        r.Channel(6, 0, "/f", "", {}),
        r.Channel(7, 2, "/b", "cdr", {}),  # a second publisher of /b
        r.Channel(8, 4, "/b", "json", {}),  # another type on the same name
    )
    for channel in range(1, 9):
        file.messages(channel, [channel])
    notes = Notes()
    log = open_file(save(tmp_path, file.finish()), notes)
    assert [(t.name, t.type, t.encoding, t.definition_format, t.count) for t in log.topics()] == [
        ("/a", "sensor_msgs/msg/LaserScan", "ros1", "ros1msg", 1),
        ("/b", "Anything", "json", "jsonschema", 1),
        ("/b", "sensor_msgs/msg/LaserScan", "cdr", "ros2msg", 2),
        ("/c", "foxglove.LaserScan", "protobuf", "protobuf", 1),
        ("/d", "Anything", "json", "jsonschema", 1),
        ("/e/_service_event", "std_srvs/srv/Trigger_Event", "cdr", "ros2msg", 1),
        ("/f", "", "", "", 1),
    ]
    assert {t.name for t in log.topics() if t.latched} == {"/a", "/b", "/d"}
    assert len(read(log)) == 8
    assert not list(notes)


@pytest.mark.parametrize(("profile", "encoding"), [("ros1", "ros1"), ("ros2", "cdr"), ("x", "")])
def test_a_channel_without_encoding_takes_the_profiles(
    profile: str, encoding: str, tmp_path: Path
) -> None:
    file = McapBytes(profile=profile).add(r.Channel(1, 0, "/a", "", {})).messages(1, [1])
    log = open_file(save(tmp_path, file.finish()), Notes())
    assert log.topics()[0].encoding == encoding
    assert log.container.kind == f"MCAP {profile}"


def test_container_tells_times_and_size(tmp_path: Path) -> None:
    data = file_of(range(BASE, BASE + 100, 10)).finish()
    container = open_file(save(tmp_path, data), Notes()).container
    assert (container.start_ns, container.end_ns) == (BASE, BASE + 93)
    assert (container.size, container.compression) == (len(data), "zstd")
    assert container.state == "complete (CRC ok)"


def test_attachments_and_metadata(tmp_path: Path) -> None:
    file = McapBytes().add(
        r.Attachment(1, 2, "../../x", "image/png", b"first", 1),
        r.Attachment(1, 2, "two", "", b"second", 1),
        r.Metadata("run", {"a": "1", "b": "2"}),
    )
    data = bytearray(file.finish())
    log = open_file(save(tmp_path, bytes(data)), Notes())
    assert [(name, kind, bytes(body)) for name, kind, body in log.attachments()] == [
        ("../../x", "image/png", b"first"),
        ("two", "", b"second"),
    ]
    assert list(log.metadata()) == [("run", {"a": "1", "b": "2"})]
    data[data.index(b"first")] ^= 1
    notes = Notes()
    log = open_file(save(tmp_path, bytes(data)), notes)
    assert [name for name, _, _ in log.attachments()] == ["two"]
    assert [note.problem for note in notes] == ["attachment whose CRC does not match"]


def test_times_beyond_63_bits_are_the_last(tmp_path: Path) -> None:
    log = open_file(save(tmp_path, file_of([0, 2**64 - 10]).finish()), Notes())
    assert [m.time_ns for m in log.messages()] == [0, 3, 2**63 - 1, 2**63 - 1]


def test_views_outlive_the_log(tmp_path: Path) -> None:
    log = open_file(save(tmp_path, file_of([1], compression="").finish()), Notes())
    first = next(iter(log.messages())).data
    log.close()
    assert bytes(first[:2]) == b"\1\0"


def test_a_file_that_grows_is_read_as_far_as_it_was(tmp_path: Path) -> None:
    file = file_of(range(0, 1000, 10))
    data = file.finish()
    behind = file.chunks[10][1] + 30
    path = save(tmp_path, data[:behind])
    log = open_file(path, Notes())
    with path.open("ab") as more:
        more.write(data[behind:])
    assert len(read(log)) == 110
    assert len(read(open_file(path, Notes()))) == 200


@pytest.mark.parametrize("features", [ALL, {"ch"}, set()])
def test_a_file_that_shrinks_is_a_counted_loss(features: set[str], tmp_path: Path) -> None:
    path = save(tmp_path, file_of(range(20_000), features=features).finish())
    notes = Notes()
    log = open_file(path, notes)
    os.truncate(path, 100_000)
    found = read(log)
    assert found == sorted(found, key=lambda item: item[1])
    assert len(found) < 40_000
    assert notes.total("lost") > 0
    assert {note.problem for note in notes} == {"the file was cut while it was read"}


@pytest.mark.parametrize("name", ["-dash.mcap", "no extension", "log.bag", "ü\n.txt"])
def test_names_do_not_matter(name: str, tmp_path: Path) -> None:
    path = save(tmp_path, file_of([1, 2]).finish(), name)
    with path.open("rb") as file:
        assert fits(path, file.read(4096))
    assert len(read(open_file(path, Notes()))) == 4
    assert not fits(path, b"#ROSBAG V2.0\n")


def test_wrapped_files_are_read_from_their_copy_but_named_as_given(tmp_path: Path) -> None:
    data = file_of([1, 2]).finish()
    copy = save(tmp_path, data[:-8], "copy")
    notes = Notes()
    log = open_file(tmp_path / "log.mcap.zst", notes, unpacked=copy)
    assert len(read(log)) == 4
    assert [note.path for note in notes] == [str(tmp_path / "log.mcap.zst")]


def resident_bytes() -> int:
    """Of this process now, mapped pages of files included."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize("compression", ["", "zstd"])
def test_memory_stays_flat(compression: str, tmp_path: Path) -> None:
    path = tmp_path / "big.mcap"
    body = os.urandom(4096)
    with path.open("wb") as out:
        head = McapBytes().add(*scan_definitions(1))
        head.close_chunk()
        out.write(head.out)
        for number in range(1000):
            times = range(number * 256, number * 256 + 256)
            records = [message(1, time, body) for time in times]
            out.write(chunk(records, (times[0], times[-1]), compression))
    log = open_file(path, Notes())
    before, peak, count = resident_bytes(), 0, 0
    for count, _ in enumerate(log.messages(), 1):
        if count % 2000 == 0:
            peak = max(peak, resident_bytes())
    assert count == 256_000  # 1 GB of messages
    assert peak - before < 150 << 20


def test_the_log_is_a_log() -> None:
    log: type[Log] = McapLog
    assert log
