"""Which topic is the scan and where poses come from: a table of logs, and the errors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from formats.errors import UsageError
from formats.frame import Pose
from formats.stream import Options, frames
from tests.parts import (
    RANGES,
    Add,
    amcl,
    brief_map,
    drive,
    few_scans,
    global_odometry,
    map_odom,
    mount,
    odom,
    odometry,
    opened,
    reversed_map,
    scans,
    second_mount,
    second_scan,
    seldom_goal,
    slashed,
    truth,
    vicon,
)
from tests.ros_logs import RosLog

CASES: list[tuple[list[Add], Options, str, float]] = [
    # what the log holds, options, kind of source, x of the first pose
    ([odom, map_odom], {}, "tf", 100.2),
    ([odom, map_odom, truth, amcl, odometry], {}, "tf", 100.2),
    ([slashed], {}, "tf", 100.2),
    ([odom, reversed_map], {}, "tf", 100.2),
    ([vicon], {}, "tf", 200.2),
    ([odom, truth, amcl, odometry], {}, "pose topic", 300.2),
    ([odom, amcl, odometry], {}, "amcl_pose", 400.2),
    ([amcl], {}, "amcl_pose", 400.2),
    ([odom, odometry], {}, "tf odometry", 0.2),
    ([odometry], {}, "odometry topic", 500.2),
    ([global_odometry, odom], {}, "pose topic", 600.2),
    ([odom, truth, seldom_goal], {}, "pose topic", 300.2),
    ([odom, seldom_goal], {}, "tf odometry", 0.2),
    ([odom, map_odom, truth], {"pose": "/truth"}, "pose topic", 300.2),
    ([odom, map_odom, truth], {"pose": "truth"}, "pose topic", 300.2),
    ([odom, map_odom, odometry], {"pose": "/odom"}, "odometry topic", 500.2),
    ([odom, truth], {"pose": "tf"}, "tf odometry", 0.2),
    ([odom, map_odom], {"map_frame": "odom"}, "tf", 0.2),
    ([odom, map_odom], {"sensor_pose": Pose(0.5, 0.0, 0.0)}, "tf", 100.5),
    ([odom, map_odom], {"base_frame": "laser"}, "tf", 100.2),
    # A map frame that reaches 5 of 30 scans only is not enough where odometry reaches all.
    ([odom, brief_map], {}, "tf odometry", 0.2),
]


@pytest.mark.parametrize(("adds", "options", "kind", "x"), CASES)
def test_pose_source(adds: list[Add], options: Options, kind: str, x: float) -> None:
    found, notes = opened(drive(scans, mount, *adds), **options)
    assert found.choice.source.kind == kind
    assert found.poses[0, 0] == pytest.approx(x)
    assert found.choice.in_map == ("odometry" not in kind)
    assert any("odometry alone" in str(note) for note in notes) == ("odometry" in kind)
    assert len(found.choice.reasons) == 2
    assert [note.problem for note in notes.of("info")][-2:] == found.choice.reasons


def test_frames_are_named_with_their_reasons() -> None:
    found, _ = opened(drive(scans, mount, odom, map_odom))
    choice = found.choice
    assert (choice.map_frame, choice.base_frame, choice.sensor_frame) == (
        "map",
        "base_link",
        "laser",
    )
    assert choice.sensor_pose == pytest.approx((0.2, 0.0, 0.0))
    assert choice.reasons == [
        "scans from /scan (LaserScan: the only LaserScan)",
        "poses from tf map > base_link > laser (30 of 30 scans): tf knows the map frame",
    ]


def test_a_scan_on_the_body_needs_no_transform() -> None:
    log = RosLog()
    for k in range(10):
        log.scan(k / 10, RANGES, frame="base_link")
        log.pose(k / 10, "/pose", (k / 10, 0.0, 0.0))
    found, _ = opened(log)
    assert found.poses[:, 0].tolist() == pytest.approx([k / 10 for k in range(10)])


def test_a_scan_without_a_frame_sits_on_the_body_with_a_warning() -> None:
    log = drive(mount, odom)
    for k in range(10):
        log.scan(k / 10, RANGES, frame="")
    found, notes = opened(log)
    assert found.poses[0, 0] == 0.0
    assert any("scans name no frame" in str(note) for note in notes.of("warning"))


def test_several_scan_topics_are_listed_with_what_to_type() -> None:
    log = drive(scans, mount, odom, second_scan, second_mount)
    with pytest.raises(UsageError) as caught:
        opened(log)
    assert str(caught.value) == (
        "memory: 2 topics may be the scan: /rear (LaserScan x30), /scan (LaserScan x30); "
        "choose one with --scan /rear or --scan /scan"
    )
    assert opened(log, scan="/rear")[0].poses[0, 0] == pytest.approx(-0.2)
    assert opened(log, scan="rear")[0].choice.reasons[0] == (
        "scans from /rear (LaserScan: as asked for)"
    )


def test_the_only_scan_that_transforms_reach_is_taken() -> None:
    found, _ = opened(drive(scans, mount, odom, second_scan))
    assert found.choice.reasons[0] == (
        "scans from /scan (LaserScan: the only one that the transforms reach)"
    )


def test_a_topic_with_few_messages_is_not_a_peer() -> None:
    found, _ = opened(drive(scans, mount, odom, few_scans))
    assert found.choice.scan.name == "/scan"


def test_two_types_on_one_topic_give_the_laser_scan() -> None:
    log = drive(scans, mount, odom)
    for k in range(60):
        log.say(k / 20, "/scan", "std_msgs/msg/String", data="no scan")
    assert opened(log)[0].choice.scan.type == "sensor_msgs/msg/LaserScan"


def two_robots(log: RosLog, t: float, x: float) -> None:
    for robot, side in (("one", 10.0), ("two", 20.0)):
        if t == 0:
            log.static(f"{robot}/base_link", f"{robot}/laser", (0.2, 0.0, 0.0))
            log.static("map", f"{robot}/odom", (0.0, side, 0.0))
        log.tf(t, f"{robot}/odom", f"{robot}/base_link", (x, 0.0, 0.0))
        log.scan(t, RANGES, topic=f"/{robot}/scan", frame=f"{robot}/laser")


def test_two_robots_are_a_choice_and_each_has_its_own_chain() -> None:
    log = drive(two_robots)
    with pytest.raises(UsageError, match=r"2 topics may be the scan: /one/scan .* /two/scan"):
        opened(log)
    for robot, side in (("one", 10.0), ("two", 20.0)):
        found, _ = opened(log, scan=f"/{robot}/scan")
        assert (found.choice.map_frame, found.choice.base_frame) == ("map", f"{robot}/base_link")
        assert found.poses[0].tolist() == pytest.approx([0.2, side, 0.0])


def test_a_map_frame_may_also_choose_among_pose_topics() -> None:
    def other(log: RosLog, t: float, x: float) -> None:
        log.pose(t, "/other", (x, 0.0, 0.0), frame="other_map")

    found, _ = opened(drive(scans, mount, truth, other), map_frame="other_map")
    assert found.choice.source.topic is not None
    assert found.choice.source.topic.name == "/other"


def test_poses_in_another_frame_on_one_topic_are_counted() -> None:
    log = drive(scans, mount, truth)
    log.pose(1.05, "/truth", (0.0, 0.0, 0.0), frame="odom")
    found, notes = opened(log)
    assert len(found) == 30
    assert [str(note) for note in notes.of("skipped")] == [
        "memory: /truth: poses in odom among those in map ignored"
    ]


def test_several_pose_topics_are_listed_with_what_to_type() -> None:
    def other(log: RosLog, t: float, x: float) -> None:
        log.pose(t, "/other", (x, 0.0, 0.0))

    with pytest.raises(UsageError, match=r"2 topics may be .* --pose /other or --pose /truth"):
        opened(drive(scans, mount, truth, other))


def test_a_sensor_pose_replaces_what_tf_does_not_say() -> None:
    found, _ = opened(drive(scans, truth), sensor_pose=Pose(0.1, 0.2, 0.3))
    assert found.poses[0] == pytest.approx([300.1, 0.2, 0.3])


def test_sonar_topics_are_taken_only_where_there_is_no_laser() -> None:
    def sonar(log: RosLog, t: float, _x: float) -> None:
        header = log.header(t, "laser", None)
        fields: dict[str, Any] = {
            "field_of_view": 0.5,
            "min_range": 0.1,
            "max_range": 4.0,
            "range": 1.5,
        }
        log.say(t, "/sonar", "sensor_msgs/msg/Range", header=header, **fields)

    assert opened(drive(scans, sonar, mount, odom))[0].choice.scan.name == "/scan"
    found, _ = opened(drive(sonar, mount, odom))
    scan = next(iter(found.frames())).scan
    assert (scan.bearings.tolist(), scan.widths.tolist()) == ([0.0], [0.5])
    assert scan.ranges.tolist() == [1.5]


def test_frames_is_a_plain_loop() -> None:
    made: Iterator[object] = frames(drive(scans, mount, odom).opened())
    assert len(list(made)) == 30


def two_poses(apart: float) -> RosLog:
    """The poses of one SLAM on two topics, as hector_mapping says them."""
    log = drive(mount)
    for k in range(20):
        x, t = k / 10, k / 10
        log.pose(t, "/slam_out_pose", (x, 0.0, 0.0))
        log.amcl_pose(t, (x + apart, 0.0, 0.0), topic="/poseupdate")
        log.scan(t, RANGES)
    return log


def test_two_topics_that_say_the_same_poses_are_one() -> None:
    found, _ = opened(two_poses(0.0))
    assert found.choice.source.topic is not None
    assert found.poses[:, 0].tolist() == pytest.approx([k / 10 for k in range(20)], abs=0.3)
    with pytest.raises(UsageError, match=r"2 topics may be the robot's poses: /poseupdate"):
        opened(two_poses(0.1))
