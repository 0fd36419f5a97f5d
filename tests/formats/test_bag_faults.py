"""Hostile and odd ROS 1 bags."""

from __future__ import annotations

from pathlib import Path

import pytest

from formats.bag import log as bag
from formats.errors import FormatError, Notes
from tests.bag_files import (
    bag_header,
    connection_record,
    drive,
    make_bag,
    message_record,
    pack,
    raws,
    read_bag,
    record,
    spoil,
    told,
    u32,
)

KINDS = ["none", "lz4", "bz2"]


@pytest.mark.parametrize("claimed", [None, 1_000])
def test_bombs_stop_at_the_limit(tmp_path: Path, claimed: int | None) -> None:
    messages = drive(30)
    made = make_bag(messages, "bz2", index=False)
    data = connection_record(7, "/bomb") + message_record(7, 1, bytes(300_000_000))
    size = len(data) if claimed is None else claimed
    fields = [("compression", b"bz2"), ("op", b"\x05"), ("size", u32(size))]
    found, notes = read_bag(
        tmp_path / "x.bag", made.raw + record(fields, pack("bz2", data)), max_chunk=1 << 24
    )
    assert found == messages
    assert notes.of("lost")


def test_unknown_compression_costs_that_chunk(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages, "lz4")
    place = made.chunks[2]
    raw = spoil(made.raw, made.raw.index(b"=lz4", place.pos), b"=xyz")
    found, notes = read_bag(tmp_path / "x.bag", raw)
    assert found == [m for m in messages if m not in place.messages]
    assert set(told(notes)) == {"compression 'xyz' is not known"}
    assert notes.total("lost") == len(place.messages)


@pytest.mark.parametrize("kind", ["lz4", "bz2"])
def test_damage_inside_compressed_data_is_told(tmp_path: Path, kind: str) -> None:
    messages = drive()
    made = make_bag(messages, kind)
    place = made.chunks[2]
    others = [m for m in messages if m not in place.messages]
    for part in range(1, 9):
        pos = place.data + (place.end - place.data) * part // 9
        found, notes = read_bag(tmp_path / "x.bag", spoil(made.raw, pos, b"\x00\xff\x00\xff"))
        assert [m for m in found if m in others] == others
        assert notes.of("lost")


def test_messages_of_an_unknown_connection(tmp_path: Path) -> None:
    data = connection_record(0, "/a") + message_record(0, 1, b"a") + message_record(9, 2, b"b")
    fields = [("compression", b"none"), ("op", b"\x05"), ("size", u32(len(data)))]
    head = b"#ROSBAG V2.0\n" + bag_header(0, 0, 0)
    found, notes = read_bag(tmp_path / "x.bag", head + record(fields, data))
    assert found == [("/a", 1, b"a")]
    assert [(note.problem, note.count) for note in notes.of("lost")] == [
        ("messages of an unknown connection", 1)
    ]


def test_glued_bags_and_junk(tmp_path: Path) -> None:
    messages = drive()
    for index in (True, False):
        first = make_bag(messages[:150], index=index).raw
        second = make_bag(messages[150:], "lz4", index=index).raw
        found, notes = read_bag(tmp_path / "x.bag", first + second)
        assert found == messages
        assert not notes.of("lost")
        assert "another bag is glued to its end; read as one" in told(notes)
    found, notes = read_bag(tmp_path / "x.bag", make_bag(messages).raw + b"junk" * 100)
    assert found == messages
    assert told(notes) == ["400 bytes of junk after the end"]


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
        read_bag(tmp_path / "x.bag", raw)


def test_an_empty_file_is_refused(tmp_path: Path) -> None:
    assert not bag.fits(tmp_path / "x", b"")
    with pytest.raises(FormatError, match="cannot be read"):
        read_bag(tmp_path / "x.bag", b"")


def test_encrypted_bag_is_refused(tmp_path: Path) -> None:
    head = bag_header(5_000, 1, 1, [("encryptor", b"rosbag/AesCbcEncryptor")])
    with pytest.raises(FormatError, match="is encrypted \\(rosbag/AesCbcEncryptor\\)"):
        read_bag(tmp_path / "x.bag", b"#ROSBAG V2.0\n" + head)


def test_bad_topic_names_and_damaged_definitions_read(tmp_path: Path) -> None:
    names = ["/a\udcff", "/\x1b[31m", "/" + "x" * 60_000]
    data = b"".join(connection_record(n, name) for n, name in enumerate(names))
    data = data.replace(b"md5sum", b"md\x00\xffum").replace(b"string data", b"\xff\xfe{}[;; dat")
    data += b"".join(message_record(n, n, b"x") for n in range(3))
    fields = [("compression", b"none"), ("op", b"\x05"), ("size", u32(len(data)))]
    head = b"#ROSBAG V2.0\n" + bag_header(0, 0, 0)
    found, notes = read_bag(tmp_path / "x.bag", head + record(fields, data))
    assert [name for name, _, _ in found] == ["/a\\xff", names[1], names[2]]
    assert not notes.of("lost")


def test_unknown_records_are_skipped(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages, index=False)
    odd = record([("op", b"\x5a"), ("what", b"ever")], b"data")
    at = made.chunks[1].pos
    found, notes = read_bag(tmp_path / "x.bag", made.raw[:at] + odd + made.raw[at:])
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
