"""The sheet apart from what is drawn on it: its place and its frame do not matter."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from replay.drawing import extract, sheet
from replay.drawing.sheet import Sheet
from tests.drawings import flat


def test_white_paper_about_a_drawing_moves_what_is_found_and_no_more() -> None:
    plain = flat().gray
    wide = np.full((plain.shape[0] + 300, plain.shape[1] + 210), 255, dtype=np.uint8)
    wide[250 : 250 + plain.shape[0], 130 : 130 + plain.shape[1]] = plain
    one, other = extract(plain, resolution=0.01), extract(wide, resolution=0.01)
    place = slice(250, 250 + plain.shape[0]), slice(130, 130 + plain.shape[1])
    assert (other.walls[place] == one.walls).all()
    assert other.walls.sum() == one.walls.sum()
    assert (other.layers["text"][place] == one.layers["text"]).all()
    ends = [np.array([door.hinge, door.end, door.opened]) for door in one.doors]
    moved = [np.array([door.hinge, door.end, door.opened]) - (130, 250) for door in other.doors]
    np.testing.assert_allclose(np.sort(moved, axis=0), np.sort(ends, axis=0), atol=1e-6)


def test_frame_and_title_block_are_layers_of_their_own_and_change_nothing() -> None:
    plain = flat().gray
    framed = cv2.copyMakeBorder(plain, 60, 160, 60, 60, cv2.BORDER_CONSTANT, value=255)
    high, wide = framed.shape
    cv2.rectangle(framed, (12, 12), (wide - 13, high - 13), 0, 2)
    cv2.rectangle(framed, (wide - 420, high - 130), (wide - 13, high - 13), 0, 2)
    cv2.putText(framed, "Drawing 7", (wide - 400, high - 50), cv2.FONT_HERSHEY_SIMPLEX, 2, 0, 3)
    cv2.ellipse(framed, (wide - 60, high - 60), (40, 40), 0, 180, 270, 0, 1)  # as a door's arc
    cv2.line(framed, (wide - 60, high - 60), (wide - 60, high - 100), 0, 1)
    found = extract(np.asarray(framed), resolution=0.01)
    assert (found.walls[60:-160, 60:-60] == extract(plain, resolution=0.01).walls).all()
    assert len(found.doors) == len(flat().doors)
    ink = framed < 128
    corner = np.zeros_like(ink)
    corner[high - 128 : high - 15, wide - 418 : wide - 15] = True
    assert found.layers["title block"][ink & corner].all()
    assert found.layers["frame"][12:14, 12 : wide - 12].all()
    total = np.sum([mask.astype(int) for mask in found.layers.values()], axis=0)
    assert total.max() == 1
    assert total[ink].all()


@pytest.mark.parametrize("shape", [(301, 402), (300, 401)])
def test_a_picture_worked_on_at_half_its_size_comes_back_whole(
    shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sheet, "LARGE", 1000)
    gray = np.full(shape, 255, dtype=np.uint8)
    cv2.rectangle(gray, (60, 40), (380, 280), 0, 12)
    half = Sheet.of(gray)
    assert half.scale == 2
    found = extract(gray, resolution=0.02)
    assert found.walls.shape == shape
    off = found.walls ^ (gray < 128)
    assert not cv2.erode(off.astype(np.uint8), np.ones((3, 3), np.uint8)).any()
    assert found.walls.any()
