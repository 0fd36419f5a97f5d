"""Cells of paper between strokes: shapes by hand, and which of them lie side by side."""

from __future__ import annotations

import cv2
import numpy as np

from replay.drawing.cells import Cells, stacked


def at(cells: Cells, row: int, col: int) -> int:
    return int(cells.labels[row, col])


def test_panes_lie_side_by_side_and_walls_in_a_row_do_not() -> None:
    ink = np.zeros((200, 400), dtype=np.uint8)
    cv2.rectangle(ink, (20, 50), (150, 70), 1, 2)
    cv2.rectangle(ink, (150, 50), (250, 70), 1, 2)
    cv2.line(ink, (150, 60), (250, 60), 1, 2)  # a window between two pieces of wall
    cv2.rectangle(ink, (250, 50), (380, 70), 1, 2)
    cells = Cells.of(ink, 1e5)
    chosen = cells.width < 30
    found = stacked(cells, chosen, 3)
    panes = {at(cells, 55, 200), at(cells, 65, 200)}
    assert set(np.flatnonzero(found).tolist()) == panes
    assert len(panes) == 2


def test_a_square_on_a_corner_fills_half_its_box_and_an_upright_one_all() -> None:
    ink = np.ones((60, 120), dtype=np.uint8)
    cv2.fillPoly(ink, [np.array([[30, 10], [50, 30], [30, 50], [10, 30]])], 0)
    ink[10:50, 70:110] = 0
    cells = Cells.of(ink, 1e5)
    assert abs(cells.boxed[at(cells, 30, 30)] - 0.5) < 0.03
    assert cells.boxed[at(cells, 30, 90)] == 1.0
