"""`--truth-poses`: errors that are known by construction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import UsageError
from formats.frame import Pose
from formats.trajectory import write_tum
from replay.running import run
from tests.ros_logs import RosLog

MOUNT = Pose(0.1, 0.0, 0.5)
WAY = [Pose(0.2 * k, 0.1 * k, 0.1 * k) for k in range(30)]
OFF = Pose(0.3, -0.4, 0.2)


def drive(frame: str = "map") -> RosLog:
    """Poses in tf, a scan at each of them, and on /true the same poses moved by OFF."""
    log = RosLog()
    log.static("base_link", "laser", tuple(MOUNT))
    for k, pose in enumerate(WAY):
        log.tf(k / 10, frame, "base_link", tuple(pose))
        log.pose(k / 10, "/true", tuple(OFF @ pose))
        log.scan(k / 10, [2.0] * 30, angle_min=-1.0, increment=0.05, range_max=4.0)
    return log


def mapped(tmp_path: Path, truth: str | Path, frame: str = "map") -> dict[str, Any]:
    path = drive(frame).write(tmp_path / "drive.mcap")
    found = run(
        path,
        truth_poses=truth,
        poses="log",
        pose="tf",
        output=tmp_path / "x.replay.mcap",
        force=True,
    )
    assert found.facts["said"]["truth"]
    errors: dict[str, Any] = found.facts["pose_errors"]
    return errors


def far(k: int) -> float:
    """m that OFF moves the sensor at the k-th pose."""
    here, there = WAY[k] @ MOUNT, OFF @ WAY[k] @ MOUNT
    return float(np.hypot(here.x - there.x, here.y - there.y))


def test_a_topic_is_the_truth_of_the_robot(tmp_path: Path) -> None:
    errors = mapped(tmp_path, "/true")
    wanted = np.array([far(k) for k in range(30)])
    assert errors["poses"] == 30
    assert errors["ape_m"]["rmse"] == pytest.approx(np.sqrt(np.mean(wanted**2)))
    assert errors["ape_deg"]["mean"] == pytest.approx(np.degrees(0.2))
    assert errors["rpe_m"]["max"] == pytest.approx(0.0, abs=1e-9)  # it is moved as a whole


def test_a_tum_file_is_the_truth_of_the_sensor(tmp_path: Path) -> None:
    path, start = tmp_path / "true.tum", RosLog().ns(0.0)
    times = [start + k * 100_000_000 for k in range(30)]
    write_tum(path, times, [OFF @ pose @ MOUNT for pose in WAY])
    errors = mapped(tmp_path, path)
    wanted = np.array([far(k) for k in range(30)])
    assert errors["ape_m"]["rmse"] == pytest.approx(np.sqrt(np.mean(wanted**2)))


def test_odometry_is_aligned_first(tmp_path: Path) -> None:
    errors = mapped(tmp_path, "/true", "odom")
    assert errors["aligned"]
    assert errors["ape_m"]["max"] == pytest.approx(0.0, abs=1e-9)


def test_relations_ask_for_no_frame(tmp_path: Path) -> None:
    start = RosLog().ns(0.0) / 1e9
    a, b = WAY[3] @ MOUNT, WAY[20] @ MOUNT
    step = a.inverse() @ b
    line = f"{start + 0.3:.6f} {start + 2.0:.6f} {step.x + 0.3} {step.y - 0.4} 0 0 0 {step.yaw}"
    path = tmp_path / "by-hand.relations"
    path.write_text(f"{line}\n1 2 0 0 0 0 0 0\n", encoding="utf-8")
    errors = mapped(tmp_path, path)
    assert (errors["relations"], errors["missed"]) == (1, 1)
    assert errors["relations_m"]["mean"] == pytest.approx(0.5, abs=1e-6)


def test_a_truth_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file and no such topic"):
        mapped(tmp_path, "/nothing")
