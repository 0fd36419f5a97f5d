"""ROS 1 bags: whole ones as rosbags reads them, damaged ones with every loss counted."""

from __future__ import annotations

import struct
import tracemalloc
from itertools import permutations
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

from formats import bag
from formats.errors import FormatError, Notes
from formats.log import Container, Topic
from tests.bag_files import (
    Bag,
    Raw,
    bag_header,
    connection_record,
    drive,
    make_bag,
    message_record,
    pack,
    raws,
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


def read(path: Path, raw: bytes, max_chunk: int = bag.MAX_CHUNK) -> tuple[list[Raw], Notes]:
    """Write these bytes, read them as a bag."""
    path.write_bytes(raw)
    notes = Notes()
    log = bag.open_file(path, notes, max_chunk)
    found = raws(log)
    log.close()
    return found, notes


def told(notes: Notes) -> set[str]:
    return {note.problem for note in notes}


# ---------------------------------------------------------------------------- whole files


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
    found, notes = read(tmp_path / "x.bag", make_bag(messages, order=order, index=index).raw)
    assert found == messages
    assert not notes.of("lost")


def test_chunks_that_overlap_in_time_are_merged(tmp_path: Path) -> None:
    messages = drive(300)
    shuffled = messages[::2] + messages[1::2]
    for kind in KINDS:
        found, notes = read(tmp_path / "x.bag", make_bag(shuffled, kind, 4_000).raw)
        assert found == messages
        assert list(notes) == []


def test_a_small_chunk_cache_gives_the_same(tmp_path: Path) -> None:
    messages = drive(300)
    raw = make_bag(messages[::3] + messages[1::3] + messages[2::3], "lz4", 4_000).raw
    found, notes = read(tmp_path / "x.bag", raw, max_chunk=6_000)
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
    found, _ = read(tmp_path / "x.bag", make_bag(messages, chunk=500).raw)
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


# ---------------------------------------------------------------------------- faults


def test_unindexed_bag_is_read_in_full(tmp_path: Path) -> None:
    messages = drive()
    for kind in KINDS:
        found, notes = read(tmp_path / "x.bag.active", make_bag(messages, kind, index=False).raw)
        assert found == messages
        assert [note.kind for note in notes] == ["warning"]
        assert "no index" in notes.of("warning")[0].problem


def there(made: Bag, cut: int, kind: str) -> int:
    """Messages whose bytes lie before a cut, by the codec's own blocks."""
    whole = [place for place in made.chunks if place.end <= cut]
    count = sum(len(place.messages) for place in whole)
    for place in made.chunks[len(whole) : len(whole) + 1]:
        readable = 0
        if kind == "none":
            readable = cut - place.data
        elif kind == "lz4":  # blocks of 64 kB, each behind its size; a bz2 block holds 900 kB
            pos = place.data + 7
            while pos + 4 <= cut:
                size = struct.unpack_from("<I", made.raw, pos)[0] & 0x7FFFFFFF
                pos += 4 + size
                readable += 65536 * (size > 0 and pos <= cut)
        count += sum(1 for _, end in place.offsets if end <= readable)
    return count


@pytest.mark.parametrize("kind", KINDS)
def test_cut_anywhere(tmp_path: Path, kind: str) -> None:
    """54 even cuts of a bag of 300-kB chunks: everything that is there, and the loss is told."""
    messages = drive(1_200, 2_000)
    made = make_bag(messages, kind, 300_000)
    physically = got = 0
    for step in range(1, 55):
        cut = len(made.raw) * step // 55
        try:
            found, notes = read(tmp_path / "x.bag", made.raw[:cut])
        except FormatError:
            assert there(made, cut, kind) == 0
            continue
        assert found == messages[: len(found)]
        assert cut >= made.index_pos or notes.of("lost")
        assert len(found) >= there(made, cut, kind)
        physically += there(made, cut, kind)
        got += len(found)
    assert physically > 20_000
    assert got >= physically  # 98 % was asked for


def test_cut_inside_the_index_loses_nothing(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages)
    for cut in (made.index_pos, made.index_pos + 50, len(made.raw) - 3):
        found, notes = read(tmp_path / "x.bag", made.raw[:cut])
        assert found == messages
        assert not notes.of("lost")
        assert len(notes.of("warning")) <= 2


def test_cut_inside_the_bag_header(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no readable record"):
        read(tmp_path / "x.bag", make_bag(drive()).raw[:1_000])


def spoil(raw: bytes, pos: int, new: bytes) -> bytes:
    return raw[:pos] + new + raw[pos + len(new) :]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("index", [True, False])
def test_damaged_chunk_header(tmp_path: Path, kind: str, index: bool) -> None:
    """The messages behind it are found by their own records, or by the compression's magic."""
    messages = drive()
    made = make_bag(messages, kind, index=index)
    raw = spoil(made.raw, made.chunks[2].pos + 4, b"\xff" * 8)
    found, notes = read(tmp_path / "x.bag", raw)
    assert found == messages
    assert told(notes) & {"damaged bytes between records", "damaged chunk"}


@pytest.mark.parametrize("kind", ["lz4", "bz2"])
@pytest.mark.parametrize("index", [True, False])
def test_a_chunk_that_is_gone_is_counted_by_topic(tmp_path: Path, kind: str, index: bool) -> None:
    messages = drive()
    made = make_bag(messages, kind, index=index)
    place = made.chunks[2]
    raw = spoil(made.raw, place.pos, bytes(place.end - place.pos))
    found, notes = read(tmp_path / "x.bag", raw)
    assert found == [m for m in messages if m not in place.messages]
    lost = {note.topic: note.count for note in notes.of("lost") if note.topic}
    assert lost == {
        name: sum(m[0] == name for m in place.messages) for name in ("/scan", "/odom", "/tf")
    }


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("length", [0, 50, 300, 1_000, 2_000, 2**31, 2**32 - 1])
def test_damaged_message_length_costs_that_message(
    tmp_path: Path, index: bool, length: int
) -> None:
    messages = drive()
    made = make_bag(messages, index=index)
    start = made.chunks[1].data + made.chunks[1].offsets[5][0]
    raw = spoil(made.raw, start + 42, u32(length))
    found, notes = read(tmp_path / "x.bag", raw)
    bad = made.chunks[1].messages[5]
    assert found == [m for m in messages if m is not bad]
    assert [(note.topic, note.count) for note in notes.of("lost")] == [(bad[0], 1)]


@pytest.mark.parametrize("index", [True, False])
def test_damaged_message_header_costs_that_message(tmp_path: Path, index: bool) -> None:
    messages = drive()
    made = make_bag(messages, index=index)
    start = made.chunks[1].data + made.chunks[1].offsets[5][0]
    found, notes = read(tmp_path / "x.bag", spoil(made.raw, start + 8, b"XXXX"))
    bad = made.chunks[1].messages[5]
    assert found == [m for m in messages if m is not bad]
    assert notes.total("lost") == 1
    assert not index or notes.of("lost")[0].topic == bad[0]


def test_index_and_message_disagree_on_the_time(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages)
    place = made.chunks[1]
    start = place.data + place.offsets[5][0]
    for pos, new in ((start + 34, u32(1)), (start + 38, u32(999_999_999))):
        found, notes = read(tmp_path / "x.bag", spoil(made.raw, pos, new))
        assert [t for _, t, _ in found] == sorted(t for _, t, _ in found)
        assert sorted(d for _, _, d in found) == sorted(d for _, _, d in messages)
        assert "index and messages disagree" in told(notes)


def test_damaged_index_entries(tmp_path: Path) -> None:
    """Every byte of one index record spoilt in turn: nothing is lost, and something is said."""
    messages = drive(60)
    made = make_bag(messages, chunk=6_000)
    place = made.chunks[1]
    entry = 4 + 47 + 4  # where the index record's entries begin
    for pos in range(place.end, place.end + entry + 24):
        raw = spoil(made.raw, pos, bytes([made.raw[pos] ^ 0x55]))
        found, notes = read(tmp_path / "x.bag", raw)
        assert found == messages, pos - place.end
        assert not notes.of("lost"), pos - place.end


def test_lengths_of_4_gib_are_bounded(tmp_path: Path) -> None:
    messages = drive()
    for kind in KINDS:
        made = make_bag(messages, kind)
        place = made.chunks[2]
        size_field = made.raw.index(b"size=", place.pos) + 5
        for pos in (place.pos, place.data - 4, size_field, 13, made.raw.index(b"conn_count=") + 11):
            found, notes = read(tmp_path / "x.bag", spoil(made.raw, pos, b"\xff\xff\xff\xff"))
            assert found == messages, (kind, pos)
            assert list(notes), (kind, pos)


@pytest.mark.parametrize("claimed", [None, 1_000])
def test_bombs_stop_at_the_limit(tmp_path: Path, claimed: int | None) -> None:
    messages = drive(30)
    made = make_bag(messages, "bz2", index=False)
    data = connection_record(7, "/bomb") + message_record(7, 1, bytes(300_000_000))
    size = len(data) if claimed is None else claimed
    fields = [("compression", b"bz2"), ("op", b"\x05"), ("size", u32(size))]
    found, notes = read(
        tmp_path / "x.bag", made.raw + record(fields, pack("bz2", data)), max_chunk=1 << 24
    )
    assert found == messages
    assert notes.of("lost")


def test_unknown_compression_costs_that_chunk(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages, "lz4")
    place = made.chunks[2]
    raw = spoil(made.raw, made.raw.index(b"=lz4", place.pos), b"=xyz")
    found, notes = read(tmp_path / "x.bag", raw)
    assert found == [m for m in messages if m not in place.messages]
    assert told(notes) == {"compression 'xyz' is not known"}
    assert notes.total("lost") == len(place.messages)


@pytest.mark.parametrize("kind", ["lz4", "bz2"])
def test_damage_inside_compressed_data_is_told(tmp_path: Path, kind: str) -> None:
    messages = drive()
    made = make_bag(messages, kind)
    place = made.chunks[2]
    others = [m for m in messages if m not in place.messages]
    for part in range(1, 9):
        pos = place.data + (place.end - place.data) * part // 9
        found, notes = read(tmp_path / "x.bag", spoil(made.raw, pos, b"\x00\xff\x00\xff"))
        assert [m for m in found if m in others] == others
        assert notes.of("lost")


def test_messages_of_an_unknown_connection(tmp_path: Path) -> None:
    data = connection_record(0, "/a") + message_record(0, 1, b"a") + message_record(9, 2, b"b")
    fields = [("compression", b"none"), ("op", b"\x05"), ("size", u32(len(data)))]
    head = b"#ROSBAG V2.0\n" + bag_header(0, 0, 0)
    found, notes = read(tmp_path / "x.bag", head + record(fields, data))
    assert found == [("/a", 1, b"a")]
    assert [(note.problem, note.count) for note in notes.of("lost")] == [
        ("messages of an unknown connection", 1)
    ]


def test_glued_bags_and_junk(tmp_path: Path) -> None:
    messages = drive()
    for index in (True, False):
        first = make_bag(messages[:150], index=index).raw
        second = make_bag(messages[150:], "lz4", index=index).raw
        found, notes = read(tmp_path / "x.bag", first + second)
        assert found == messages
        assert not notes.of("lost")
        assert "another bag is glued to its end; read as one" in told(notes)
    found, notes = read(tmp_path / "x.bag", make_bag(messages).raw + b"junk" * 100)
    assert found == messages
    assert told(notes) == {"400 bytes of junk after the end"}


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"#ROSRECORD V1.2\n" + bytes(100), "version 1.2, not 2.0"),
        (b"#ROSBAG V1.3\n" + bytes(100), "version 1.3, not 2.0"),
        (b"#ROSBAG V2.0\n", "no readable record"),
    ],
)
def test_other_versions_and_empty_files_are_refused(tmp_path: Path, raw: bytes, said: str) -> None:
    with pytest.raises(FormatError, match=said):
        read(tmp_path / "x.bag", raw)


def test_an_empty_file_is_refused(tmp_path: Path) -> None:
    assert not bag.fits(tmp_path / "x", b"")
    with pytest.raises(FormatError, match="cannot be read"):
        read(tmp_path / "x.bag", b"")


def test_encrypted_bag_is_refused(tmp_path: Path) -> None:
    head = bag_header(5_000, 1, 1, [("encryptor", b"rosbag/AesCbcEncryptor")])
    with pytest.raises(FormatError, match="is encrypted \\(rosbag/AesCbcEncryptor\\)"):
        read(tmp_path / "x.bag", b"#ROSBAG V2.0\n" + head)


def test_bad_topic_names_and_damaged_definitions_read(tmp_path: Path) -> None:
    names = ["/a\udcff", "/\x1b[31m", "/" + "x" * 60_000]
    data = b"".join(connection_record(n, name) for n, name in enumerate(names))
    data = data.replace(b"md5sum", b"md\x00\xffum").replace(b"string data", b"\xff\xfe{}[;; dat")
    data += b"".join(message_record(n, n, b"x") for n in range(3))
    fields = [("compression", b"none"), ("op", b"\x05"), ("size", u32(len(data)))]
    head = b"#ROSBAG V2.0\n" + bag_header(0, 0, 0)
    found, notes = read(tmp_path / "x.bag", head + record(fields, data))
    assert [name for name, _, _ in found] == ["/a\\xff", names[1], names[2]]
    assert not notes.of("lost")


def test_unknown_records_are_skipped(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages, index=False)
    odd = record([("op", b"\x5a"), ("what", b"ever")], b"data")
    at = made.chunks[1].pos
    found, notes = read(tmp_path / "x.bag", made.raw[:at] + odd + made.raw[at:])
    assert found == messages
    assert "record of unknown kind 90 skipped" in told(notes)


def test_losses_are_counted_once_over_several_passes(tmp_path: Path) -> None:
    made = make_bag(drive())
    start = made.chunks[1].data + made.chunks[1].offsets[5][0]
    path = tmp_path / "x.bag"
    path.write_bytes(spoil(made.raw, start + 42, u32(3)))
    notes = Notes()
    log = bag.open_file(path, notes)
    for _ in range(3):
        raws(log)
    assert notes.total("lost") == 1
    assert not log.container.whole


# ---------------------------------------------------------------------------- random damage

SOUND = {kind: make_bag(drive(90, 300), kind, 6_000) for kind in KINDS}
BARE = {kind: make_bag(drive(90, 300), kind, 6_000, index=False) for kind in KINDS}


def check_damage(path: Path, kind: str, index: bool, flips: list[tuple[int, int]]) -> None:
    """The same, an error of ours, or something said; never more than there was.

    What no bag can show is left out: a changed payload where the compression has no checksum, and
    text of a connection that is recorded once.
    """
    made = (SOUND if index else BARE)[kind]
    raw = bytearray(made.raw)
    for place, value in flips:
        raw[place % len(raw)] ^= value
    before = drive(90, 300)
    try:
        found, notes = read(path, bytes(raw))
    except FormatError:
        return
    said = notes.of("lost") + notes.of("warning")
    assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
    assert len(found) <= len(before)
    if not said:
        assert len(found) == len(before)
        if index:
            assert [time for _, time, _ in found] == [time for _, time, _ in before]
        if kind != "none":
            assert [data for _, _, data in found] == [data for _, _, data in before]


flips = st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 255)), min_size=1, max_size=4)


@given(st.sampled_from(KINDS), st.booleans(), flips)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_random_damage(
    tmp_path_factory: pytest.TempPathFactory, kind: str, index: bool, flips: list[tuple[int, int]]
) -> None:
    check_damage(tmp_path_factory.getbasetemp() / "damaged.bag", kind, index, flips)


@pytest.mark.slow
@given(st.sampled_from(KINDS), st.booleans(), flips)
@settings(max_examples=2_000, deadline=None)
def test_random_damage_at_length(
    tmp_path_factory: pytest.TempPathFactory, kind: str, index: bool, flips: list[tuple[int, int]]
) -> None:
    check_damage(tmp_path_factory.getbasetemp() / "damaged.bag", kind, index, flips)
