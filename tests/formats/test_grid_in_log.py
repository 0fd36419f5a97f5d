"""Maps in logs as plans: the last one, as nav2 validates it, or one line that says why not."""

from __future__ import annotations

import hashlib
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.plans.file import Plan, open_plan
from formats.results.file import read_result
from replay.cli import _exit_code
from tests.ros_logs import RosLog, pose_fields

GRID = "nav_msgs/msg/OccupancyGrid"
# y upwards in the message: the lowest row first
ROOM = [[100, 100, 100, 100], [100, 0, 0, 100], [100, 0, -1, 100], [100, 100, 60, 30]]
UPRIGHT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def say_map(
    log: RosLog, t: float = 0.0, rows: Any = ROOM, topic: str = "/map", **changed: Any
) -> RosLog:
    data = np.array(rows, dtype=np.int8)
    info = {
        "resolution": changed.get("resolution", 0.05),
        "width": changed.get("width", data.shape[1]),
        "height": changed.get("height", data.shape[0]),
        "origin": pose_fields(changed.get("origin", (-1.0, 2.0, 0.0))),
    }
    header = log.header(t, "map", None)
    log.say(t, topic, GRID, latched=True, header=header, info=info, data=data.ravel())
    return log


def written(tmp_path: Path, name: str = "a.mcap", **changed: Any) -> Path:
    return say_map(RosLog(), **changed).write(tmp_path / name)


def plan(path: Path, topic: str = "/map", notes: Notes | None = None, **options: Any) -> Plan:
    return open_plan(f"{path}:{topic}", notes or Notes(), **options)


@pytest.mark.parametrize("name", ["a.mcap", "a.bag", "folder"])
def test_a_map_in_a_log_is_a_plan_with_its_place(name: str, tmp_path: Path) -> None:
    log = say_map(RosLog())
    kind = "rosbag2-sqlite3" if name == "folder" else ""
    found = plan(log.write(tmp_path / name, kind))
    assert found.occupancy.tolist() == ROOM[::-1]  # row 0 on top
    assert found.grey[0].tolist() == [0, 0, 102, 178]  # 255 - 2.55 * 60, and of 30: 178.5
    assert found.grey[1, 2] == 205
    assert found.resolution == 0.05
    assert found.origin == Pose(-1.0, 2.0, 0.0)
    assert found.placed
    assert found.in_log


def test_the_file_of_the_log_is_the_input(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert plan(path).inputs == {str(path): hashlib.sha256(path.read_bytes()).hexdigest()}


def test_the_last_of_several_maps_counts(tmp_path: Path) -> None:
    log = say_map(RosLog())
    other = [[100, 0], [0, 0]]
    say_map(log, 1.0, other)
    notes = Notes()
    found = plan(log.write(tmp_path / "a.mcap"), notes=notes)
    assert found.occupancy.tolist() == other[::-1]
    assert "the last of 2 maps is taken" in " ".join(map(str, notes))


def test_the_origin_may_be_turned_and_options_overrule(tmp_path: Path) -> None:
    path = written(tmp_path, origin=(1.0, 2.0, pi / 2))
    assert plan(path).origin == pytest.approx((1.0, 2.0, pi / 2))
    found = plan(path, resolution=0.1, origin=Pose(5.0, 6.0, 0.0))
    assert (found.resolution, found.origin) == (0.1, Pose(5.0, 6.0, 0.0))


def test_the_topic_may_lack_its_slash_and_a_name_may_hold_a_colon(tmp_path: Path) -> None:
    path = written(tmp_path, "10:30.mcap")
    assert plan(path, "map").occupancy.shape == (4, 4)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "100000 x 100000": ({"width": 100_000, "height": 100_000}, "map of a wrong size"),
    "wrong length": ({"width": 5}, "map of a wrong size"),
    "no cells": ({"rows": np.zeros((0, 0))}, "a map of 0 x 0 cells"),
    "resolution 0": ({"resolution": 0.0}, "resolution is 0 m"),
    "resolution nan": ({"resolution": nan}, "resolution is nan m"),
    "resolution inf": ({"resolution": inf}, "resolution is inf m"),
    "resolution below 0": ({"resolution": -0.05}, "resolution is -0.05 m"),
    "value 101": ({"rows": [[100, 101], [0, 0]]}, "values from 0 to 101"),
    "value -2": ({"rows": [[100, -2], [0, 0]]}, "values from -2 to 100"),
    "origin nan": ({"origin": (nan, *UPRIGHT[1:])}, "origin is not finite"),
    "turn nan": ({"origin": (*UPRIGHT[:6], nan)}, "origin is not finite"),
    "turn of zeros": ({"origin": (0.0,) * 7}, "a quaternion of norm 0"),
    "turn of norm 2": ({"origin": (*UPRIGHT[:6], 2.0)}, "a quaternion of norm 2"),
    "tilted": ({"origin": (0.0, 0.0, 0.0, 0.2, 0.0, 0.0)}, "origin is tilted"),
    "no wall": ({"rows": [[0, 0], [0, -1]]}, "no pixel of it is wall"),
    "nothing known": ({"rows": [[-1, -1], [-1, -1]]}, "every pixel is grey 205"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_map_that_cannot_be_right_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    changed, problem = REFUSED[name]
    path = written(tmp_path, **changed)
    with pytest.raises(FormatError) as error:
        plan(path)
    assert problem in str(error.value)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_a_topic_that_is_no_map_names_those_that_are(tmp_path: Path) -> None:
    log = say_map(RosLog(), topic="/slam/map")
    log.scan(0.0, [1.0, 2.0])
    path = log.write(tmp_path / "a.mcap")
    with pytest.raises(UsageError, match=r"/map: no such topic; maps here: /slam/map"):
        plan(path)
    with pytest.raises(UsageError, match=r"is a sensor_msgs/msg/LaserScan, not a map"):
        plan(path, "/scan")


def test_a_log_without_a_topic_and_a_file_that_is_not_there(tmp_path: Path) -> None:
    path = written(tmp_path)
    with pytest.raises(FormatError, match=r"is a log, not a plan; a map in it is LOG:/TOPIC"):
        open_plan(path, Notes())
    with pytest.raises(FormatError, match=r"none\.mcap:/map: does not exist"):
        open_plan(f"{tmp_path}/none.mcap:/map", Notes())
    (tmp_path / "plan.txt").write_text("hello")
    with pytest.raises(FormatError, match=r"plan\.txt: is text, not a log"):
        open_plan(f"{tmp_path}/plan.txt:/map", Notes())


def walls() -> Any:
    rows = np.zeros((80, 120), dtype=np.int8)
    rows[0] = rows[-1] = 100
    rows[:, 0] = rows[:, -1] = 100
    return rows


def test_run_takes_the_map_of_the_very_log_and_that_of_a_result(tmp_path: Path) -> None:
    log = say_map(RosLog(), rows=walls(), origin=(-1.0, -2.0, 0.0))
    log.static("base_link", "laser", (0.0, 0.0, 0.0))
    for k in range(12):
        log.tf(k / 10, "map", "base_link", (0.1 * k, 0.0, 0.0))
        log.scan(k / 10, [1.9 - 0.01 * k] * 90)
    path, out, again = (tmp_path / name for name in ("a.mcap", "out.mcap", "again.mcap"))
    log.write(path)
    assert _exit_code(["run", str(path), "--prior", f"{path}:/map", "-o", str(out)]) == 0
    first = read_result(out)
    assert str(path) in first.facts["inputs"]
    words = ["run", str(path), "--prior", f"{path}:/map", "--truth", f"{out}:/prior"]
    assert _exit_code([*words, "-o", str(again)]) == 0
    np.testing.assert_array_equal(
        first.evidence().counts.sum(axis=(1, 2)),
        read_result(again).evidence().counts.sum(axis=(1, 2)),
    )


def test_the_log_of_a_prior_is_never_the_output(tmp_path: Path) -> None:
    path = written(tmp_path)
    before = path.read_bytes()
    words = ["run", str(path), "--prior", f"{path}:/map", "-o", str(path), "--force"]
    assert _exit_code(words) != 0
    other = written(tmp_path, "b.mcap")
    assert (
        _exit_code(["run", str(other), "--prior", f"{path}:/map", "-o", str(path), "--force"]) != 0
    )
    assert path.read_bytes() == before
