"""The frame stream: containers agree, times are put right, scans are seen from above."""

from __future__ import annotations

import gzip
from math import cos, inf, nan, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.drive import Drive
from formats.errors import FormatError, Notes, UsageError
from formats.frame import Frame, Pose
from formats.opening import READERS
from formats.stream import frames, open_log, survey
from tests.ros_logs import START_NS, RosLog

SECOND = 1_000_000_000
BEAMS = [1.0, 2.0, 3.0, 4.0, 5.0]


def drive(
    steps: int = 20, mount: tuple[float, ...] = (0.2, 0.0, 0.0), speed: float = 0.5, **scan: Any
) -> RosLog:
    """A robot that drives along x at 10 Hz from t = 0, its poses one step longer than its scans."""
    log = RosLog()
    log.static("base_link", "laser", mount)
    for k in range(steps):
        log.tf(k / 10, "odom", "base_link", (speed * k / 10, 0.0, 0.0))
        log.scan(k / 10, BEAMS, **scan)
    log.tf(steps / 10, "odom", "base_link", (speed * steps / 10, 0.0, 0.0))
    return log


def surveyed(log: RosLog, **options: Any) -> tuple[Drive, list[str]]:
    notes = Notes()
    found = survey(log.opened(), notes, **options)
    return found, [str(note) for note in notes if note.kind != "info"]


def problems(log: RosLog, **options: Any) -> list[str]:
    """Notes but for infos and the warning that this is odometry."""
    return [note for note in surveyed(log, **options)[1] if "odometry alone" not in note]


def points(frame: Frame) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Where the beams end, (n, 2) in the map frame."""
    r, b = frame.scan.ranges.astype(np.float64), frame.scan.bearings
    return frame.pose.apply(np.stack([r * np.cos(b), r * np.sin(b)], axis=1))


def same(a: Frame, b: Frame) -> None:
    assert (a.time_ns, a.pose) == (b.time_ns, b.pose)
    for name in ("bearings", "widths", "ranges", "min_range", "max_range"):
        np.testing.assert_array_equal(getattr(a.scan, name), getattr(b.scan, name))


# --- containers ---


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
    assert set(READERS) == {"ROS 1 bag", "MCAP", "rosbag2"}  # each stands in KINDS above


# --- times ---


def test_stamps_count_not_log_times() -> None:
    log = RosLog()
    log.static("base_link", "laser", (0.2, 0.0, 0.0))
    for k in range(20):
        log.tf(k / 10, "odom", "base_link", (k / 10, 0.0, 0.0))
        log.scan(k / 10 + 0.2, BEAMS, at=k / 10)
    found, _ = surveyed(log)
    assert found.poses[:, 0].tolist() == pytest.approx([0.2 + k / 10 for k in range(20)])
    assert found.times_ns.tolist() == [log.ns(k / 10) for k in range(20)]
    notes = Notes()
    survey(log.opened(), notes)
    assert any("stamps lie 0.20 s before the log times" in str(note) for note in notes.of("info"))


def test_stamps_of_zero_give_way_to_log_times() -> None:
    log = RosLog()
    zero: dict[str, Any] = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "base_link"}
    for k in range(10):
        log.odometry(k / 10, (k / 10, 0.0, 0.0))
        log.scan(k / 10, BEAMS, header=zero)
    found, notes = surveyed(log)
    assert found.times_ns[3] == log.ns(0.3)
    assert found.poses[3, 0] == pytest.approx(0.3)
    assert any("header stamps are all 0" in note for note in notes)


def test_nothing_is_extrapolated_and_what_is_missing_is_counted() -> None:
    log = drive()
    for t in (-0.2, -0.1, 2.05, 2.15):
        log.scan(t, BEAMS)
    found, _ = surveyed(log)
    assert (found.total, found.posed, len(found)) == (24, 20, 20)
    # The log starts 0.2 s before the first transform.
    assert problems(log) == [
        "memory: /scan: 2 x no transform odom > base_link before 0.20 s (first at 0.00 s)",
        "memory: /scan: 2 x no transform odom > base_link after 2.20 s (first at 2.25 s)",
    ]


def test_a_gap_in_the_transforms_costs_its_scans() -> None:
    log = drive()
    log.happened = [row for row in log.happened if row[1] != "/tf" or not 5 < _step(row) < 40]
    more = drive(steps=60)
    log.happened += [row for row in more.happened if row[1] == "/scan" and _step(row) >= 20]
    log.happened += [row for row in more.happened if row[1] == "/tf" and _step(row) >= 40]
    found, notes = surveyed(log)
    assert len(found) == 60 - 34
    assert "memory: /scan: 34 x no transform odom > base_link within its gaps" in " ".join(notes)


def _step(row: tuple[int, str, str, bool, dict[str, Any]]) -> int:
    return round((row[0] - START_NS) / 1e8)


def test_a_pause_is_a_warning_with_its_length() -> None:
    log = drive()
    later = drive()
    later.start_ns += 60 * SECOND
    log.happened += [(row[0] + 60 * SECOND, *row[1:]) for row in drive().happened[1:]]
    for row in log.happened:
        if row[0] >= START_NS + 60 * SECOND:
            header = row[4]["header"] if "header" in row[4] else row[4]["transforms"][0]["header"]
            header["stamp"]["sec"] += 60
    assert "memory: /scan: no scans for 58.1 s at 1.90 s" in problems(log)


def test_scans_out_of_order_are_sorted_and_repeated_ones_dropped() -> None:
    log = RosLog()
    for k in range(21):
        log.tf(k / 10, "odom", "laser", (k / 10, 0.0, 0.0))
    for place, k in enumerate((0, 1, 3, 2, 4, 5, 5, 6, 7)):
        log.scan(place / 10, [float(k)], at=k / 10, increment=0.1)
    found, _ = surveyed(log)
    made = list(found.frames())
    assert [frame.scan.ranges[0] for frame in made] == [0, 1, 2, 3, 4, 5, 6, 7]
    assert [frame.pose.x for frame in made] == pytest.approx([k / 10 for k in range(8)])
    assert problems(log) == [
        "memory: /scan: same stamp as the scan before at 0.50 s",
        "memory: /scan: scan out of order (sorted)",
    ]


def test_sonars_that_share_a_topic_and_a_stamp_all_count() -> None:
    log = RosLog()
    log.static("base_link", "left", (0.0, 0.1, 1.5))
    log.static("base_link", "right", (0.0, -0.1, -1.5))
    for k in range(10):
        log.odometry(k / 10, (k / 10, 0.0, 0.0))
        for side in ("left", "right"):
            log.say(
                k / 10,
                "/sonar",
                "sensor_msgs/msg/Range",
                header=log.header(k / 10, side, None),
                field_of_view=0.5,
                max_range=4.0,
                range=1.0,
            )
    found, _ = surveyed(log)
    assert len(found) == 20
    assert sorted(found.poses[:2, 1]) == [-0.1, 0.1]


def test_a_clock_set_back_begins_a_new_pass() -> None:
    log = RosLog()
    for k in range(40):
        at = k / 10 if k < 20 else k / 10 - 3600
        log.tf(k / 10, "odom", "laser", (k / 10, 0.0, 0.0), at=at)
        log.scan(k / 10 + 0.01, BEAMS, at=at)
    found, notes = surveyed(log)
    assert found.poses[:, 0].tolist() == pytest.approx([k / 10 for k in range(40)])
    assert np.all(np.diff(found.times_ns) > 0)
    assert any("clock goes back by 3599.90 s" in note and "at 2.01 s" in note for note in notes)


def test_a_recording_played_twice_is_two_passes() -> None:
    log = RosLog()
    for again in (0, 1):
        for k in range(20):
            log.tf(again * 5 + k / 10, "odom", "laser", (k / 10, 7.0 * again, 0.0), at=k / 10)
            log.scan(again * 5 + k / 10, BEAMS, at=k / 10)
    found, _ = surveyed(log)
    assert len(found) == 40
    assert found.poses[:, 1].tolist() == [0.0] * 20 + [7.0] * 20
    assert found.times_ns.tolist() == [log.ns(a * 5 + k / 10) for a in (0, 1) for k in range(20)]


def test_a_single_stray_stamp_costs_one_scan() -> None:
    for wrong in (-3600.0, 3600.0):
        log = drive()
        log.happened[2 * 8 + 2][4]["header"]["stamp"]["sec"] += int(wrong)
        found, notes = surveyed(log)
        assert len(found) == 19
        assert not any("clock" in note for note in notes)


def test_clocks_that_differ_are_an_error_with_the_offset() -> None:
    log = RosLog()
    for k in range(20):
        log.tf(k / 10, "odom", "laser", (k / 10, 0.0, 0.0))
        log.scan(k / 10, BEAMS, at=k / 10 + 86400)
    with pytest.raises(FormatError, match=r"86400.00 s apart: --pose-delay 86400.00"):
        surveyed(log)
    assert len(surveyed(log, pose_delay=86400.0)[0]) == 20


def test_a_pose_delay_moves_the_poses() -> None:
    found, notes = surveyed(drive(speed=1.0), pose_delay=0.05)
    assert found.poses[0, 0] == pytest.approx(0.2 + 0.05)  # the scan at 0.1 s; the pose of 0.05 s
    assert any("no transform odom > base_link before 0.05 s" in note for note in notes)


def test_simulated_time_from_zero() -> None:
    log = drive()
    log.start_ns = 0
    again = RosLog(start_ns=0)
    again.static("base_link", "laser", (0.2, 0.0, 0.0))
    for k in range(20):
        again.tf(1e9 + k / 10, "odom", "base_link", (k / 10, 0.0, 0.0), at=k / 10)
        again.scan(1e9 + k / 10, BEAMS, at=k / 10)
    found, _ = surveyed(again)
    assert found.times_ns.tolist() == [k * SECOND // 10 for k in range(20)]
    assert len(surveyed(again, start_offset=1.0)[0]) == 10


# --- selection ---


def test_start_offset_and_duration_count_from_the_start_of_the_log() -> None:
    found, _ = surveyed(drive(), start_offset=0.5, duration=0.6)
    assert found.times_ns.tolist() == [START_NS + k * SECOND // 10 for k in range(5, 12)]
    with pytest.raises(FormatError, match="no scans between --start-offset"):
        surveyed(drive(), start_offset=100.0)


def test_gates() -> None:
    # 0.05 m a scan: the places are 0, 0.05, 0.1 ...
    assert surveyed(drive(), every=3)[0].poses[:3, 0] == pytest.approx([0.2, 0.35, 0.5])
    assert surveyed(drive(), min_travel=0.12)[0].poses[:3, 0] == pytest.approx([0.2, 0.35, 0.5])
    two = surveyed(drive(), min_travel=0.12, readings_per_pose=2)[0]
    assert two.poses[:4, 0] == pytest.approx([0.2, 0.25, 0.35, 0.4])
    assert two.posed == 20
    still = surveyed(drive(speed=0.0), readings_per_pose=3)[0]
    assert len(still) == len(list(still.frames())) == 3
    with pytest.raises(UsageError, match="at least 1"):
        surveyed(drive(), every=0)


def test_a_turn_opens_the_gate_across_pi() -> None:
    log = RosLog()
    for k in range(20):
        log.tf(k / 10, "odom", "laser", (0.0, 0.0, 3.0 + 0.05 * k))
        log.scan(k / 10, BEAMS)
    found, _ = surveyed(log, min_turn=0.12)
    turned = np.unwrap(found.poses[:, 2])
    assert turned.tolist() == pytest.approx([3.0 + 0.15 * k for k in range(7)])


def test_what_a_run_needs_to_know_beforehand() -> None:
    found, _ = surveyed(drive(mount=(0.0, 0.5, 0.0)))
    assert found.bounds == pytest.approx((0.0, 0.5, 0.95, 0.5))
    assert found.limit == 10.0
    assert len(found) == 20
    assert [f.time_ns for f in found.frames()] == [f.time_ns for f in found.frames()]


# --- scans ---


def seen(mount: tuple[float, ...], **scan: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    log = RosLog()
    log.static("base_link", "laser", mount)
    for k in range(3):
        log.odometry(k / 10, (1.0, 2.0, 0.5))
        log.scan(k / 10, scan.pop("ranges", BEAMS) if k == 0 else BEAMS, **scan)
    frame = next(iter(survey(log.opened(), Notes()).frames()))
    assert np.all(np.diff(frame.scan.bearings) > 0)
    assert np.all(frame.scan.widths > 0)
    return points(frame)


def test_mirrored_and_backward_sensors_see_the_same_room() -> None:
    upright = seen((0.1, 0.0, 0.3, 0.0, 0.0, 0.2), angle_min=-1.0, increment=0.3)
    inverted = seen((0.1, 0.0, 0.3, pi, 0.0, 0.2), angle_min=1.0, increment=-0.3)
    flipped = seen((0.1, 0.0, 0.3, pi, 0.0, 0.2 - 0.2), angle_min=0.8, increment=-0.3)
    backward = seen((0.1, 0.0, 0.3, 0.0, 0.0, 0.2 + pi), angle_min=-1.0 - pi, increment=0.3)
    falling = seen((0.1, 0.0, 0.3, 0.0, 0.0, 0.2), angle_min=-1.0, increment=0.3)[::-1]
    for other in (inverted, flipped, backward, falling[::-1]):
        np.testing.assert_allclose(other, upright, atol=1e-6)


def test_a_falling_increment_gives_ascending_bearings() -> None:
    up = seen((0.0, 0.0, 0.0), angle_min=-0.6, increment=0.3)
    down = seen((0.0, 0.0, 0.0), angle_min=0.6, increment=-0.3, ranges=BEAMS[::-1])
    np.testing.assert_allclose(up, down, atol=1e-6)


def test_a_pitched_sensor_is_projected_and_sees_no_wall_on_the_floor() -> None:
    """30 degrees down at 0.3 m: the beam ahead meets the floor after 0.6 m, those aside a wall."""
    log = RosLog()
    log.static("base_link", "laser", (0.0, 0.0, 0.3, 0.0, pi / 6, 0.0))
    for k in range(3):
        log.odometry(k / 10, (0.0, 0.0, 0.0))
        log.scan(k / 10, [2.0, 0.6, 2.0], angle_min=-pi / 2, increment=pi / 2)
    notes = Notes()
    frame = next(iter(survey(log.opened(), notes).frames()))
    wanted = np.array([[0.0, -2.0], [nan, nan], [0.0, 2.0]])
    np.testing.assert_allclose(points(frame), wanted, atol=1e-6)
    assert any("tilted by up to 30 deg" in str(note) for note in notes.of("warning"))


def test_a_rolled_beam_is_shortened_by_its_slope() -> None:
    log = RosLog()
    log.static("base_link", "laser", (0.0, 0.0, 0.0, 0.1, 0.0, 0.0))  # rolled: left beam rises
    for k in range(3):
        log.odometry(k / 10, (0.0, 0.0, 0.0))
        log.scan(k / 10, [2.0, 2.0, 2.0], angle_min=-pi / 2, increment=pi / 2)
    found = points(next(iter(survey(log.opened(), Notes()).frames())))
    wanted = np.array([[0.0, -2 * cos(0.1)], [2.0, 0.0], [0.0, 2 * cos(0.1)]])
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_deskew_puts_the_wall_where_it_is() -> None:
    """A robot that turns and drives while its beams go round sees one straight wall at x = 3."""
    n, sweep, rate, speed = 181, 0.1, 1.0, 0.8
    log = RosLog()
    for k in range(101):
        t = k / 50
        log.tf(t, "odom", "laser", _arc(t, rate, speed))
    for k in range(1, 9):
        ranges = []
        for i in range(n):
            x, _, yaw = _arc(k / 10 + sweep * i / (n - 1), rate, speed)
            ranges.append((3.0 - x) / max(cos(yaw + _bearing(i, n)), 1e-9))
        log.scan(
            k / 10, ranges, angle_min=-0.5, increment=1.0 / (n - 1), time_increment=sweep / (n - 1)
        )
    straight = [points(frame)[:, 0] for frame in survey(log.opened(), Notes()).frames()]
    skewed = [points(frame)[:, 0] for frame in survey(log.opened(), Notes(), deskew=False).frames()]
    assert np.abs(np.array(straight) - 3.0).max() < 0.002
    assert np.abs(np.array(skewed) - 3.0).max() > 0.1


def _bearing(i: int, n: int) -> float:
    return -0.5 + i / (n - 1)


def _arc(t: float, rate: float, speed: float) -> tuple[float, float, float]:
    """Driving a circle, from its lowest point; turned back at the start so the wall stays ahead."""
    r, start = speed / rate, -0.4
    return (
        r * (sin(start + rate * t) - sin(start)),
        r * (cos(start) - cos(start + rate * t)),
        start + rate * t,
    )


def test_deskewed_frames_are_of_the_middle_of_the_sweep() -> None:
    log = drive(speed=1.0, time_increment=0.01)  # 5 beams: 0.04 s
    found, _ = surveyed(log)
    assert found.times_ns[0] == log.ns(0.02)
    assert found.poses[0, 0] == pytest.approx(0.22)
    plain, _ = surveyed(log, deskew=False)
    assert plain.times_ns[0] == log.ns(0.0)
    assert plain.poses[0, 0] == pytest.approx(0.2)


def test_an_absurd_time_increment_is_ignored_with_one_warning() -> None:
    log = drive(time_increment=153333.0)
    found, _ = surveyed(log)
    assert found.times_ns[0] == log.ns(0.0)
    assert len([note for note in problems(log) if "not de-skewed" in note]) == 1


def test_ranges_are_raw() -> None:
    odd = [nan, inf, -inf, 0.0, -1.0, 10.0, 11.0]
    log = RosLog()
    for k in range(3):
        log.odometry(k / 10, (0.0, 0.0, 0.0), child="laser")
        log.scan(k / 10, odd)
    scan = next(iter(survey(log.opened(), Notes()).frames())).scan
    np.testing.assert_array_equal(scan.ranges, np.array(odd, dtype=np.float32))
    assert scan.ranges.dtype == np.float32
    assert scan.ranges.flags.c_contiguous
    assert [scan.min_range, scan.max_range] == pytest.approx([0.1, 10.0])


BAD: dict[str, dict[str, Any]] = {
    "angle_increment is 0": {"increment": 0.0},
    "angle_increment is nan": {"increment": nan},
    "no ranges": {"ranges": []},
    "all ranges are nan": {"ranges": [nan, nan]},
    "range_min 9 above range_max 1": {"range_min": 9.0, "range_max": 1.0},
}


@pytest.mark.parametrize("text", BAD)
def test_one_bad_scan_is_counted_and_all_bad_ones_are_an_error(text: str) -> None:
    log, options = drive(), dict(BAD[text])
    ranges = options.pop("ranges", BEAMS)
    log.scan(1.95, ranges, **options)
    found, _ = surveyed(log)
    assert (found.total, len(found)) == (21, 20)
    assert problems(log) == [f"memory: /scan: {text} at 1.95 s"]
    log.happened = [row for row in log.happened if row[1] != "/scan"]
    log.scan(0.5, ranges, **options)
    with pytest.raises(FormatError, match=text):
        surveyed(log)


def test_both_range_limits_zero_mean_none() -> None:
    found, notes = surveyed(drive(range_min=0.0, range_max=0.0))
    scan = next(iter(found.frames())).scan
    assert [scan.min_range, scan.max_range, found.limit] == [0.0, inf, inf]
    assert any("range_max is 0 or inf" in note for note in notes)


def test_the_number_of_beams_may_change() -> None:
    log = drive()
    log.scan(1.95, [1.0] * 7)
    assert [len(f.scan.ranges) for f in survey(log.opened(), Notes()).frames()] == [5] * 20 + [7]


def test_unreadable_scans_are_lost_and_the_others_keep_their_poses(tmp_path: Path) -> None:
    log = drive().opened()
    for k in [k for k, m in enumerate(log._messages) if m.topic.name == "/scan"][4:6]:
        log._messages[k] = log._messages[k]._replace(data=log._messages[k].data[:30])
    notes = Notes()
    made = list(survey(log, notes).frames())
    assert [f.pose.x for f in made] == pytest.approx(
        [0.2 + 0.05 * k for k in range(20) if k not in (4, 5)]
    )
    assert notes.total("lost") == 2
    assert notes.total("skipped") == 0


def test_the_first_echo_of_each_beam_counts() -> None:
    log = RosLog()
    for k in range(3):
        log.odometry(k / 10, (0.0, 0.0, 0.0), child="laser")
        log.say(
            k / 10,
            "/echoes",
            "sensor_msgs/msg/MultiEchoLaserScan",
            header=log.header(k / 10, "laser", None),
            angle_min=-0.1,
            angle_increment=0.1,
            range_max=30.0,
            ranges=[{"echoes": [2.0, 5.0]}, {"echoes": []}, {"echoes": [7.0]}],
        )
    scan = next(iter(survey(log.opened(), Notes()).frames())).scan
    np.testing.assert_array_equal(scan.ranges, np.array([2.0, nan, 7.0], dtype=np.float32))
    assert scan.bearings.tolist() == pytest.approx([-0.1, 0.0, 0.1])


# --- real logs ---


JARVIS = "bags/crob_lab/jarvis_circular_path_fast.bag"
TRUTH = {"pose": "/pose_ground_truth", "pose_delay": 0.135}
UPPER = {"scan": "/driver_laser_navigation/laser_scan"}
LOWER = {"scan": "/driver_laser_security/laser_scan"}
REAL: list[tuple[str, dict[str, Any], str, int, int]] = [
    # 957: the last scan lies 0.06 s after the last odom > base_link.
    ("bags/bham_pioneer/trace0.bag", {}, "tf", 957, 958),
    (JARVIS, UPPER, "tf", 204, 204),
    (JARVIS, {**UPPER, **TRUTH}, "pose topic", 202, 204),
    (JARVIS, {**LOWER, **TRUTH}, "pose topic", 212, 213),
    # By tf the last scan is late by 0.5 ms; the topic starts two scans later than tf.
    ("bags/olin_mac_floor1/macfirst_floor_take_2", {}, "tf odometry", 356, 357),
    ("bags/olin_mac_floor1/macfirst_floor_take_2", {"pose": "/odom"}, "odometry topic", 354, 357),
    ("bags/olin_neato_2018/middle.bag", {"scan": "/scan"}, "tf odometry", 184, 185),
]


@pytest.mark.parametrize(("path", "options", "kind", "used", "total"), REAL)
def test_real_logs(
    shared_data: Path, path: str, options: dict[str, Any], kind: str, used: int, total: int
) -> None:
    notes = Notes()
    log = open_log(shared_data / path, notes)
    found = survey(log, notes, **options)
    assert (found.choice.source.kind, len(found), found.total) == (kind, used, total)
    assert sum(1 for _ in found.frames()) == used
    assert notes.total("skipped") == total - used
    assert not notes.of("lost")
    log.close()


CHOICES = {
    JARVIS: ["/driver_laser_navigation/laser_scan (LaserScan x204)", "laser_scan (LaserScan x213)"],
    "bags/olin_neato_2018/middle.bag": ["/scan (LaserScan x185)", "/stable_scan (LaserScan x184)"],
    "bags/crob_lab/guardian_3.bag": [
        "/hokuyo_back_scan (LaserScan x1038)",
        "/scan (LaserScan x1036)",
    ],
}


@pytest.mark.parametrize("path", CHOICES)
def test_real_logs_that_want_a_choice(shared_data: Path, path: str) -> None:
    with pytest.raises(UsageError) as caught:
        list(frames(shared_data / path))
    for topic in CHOICES[path]:
        assert topic in str(caught.value)


NO_POSES = [
    "bags/cartographer_backpack/b0-2014-07-21-12-42-53-tiny.bag",
    "bags/plotjuggler/tilt_laser.bag",  # a laser that tilts on a still table
    "bags/kev1n_hector/2021-01-29-20-05-03.bag",
]


@pytest.mark.parametrize("path", NO_POSES)
def test_real_logs_without_poses(shared_data: Path, path: str) -> None:
    with pytest.raises(FormatError, match=r"no pose source: looked for .*--poses match"):
        list(frames(shared_data / path))


def test_deskew_sharpens_a_real_room(shared_data: Path) -> None:
    """The share of hits under 10 cm from a drawn wall: 81 % as recorded, more when de-skewed."""
    import cv2

    plan = cv2.imread(str(shared_data / "maps/crob_lab/i-108_10mm.pgm"), cv2.IMREAD_GRAYSCALE)
    assert plan is not None
    far = 0.01 * cv2.distanceTransform((plan >= 90).astype(np.uint8), cv2.DIST_L2, 5)
    place = Pose(-14.5115, -3.7328, 0.02681).inverse()
    shares = []
    for deskew in (False, True):
        log = open_log(shared_data / JARVIS, Notes())
        near = []
        for frame in frames(log, scan=UPPER["scan"], deskew=deskew, **TRUTH):  # type: ignore[arg-type]
            hit = np.isfinite(frame.scan.ranges) & (frame.scan.ranges < 25)
            cells = np.floor(place.apply(points(frame)[hit]) / 0.01).astype(int)
            rows, cols = plan.shape[0] - 1 - cells[:, 1], cells[:, 0]
            inside = (rows >= 0) & (rows < plan.shape[0]) & (cols >= 0) & (cols < plan.shape[1])
            near.append(far[rows[inside], cols[inside]] < 0.1)
        shares.append(float(np.concatenate(near).mean()))
        log.close()
    assert shares[0] == pytest.approx(0.81, abs=0.01)
    assert shares[1] > shares[0] + 0.03
