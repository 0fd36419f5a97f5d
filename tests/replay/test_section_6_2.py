from __future__ import annotations

from pathlib import Path

import numpy as np

from formats.errors import Notes
from formats.frame import Pose
from formats.results.file import read_result
from scripts.section_6_2 import experiment, f2_over_time, start_of
from tests.localising import MOUNT, OFFICE, ROUND, WIDE, drifting, drive, way
from tests.ros_logs import RosLog
from tests.worlds import world_png

TRUTH = way(ROUND)[:80]
ORIGIN = Pose(12.0, -7.0, 0.0)


def test_both_priors_are_mapped_from_the_same_poses_from_two_starts(tmp_path: Path) -> None:
    log = RosLog()
    log.static("base_link", "laser", tuple(MOUNT))
    said = drifting(TRUTH)
    for k, sighting in enumerate(drive(OFFICE, TRUTH, said, cell=WIDE)):
        log.tf(k / 10, "odom", "base_link", tuple(said[k]))
        log.pose(k / 10, "/true", tuple(ORIGIN @ TRUTH[k]))
        step = 1.5 * np.pi / 89
        log.scan(
            k / 10, sighting.scan.ranges, angle_min=-0.75 * np.pi, increment=step, range_max=12.0
        )
    path = str(log.write(tmp_path / "drive.mcap"))
    plan = str(world_png(tmp_path / "plan.png", OFFICE))
    start = start_of(path, "/true", 0.0)
    assert np.allclose(start, ORIGIN @ TRUTH[0])
    found = experiment(
        path,
        plan,
        start,
        folder=str(tmp_path),
        plan_origin=ORIGIN,
        plan_resolution=WIDE,
        truth_poses="/true",
        resolution=0.1,
    )
    firsts = {}
    for name, result in found.items():
        assert set(result.counts) == {"none", "bayes", "paper"}
        poses = read_result(tmp_path / f"{name}.replay.mcap", Notes()).poses
        wanted = ORIGIN @ TRUTH[0] @ MOUNT
        firsts[name] = float(np.hypot(poses[0, 0] - wanted.x, poses[0, 1] - wanted.y))
        assert result.facts["pose_errors"]["ape_m"]["rmse"] < 0.25
        seconds = [s for s, _ in f2_over_time(result, "bayes")]
        assert seconds == sorted(seconds)
        assert f2_over_time(result, "bayes")[-1][1] > f2_over_time(result, "none")[-1][1]
    assert firsts["exact"] < 0.01 < firsts["variance"]
