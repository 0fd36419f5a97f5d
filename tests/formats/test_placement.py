"""Placements read back as they were written, and say where a picture's corner lies."""

from __future__ import annotations

import json
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError
from formats.frame import Pose
from formats.plans.placement import Placement, read_placement, write_placement

# 20 px a metre, not turned: metre (0, 0) lies at pixel (10, 89), y up in metres, down in pixels
PLAIN = np.array([[20.0, 0.0, 10.0], [0.0, -20.0, 89.0]])


def test_it_reads_back_to_the_same_bits(tmp_path: Path) -> None:
    matrix = np.array([[1 / 3, -0.1, 1e-17], [0.1, 1 / 3, 12345.678901234567]])
    written = Placement(matrix, "pixels", False, "plan.png", "ab" * 32, "m.pgm", {"score": 0.25})
    write_placement(tmp_path / "p.json", written)
    read = read_placement(tmp_path / "p.json")
    assert np.array_equal(read.matrix, matrix)
    assert (read.unit, read.confident, read.plan, read.source) == (
        "pixels",
        False,
        "plan.png",
        "m.pgm",
    )
    assert read.plan_sha256 == "ab" * 32
    assert read.facts == {"score": 0.25}


def test_the_corner_of_a_plan_that_is_not_turned() -> None:
    place = Placement(PLAIN, "metres")
    assert place.scale == 20.0
    assert not place.mirrored
    # the lower left corner of 100 rows is pixel (-0.5, 99.5): metre (-10.5 / 20, -10.5 / 20)
    assert place.origin((100, 300)) == pytest.approx(Pose(-0.525, -0.525, 0.0))


def test_the_corner_of_a_plan_that_lies_on_its_side() -> None:
    # the plan's x runs along the log's y: pixel = (10 + 20 Y, 50 + 20 X)
    place = Placement(np.array([[0.0, 20.0, 10.0], [20.0, 0.0, 50.0]]), "metres")
    assert not place.mirrored
    # pixel (-0.5, 99.5) -> Y = -0.525, X = 2.475
    assert place.origin((100, 300)) == pytest.approx(Pose(2.475, -0.525, pi / 2))


def test_a_mirrored_plan_is_flipped_first() -> None:
    # pixel = (290 - 20 X, 89 - 20 Y); flipped left to right (300 columns): (9 + 20 X, 89 - 20 Y)
    place = Placement(np.array([[-20.0, 0.0, 290.0], [0.0, -20.0, 89.0]]), "metres")
    assert place.mirrored
    assert place.origin((100, 300)) == pytest.approx(Pose(-0.475, -0.525, 0.0))


def test_pixels_have_y_down_on_both_sides() -> None:
    assert not Placement(np.array([[2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), "pixels").mirrored
    assert Placement(np.array([[2.0, 0.0, 0.0], [0.0, -2.0, 0.0]]), "pixels").mirrored


def test_a_map_picture_has_no_metres() -> None:
    with pytest.raises(FormatError, match="not a log"):
        Placement(np.eye(2, 3), "pixels", source="m.png").origin((10, 10))


GOOD = {"format": "replay placement", "version": 1, "unit": "metres", "matrix": PLAIN.tolist()}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, "no placement"),
        ({"version": 2}, "version 2"),
        ({"unit": "feet"}, "'feet'"),
        ({"matrix": [[1, 0], [0, 1]]}, "two rows of three"),
        ({"matrix": [[1, 0, float("nan")], [0, 1, 0]]}, "two rows of three"),
        ({"matrix": [[1, 0, "x"], [0, 1, 0]]}, "two rows of three"),
        ({"matrix": None}, "two rows of three"),
        ({"matrix": [[1, 0.2, 0], [0, 1, 0]]}, "turn, scale and shift"),
        ({"matrix": [[0, 0, 1], [0, 0, 1]]}, "turn, scale and shift"),
        ({"matrix": [[1e-300, 0, 0], [0, -1e-300, 0]]}, "turn, scale and shift"),
        ({"matrix": [[1e200, 0, 0], [0, -1e200, 0]]}, "beyond reason"),
        ({"matrix": [[50, 0, 1e308], [0, -50, 0]]}, "beyond reason"),
    ],
)
def test_what_is_no_placement_is_refused(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    path = tmp_path / "p.json"
    path.write_text(json.dumps({**GOOD, **change}))
    with pytest.raises(FormatError, match=said) as caught:
        read_placement(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00", "[" * 100_000, "7"])
def test_other_files_are_refused_in_a_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "p.json").write_text(text)
    with pytest.raises(FormatError, match=r"not JSON|no placement"):
        read_placement(tmp_path / "p.json")


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="No such file"):
        read_placement(tmp_path / "none.json")
