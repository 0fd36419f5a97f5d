"""ROS 1 bags: whole ones as rosbags and we ourselves wrote them."""

from __future__ import annotations

import tracemalloc
from itertools import permutations
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

from formats.bag import log as bag
from formats.errors import Notes
from formats.log import Container, Topic
from tests.bag_files import (
    Raw,
    bag_header,
    connection_record,
    drive,
    make_bag,
    message_record,
    raws,
    read_bag,
    record,
    u32,
)

KINDS = ["none", "lz4", "bz2"]
REAL = [
    "bham_pioneer/amcl_ground_truth_poses_and_estimated_poses.bag",
    "bham_pioneer/trace0.bag",
    "cartographer_backpack/b0-2014-07-21-12-42-53-tiny.bag",
    "crob_lab/guardian_3.bag",
    "crob_lab/jarvis_circular_path_fast.bag",
    "evo/ROS_example.bag",
    "evo/tf_example.bag",
    "kev1n_hector/2021-01-29-20-05-03.bag",
    "olin_neato_2018/middle.bag",
    "plotjuggler/tilt_laser.bag",
    "rosbagjs/example.bag",
    "rosbagjs/example-bz2.bag",
    "rosbagjs/example-lz4.bag",
    "rosbagjs/example-unsorted-chunks.bag",
]


@pytest.mark.parametrize("name", REAL)
def test_real_bags_as_rosbags_reads_them(shared_data: Path, name: str) -> None:
    path = shared_data / "bags" / name
    if not path.is_file():
        pytest.skip(f"no {path}")
    with Reader(path) as reader:
        theirs = [(c.topic, c.msgtype, time, bytes(data)) for c, time, data in reader.messages()]
        counts = {c.topic: 0 for c in reader.connections}
    notes = Notes()
    log = bag.open_file(path, notes)
    ours = [(m.topic.name, m.topic.type, m.time_ns, bytes(m.data)) for m in log.messages()]
    for topic, *_ in theirs:
        counts[topic] += 1
    assert [time for _, _, time, _ in ours] == [time for _, _, time, _ in theirs]
    assert sorted(ours) == sorted(theirs)  # the order of equal times is not rosbags' to say
    assert {t.name: 0 for t in log.topics()} | _summed(log.topics()) == counts
    assert list(notes) == []
    assert log.container.whole
    log.close()


def _summed(topics: list[Topic]) -> dict[str, int]:
    found: dict[str, int] = {}
    for topic in topics:
        found[topic.name] = found.get(topic.name, 0) + (topic.count or 0)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_bags_of_rosbags_writer(tmp_path: Path, kind: str) -> None:
    path, store = tmp_path / "x.bag", get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    if kind != "none":
        writer.set_compression(Writer.CompressionFormat[kind.upper()])
    messages = drive(2_000, 3_000)
    with writer:
        names = {
            name: writer.add_connection(name, "std_msgs/msg/String", typestore=store)
            for name in ("/scan", "/odom", "/tf")
        }
        for topic, time, data in messages:
            writer.write(names[topic], time, data)
    notes = Notes()
    log = bag.open_file(path, notes)
    assert raws(log) == messages
    assert [(t.name, t.type, t.encoding, t.definition_format) for t in log.topics()] == [
        (name, "std_msgs/msg/String", "ros1", "ros1msg") for name in ("/odom", "/scan", "/tf")
    ]
    assert log.container == Container(
        "ROS 1 bag", kind, path.stat().st_size, messages[0][1], messages[-1][1], True, "complete"
    )
    assert list(notes) == []


@pytest.mark.parametrize("order", list(permutations(("conn", "op", "time"))))
@pytest.mark.parametrize("index", [True, False])
def test_header_fields_in_any_order(tmp_path: Path, order: tuple[str, ...], index: bool) -> None:
    messages = drive(60)
    found, notes = read_bag(tmp_path / "x.bag", make_bag(messages, order=order, index=index).raw)
    assert found == messages
    assert not notes.of("lost")


def test_chunks_that_overlap_in_time_are_merged(tmp_path: Path) -> None:
    messages = drive(300)
    shuffled = messages[::2] + messages[1::2]
    for kind in KINDS:
        found, notes = read_bag(tmp_path / "x.bag", make_bag(shuffled, kind, 4_000).raw)
        assert found == messages
        assert list(notes) == []


def test_a_small_chunk_cache_gives_the_same(tmp_path: Path) -> None:
    messages = drive(300)
    raw = make_bag(messages[::3] + messages[1::3] + messages[2::3], "lz4", 4_000).raw
    found, notes = read_bag(tmp_path / "x.bag", raw, max_chunk=6_000)
    assert found == messages
    assert list(notes) == []


@pytest.mark.parametrize("index", [True, False])
def test_memory_does_not_grow_with_the_bag(tmp_path: Path, index: bool) -> None:
    """Ten times the chunks, the same peak: what is decompressed goes once it has been given."""
    peaks = []
    for count in (800, 8_000):
        path = tmp_path / f"{count}.bag"
        path.write_bytes(make_bag(drive(count, 4_000), "lz4", 200_000, index=index).raw)
        tracemalloc.start()
        log = bag.open_file(path, Notes())
        assert sum(1 for _ in log.messages()) == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        log.close()
    assert peaks[1] < peaks[0] + 1_000_000  # of 24 MB more in the chunks


def test_equal_times_keep_the_order_of_the_file(tmp_path: Path) -> None:
    messages = [Raw(f"/t{k % 7}", 1_000, bytes([k])) for k in range(200)]
    found, _ = read_bag(tmp_path / "x.bag", make_bag(messages, chunk=500).raw)
    assert found == messages


def test_topics_are_filtered_and_passes_repeat(tmp_path: Path) -> None:
    messages = drive(300)
    path = tmp_path / "x.bag"
    path.write_bytes(make_bag(messages).raw)
    log = bag.open_file(path, Notes())
    for names in ({"/odom"}, {"/scan", "/tf"}, set()):
        assert raws(log, names) == [m for m in messages if m[0] in names]
    assert raws(log) == messages
    assert [t.count for t in log.topics()] == [100, 100, 100]


def test_two_types_on_one_topic_are_two_topics_and_two_publishers_are_one(tmp_path: Path) -> None:
    head = b"#ROSBAG V2.0\n" + bag_header(0, 0, 0)
    data = (
        connection_record(0, "/a", "std_msgs/String")
        + message_record(0, 1, b"one")
        + connection_record(1, "/a", "std_msgs/Int8", [("latching", b"1")])
        + message_record(1, 2, b"two")
        + connection_record(2, "/a", "std_msgs/String")
        + message_record(2, 3, b"three")
    )
    fields = [("compression", b"none"), ("op", b"\x05"), ("size", u32(len(data)))]
    path = tmp_path / "x.bag"
    path.write_bytes(head + record(fields, data))
    log = bag.open_file(path, Notes())
    assert [(t.type, t.count, t.latched) for t in log.topics()] == [
        ("std_msgs/msg/Int8", 1, True),
        ("std_msgs/msg/String", 2, False),
    ]
    strings = [m.data for m in log.messages([log.topics()[1]])]
    assert strings == [b"one", b"three"]


def test_payloads_of_uncompressed_chunks_are_views(tmp_path: Path) -> None:
    path = tmp_path / "x.bag"
    path.write_bytes(make_bag(drive(9)).raw)
    log = bag.open_file(path, Notes())
    kept = [m.data for m in log.messages()]
    assert all(isinstance(data, memoryview) and data.readonly for data in kept)
    log.close()  # with views still held
    assert [bytes(data) for data in kept] == [data for _, _, data in drive(9)]


def test_no_messages(shared_data: Path) -> None:
    log = bag.open_file(shared_data / "bags/rosbagjs/no-messages.bag", Notes())
    assert raws(log) == []
    assert (log.container.start_ns, log.container.end_ns, log.container.whole) == (0, 0, True)
