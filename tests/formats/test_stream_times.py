"""Times are put right: clocks, passes, gaps, order; nothing is extrapolated."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.stream import survey
from tests.drives import BEAMS, drive, problems, surveyed
from tests.ros_logs import START_NS, RosLog

SECOND = 1_000_000_000


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
    assert not any("clocks" in note for note in notes)


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
        "memory: /scan: same stamp as the scan before at 0.60 s",
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
    with pytest.raises(FormatError, match=r"seem 86400.00 s apart: try --pose-delay 86400.00"):
        surveyed(log)
    assert len(surveyed(log, pose_delay=86400.0)[0]) == 20
    assert problems(log, pose_delay=86400.0) == []


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


def test_header_and_log_clocks_may_differ_as_long_as_they_agree_among_themselves() -> None:
    log = RosLog()
    for k in range(20):
        log.tf(k / 10 + 86400, "odom", "laser", (k / 10, 0.0, 0.0), at=k / 10)
        log.scan(k / 10 + 86400, BEAMS, at=k / 10)
    notes = Notes()
    assert len(survey(log.opened(), notes)) == 20
    assert any("stamps lie 86400.00 s before" in str(note) for note in notes.of("info"))


@pytest.mark.parametrize("log_time", [0, (1 << 64) - 1])
def test_log_times_may_be_meaningless(log_time: int) -> None:
    log = drive().opened()
    log._messages = [m._replace(time_ns=log_time) for m in log._messages]
    made = list(survey(log, Notes()).frames())
    assert [frame.time_ns for frame in made] == [START_NS + k * SECOND // 10 for k in range(20)]
    assert made[3].pose.x == pytest.approx(0.35)


def test_odd_stamps_are_carried_or_dropped_and_counted() -> None:
    log = drive()
    headers = [row[4]["header"]["stamp"] for row in log.happened if row[1] == "/scan"]
    headers[3]["sec"] -= 1
    headers[3]["nanosec"] += SECOND
    headers[5]["sec"] = -5
    found, _ = surveyed(log)
    assert found.times_ns[3] == log.ns(0.3)
    assert len(found) == 19
    assert problems(log) == [
        "memory: /scan: nanoseconds of a second or more, carried",
        "memory: /scan: stamp before 1970 at 0.50 s",
    ]


def test_every_scan_twice_counts_once() -> None:
    log = drive()
    log.happened = [row for row in log.happened for _ in range(1 + (row[1] == "/scan"))]
    found, _ = surveyed(log)
    assert (found.total, len(found)) == (40, 20)
    assert problems(log) == ["memory: /scan: 20 x same stamp as the scan before (first at 0.00 s)"]


def test_a_teleport_costs_the_scans_in_its_step() -> None:
    log = drive()
    for row in log.happened:
        if row[1] == "/tf" and row[0] >= START_NS + SECOND:
            row[4]["transforms"][0]["transform"]["translation"]["y"] += 3.0
    log.scan(0.95, BEAMS)
    found, _ = surveyed(log)
    assert len(found) == 20
    assert problems(log) == [
        "memory: /tf: odom > base_link jumps by 3.0 m; not interpolated at 1.00 s",
        "memory: /scan: no transform odom > base_link across its jumps at 0.95 s",
    ]


def test_a_loop_of_transforms_is_an_error() -> None:
    log = drive()
    log.tf(0.0, "laser", "odom", (0.0, 0.0, 0.0))
    with pytest.raises(FormatError, match=r"memory: /tf: the transforms form a loop, .*laser"):
        surveyed(log)


def test_a_loop_elsewhere_harms_nobody() -> None:
    log = drive()
    for parent, child in (("a", "b"), ("b", "c"), ("c", "a")):
        log.tf(0.0, parent, child, (0.0, 0.0, 0.0))
    assert len(surveyed(log)[0]) == 20


def test_scans_of_a_second_frame_have_its_pose() -> None:
    log = drive()
    log.static("base_link", "other", (-0.2, 0.0, 0.0))
    log.happened[8][4]["header"]["frame_id"] = "other"
    found, _ = surveyed(log)
    assert log.happened[8][1] == "/scan"
    assert sorted(found.poses[3:4, 0] - 0.15) == pytest.approx([-0.2])
    assert problems(log) == ["memory: /scan: another frame than the first scan: laser, other"]


def test_odometry_carries_the_seldom_poses_of_amcl() -> None:
    """A square corner between two poses of amcl, 8 s apart; odometry is off by a turn of 90 deg."""
    log = RosLog()
    for k in range(101):
        t = k / 10
        x, y = min(t, 5.0), max(t - 5.0, 0.0)
        log.tf(t, "odom", "laser", (x, y, 0.0))
        log.scan(t, BEAMS)
        if k in (10, 90):
            log.amcl_pose(t, (7.0 - y, 2.0 + x, pi / 2))
    found, notes = surveyed(log)
    assert found.choice.source.kind == "amcl_pose"
    assert len(found) == 81
    corner = found.poses[40]  # at 5 s
    assert corner.tolist() == pytest.approx([7.0, 7.0, pi / 2])
    assert notes == [
        "memory: /scan: 10 x no pose on /amcl_pose before 1.00 s (first at 0.00 s)",
        "memory: /scan: 10 x no pose on /amcl_pose after 9.00 s (first at 9.10 s)",
    ]
    assert found.choice.reasons[1] == (
        "poses from /amcl_pose map > laser, carried by tf odom > laser "
        "(PoseWithCovarianceStamped, 81 of 101 scans): "
        "tf knows no map frame, no other topic the pose"
    )
