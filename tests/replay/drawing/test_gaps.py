"""Gaps in walls and the doors that shut them without an arc; windows are none."""

from __future__ import annotations

from math import cos, hypot, radians, sin

import cv2
import numpy as np
import pytest

from replay.drawing import Door, extract
from replay.drawing.gaps import find_gaps, patch
from replay.drawing.openings import gap_doors
from replay.reproduction.example_plans import Plan, symbol

WIDTH = 90.0


def wall_with_gap(turn_deg: float, gap: float = 70.0) -> np.ndarray:
    """A wall 12 px thick with an opening about the middle of a sheet of 400 x 400 px."""
    walls = np.zeros((400, 400), dtype=np.uint8)
    u = np.array([cos(radians(turn_deg)), sin(radians(turn_deg))])
    v = np.array([-u[1], u[0]])
    for a, b in ((-170, -gap / 2), (gap / 2, 170)):
        corners = np.array([a * u + 6 * v, b * u + 6 * v, b * u - 6 * v, a * u - 6 * v]) + 200
        cv2.fillPoly(walls, [np.rint(corners * 16).astype(np.int32)], 1, shift=4)
    return walls


@pytest.mark.parametrize("turn_deg", [0, 17, 45, 90, 128])
def test_an_opening_is_found_once_at_any_turn(turn_deg: int) -> None:
    (gap,) = find_gaps(wall_with_gap(turn_deg), 75.0)
    assert gap.ends
    assert abs(gap.width - 70) < 4
    assert abs(gap.thick - 13) < 3
    assert hypot(gap.at(0.5, 0.0)[0] - 200, gap.at(0.5, 0.0)[1] - 200) < 3


def test_openings_wider_or_narrower_than_doors_are_none() -> None:
    assert find_gaps(wall_with_gap(0, 20), 75.0) == []
    assert find_gaps(wall_with_gap(0, 240), 75.0) == []


def test_a_patch_shows_a_gap_along_its_middle_row() -> None:
    walls = wall_with_gap(30)
    (gap,) = find_gaps(walls, 75.0)
    seen = patch(walls, gap)
    ways = np.array(
        [[[0.1, 0.0], [0.9, 0.0]], [[-0.8, 0.0], [-0.1, 0.0]], [[1.1, 0.0], [1.8, 0.0]]]
    )
    shares = seen.along(ways[:, 0], ways[:, 1])
    assert shares[0] < 0.05
    assert shares[1] > 0.95
    assert shares[2] > 0.95


def found(kind: str, turn_deg: float, width: float = WIDTH) -> list[Door]:
    drawn, middle = symbol(kind, turn_deg, width, True)
    doors = extract(drawn.gray, resolution=0.9 / width).doors
    near = [d for d in doors if np.hypot(*(d.triangle().mean(axis=0) - middle)) < 0.5 * width]
    return [d for d in near if abs(d.width - width) < 0.15 * width]


@pytest.mark.parametrize("kind", ["sliding", "pocket", "folding"])
@pytest.mark.parametrize("turn_deg", [0.0, 30.0, 60.0, 135.0])
def test_what_slides_or_folds_is_found_and_named(kind: str, turn_deg: float) -> None:
    assert [door.kind for door in found(kind, turn_deg)] == [kind]


@pytest.mark.parametrize("lines", [(-4, 4), (-5, 0, 5), ()])
def test_a_window_or_an_empty_opening_is_no_door(lines: tuple[int, ...]) -> None:
    sheet = Plan.blank(400, 400)
    walls = wall_with_gap(0)
    sheet.gray[walls > 0] = 0
    for v in lines:
        sheet.line((165, 200 + v), (235, 200 + v))
    ink = (sheet.gray < 128).astype(np.uint8)
    assert gap_doors(walls, ink, [], [], 75.0) == []


def test_a_leaf_ajar_with_a_short_arc_is_found() -> None:
    """As toilets' doors are drawn: open by 30 degrees."""
    sheet = Plan.blank(400, 400)
    walls = wall_with_gap(0)
    sheet.gray[walls > 0] = 0
    sheet.leaf((165, 200), (234, 200), -radians(30))
    ink = (sheet.gray < 128).astype(np.uint8)
    (door,) = gap_doors(walls, ink, [], [], 75.0)
    assert np.hypot(door.hinge[0] - 165, door.hinge[1] - 200) < 8
    assert abs(door.width - 69) < 7
    assert abs(door.swing + radians(30)) < radians(6)


def test_treads_beside_an_opening_make_no_sliding_door() -> None:
    """Two rails in the gap are a sliding door on a bare floor, and the foot of a stair else."""
    sheet = Plan.blank(400, 400)
    walls = wall_with_gap(0)
    sheet.gray[walls > 0] = 0
    sheet.line((165, 197), (203, 197))
    sheet.line((197, 203), (235, 203))
    ink = (sheet.gray < 128).astype(np.uint8)
    (door,) = gap_doors(walls, ink, [], [], 75.0)
    assert door.kind == "sliding"
    for y in (222, 234, 246, 258):
        sheet.line((160, y), (240, y))
    ink = (sheet.gray < 128).astype(np.uint8)
    assert gap_doors(walls, ink, [], [], 75.0) == []


@pytest.mark.parametrize(("turn_deg", "far"), [(30, (30, 55)), (75, (14, 56))])
def test_what_a_leaf_would_sweep_is_floor(turn_deg: int, far: tuple[int, int]) -> None:
    """Hatching and fixtures hold lines that would do for a leaf and an arc."""
    sheet = Plan.blank(400, 400)
    walls = wall_with_gap(0)
    sheet.gray[walls > 0] = 0
    sheet.leaf((165, 200), (234, 200), -radians(turn_deg))
    ink = (sheet.gray < 128).astype(np.uint8)
    assert len(gap_doors(walls, ink, [], [], 75.0)) == 1
    for x in range(165 + far[0], 165 + far[1], 3):
        sheet.line((x, 160), (x, 199))
    ink = (sheet.gray < 128).astype(np.uint8)
    assert gap_doors(walls, ink, [], [], 75.0) == []
