from __future__ import annotations

from itertools import combinations
from math import cos, pi, radians, sin

import cv2
import numpy as np
import pytest

from replay.drawing import extract
from replay.drawing.corners import harris_corners
from replay.drawing.georgiou import georgiou
from replay.drawing.ink import binarise, grown
from replay.drawing.triangles import (
    ANGLES,
    SIDES,
    Triangle,
    connectivity_check,
    doors_of,
)
from replay.planning.scores import score_doors, score_walls
from tests.drawings import Sheet, flat


def test_corners_of_a_square_are_where_its_corners_are() -> None:
    gray = np.full((80, 100), 255, dtype=np.uint8)
    gray[20:61, 30:71] = 0
    corners = harris_corners(gray)
    assert len(corners) == 4
    expected = np.array([[30, 20], [70, 20], [30, 60], [70, 60]])
    assert np.abs(corners - expected).max() <= 2


def test_a_sheet_without_corners_has_none() -> None:
    assert harris_corners(np.full((50, 60), 255, dtype=np.uint8)).shape == (0, 2)


def all_triples(corners: np.ndarray, ink: np.ndarray, low: float, high: float) -> set[Triangle]:
    """Algorithm 1's loop as it is printed: every unique combination of three corners.

    Lengths and angles by the law of cosines, one triple after the other.
    """
    found: set[Triangle] = set()
    for triple in combinations(range(len(corners)), 3):
        for apex in triple:
            b, c = (k for k in triple if k != apex)
            ab = np.hypot(*(corners[b] - corners[apex]))
            ac = np.hypot(*(corners[c] - corners[apex]))
            bc = np.hypot(*(corners[c] - corners[b]))
            if not (low <= ab <= high and low <= ac <= high):
                continue
            if abs(ab - ac) > SIDES * max(ab, ac):
                continue
            angle = np.arccos(np.clip((ab**2 + ac**2 - bc**2) / (2 * ab * ac), -1, 1))
            if not ANGLES[0] <= angle <= ANGLES[1]:
                continue
            if connectivity_check(corners, ink, apex, np.array([b]), np.array([c]))[0]:
                found.add(Triangle(apex, b, c))
    return found


@pytest.mark.parametrize(("shut", "swing"), [(0.0, pi / 2), (pi / 2, -pi / 2), (2.5, pi / 2)])
def test_the_tree_finds_the_same_doors_as_all_triples(shut: float, swing: float) -> None:
    sheet = Sheet.of(240, 280)
    sheet.wall(20, 110, 260, 122)
    sheet.door(130, 116, shut, swing, width=60)
    sheet.text("AB", 30, 60)
    ink = grown(binarise(sheet.gray), 3)
    corners = harris_corners(sheet.gray, most=60)
    assert len(corners) > 20
    slow = all_triples(corners, ink, 10, 80)
    fast = doors_of(corners, ink, 10, 80)
    assert len(fast) == len(set(fast))
    assert set(fast) == slow
    assert slow


def test_the_tree_finds_the_same_doors_among_corners_at_random() -> None:
    rng = np.random.default_rng(3)
    corners = rng.integers(5, 95, (40, 2)).astype(np.float64)
    ink = (rng.random((100, 100)) < 0.85).astype(np.uint8)  # most sides are joined by chance
    slow = all_triples(corners, ink, 15, 60)
    assert len(slow) > 50
    assert set(doors_of(corners, ink, 15, 60)) == slow


def test_two_of_three_sides_must_be_ink_and_an_arc_counts() -> None:
    corners = np.array([[20.0, 20.0], [70.0, 20.0], [20.0, 70.0]])
    first, second = np.array([1]), np.array([2])

    def check(*strokes: str) -> bool:
        ink = np.zeros((100, 100), dtype=np.uint8)
        for stroke in strokes:
            if stroke == "arc":
                t = np.linspace(0, pi / 2, 30)
                points = np.column_stack((20 + 50 * np.cos(t), 20 + 50 * np.sin(t)))
                cv2.polylines(ink, [np.rint(points).astype(np.int32)], False, 1, 2)
            else:
                a, b = (corners[int(k)].astype(int).tolist() for k in stroke)
                cv2.line(ink, a, b, 1, 2)
        return bool(connectivity_check(corners, ink, 0, first, second)[0])

    assert check("01", "02")
    assert check("01", "arc")
    assert check("02", "12")
    assert not check("01")
    assert not check("arc")


def test_every_door_of_a_flat_is_found_and_its_walls_from_them() -> None:
    sheet = flat()
    found = georgiou(sheet.gray)
    truth = [door.sector() for door in sheet.doors]
    assert score_doors(found.doors, truth) == (1, 1, 1)
    assert score_walls(found.walls, sheet.walls).f1_3px > 0.97
    assert not found.walls[625:].any()  # the title hangs on no wall


@pytest.mark.parametrize("turn_deg", range(0, 360, 45))
def test_a_swing_door_is_found_at_any_turn(turn_deg: int) -> None:
    turn = radians(turn_deg)
    sheet = Sheet.of(300, 300)
    along = np.array([cos(turn), sin(turn)])
    middle = np.array([150.0, 150.0])
    ends = np.rint([middle - 140 * along, middle + 140 * along]).astype(int)
    cv2.line(sheet.gray, ends[0].tolist(), ends[1].tolist(), 0, 9)
    hinge = middle - 35 * along
    door = sheet.door(round(hinge[0]), round(hinge[1]), turn, -pi / 2, width=70)
    ink = grown(binarise(sheet.gray), 3)
    corners = harris_corners(sheet.gray)
    triangles = doors_of(corners, ink, 40, 100)
    apexes = np.array([corners[triangle.apex] for triangle in triangles])
    assert np.hypot(*(apexes - door.hinge).T).min() < 9


def test_the_method_is_chosen_by_name() -> None:
    sheet = flat()
    one = extract(sheet.gray, method="georgiou")
    assert one.doors == georgiou(sheet.gray).doors


def test_blank_paper_has_no_doors_and_no_walls() -> None:
    found = georgiou(np.full((120, 160), 255, dtype=np.uint8))
    assert found.doors == []
    assert not found.walls.any()
