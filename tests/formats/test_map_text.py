"""Maps as text: a small one by hand, what is wrong with others, and Wean Hall's own."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.plans.file import Plan, open_plan

HEADER = """robot_specifications->global_mapsize_x                 20
robot_specifications->resolution                       10
robot_specifications->autoshifted_x                    0

global_map[0]: 2 3
"""
# x = 0: free, unknown, wall going up; x = 1: free, 0.75 free, wall
CELLS = "1.000 -1.000 0.000 \n1.000 0.750 0.020 \n"


def read(tmp_path: Path, text: str | bytes) -> Plan:
    path = tmp_path / "hall.dat"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return open_plan(path, Notes())


def test_a_line_is_one_x_and_its_numbers_go_up(tmp_path: Path) -> None:
    plan = read(tmp_path, HEADER + CELLS)
    assert plan.occupancy.tolist() == [[100, 98], [-1, 25], [0, 0]]
    assert plan.grey.tolist() == [[0, 5], [205, 191], [255, 255]]
    assert plan.resolution == 0.1
    assert plan.placed
    assert plan.origin == Pose(0.0, 0.0, 0.0)


def test_it_may_be_packed(tmp_path: Path) -> None:
    plan = read(tmp_path, gzip.compress((HEADER + CELLS).encode()))
    assert plan.occupancy.shape == (3, 2)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (HEADER + CELLS[:-8], "holds 5 cells, and says 2 x 3"),
        (HEADER.replace("2 3", "999999 999999") + CELLS, "999999 x 999999 cells is not read"),
        (HEADER.replace("2 3", "0 0") + CELLS, "0 x 0 cells is not read"),
        (HEADER.replace("2 3", "many") + CELLS, "without its size"),
        (HEADER + CELLS.replace("0.750", "0.7x0"), "a cell that is no number"),
        (HEADER + CELLS.replace("0.750", "1.750"), "neither -1 nor from 0 to 1"),
        (HEADER + CELLS.replace("0.750", "nan"), "neither -1 nor from 0 to 1"),
        (HEADER.replace("   10", "   0") + CELLS, ""),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text: str, problem: str, tmp_path: Path) -> None:
    if not problem:  # a scale of 0 is as good as none
        assert read(tmp_path, text).resolution is None
        return
    with pytest.raises(FormatError, match=problem):
        read(tmp_path, text)


def test_other_packed_files_are_no_plans(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="is not a picture that is read"):
        read(tmp_path, gzip.compress(b"hello"))


def test_wean_hall_holds_what_was_counted(shared_data: Path) -> None:
    plan = open_plan(shared_data / "carmen/cmu_wean/wean.dat.gz", Notes())
    assert plan.occupancy.shape == (800, 800)
    assert int((plan.occupancy == -1).sum()) == 466_143  # by awk on the text
    assert int((plan.occupancy == 0).sum()) >= 31_284
    assert np.isclose(plan.scale, 0.1)
