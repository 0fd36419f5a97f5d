from __future__ import annotations

import cv2
import numpy as np
import pytest

from replay.drawing import ink
from replay.drawing.ink import (
    binarise,
    closed,
    directions,
    faint,
    noise,
    opened,
    opened_by,
    paper_tone,
    shrunk,
    straight,
    tones,
)


@pytest.mark.parametrize("side", [2, 3, 4, 7, 8])
def test_opening_keeps_a_fitting_square_where_it_is_and_drops_a_smaller_one(side: int) -> None:
    mask = np.zeros((40, 50), dtype=np.uint8)
    mask[10 : 10 + side, 20 : 20 + side] = 1
    assert (opened(mask, side) == mask).all()
    assert not opened(mask, side + 1).any()


def test_an_opening_by_a_rectangle_counts_rows_first() -> None:
    mask = np.zeros((20, 20), dtype=np.uint8)
    mask[4:6, 2:12] = 1
    assert (opened_by(mask, (2, 10)) == mask).all()
    assert not opened_by(mask, (10, 2)).any()


def test_closing_fills_a_gap_and_does_not_glue_to_the_edge() -> None:
    mask = np.zeros((20, 20), dtype=np.uint8)
    mask[5:15, 2:9] = 1
    mask[5:15, 11:18] = 1
    filled = closed(mask, 3)
    assert filled[5:15, 2:18].all()
    assert filled.sum() == 160


def test_faint_grey_hatching_is_ink_and_the_grain_of_a_scan_is_not() -> None:
    gray = np.full((100, 100), 255, dtype=np.uint8)
    gray[10:15] = 119
    gray[30:35] = 187
    assert binarise(gray).sum() == 1000
    rng = np.random.default_rng(1)
    scan = (255 - rng.integers(0, 12, (100, 100))).astype(np.uint8)
    scan[10:20] = 20
    assert binarise(scan).sum() == 1000


def test_a_block_with_any_ink_is_ink() -> None:
    mask = np.zeros((5, 7), dtype=np.uint8)
    mask[4, 6] = 1
    assert shrunk(mask, 3).tolist() == [[0, 0, 0], [0, 0, 1]]


def test_straight_keeps_long_lines_of_any_direction_and_drops_blobs() -> None:
    mask = np.zeros((60, 60), dtype=np.uint8)
    for k in range(40):
        mask[10 + k, 10 + k : 12 + k] = 1
    mask[5:12, 40:47] = 1
    kept = straight(mask, 20)
    assert kept[30, 30]
    assert not kept[5:12, 40:47].any()


def test_greys_are_counted_exactly(monkeypatch: pytest.MonkeyPatch) -> None:
    gray = np.random.default_rng(2).integers(0, 256, (123, 77)).astype(np.uint8)
    monkeypatch.setattr(ink, "EXACT", 1000)
    assert (tones(gray) == np.bincount(gray.ravel(), minlength=256)).all()


def test_normals_of_strokes_do_not_depend_on_the_bands_they_are_read_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mask = np.zeros((200, 160), dtype=np.uint8)
    for k in range(12):
        turn = k * np.pi / 12
        way = np.rint(70 * np.array([np.cos(turn), np.sin(turn)])).astype(int)
        mid = np.array([80, 100])
        cv2.line(mask, (mid - way).tolist(), (mid + way).tolist(), 1, 1)
    rows, cols = np.nonzero(mask)
    whole = directions(mask, rows, cols)
    monkeypatch.setattr(ink, "BAND", 160 * 9)
    for one, other in zip(whole, directions(mask, rows, cols), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)


def test_the_normal_of_a_line_lies_across_it() -> None:
    mask = np.zeros((100, 100), dtype=np.uint8)
    cv2.line(mask, (10, 20), (90, 60), 1, 1)
    nx, ny, sure = directions(mask, np.array([40]), np.array([50]))
    assert sure[0] > 0.9
    assert abs(nx[0] * 80 + ny[0] * 40) / np.hypot(80, 40) < 0.03


def test_coloured_floors_are_paper_and_what_is_drawn_on_them_is_ink() -> None:
    gray = np.full((300, 400), 255, dtype=np.uint8)
    gray[50:250, 50:350] = 225
    gray[50:250, 200:350] = 190
    gray[100, 60:340] = 60
    gray[150:156, 60:340] = 40
    wanted = np.zeros_like(gray)
    wanted[100, 60:340], wanted[150:156, 60:340] = 1, 1
    assert (binarise(gray) == wanted).all()
    assert paper_tone(gray) == 190


def test_the_shaded_side_of_a_noisy_scan_is_paper() -> None:
    rng = np.random.default_rng(4)
    paper = 240 - 30 * np.linspace(0, 1, 400)[None, :] + rng.normal(0, 7, (300, 400))
    gray = np.clip(paper, 0, 255).astype(np.uint8)
    gray[100:110] = 50
    assert noise(gray) == pytest.approx(7, abs=1)
    ink = binarise(gray)
    assert ink[100:110].all()
    assert ink.sum() < 4000 + 100


def test_dark_walls_are_no_floor_however_thick() -> None:
    gray = np.full((200, 200), 255, dtype=np.uint8)
    gray[50:150, 50:150] = 140
    assert paper_tone(gray) == 255
    assert binarise(gray).sum() == 10_000


def test_faint_lines_are_drawn_and_floors_of_their_own_tone_are_not() -> None:
    gray = np.full((300, 400), 255, dtype=np.uint8)
    gray[50:250, 50:200] = 235
    gray[20:24, 20:380] = 30
    gray[280, 20:380] = 240  # a hairline on white
    lines = faint(gray, binarise(gray))
    assert lines[20:24, 20:380].all()
    assert lines[280, 20:380].all()
    assert not lines[50:250, 50:200].any()
