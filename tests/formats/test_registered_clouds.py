"""Clouds in a frame that does not move with the robot: seen from its body all the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from formats.depth.scans import cloud_scan, moved
from formats.errors import Notes
from formats.frame import Pose
from formats.messages import Cloud
from formats.stream import survey
from formats.streaming.way import matrix
from tests.faults_world import path
from tests.flat_sensors import cloud
from tests.ros_logs import RosLog

STEPS = 12
DRIFT = Pose(0.3, -0.2, 0.1)  # of odom in the map


def points(seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """What stands around a body, at heights within the slab, above it and on the floor."""
    rng = np.random.default_rng(seed)
    angles, away = np.linspace(-3, 3, 400), rng.uniform(1, 4, 400)
    heights = rng.choice([0.0, 0.3, 0.6, 1.8], 400)
    found = np.stack([away * np.cos(angles), away * np.sin(angles), heights], axis=1)
    found[::50] = np.nan
    return found


def drive(frame: str, poses: str) -> RosLog:
    """A body with a cloud at each step, said in its own frame or in one where it drives."""
    log = RosLog()
    for k in range(STEPS):
        t = k / 10
        body = Pose(*path(t))
        if poses == "odom topic":
            log.odometry(t, body, frame="camera_init", child="base_link")
        else:
            log.tf(t, "odom", "base_link", body)
        if poses == "map":
            log.tf(t, "map", "odom", DRIFT)
        there = {"base_link": Pose(0, 0, 0), "map": DRIFT @ body}.get(frame, body)
        m = matrix(there)
        cloud(log, t, points(k) @ m[:3, :3].T + m[:3, 3])
        log.happened[-1][4]["header"]["frame_id"] = frame
    return log


@pytest.mark.parametrize(
    ("frame", "poses"),
    [("odom", "odom"), ("odom", "map"), ("map", "map"), ("camera_init", "odom topic")],
)
def test_frames_are_those_of_the_cloud_in_the_bodys_own_frame(frame: str, poses: str) -> None:
    notes = Notes()
    found = list(survey(drive(frame, poses).opened(), notes).frames())
    expected = list(survey(drive("base_link", poses).opened(), Notes()).frames())
    assert len(found) == len(expected) == STEPS
    for a, b in zip(found, expected, strict=True):
        assert a.time_ns == b.time_ns
        assert a.pose == pytest.approx(b.pose, abs=1e-9)
        np.testing.assert_array_equal(a.scan.bearings, b.scan.bearings)
        # Floats of 32 bits in another frame: a point at the edge of a bin may change sides.
        same = np.isclose(a.scan.ranges, b.scan.ranges, atol=1e-5, equal_nan=True)
        assert same.mean() > 0.98
        assert np.isfinite(b.scan.ranges).sum() > 100
    said = f"their frame {frame} does not move with the robot: seen from base_link"
    assert said in [note.problem for note in notes]


def test_the_sensors_own_cloud_comes_before_the_mappers() -> None:
    log, own = drive("odom", "map"), drive("base_link", "map")
    for row in own.happened:
        if row[1] == "/points":
            log.happened.append((row[0], "/velodyne_points", *row[2:]))
    choice = survey(log.opened(), Notes()).choice
    assert choice.scan.name == "/velodyne_points"
    assert "the only one in a frame that moves with the robot" in choice.reasons[0]


def test_scans_in_such_a_frame_are_warned_of() -> None:
    log = RosLog()
    for k in range(STEPS):
        log.tf(k / 10, "odom", "base_link", path(k / 10))
        log.scan(k / 10, [1.0] * 9, frame="odom")
    notes = Notes()
    survey(log.opened(), notes)
    said = "their frame odom does not move with the robot: taken as seen from its origin"
    assert said in [note.problem for note in notes.of("warning")]


def test_clouds_with_nothing_at_the_heights_that_count_are_warned_of() -> None:
    """A flat cloud on the floor: what a laser's scan is as a cloud in odom."""
    log = drive("odom", "odom")
    for row in log.happened:
        if row[1] == "/points":
            flat = row[4]["data"].view("<f4").reshape(-1, 3)
            flat[:, 2] = 0.0
    notes = Notes()
    assert len(list(survey(log.opened(), notes).frames())) == STEPS
    said = "no return from 0.1 to 1 m above the floor: see --scan-height"
    assert said in [note.problem for note in notes.of("warning")]
    notes = Notes()
    seen = list(survey(log.opened(), notes, scan_height=(-0.1, 0.1)).frames())
    assert all(np.isfinite(frame.scan.ranges).any() for frame in seen)
    assert said not in [note.problem for note in notes.of("warning")]


def test_points_that_are_none_warn_nobody() -> None:
    """A signalling nan, infinities of both signs, the largest numbers: none of them is a point."""
    odd = np.array([0x7FA00000, 0x7F800000, 0xFF800000, 0x7F7FFFFF], np.uint32).view(np.float32)
    rows = np.stack([odd, odd[::-1], odd], axis=1)
    turned = matrix(Pose(1.0, 2.0, 0.7))
    scan = cloud_scan(moved(Cloud(0, "odom", rows), turned), np.eye(4))
    assert np.isnan(scan.ranges).all()
