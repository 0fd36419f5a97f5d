"""The frame stream: selection, what a run asks beforehand, and real logs."""

from __future__ import annotations

import json
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.log import Message, Topic
from formats.stream import frames, open_log, survey
from tests.drives import BEAMS, drive, points, surveyed
from tests.memory_log import MemoryLog
from tests.ros_logs import START_NS, RosLog

SECOND = 1_000_000_000


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


def test_transforms_that_lead_nowhere_are_dropped_from_long_logs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = drive()
    for k in range(20):
        log.tf(k / 10, "base_link", "wheel", (0.0, 0.0, k / 10))
        log.tf(k / 10, "odom", "map", (-1.0, 0.0, 0.0))  # a map that hangs below odom leads on
    monkeypatch.setattr("formats.streaming.gathering.MANY", 10)
    found, _ = surveyed(log)
    tree = found.way.gathered.tree
    assert tree.samples(("base_link", "wheel")) is None
    assert found.choice.map_frame == "map"
    assert found.poses[0, 0] == pytest.approx(1.2)


def test_a_thousand_frame_names_are_not_kept() -> None:
    log = drive()
    for k in range(1000):
        log.scan(0.5 + k / 1000, BEAMS, frame=f"damaged{k}")
    found, _ = surveyed(log)
    assert (found.total, len(found)) == (1020, 20)
    assert len(found.way.scans.names) == 256


def in_json(name: str, time_ns: int, **fields: Any) -> Message:
    """A message of Foxglove's, as JSON."""
    stamp = {"timestamp": {"sec": time_ns // SECOND, "nsec": time_ns % SECOND}}
    topic = Topic(f"/{name}", f"foxglove.{name}", "json")
    return Message(topic, time_ns, json.dumps(stamp | fields).encode())


def test_foxglove_messages_give_the_same_frames() -> None:
    log, messages = drive(range_min=0.0, range_max=inf), []
    for k in range(21):
        places = {
            ("odom", "base_link"): {"x": 0.05 * k},
            ("base_link", "laser"): {"x": 0.2},
        }
        for (parent, child), place in places.items():
            frames_ = {"parent_frame_id": parent, "child_frame_id": child}
            still = {"w": 1.0}
            t = log.ns(k / 10)
            messages.append(
                in_json("FrameTransform", t, translation=place, rotation=still, **frames_)
            )
        ends = {"start_angle": -pi / 2, "end_angle": pi / 2}
        if k < 20:
            messages.append(in_json("LaserScan", t, frame_id="laser", ranges=BEAMS, **ends))
    found = list(survey(MemoryLog(messages), Notes()).frames())
    for a, b in zip(found, survey(log.opened(), Notes()).frames(), strict=True):
        assert a.time_ns == b.time_ns
        assert a.pose == pytest.approx(b.pose)
        np.testing.assert_allclose(a.scan.bearings, b.scan.bearings, atol=1e-6)
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)


def small() -> list[Message]:
    log = drive(steps=5, time_increment=0.01)
    log.amcl_pose(0.1, (1.0, 2.0, 3.0))
    log.pose(0.2, "/pose", (1.0, 2.0, 3.0))
    log.odometry(0.3, (1.0, 2.0, 3.0))
    return log.opened()._messages


SMALL = small()
damage = st.tuples(st.integers(0, len(SMALL) - 1), st.integers(0, 10_000), st.integers(0, 255))


@settings(max_examples=150, deadline=None)
@given(st.lists(damage, min_size=1, max_size=12), st.booleans())
def test_damaged_payloads_give_frames_or_one_line(
    hits: list[tuple[int, int, int]], cut: bool
) -> None:
    messages = list(SMALL)
    for number, place, value in hits:
        data = bytearray(messages[number].data)
        if data and cut and value < 20:
            del data[place % len(data) :]
        elif data:
            data[place % len(data)] = value
        messages[number] = messages[number]._replace(data=bytes(data))
    said, made = "", []
    try:
        found = survey(MemoryLog(messages), Notes())
        made = list(found.frames())
    except FormatError as error:
        said = str(error)
    assert "\n" not in said
    assert bool(made) != bool(said)
    if made:
        assert len(made) <= len(found) <= found.total
        assert np.isfinite(found.poses).all()
        assert np.abs(found.poses).max() < 2e8
        assert all(len(frame.scan.bearings) == len(frame.scan.ranges) for frame in made)


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
