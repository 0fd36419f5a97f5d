from __future__ import annotations

from math import pi, radians
from pathlib import Path

import numpy as np
import pytest

from formats.errors import Notes, UsageError
from formats.frame import Floats, Pose
from formats.plans.file import Plan, open_plan
from formats.stream import open_log, survey
from replay.localise.estimate import settled
from replay.localise.localising import LOCALISERS, localise
from replay.localise.poses import Poses
from tests.localising import CELL, MOUNT, OFFICE, TOUR, drifting, drive, way
from tests.ros_logs import RosLog
from tests.worlds import world_png

ORIGIN = Pose(12.0, -7.0, 0.4)  # of the picture's corner, in the yaml's frame


def log_of(truth: list[Pose]) -> RosLog:
    """Odometry in tf, a lidar of 270 degrees on its mounting."""
    log = RosLog()
    log.static("base_link", "laser", tuple(MOUNT))
    said = drifting(truth)
    for k, sighting in enumerate(drive(OFFICE, truth, said)):
        log.tf(k / 10, "odom", "base_link", tuple(said[k]))
        log.scan(
            k / 10,
            sighting.scan.ranges,
            angle_min=-0.75 * pi,
            increment=1.5 * pi / 89,
            range_min=0.05,
            range_max=12.0,
        )
    return log


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return open_plan(world_png(tmp_path / "p.png", OFFICE), Notes(), resolution=CELL, origin=ORIGIN)


def off(found: Poses, truth: list[Pose]) -> tuple[Floats, Floats]:
    """m and rad at every frame, in the frame of the plan's yaml."""
    wanted = np.array([ORIGIN @ pose @ MOUNT for pose in truth[: len(found.times_ns)]])
    error = found.poses - wanted
    return np.hypot(error[:, 0], error[:, 1]), np.abs(np.mod(error[:, 2] + pi, 2 * pi) - pi)


def test_poses_of_the_sensor_come_in_the_frame_of_the_plan_s_yaml(plan: Plan) -> None:
    truth = way(TOUR)
    notes = Notes()
    found = survey(log_of(truth).opened(), notes)
    poses = localise(found, plan, seed=1, notes=notes)
    places, turns = off(poses, truth)
    assert len(poses.times_ns) == len(found)
    assert np.sqrt(np.mean(places**2)) < 0.08
    assert places.max() < 0.25
    assert turns.max() < radians(8)
    assert 0 < poses.settled < len(found) / 2
    assert len(poses.particles) == len(poses.updates) < len(found) / 2
    assert poses.covariances.shape == (len(found), 3, 3)
    assert poses.covariances[0, 0, 0] > 1.0  # from anywhere
    assert settled(poses.covariances[poses.settled])
    assert not settled(poses.covariances[poses.settled - 1])
    said = [note.problem for note in notes if "amcl" in note.problem]
    seconds = (found.times_ns[poses.settled] - found.times_ns[0]) / 1e9
    assert said == [f"poses from amcl, certain after {seconds:.1f} s"]


def test_a_start_is_a_pose_of_the_body_in_that_frame(plan: Plan) -> None:
    truth = way(TOUR)[:50]
    found = survey(log_of(truth).opened(), Notes())
    start = ORIGIN @ truth[0] @ Pose(0.1, -0.1, 0.05)
    poses = localise(found, plan, start=start, covariance=np.diag([0.04, 0.04, 0.01]))
    assert poses.settled == 0
    assert off(poses, truth)[0].max() < 0.15


def test_the_covariance_is_turned_with_the_plan(plan: Plan) -> None:
    """An error along the yaml's x axis only, before any reading says more."""
    truth = way(TOUR)[:5]
    found = survey(log_of(truth).opened(), Notes())
    wide = np.diag([0.25, 1e-6, 1e-6])
    poses = localise(
        found,
        plan,
        start=ORIGIN @ truth[0],
        covariance=wide,
        effective_beams=1e-6,
        max_particles=5000,
    )
    deviations = np.sqrt(np.diag(poses.covariances[0]))
    assert deviations[:2] == pytest.approx([0.5, 0.001], rel=0.05)


def test_what_cannot_be_is_said(plan: Plan) -> None:
    found = survey(log_of(way(TOUR)[:5]).opened(), Notes())
    with pytest.raises(UsageError, match="no such localiser; there are amcl"):
        localise(found, plan, method="guess")


def test_never_certain_is_a_warning(plan: Plan) -> None:
    truth = [Pose(2.0, 1.4, 0.0)] * 3
    found = survey(log_of(truth).opened(), Notes())
    notes = Notes()
    poses = localise(found, plan, notes=notes, effective_beams=0.01)
    assert poses.settled == len(found)
    assert [note.kind for note in notes if "never was certain" in note.problem] == ["warning"]


@pytest.mark.parametrize("method", ["match", "fastslam"])
def test_what_starts_where_nothing_is_certain_is_never_certain(plan: Plan, method: str) -> None:
    """Scans lie well on the map of those before, but where that lies on the plan nobody knows."""
    truth = [Pose(2.0, 1.4, 0.0)] * 3
    found = survey(log_of(truth).opened(), Notes())
    poses = localise(found, plan, method=method, effective_beams=0.01, particles=3)
    assert poses.settled == len(found)


@pytest.mark.parametrize("method", LOCALISERS)
def test_a_counter_that_is_set_back_moves_no_robot(plan: Plan, method: str) -> None:
    """Half way odometry begins anew elsewhere."""
    truth = way(TOUR)
    log = RosLog()
    log.static("base_link", "laser", tuple(MOUNT))
    said = drifting(truth)
    half = len(truth) // 2
    for k, sighting in enumerate(drive(OFFICE, truth, said)):
        pose = said[k] if k < half else Pose(400.0, 300.0, 1.0) @ said[half].inverse() @ said[k]
        log.tf(k / 10, "odom", "base_link", tuple(pose))
        ranges = sighting.scan.ranges
        log.scan(
            k / 10,
            ranges,
            angle_min=-0.75 * pi,
            increment=1.5 * pi / 89,
            range_min=0.05,
            range_max=12.0,
        )
    found = survey(log.opened(), Notes())
    start = ORIGIN @ truth[0]
    poses = localise(found, plan, method=method, start=start, covariance=np.eye(3) * 1e-4)
    assert off(poses, truth)[0].max() < 0.3


def test_every_localiser_is_tested() -> None:
    assert set(LOCALISERS) == {"amcl", "match", "fastslam"}  # the others: test_slam.py


def jarvis(shared_data: Path, seeds: range) -> list[float]:
    """RMSE (m) against measured poses from when the filter is certain, inf where it never is."""
    notes = Notes()
    log = open_log(shared_data / "bags/crob_lab/jarvis_circular_path_fast.bag", notes)
    scan = "/driver_laser_navigation/laser_scan"
    found = survey(log, notes, scan=scan, map_frame="odom")
    truth = survey(
        log,
        notes,
        scan=scan,
        pose="/pose_ground_truth",
        pose_delay=0.135,
        sensor_pose=found.choice.sensor_pose,
    )
    plan = open_plan(
        shared_data / "maps/crob_lab/i-108_10mm.pgm",
        notes,
        origin=Pose(-14.5115, -3.7328, 0.02681),
    )
    rmse = []
    for seed in seeds:
        poses = localise(found, plan, seed=seed)
        _, i, j = np.intersect1d(poses.times_ns, truth.times_ns, return_indices=True)
        error = np.hypot(*(poses.poses[i] - truth.poses[j])[:, :2].T)[i >= poses.settled]
        rmse.append(float(np.sqrt(np.mean(error**2))) if error.size > 100 else np.inf)
    log.close()
    return rmse


def test_jarvis_is_found_on_the_drawn_plan(shared_data: Path) -> None:
    assert max(jarvis(shared_data, range(2))) < 0.10


@pytest.mark.slow
def test_jarvis_is_found_from_nine_of_ten_seeds(shared_data: Path) -> None:
    rmse = jarvis(shared_data, range(10))
    assert sum(error < 0.10 for error in rmse) >= 9


def test_the_turtlebot_sees_the_walls_of_its_map(shared_data: Path) -> None:
    import cv2

    notes = Notes()
    log = open_log(shared_data / "bags/olin_mac_floor1/macfirst_floor_take_2", notes)
    plan = open_plan(shared_data / "bags/olin_mac_floor1/maps/mac_1st_floor_final.yaml", notes)
    found = survey(log, notes)
    poses = localise(found, plan, seed=3)
    distance = plan.scale * cv2.distanceTransform(
        (~plan.wall).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )
    near = []
    for frame, pose in zip(found.frames(), poses.poses, strict=True):
        if frame.time_ns < found.times_ns[0] + 10e9:
            continue
        r = frame.scan.ranges.astype(float)
        good = (r > frame.scan.min_range) & (r < frame.scan.max_range)
        b = frame.scan.bearings[good]
        ends = (plan.origin.inverse() @ Pose(*pose)).apply(
            np.column_stack([r[good] * np.cos(b), r[good] * np.sin(b)])
        )
        cols, rows = np.floor(ends / plan.scale).astype(int).T
        rows = distance.shape[0] - 1 - rows
        inside = (cols >= 0) & (cols < distance.shape[1]) & (rows >= 0) & (rows < len(distance))
        hits = np.zeros(len(ends), dtype=bool)
        hits[inside] = distance[rows[inside], cols[inside]] <= 0.15
        near.append(hits)
    log.close()
    assert np.concatenate(near).mean() >= 0.80


@pytest.mark.slow
def test_a_corridor_is_told_from_its_other_end_by_the_room_at_the_end_of_the_drive(
    shared_data: Path,
) -> None:
    """Wean Hall, log 2: turned round, all of the drive but its last tenth fits the map as well."""
    import cv2

    notes = Notes()
    log = open_log(shared_data / "carmen/cmu_wean/robotdata2.log.gz", notes)
    plan = open_plan(shared_data / "carmen/cmu_wean/wean.dat.gz", notes)
    found = survey(log, notes, poses="odometry")
    poses = localise(found, plan, seed=1)
    away = plan.scale * cv2.distanceTransform(
        (~plan.wall).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )
    near = []
    for k, frame in enumerate(found.frames()):
        r, b = frame.scan.ranges.astype(float), frame.scan.bearings
        good = (r > 0.1) & (r < 0.99 * frame.scan.max_range)
        x, y, yaw = poses.poses[k]
        cols = ((x + r * np.cos(b + yaw) - plan.corner[0]) / plan.scale)[good].astype(int)
        rows = ((y + r * np.sin(b + yaw) - plan.corner[1]) / plan.scale)[good].astype(int)
        inside = (cols >= 0) & (cols < 800) & (rows >= 0) & (rows < 800)
        hits = np.zeros(len(cols))
        hits[inside] = away[799 - rows[inside], cols[inside]] <= 0.2
        near.append(float(hits.mean()) if hits.size else 1.0)
    log.close()
    assert np.mean(near[-len(near) // 10 :]) > 0.8  # turned round: 0.70
    assert poses.settled < len(found)
