"""Folders of rosbag2: split, compressed, with odd or hostile metadata.yaml."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from formats.errors import FormatError, Notes
from formats.rosbag2 import log as rosbag2
from tests.bag_files import Raw, drive, raws, told
from tests.rosbag2_files import (
    clean_temporary,  # noqa: F401 (a fixture)
    read_rosbag2,
    write_db3,
    write_metadata,
)

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd


pytestmark = pytest.mark.usefixtures("clean_temporary")


def split(folder: Path, messages: list[Raw], parts: int, overlap: bool = False) -> list[str]:
    """Write messages into parts x_0.db3, ...; their names."""
    folder.mkdir()
    size = -(-len(messages) // parts)
    names = []
    for n in range(parts):
        some = messages[n::parts] if overlap else messages[n * size : (n + 1) * size]
        names.append(f"x_{n}.db3")
        write_db3(folder / names[-1], some)
    return names


@pytest.mark.parametrize("overlap", [False, True])
@pytest.mark.parametrize("metadata", [False, True])
def test_split_folders(tmp_path: Path, overlap: bool, metadata: bool) -> None:
    messages = drive(300)
    folder = tmp_path / "x"
    names = split(folder, messages, 3, overlap)
    if metadata:
        write_metadata(folder, names[::-1], 300)
    assert rosbag2.fits(folder, b"")
    log = rosbag2.open_file(folder, Notes())
    assert raws(log) == messages
    assert raws(log, ["/tf"]) == [m for m in messages if m[0] == "/tf"]
    assert [topic.count for topic in log.topics()] == [100, 100, 100]
    log.close()


def test_a_folder_of_several_recordings_is_none(tmp_path: Path) -> None:
    write_db3(tmp_path / "monday.db3", drive(3))
    assert rosbag2.fits(tmp_path, b"")
    write_db3(tmp_path / "tuesday.db3", drive(3))
    assert not rosbag2.fits(tmp_path, b"")
    (tmp_path / "empty").mkdir()
    assert not rosbag2.fits(tmp_path / "empty", b"")


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"storage_identifier": "mcap"}, "says storage 'mcap'; its parts are rosbag2 sqlite3"),
        ({"version": 99}, "is of version 99"),
        ({"version": "new"}, "is of version new"),
        ({"message_count": 301}, "says 301 messages; 300 are there"),
        ({"relative_file_paths": "[x_0.db3]"}, ""),
        ({"relative_file_paths": "[old/x_0.db3, old/x_1.db3, old/x_2.db3]"}, ""),
        ({"relative_file_paths": "[../../etc/x_9.db3, /etc/passwd, x_0.db3]"}, "outside of its"),
        ({"relative_file_paths": "17"}, ""),
        ({"relative_file_paths": "[{a: 1}, x_0.db3]"}, "names a part that is no text"),
        ({"topics_with_message_count": "[1, {topic_metadata: 3}]"}, ""),
        ({"files": "[1, {path: [1], message_count: 1}]"}, ""),
    ],
)
def test_odd_metadata_is_told_and_the_parts_are_read(
    tmp_path: Path, fields: dict[str, object], said: str
) -> None:
    messages = drive(300)
    folder = tmp_path / "x"
    write_metadata(folder, split(folder, messages, 3), 300, fields=fields)
    found, notes = read_rosbag2(folder)
    assert found == messages
    assert not notes.of("lost")
    assert any(said in problem for problem in told(notes)) if said else True
    assert all("\n" not in str(note) for note in notes)


BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{b}: &{b} [*{a},*{a},*{a},*{a},*{a},*{a},*{a},*{a},*{a}]\n"
    for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
MERGES = "a: &a {k: 1}\n" + "".join(
    f"{b}: &{b} {{<<: [*{a},*{a},*{a},*{a},*{a},*{a},*{a},*{a}]}}\n"
    for a, b in zip("abcdefghijk", "bcdefghijkl", strict=True)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "not used: a YAML alias at line 2"),
        (MERGES, "not used: a YAML alias at line 2"),
        ("x: !!python/object/apply:os.system ['touch pwned']", "not used: a YAML tag at line 1"),
        ("x: " + "[" * 5_000, "not used: more than 32 levels at line 1"),
        ("x: [1, 2", "not used: did not find expected ',' or ']'"),
        ("\x00\x01", "not used: "),
        ("", "not used: holds no rosbag2_bagfile_information"),
        ("- 1", "not used: holds no rosbag2_bagfile_information"),
    ],
)
def test_hostile_metadata_is_not_used(tmp_path: Path, text: str, said: str) -> None:
    messages = drive(30)
    write_db3(tmp_path / "x_0.db3", messages)
    (tmp_path / "metadata.yaml").write_text(text)
    found, notes = read_rosbag2(tmp_path)
    assert found == messages
    assert len(told(notes)) == 1
    assert told(notes)[0].startswith(said)
    assert "\n" not in str(next(iter(notes)))


def test_missing_and_empty_parts_are_counted(tmp_path: Path) -> None:
    messages = drive(300)
    folder = tmp_path / "x"
    names = split(folder, messages, 3)
    files = "".join(f"    - path: {name}\n      message_count: 100\n" for name in names)
    write_metadata(folder, names, 300, more="  files:\n" + files)
    (folder / names[0]).unlink()
    (folder / names[2]).write_bytes(b"")
    found, notes = read_rosbag2(folder)
    assert found == messages[100:200]
    assert sorted((note.problem, note.count) for note in notes.of("lost")) == [
        ("is empty", 100),
        ("is missing", 100),
    ]
    (folder / names[1]).write_bytes(b"#!/bin/sh\n")
    with pytest.raises(FormatError, match=r"x_0\.db3: is missing"):
        read_rosbag2(folder)


def test_file_compression(tmp_path: Path) -> None:
    messages = drive(200)
    names = split(tmp_path / "x", messages, 2)
    for name in names:
        part = tmp_path / "x" / name
        part.with_name(f"{name}.zstd").write_bytes(zstd.compress(part.read_bytes()))
        part.unlink()
    found, _ = read_rosbag2(tmp_path / "x")
    assert found == messages
    packed = [f"{name}.zstd" for name in names]
    write_metadata(tmp_path / "x", packed, 200, fields={"compression_mode": "FILE"})
    found, notes = read_rosbag2(tmp_path / "x")
    assert found == messages
    assert list(notes) == []
    whole = (tmp_path / "x" / "x_1.db3.zstd").read_bytes()
    (tmp_path / "x" / "x_1.db3.zstd").write_bytes(whole[: len(whole) // 2])
    found, notes = read_rosbag2(tmp_path / "x")
    assert found[:100] == messages[:100]
    assert notes.of("lost")


def test_message_compression_and_its_damage(tmp_path: Path) -> None:
    messages = [Raw(topic, time, b"\0\1\0\0" + data) for topic, time, data in drive(100)]
    packed = [(topic, time, zstd.compress(data)) for topic, time, data in messages]
    packed[7] = (packed[7][0], packed[7][1], packed[7][2][:-9])
    packed[8] = (packed[8][0], packed[8][1], b"\x28\xb5\x2f\xfd" + b"\xff" * 40)
    packed[9] = (packed[9][0], packed[9][1], zstd.compress(bytes(70_000_000)))
    path = tmp_path / "x.db3"
    write_db3(path, packed)
    notes = Notes()
    log = rosbag2.open_file(path, notes, 1 << 20)
    for _ in range(2):
        assert raws(log) == messages[:7] + messages[10:]
    assert {note.topic: note.count for note in notes.of("lost")} == {
        "/odom": 1,
        "/tf": 1,
        "/scan": 1,
    }
    log.close()
