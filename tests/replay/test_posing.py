"""`--poses`: who finds the poses of a run, and what the result says of them."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Floats, Pose
from formats.result import Result
from formats.results.file import read_result
from replay.running import run
from tests.localising import CELL, MOUNT, OFFICE, ROUND, TOUR, WIDE, drifting, drive, way
from tests.ros_logs import RosLog
from tests.worlds import world_png

ORIGIN = Pose(12.0, -7.0, 0.4)  # of the picture's corner, in the yaml's frame
TRUTH = way(TOUR)
AROUND = way(ROUND)[:150]


def log_of(
    truth: list[Pose], frames: Iterable[str] = ("odom",), cell: float = CELL, *, blind: bool = False
) -> RosLog:
    """Odometry, or more, in tf, and a lidar of 270 degrees on its mounting; blind: sees nothing."""
    log = RosLog()
    log.static("base_link", "laser", tuple(MOUNT))
    said = drifting(truth)
    for k, sighting in enumerate(drive(OFFICE, truth, said, cell=cell)):
        if "odom" in frames:
            log.tf(k / 10, "odom", "base_link", tuple(said[k]))
        if "map" in frames:
            log.tf(k / 10, "map", "odom", tuple((ORIGIN @ truth[k]) @ said[k].inverse()))
        log.scan(
            k / 10,
            np.full_like(sighting.scan.ranges, np.inf) if blind else sighting.scan.ranges,
            angle_min=-0.75 * pi,
            increment=1.5 * pi / 89,
            range_min=0.05,
            range_max=12.0,
        )
    return log


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """The office, placed by a yaml beside it."""
    return placed(tmp_path, CELL)


@pytest.fixture
def wide(tmp_path: Path) -> Path:
    """Twice as large, where the tour around touches no wall."""
    return placed(tmp_path, WIDE)


def placed(tmp_path: Path, cell: float) -> Path:
    x, y, yaw = ORIGIN
    text = f"image: plan.png\nresolution: {cell}\norigin: [{x}, {y}, {yaw}]\nnegate: 0\n"
    (tmp_path / "plan.yaml").write_text(
        text + "occupied_thresh: 0.65\nfree_thresh: 0.196\n", encoding="utf-8"
    )
    return world_png(tmp_path / "plan.png", OFFICE)


def mapped(tmp_path: Path, log: RosLog, prior: Path | None, **options: Any) -> Result:
    path = log.write(tmp_path / "drive.mcap")
    options = {"output": tmp_path / "x.replay.mcap", "force": True, **options}
    return run(path, prior, **options)


def errors(result: Path, truth: list[Pose]) -> tuple[Floats, Floats]:
    """m and rad of every pose on /pose, which is in the plan's own frame."""
    run_file = read_result(result, Notes())
    wanted = np.array([Pose(0, 0, -ORIGIN.yaw) @ ORIGIN @ pose @ MOUNT for pose in truth])
    off = run_file.poses - wanted
    return np.hypot(off[:, 0], off[:, 1]), np.abs(np.mod(off[:, 2] + pi, 2 * pi) - pi)


def test_odometry_and_a_placed_plan_are_localised(tmp_path: Path, plan: Path) -> None:
    found = mapped(tmp_path, log_of(TRUTH), plan, seed=1)
    said = found.facts["said"]["poses"]
    assert said[0].startswith("amcl on the plan (the log has odometry only), 0.")
    assert "certain after" in said[0]
    assert found.facts["poses_depend_on"] == "log, plan, seed 1"
    places, turns = errors(tmp_path / "x.replay.mcap", TRUTH)
    assert np.sqrt(np.mean(places**2)) < 0.08
    assert turns.max() < radians(8)


def test_poses_in_the_map_are_taken_as_they_are(tmp_path: Path, plan: Path) -> None:
    found = mapped(tmp_path, log_of(TRUTH, ("map", "odom")), plan)
    assert "poses" not in found.facts["said"]
    assert found.facts["poses_depend_on"] == "log"
    assert errors(tmp_path / "x.replay.mcap", TRUTH)[0].max() < 1e-6


def test_amcl_takes_the_odometry_where_the_map_is_known_too(tmp_path: Path, plan: Path) -> None:
    """The poses in the map, which somebody else found, must not leak into the filter."""
    alone = mapped(tmp_path, log_of(TRUTH), plan, poses="amcl")
    both = mapped(tmp_path, log_of(TRUTH, ("map", "odom")), plan, poses="amcl")
    assert both.facts["poses"].startswith("amcl on the plan (as asked for)")
    assert np.array_equal(alone.counts["bayes"], both.counts["bayes"])


def test_without_a_plan_odometry_stays_what_it_is(tmp_path: Path) -> None:
    notes = Notes()
    found = mapped(tmp_path, log_of(TRUTH), None, notes=notes)
    assert found.facts["poses_depend_on"] == "log"
    assert any("odometry alone" in note.problem for note in notes.of("warning"))


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(
    tmp_path: Path, plan: Path
) -> None:
    log, poses = log_of(TRUTH[:60]), []
    for seed in (5, 5, 6):
        mapped(tmp_path, log, plan, seed=seed)
        poses.append(read_result(tmp_path / "x.replay.mcap", Notes()).poses)
    assert np.array_equal(poses[0], poses[1])
    assert not np.array_equal(poses[0], poses[2])


def test_a_start_with_its_covariance(tmp_path: Path, plan: Path) -> None:
    start = ORIGIN @ TRUTH[0]
    found = mapped(
        tmp_path, log_of(TRUTH[:30]), plan, initial_pose=start, initial_cov=(0.01, 0.01, 0.005)
    )
    assert "certain after 0.0 s" in found.facts["poses"]
    assert found.facts["poses_depend_on"] == "log, plan, seed 0, start"
    assert errors(tmp_path / "x.replay.mcap", TRUTH[:30])[0].max() < 0.15


def test_every_scan_is_localised_though_few_are_mapped(tmp_path: Path, plan: Path) -> None:
    whole = mapped(tmp_path, log_of(TRUTH), plan, seed=1)
    poses = read_result(tmp_path / "x.replay.mcap", Notes()).poses
    few = mapped(tmp_path, log_of(TRUTH), plan, seed=1, every=10)
    assert few.facts["scans"] == -(-whole.facts["scans"] // 10)
    assert np.array_equal(read_result(tmp_path / "x.replay.mcap", Notes()).poses, poses[::10])


def test_the_covariance_is_in_the_result(tmp_path: Path, plan: Path) -> None:
    found = mapped(tmp_path, log_of(TRUTH), plan, seed=1)
    with AnyReader([tmp_path / "x.replay.mcap"]) as reader:
        topics = [c for c in reader.connections if c.topic == "/pose_with_covariance"]
        messages: list[Any] = [
            reader.deserialize(m, c.msgtype) for c, _, m in reader.messages(topics)
        ]
    assert len(messages) == found.facts["scans"]
    spread = np.array([message.pose.covariance for message in messages]).reshape(-1, 6, 6)
    assert np.allclose(spread, spread.transpose(0, 2, 1))
    assert spread[0, 0, 0] > 1.0  # from anywhere
    assert 0.0 < spread[-1, 0, 0] < 0.1
    assert 0.0 < spread[-1, 5, 5] < radians(15) ** 2
    assert not spread[:, 2:5].any()  # in the plane
    poses = read_result(tmp_path / "x.replay.mcap", Notes()).poses
    assert [m.pose.pose.position.x for m in messages] == pytest.approx(poses[:, 0].tolist())


def test_particles_are_in_the_result(tmp_path: Path, plan: Path) -> None:
    """All over the building at first, around the sensor's pose at the end; no more than 500."""
    mapped(tmp_path, log_of(TRUTH), plan, seed=1)
    out = tmp_path / "x.replay.mcap"
    with AnyReader([out]) as reader:
        topics = [c for c in reader.connections if c.topic == "/particle_cloud"]
        messages: list[Any] = [
            (time, reader.deserialize(m, c.msgtype)) for c, time, m in reader.messages(topics)
        ]
    run = read_result(out, Notes())
    assert {time for time, _ in messages} <= set(run.times_ns.tolist())
    assert {len(message.poses) for _, message in messages} == {500}
    places = [np.array([(p.position.x, p.position.y) for p in m.poses]) for _, m in messages]
    assert np.ptp(places[0], axis=0).min() > 2.0
    last = run.times_ns.tolist().index(messages[-1][0])
    assert messages[-1][1].header.frame_id == "map"
    there = run.map_to_plan.apply(run.poses[last : last + 1, :2])
    assert np.allclose(places[-1].mean(axis=0), there, atol=0.1)
    own = np.sqrt(run.covariances[last][[0, 1], [0, 1]])  # type: ignore[index]
    assert np.allclose(places[-1].std(axis=0), own, rtol=0.3, atol=0.02)


@pytest.mark.parametrize("poses", ["auto", "amcl"])
def test_a_filter_that_never_was_certain_is_warned_of(
    tmp_path: Path, plan: Path, poses: str
) -> None:
    """The lidar sees nothing, so that the robot may be anywhere."""
    notes = Notes()
    log = log_of(TRUTH[:30], blind=True)
    found = mapped(tmp_path, log, plan, poses=poses, notes=notes, max_particles=2000)
    assert "never certain" in found.facts["poses"]
    assert found.facts["settled_s"] is None
    said = [note.problem for note in notes.of("warning")]
    assert "amcl never was certain of the pose; the map may be wrong" in said


def test_a_plan_that_lies_under_the_odometry_is_mapped_by_it_then(
    tmp_path: Path, plan: Path
) -> None:
    """`auto` maps what the placement says, where the filter knows no better."""
    laid = drifting(TRUTH)[0] @ (ORIGIN @ TRUTH[0]).inverse()
    log, notes = log_of(TRUTH[:30], blind=True), Notes()
    found = mapped(tmp_path, log, plan, plan_pose=laid, notes=notes)
    assert found.facts["poses_depend_on"] == "log"
    assert found.facts["said"]["poses"][0].startswith("the log's odometry under the plan")
    said = [note.problem for note in notes.of("warning")]
    assert any("the log's odometry is taken" in line for line in said)
    poses = read_result(tmp_path / "x.replay.mcap", Notes()).poses
    mapped(tmp_path, log, plan, plan_pose=laid, poses="log")
    assert np.array_equal(read_result(tmp_path / "x.replay.mcap", Notes()).poses, poses)
    asked = mapped(tmp_path, log, plan, plan_pose=laid, poses="amcl")
    assert asked.facts["poses"].startswith("amcl on the plan (as asked for)")


def test_scans_alone_are_an_error_that_names_the_way_out(tmp_path: Path, plan: Path) -> None:
    with pytest.raises(FormatError, match=r"no pose source.*try --poses match"):
        mapped(tmp_path, log_of(TRUTH[:5], ()), plan)


def test_scans_alone_are_localised_on_a_plan(tmp_path: Path, wide: Path) -> None:
    """Scan matching is amcl's odometry."""
    found = mapped(tmp_path, log_of(AROUND, (), WIDE), wide, poses="amcl", seed=1)
    assert any("no odometry" in line for line in found.facts["said"]["log"])
    places, _ = errors(tmp_path / "x.replay.mcap", AROUND)
    assert np.sqrt(np.mean(places**2)) < 0.12


@pytest.mark.parametrize("method", ["match", "fastslam"])
def test_mapping_from_a_start_on_the_plan(tmp_path: Path, wide: Path, method: str) -> None:
    """Where none is given, amcl finds it."""
    log = log_of(AROUND, cell=WIDE)
    for start in (ORIGIN @ AROUND[0], None):
        found = mapped(tmp_path, log, wide, poses=method, initial_pose=start, particles=10, seed=1)
        assert found.facts["poses"].startswith(f"{method} on the plan (as asked for)")
        places, _ = errors(tmp_path / "x.replay.mcap", AROUND)
        assert np.sqrt(np.mean(places**2)) < 0.08


@pytest.mark.parametrize("method", ["match", "fastslam"])
def test_mapping_without_a_plan(tmp_path: Path, method: str) -> None:
    log = log_of(AROUND, () if method == "match" else ("odom",), WIDE)
    found = mapped(tmp_path, log, None, poses=method, particles=10)
    assert found.facts["poses"].startswith(f"{method} without a plan (as asked for)")
    assert found.facts["poses_depend_on"] == "log, seed 0"
    poses = read_result(tmp_path / "x.replay.mcap", Notes()).poses
    first = Pose(*poses[0].tolist())
    end = AROUND[0] @ MOUNT @ first.inverse() @ Pose(*poses[-1].tolist())
    wanted = AROUND[-1] @ MOUNT
    assert np.hypot(end.x - wanted.x, end.y - wanted.y) < 0.2


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"poses": "guess"}, UsageError, "no such way to poses"),
        ({"poses": "amcl", "prior": None}, UsageError, "needs a plan"),
        ({"poses": "log", "initial_pose": Pose(0, 0, 0)}, UsageError, "the poses are the log's"),
        ({"pose": "none"}, FormatError, "no pose source"),
        ({"max_particles": 0}, UsageError, "--max-particles"),
        ({"z_rand": 0.0}, UsageError, "--z-rand"),
    ],
)
def test_what_cannot_be_is_said(
    tmp_path: Path, plan: Path, options: dict[str, Any], error: type[Exception], said: str
) -> None:
    prior = options.pop("prior", plan)
    with pytest.raises(error, match=said):
        mapped(tmp_path, log_of(TRUTH[:5]), prior, **options)
    assert not (tmp_path / "x.replay.mcap").exists()
