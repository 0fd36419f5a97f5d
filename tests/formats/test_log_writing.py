"""Logs as we write them, read by rosbags, by mcap's own reader, and by ourselves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats import log_messages as ros
from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.log_writing import Recorded, write_log
from formats.messages import LaserScan
from formats.opening import open_log
from formats.results.messages import POSE, TF

NAMES = ("drive.mcap", "drive.bag", "drive")
SECOND = 10**9
START = 1_600_000_000 * SECOND


def messages() -> list[Recorded]:
    """A static transform, then scans and poses."""
    fixed = ros.transforms([ros.planar(START, "base_link", "laser", Pose(0.1, 0.2, 0.5))])
    out = [Recorded(START, "/tf_static", TF, fixed)]
    for i in range(50):
        t = START + i * SECOND // 10 + 123_456_789
        ranges = np.linspace(0.5, 3.0, 7) + i
        scan = ros.laser_scan(LaserScan(t, "laser", -1.0, 0.3, 0.0, 0.1, 90.0, ranges))
        out.append(Recorded(t, "/scan", ros.SCAN, scan))
        pose = ros.pose_stamped(t, "map", Pose(0.1 * i, -0.2 * i, 0.01 * i))
        out.append(Recorded(t, "/truth", POSE, pose))
    return out


@pytest.mark.parametrize("name", NAMES)
def test_rosbags_reads_what_was_written(name: str, tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    counts = write_log(tmp_path / name, messages(), metadata={"made": "so"})
    assert counts == {"/tf_static": 1, "/scan": 50, "/truth": 50}
    with AnyReader([tmp_path / name]) as reader:
        found: list[tuple[int, str, Any]] = [
            (t, c.topic, reader.deserialize(data, c.msgtype)) for c, t, data in reader.messages()
        ]
    assert [(t, topic) for t, topic, _ in found] == [(m.time_ns, m.topic) for m in messages()]
    scan, pose = found[-2][2], found[-1][2]
    assert scan.ranges.tolist() == pytest.approx((np.linspace(0.5, 3.0, 7) + 49).tolist())
    assert scan.header.stamp.sec * SECOND + scan.header.stamp.nanosec == found[-2][0]
    assert (scan.header.frame_id, scan.angle_max) == ("laser", pytest.approx(0.8))
    assert pose.pose.position.x == pytest.approx(4.9)
    fixed = found[0][2].transforms[0]
    assert (fixed.child_frame_id, fixed.transform.translation.y) == ("laser", 0.2)
    assert fixed.transform.rotation.z == pytest.approx(np.sin(0.25))


@pytest.mark.parametrize("name", NAMES)
def test_static_transforms_are_latched(name: str, tmp_path: Path) -> None:
    write_log(tmp_path / name, messages())
    log = open_log(tmp_path / name, notes := Notes())
    assert {topic.name: topic.latched for topic in log.topics()} == {
        "/tf_static": True,
        "/scan": False,
        "/truth": False,
    }
    assert sum(1 for _ in log.messages()) == 101
    log.close()
    assert not notes.total("lost")


@pytest.mark.parametrize("name", NAMES)
def test_the_same_messages_give_the_same_bytes(name: str, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        write_log(tmp_path / folder / name, messages())
    one, two = (tmp_path / folder / name for folder in ("a", "b"))
    files = [(one, two)] if one.is_file() else [(f, two / f.name) for f in sorted(one.iterdir())]
    assert len(files) == (1 if one.is_file() else 2)
    for a, b in files:
        assert a.read_bytes() == b.read_bytes()


def test_a_folder_is_named_within_as_without(tmp_path: Path) -> None:
    write_log(tmp_path / "drive", messages())
    assert sorted(p.name for p in (tmp_path / "drive").iterdir()) == ["drive.db3", "metadata.yaml"]
    assert [p.name for p in tmp_path.iterdir()] == ["drive"]


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_overwritten_without_force(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    write_log(path, messages()[:3])
    with pytest.raises(FormatError, match="exists already"):
        write_log(path, messages())
    assert sum(write_log(path, messages(), force=True).values()) == 101
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", NAMES)
def test_after_a_fault_nothing_is_left_and_the_old_log_stays(name: str, tmp_path: Path) -> None:
    def half() -> Iterator[Recorded]:
        yield from messages()[:9]
        raise RuntimeError("of the simulator")

    path = tmp_path / name
    with pytest.raises(RuntimeError):
        write_log(path, half())
    assert list(tmp_path.iterdir()) == []
    write_log(path, messages())
    with pytest.raises(RuntimeError):
        write_log(path, half(), force=True)
    log = open_log(path, Notes())
    assert sum(1 for _ in log.messages()) == 101
    log.close()


def test_a_folder_of_something_else_is_never_replaced(tmp_path: Path) -> None:
    home = tmp_path / "photos"
    home.mkdir()
    (home / "one.jpg").write_bytes(b"x")
    with pytest.raises(FormatError, match=r"is a folder without metadata\.yaml: not replaced"):
        write_log(home, messages(), force=True)
    assert (home / "one.jpg").read_bytes() == b"x"
    inside = home / "metadata.yaml"
    inside.write_bytes(b"y")
    with pytest.raises(FormatError, match="lies inside the output"):
        write_log(home, messages(), force=True, inputs=[inside])


@pytest.mark.parametrize("name", ["drive.db3", "drive.txt", "drive.mcap.zst"])
def test_other_suffixes_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"give \.mcap, \.bag, or a name without a suffix"):
        write_log(tmp_path / name, messages())
