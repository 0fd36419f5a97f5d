"""Edits of plans by hand: what each line means, and what is said of lines that mean nothing."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError
from formats.frame import Pose
from formats.plans.edits import read_plan_edits
from formats.plans.plan import Plan


def written(folder: Path, text: str) -> Path:
    path = folder / "flat.edits"
    path.write_text(text)
    return path


def plan_of(resolution: float | None) -> Plan:
    """A sheet of 100 x 80 px whose lower left corner lies at (2, 1) m."""
    grey = np.full((80, 100), 255, dtype=np.uint8)
    origin = Pose(2.0, 1.0, 0.0)
    return Plan(Path("flat.png"), grey, np.zeros((80, 100), np.int8), resolution, origin, True, {})


def test_every_form_is_read_with_its_line(tmp_path: Path) -> None:
    text = """# by hand
    add wall 1,2 3,4 5,6 7.5   # through three points
    remove wall 1,2 3,4 2

    add door 10,20 30,20 right
    add door 10,20 30,20
    remove door 5,5
    add window 1,1 9,1 2
    remove window 1,1 9,1 2
    add region 0,0 9,0 9,9
    remove region 0,0 9,0 9,9 0,9
    clear region 0,0 9,0 9,9
    """
    edits = read_plan_edits(written(tmp_path, text)).edits
    assert [(e.line, e.verb, e.thing) for e in edits] == [
        (2, "add", "wall"),
        (3, "remove", "wall"),
        (5, "add", "door"),
        (6, "add", "door"),
        (7, "remove", "door"),
        (8, "add", "window"),
        (9, "remove", "window"),
        (10, "add", "region"),
        (11, "remove", "region"),
        (12, "clear", "region"),
    ]
    assert edits[0].points.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert edits[0].thick == 7.5
    # y counts downwards: from the hinge to the right along x, the right hand points down
    assert [edits[2].swing, edits[3].swing] == [pi / 2, -pi / 2]


def test_metres_become_pixels_by_scale_and_corner(tmp_path: Path) -> None:
    text = "unit m\nadd wall 3,2 6,2 0.2\nunit px\nremove door 4,5\n"
    wall, door = read_plan_edits(written(tmp_path, text)).on(plan_of(0.05))
    # (3, 2) m lies 1 m right of and 1 m above the corner of 80 rows: 20 px; centres are whole
    assert np.allclose(wall.points, [[19.5, 59.5], [79.5, 59.5]])
    assert wall.thick == pytest.approx(4.0)
    assert door.points.tolist() == [[4, 5]]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("paint wall 1,2 3,4 5", "'paint wall' is no edit"),
        ("add", "'add' is no edit"),
        ("clear wall 1,2 3,4 5", "'clear wall' is no edit"),
        ("add wall 1,2 3,4", "wants two points X,Y or more, then a thickness"),
        ("add wall 1,2 5", "wants two points"),
        ("add wall 1,2 3,4 0", "thickness of 0 is not above 0"),
        ("add wall 1,2 3,4 -2", "not above 0"),
        ("add wall 1,2 1,2 3", "one and the same"),
        ("add wall 1,2 nan,4 3", "'nan' is out of range"),
        ("add wall 1,2 1e99,4 3", "'1e99' is out of range"),
        ("add wall 1;2 3,4 3", "'1;2' is not a point X,Y"),
        ("add wall 1,b 3,4 3", "'b' is not a number"),
        ("add door 1,2", "wants hinge"),
        ("add door 1,2 1,2", "one point"),
        ("add door 1,2 3,4 up", "'up' is not left or right"),
        ("remove door 1,2 3,4", "wants one point"),
        ("add region 1,2 3,4", "three corners"),
        ("unit feet", "not `unit px` or `unit m`"),
    ],
)
def test_a_line_that_is_no_edit_is_named(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(FormatError) as caught:
        read_plan_edits(written(tmp_path, f"# one\nadd wall 1,1 2,2 1\n{line}\n"))
    assert str(caught.value).startswith(f"{tmp_path / 'flat.edits'}: line 3: ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_text_is_said(tmp_path: Path) -> None:
    path = tmp_path / "flat.edits"
    for data in (b"\x89PNG\r\n\x1a\n\0\0", "add wall".encode("utf-16")):
        path.write_bytes(data)
        with pytest.raises(FormatError, match="not a text file of plan edits"):
            read_plan_edits(path)
    with pytest.raises(FormatError, match="is a folder"):
        read_plan_edits(tmp_path)
    with pytest.raises(FormatError, match="does not exist"):
        read_plan_edits(tmp_path / "none")


def test_an_empty_file_edits_nothing(tmp_path: Path) -> None:
    assert read_plan_edits(written(tmp_path, "\n# nothing yet\n")).edits == ()


def test_what_does_not_fit_the_plan_is_said_with_its_line(tmp_path: Path) -> None:
    metres = read_plan_edits(written(tmp_path, "unit m\nadd wall 3,2 6,2 0.2\n"))
    with pytest.raises(FormatError, match="line 2: is in metres, and nothing says how large"):
        metres.on(plan_of(None))
    beyond = read_plan_edits(written(tmp_path, "\nadd wall 300,20 600,20 9\n"))
    with pytest.raises(FormatError, match=r"line 2: lies outside of the plan \(100 x 80 px\)"):
        beyond.on(plan_of(0.05))
