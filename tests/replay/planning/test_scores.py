from math import pi

import numpy as np
import numpy.typing as npt
import pytest

from replay.drawing.shapes import Door
from replay.planning.scores import harmonic, iou, quarter, score_doors, score_hinges, score_walls


def bar(row0: int, row1: int) -> npt.NDArray[np.bool_]:
    mask = np.zeros((40, 40), dtype=bool)
    mask[row0:row1, 5:35] = True
    return mask


def test_a_mask_against_itself_is_perfect() -> None:
    assert score_walls(bar(10, 14), bar(10, 14)) == (1, 1, 1, 1, 1)


def test_half_an_overlap_by_hand() -> None:
    got = score_walls(bar(10, 14), bar(12, 16))
    assert got.precision == pytest.approx(0.5)
    assert got.recall == pytest.approx(0.5)
    assert got.iou == pytest.approx(2 / 6)
    assert got.f1_3px == 1.0  # all rows lie within 3 px of the other bar


def test_what_lies_four_pixels_off_is_not_forgiven() -> None:
    got = score_walls(bar(10, 11), bar(14, 15))
    assert got.f1_3px == 0.0
    assert score_walls(bar(10, 11), bar(13, 14)).f1_3px == 1.0


def test_nothing_found_and_nothing_there_is_nought_not_an_error() -> None:
    empty = np.zeros((40, 40), dtype=bool)
    assert score_walls(empty, empty) == (0, 0, 0, 0, 0)
    assert score_doors([], []) == (0, 0, 0)


def test_precision_counts_ink_that_is_no_wall() -> None:
    got = score_walls(bar(10, 14) | bar(30, 34), bar(10, 14))
    assert got.precision == 0.5
    assert got.recall == 1.0
    assert got.f1 == pytest.approx(2 / 3)


def test_iou_of_squares_by_hand() -> None:
    a = np.array([[0, 0], [9, 0], [9, 9], [0, 9]], dtype=float)  # 100 px
    assert iou(a, a + np.array([5, 0])) == pytest.approx(50 / 150)
    assert iou(a, a + np.array([20, 0])) == 0.0


DOOR = Door((50.0, 50.0), (90.0, 50.0), pi / 2)


def test_a_door_is_found_once_and_by_its_sweep() -> None:
    truth = [DOOR.sector()]
    assert score_doors([DOOR], truth) == (1, 1, 1)
    assert score_doors([DOOR, DOOR], truth)[:2] == (0.5, 1.0)
    other_way = Door(DOOR.hinge, DOOR.end, -DOOR.swing)
    assert score_doors([other_way], truth) == (0, 0, 0)


def test_the_quarter_of_an_annotated_door_is_found_with_its_hinge() -> None:
    # as annotators draw it: a few points along the arc, and the opening in a thick wall
    arc = DOOR.sector()[[0, 1, 6, 12, 17]]
    opening = np.array([[50.0, 42.0], [90.0, 42.0]])
    polygon = np.vstack((arc[:1], opening, arc[1:]))
    fitted = quarter(polygon)
    assert np.hypot(*(np.array(fitted.hinge) - DOOR.hinge)) <= 8
    assert 40 <= fitted.width <= 48  # the opening's 8 px may count as part of the leaf


def test_hinge_and_width_both_count() -> None:
    truth = [DOOR.sector()]
    assert score_hinges([DOOR], truth).f1 == 1.0
    far = Door((75.0, 50.0), (115.0, 50.0), pi / 2)
    wide = Door(DOOR.hinge, (110.0, 50.0), pi / 2)
    assert score_hinges([far], truth).f1 == 0.0
    assert score_hinges([wide], truth).f1 == 0.0


def test_harmonic_of_nothing() -> None:
    assert harmonic(0, 0) == 0
    assert harmonic(0.5, 1.0) == pytest.approx(2 / 3)
