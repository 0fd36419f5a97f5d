"""Logs are known by their first bytes; containers agree; what is no log is called what it is."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.frame import Frame
from formats.opening import READERS
from formats.stream import frames, open_log, survey
from tests.drives import drive
from tests.ros_logs import START_NS, RosLog

SECOND = 1_000_000_000


def same(a: Frame, b: Frame) -> None:
    assert (a.time_ns, a.pose) == (b.time_ns, b.pose)
    for name in ("bearings", "widths", "ranges", "min_range", "max_range"):
        np.testing.assert_array_equal(getattr(a.scan, name), getattr(b.scan, name))


KINDS = {"bag": "a.bag", "mcap": "a.mcap", "rosbag2-sqlite3": "lite", "rosbag2-mcap": "folder"}


def test_one_drive_gives_equal_frames_from_every_container(tmp_path: Path) -> None:
    log = drive(time_increment=0.005)
    expected = list(survey(log.opened(), Notes()).frames())
    assert len(expected) == 20
    for kind, name in KINDS.items():
        notes = Notes()
        found = list(frames(log.write(tmp_path / name, kind), notes))
        assert len(found) == 20
        for a, b in zip(found, expected, strict=True):
            same(a, b)
        assert not notes.of("lost")
        assert not notes.of("skipped")


def test_suffixes_do_not_matter(tmp_path: Path) -> None:
    path = drive().write(tmp_path / "a", "mcap").rename(tmp_path / "a.bag")
    assert len(list(frames(path))) == 20


def test_a_compressed_file_is_unpacked_and_named_as_given(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap.gz"
    path.write_bytes(gzip.compress(drive().write(tmp_path / "a.mcap").read_bytes()))
    notes = Notes()
    log = open_log(path, notes)
    assert log.path == path
    assert log.container.size == path.stat().st_size
    assert len(list(frames(log, notes))) == 20
    log.close()
    path.write_bytes(gzip.compress(b"just words\n" * 20))
    with pytest.raises(FormatError, match=r"a.mcap.gz: holds text, not a log"):
        open_log(path, notes)


def test_several_logs_are_one_by_time_and_copies_are_read_once(tmp_path: Path) -> None:
    whole = drive()
    first, second = RosLog(), RosLog()
    for k, row in enumerate(whole.happened):
        (first if k % 2 else second).happened.append(row)
    paths = [first.write(tmp_path / "a.bag"), second.write(tmp_path / "b.mcap")]
    copy = tmp_path / "copy.bag"
    copy.write_bytes(paths[0].read_bytes())
    notes = Notes()
    log = open_log([*paths, copy], notes)
    times = [message.time_ns for message in log.messages()]
    assert times == sorted(times)
    assert len(times) == len(whole.happened)
    assert [str(note) for note in notes] == [
        f"{copy}: has the same content as {paths[0]}: read once"
    ]
    assert log.container.kind.count("+") == 1
    log.close()


def test_splits_of_one_recording_join(tmp_path: Path) -> None:
    log = drive()
    early, late = RosLog(), RosLog()
    for row in log.happened:
        (early if row[0] < START_NS + SECOND else late).happened.append(row)
    paths = [late.write(tmp_path / "1.mcap"), early.write(tmp_path / "0.mcap")]
    found = list(frames(paths))
    for a, b in zip(found, survey(log.opened(), Notes()).frames(), strict=True):
        same(a, b)


NOT_LOGS = {
    "picture.bag": (b"\x89PNG\r\n\x1a\n" + bytes(20), "is a PNG picture, not a log"),
    "words.mcap": (b"hello\nworld\n", "is text, not a log"),
    "empty.bag": (b"", "is empty"),
    "eight.bag": (bytes(8), r"is unknown data \(starts with 00 00 00 00 00 00 00 00\)"),
    "page.bag": (b"<!DOCTYPE html><html>", "is HTML or XML text"),
    "pointer.bag": (b"version https://git-lfs.github.com/spec/v1\n", "LFS pointer.*git lfs pull"),
    "metadata.yaml": (
        b"rosbag2_bagfile_information:\n  version: 9\n",
        "is the metadata of a rosbag2 log; give its folder",
    ),
    "archive.bag": (b"PK\x03\x04" + bytes(50), "is a ZIP archive"),
}


@pytest.mark.parametrize("name", NOT_LOGS)
def test_what_is_not_a_log_is_called_what_it_is(tmp_path: Path, name: str) -> None:
    content, text = NOT_LOGS[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match=text) as caught:
        open_log(tmp_path / name, Notes())
    assert caught.value.exit_code == 1


def test_paths_that_lead_nowhere(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no such file"):
        open_log(tmp_path / "none.bag", Notes())
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(FormatError, match=r"cannot be read: .*symbolic links"):
        open_log(tmp_path / "a", Notes())
    (tmp_path / "folder").mkdir()
    with pytest.raises(FormatError, match="is a folder without a log: it is empty"):
        open_log(tmp_path / "folder", Notes())
    with pytest.raises(FormatError, match="cannot be read"):
        open_log("a\0b", Notes())


def test_every_reader_is_there_and_tested() -> None:
    # Each stands in KINDS above, CARMEN in test_carmen.py.
    assert set(READERS) == {"ROS 1 bag", "MCAP", "rosbag2", "CARMEN"}


def test_the_compression_of_a_wrapped_log_is_told(tmp_path: Path) -> None:
    for name, inner in (("a.bag", ""), ("a.mcap", "zstd in ")):
        path = drive().write(tmp_path / name)
        wrapped = tmp_path / f"{name}.gz"
        wrapped.write_bytes(gzip.compress(path.read_bytes()))
        log = open_log(wrapped, Notes())
        assert log.container.compression == f"{inner}gzip"
        assert log.container.size == wrapped.stat().st_size
        log.close()
