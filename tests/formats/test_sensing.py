"""Scans as seen from above: mirrored, projected, de-skewed; bad ones counted."""

from __future__ import annotations

import re
from math import cos, inf, nan, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.messages import LaserScan
from formats.sensing.scans import laser_scan
from formats.stream import survey
from tests.drives import BEAMS, drive, points, problems, surveyed
from tests.ros_logs import RosLog

SECOND = 1_000_000_000


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


def test_codes_that_are_no_distances_stay_codes_when_deskewed() -> None:
    """A 0.01 below range_min, or a no-return of range_max, moved by 2 cm would be a wall."""
    codes = [0.01, 10.0, 2.0, 0.01, 10.0]
    log = RosLog()
    log.static("base_link", "laser", (0.2, 0.0, 0.0))
    for k in range(5):
        log.tf(k / 10, "odom", "base_link", (0.1 * k, 0.0, 0.0))
        log.scan(k / 10, codes, time_increment=0.01)
    log.tf(0.5, "odom", "base_link", (0.5, 0.0, 0.0))
    kept = [0, 1, 3, 4]
    expected = np.array(codes, dtype=np.float32)[kept]
    for frame in surveyed(log)[0].frames():
        np.testing.assert_array_equal(frame.scan.ranges[kept], expected)


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
    "angle_increment is 1e-39": {"increment": 1e-39},
    "angle_min is 1e+30": {"angle_min": 1e30},
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
    assert problems(log) == [f"memory: /scan: {text.replace(chr(92), '')} at 1.95 s"]
    log.happened = [row for row in log.happened if row[1] != "/scan"]
    log.scan(0.5, ranges, **options)
    with pytest.raises(FormatError, match=re.escape(text)):
        surveyed(log)


def test_both_range_limits_zero_mean_none() -> None:
    found, notes = surveyed(drive(range_min=0.0, range_max=0.0))
    scan = next(iter(found.frames())).scan
    assert [scan.min_range, scan.max_range, found.limit] == [0.0, inf, inf]
    assert any("range_max is 0, inf or unsaid" in note for note in notes)


def test_doubles_that_are_no_floats_are_inf() -> None:
    """foxglove.LaserScan has ranges of 64 bits."""
    far = np.array([1.0, 1e300, -1e300, nan])
    reading = LaserScan(0, "laser", 0.0, 0.1, 0.0, 0.0, inf, far)
    assert laser_scan(reading, np.eye(4)).ranges.tolist() == pytest.approx(
        [1.0, inf, -inf, nan], nan_ok=True
    )


def test_a_signalling_nan_is_no_reading_and_no_warning() -> None:
    far = np.array([0x3F800000, 0x7FA00000], np.uint32).view(np.float32)
    reading = LaserScan(0, "laser", 0.0, 0.1, 0.0, 0.0, 9.0, far)
    tilted = np.eye(4)
    tilted[1:3, 1:3] = [[cos(0.04), -sin(0.04)], [sin(0.04), cos(0.04)]]
    ranges = laser_scan(reading, tilted).ranges.tolist()
    assert ranges == pytest.approx([1.0, nan], nan_ok=True)


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
