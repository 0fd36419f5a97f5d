"""Several robots in one log; rings of sonars."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.log import Topic
from formats.stream import frames, survey
from formats.streaming.ring import shared
from formats.streaming.robots import strangers
from replay.cli.info_text import info_report
from replay.inspecting.contents import inspect
from tests.drives import points
from tests.faults_world import PILLAR, ROOM, path, ray
from tests.ros_logs import RosLog

TF, POSE, SCAN = "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan"
Place = tuple[float, float, float]


def wall_distance(log: RosLog, scan: str = "") -> float:
    """m, the farthest that any return lies from the room's walls and the pillar."""
    worst = 0.0
    for frame in survey(log.opened(), Notes(), scan=scan).frames():
        good = np.isfinite(frame.scan.ranges)
        x, y = points(frame)[good].T
        off = [np.abs(x - ROOM[0]), np.abs(x - ROOM[2]), np.abs(y - ROOM[1]), np.abs(y - ROOM[3])]
        off += [np.abs(x - PILLAR[0]), np.abs(x - PILLAR[2])]
        off += [np.abs(y - PILLAR[1]), np.abs(y - PILLAR[3])]
        worst = max(worst, float(np.min(off, axis=0).max()))
    return worst


def on(pose: Place, mount: Place) -> Place:
    x, y, yaw = Pose(*pose) @ Pose(*mount)
    return x, y, yaw


def beams(pose: Place) -> list[float]:
    return [ray(pose[0], pose[1], pose[2] - pi + 2 * pi * i / 90) for i in range(90)]


MOUNTS: dict[str, Place] = {"/robot1": (0.1, 0.0, 0.0), "/robot2": (-0.2, 0.0, 2.0), "": (0, 0, 1)}


def fleet(robots: tuple[str, ...], poses: str) -> RosLog:
    """Robots that run the same nodes, frames called alike, each at a place of its own."""
    log = RosLog()
    for robot in robots:
        mount = MOUNTS[robot]
        log.tf(0.0, "base_link", "laser", mount, topic=f"{robot}/tf_static")
    for k in range(12):
        for number, robot in enumerate(robots):
            t = k / 10
            body = on(path(t), (0.0, -0.3 * number, 0.5 * number))
            if poses == "tf":
                log.tf(t, "map", "odom", (0.0, 0.0, 0.0), topic=f"{robot}/tf")
                log.tf(t, "odom", "base_link", body, topic=f"{robot}/tf")
            else:
                log.odometry(t, body, topic=f"{robot}/odom")
            given: dict[str, Any] = {"angle_min": -pi, "increment": 2 * pi / 90, "range_max": 4.0}
            log.scan(t, beams(on(body, MOUNTS[robot])), topic=f"{robot}/scan", **given)
    return log


@pytest.mark.parametrize("robots", [("/robot1", "/robot2"), ("/robot1", ""), ("", "/robot2")])
@pytest.mark.parametrize("poses", ["tf", "odom"])
def test_each_robot_is_mapped_by_its_own_poses(robots: tuple[str, ...], poses: str) -> None:
    log = fleet(robots, poses)
    with pytest.raises(UsageError, match="2 topics may be the scan"):
        survey(log.opened(), Notes())
    for robot, other in (robots, robots[::-1]):
        notes = Notes()
        drive = survey(log.opened(), notes, scan=f"{robot}/scan")
        assert len(drive) == 12
        assert wall_distance(log, f"{robot}/scan") < 1e-3
        way = "tf" if poses == "tf" else "odom"
        said = f"of other robots, left out: {other}/{way}, {other}/tf_static"
        assert said in [note.problem for note in notes]
        assert not [note for note in notes.of("warning") if "another" in note.problem]


def test_poses_of_another_robot_that_are_asked_for_are_taken() -> None:
    drive = survey(
        fleet(("/robot1", "/robot2"), "odom").opened(),
        Notes(),
        scan="/robot1/scan",
        pose="/robot2/odom",
    )
    assert drive.choice.source.topic is not None
    assert drive.choice.source.topic.name == "/robot2/odom"


def topics(*names: str) -> list[Topic]:
    kinds = {"tf": TF, "tf_static": TF, "odom": POSE, "scan": SCAN}
    return [Topic(name, kinds[name.rsplit("/", 1)[-1]], "cdr") for name in names]


@pytest.mark.parametrize(
    ("scan", "names", "others"),
    [
        ("/scan", ["/tf", "/tf_static", "/odom"], []),
        ("/front/scan", ["/rear/scan", "/tf", "/tf_static", "/front/tf_static"], []),
        # Lidar odometry beside the wheels': the same robot.
        ("/scan", ["/odom", "/kiss/odom", "/tf"], []),
        ("/lidar/scan", ["/lidar/odom", "/base/tf", "/tf_static"], []),
        ("/a/scan", ["/a/tf", "/b/tf", "/b/tf_static", "/tf"], ["/b/tf", "/b/tf_static"]),
        ("/a/scan", ["/a/tf", "/a/camera/tf", "/b/camera/tf"], ["/b/camera/tf"]),
        ("/fleet/a/scan", ["/fleet/a/tf", "/fleet/b/tf", "/fleet/tf"], ["/fleet/b/tf"]),
        ("/a/scan", ["/a/odom", "/b/odom", "/b/scan", "/tf"], ["/b/odom"]),
    ],
)
def test_whose_is_whose(scan: str, names: list[str], others: list[str]) -> None:
    known = topics(scan, *names)
    assert sorted(topic.name for topic in strangers(known, known[0])) == others


def ring(joined: bool) -> RosLog:
    """Eight sonars around a robot, on one topic or on one each."""
    log = RosLog()
    mounts = [(0.15 * cos(a), 0.15 * sin(a), a) for a in (i * pi / 4 for i in range(8))]
    for i, (x, y, yaw) in enumerate(mounts):
        log.static("base_link", f"sonar_{i}", (x, y, 0.1, 0.0, 0.0, yaw))
    for k in range(12):
        t = k / 10
        log.tf(t, "map", "base_link", path(t))
        for i, mount in enumerate(mounts):
            log.say(
                t,
                "/sonar" if joined else f"/sonar_{i}/range",
                "sensor_msgs/msg/Range",
                header=log.header(t, f"sonar_{i}", None),
                field_of_view=0.3,
                min_range=0.02,
                max_range=4.0,
                range=ray(*on(path(t), mount)),
            )
    return log


def test_a_ring_of_sonars_is_one_sensor(tmp_path: Path) -> None:
    each, one = ring(joined=False), ring(joined=True)
    notes = Notes()
    found = list(frames(each.write(tmp_path / "ring.mcap"), notes))
    expected = list(frames(one.opened()))
    assert len(found) == len(expected) == 96
    for a, b in zip(found, expected, strict=True):
        assert (a.time_ns, a.pose, a.scan.ranges) == (b.time_ns, b.pose, b.scan.ranges)
    assert wall_distance(each) < 1e-3
    assert not notes.of("warning")
    seen = inspect(tmp_path / "ring.mcap")
    lines = info_report(seen).splitlines()
    assert sum(line.endswith("<- scans") for line in lines) == 8
    assert "scans from /sonar_*/range (Range: the only Range)" in "\n".join(lines)
    assert len(list(frames(each.opened(), scan="/sonar_3/range"))) == 12


def test_rings_of_two_robots_are_a_choice() -> None:
    log = RosLog()
    for robot in ("/a", "/b"):
        log.odometry(0.0, (0.0, 0.0, 0.0), topic=f"{robot}/odom")
        fields: dict[str, Any] = {
            "header": log.header(0.0, "base_link", None),
            "field_of_view": 0.3,
        }
        log.say(0.0, f"{robot}/sonar", "sensor_msgs/msg/Range", **fields, max_range=4.0, range=1.0)
    with pytest.raises(UsageError, match="2 topics may be the scan"):
        survey(log.opened(), Notes())


def test_names_of_a_ring() -> None:
    assert shared(["/sonar_0", "/sonar_1", "/sonar_12"]) == "/sonar_*"
    assert shared(["/front/range", "/left/range"]) == "/*/range"
    assert shared(["/a", "/ab"]) == "/a*"


def prefixed(*lasers: str) -> RosLog:
    """A robot whose transforms have a prefix that its scans lack, with lasers on it."""
    log = RosLog()
    for frame in lasers:
        log.static("turtle/base_link", frame, MOUNTS["/robot1"])
    for k in range(12):
        t = k / 10
        log.tf(t, "odom", "turtle/base_link", path(t))
        given: dict[str, Any] = {"angle_min": -pi, "increment": 2 * pi / 90, "range_max": 4.0}
        log.scan(t, beams(on(path(t), MOUNTS["/robot1"])), frame="laser", **given)
    return log


def test_a_frame_may_lack_the_prefix_of_its_robot() -> None:
    log, notes = prefixed("turtle/laser", "turtle/imu"), Notes()
    survey(log.opened(), notes)
    said = "no transform knows the frame laser: taken as turtle/laser"
    assert said in [note.problem for note in notes.of("warning")]
    assert wall_distance(log) < 1e-3
    for lasers in (("turtle/imu",), ("turtle/front/laser", "turtle/rear/laser")):
        with pytest.raises(FormatError, match="no transform turtle/base_link <- laser"):
            survey(prefixed(*lasers).opened(), Notes())
