from __future__ import annotations

import cv2
import numpy as np
import pytest

from replay.drawing import Door, extract
from replay.planning.scores import score_doors, score_hinges, score_walls
from scripts.styled import STYLES
from tests.drawings import DOOR, Sheet, flat


@pytest.mark.parametrize("style", ["filled", "hatched"])
def test_walls_are_found_in_any_style_and_nothing_else_is(style: str) -> None:
    sheet = flat(style)
    found = extract(sheet.gray)
    score = score_walls(found.walls, sheet.walls)
    assert score.f1_3px > 0.97
    assert score.iou > 0.85
    assert not found.walls[625:].any()  # the title
    assert not found.walls[:95].any()  # the dimension line


def test_walls_between_two_lines_are_found_where_no_wall_is_filled() -> None:
    sheet = Sheet.of(700, 900)
    for box in ((100, 100, 800, 124), (100, 500, 800, 524), (100, 100, 124, 524)):
        sheet.wall(*box)
    sheet.wall(776, 100, 800, 524)
    sheet.gray[:] = 255
    inner = sheet.walls.astype(np.uint8)
    edges = inner - cv2.erode(inner, np.ones((3, 3), np.uint8))
    sheet.gray[edges > 0] = 0
    found = extract(sheet.gray, resolution=0.01)
    assert score_walls(found.walls, sheet.walls).f1_3px > 0.97


def test_lone_pieces_of_hollow_wall_are_found_where_nothing_else_is_drawn() -> None:
    sheet = Sheet.of(900, 1200)
    for box in ((100, 100, 700, 124), (300, 300, 324, 800), (500, 500, 1100, 524)):
        x0, y0, x1, y1 = box
        sheet.walls[y0:y1, x0:x1] = True
        cv2.rectangle(sheet.gray, (x0, y0), (x1 - 1, y1 - 1), 180, 1)
    assert score_walls(extract(sheet.gray).walls, sheet.walls).f1_3px > 0.97


def test_every_door_is_found_with_its_hinge_and_width() -> None:
    sheet = flat()
    found = extract(sheet.gray)
    truth = [door.sector() for door in sheet.doors]
    assert score_doors(found.doors, truth) == (1, 1, 1)
    assert score_hinges(found.doors, truth).f1 == 1.0
    assert abs(found.door_width - DOOR) < 3


def test_light_lines_on_a_dark_ground_give_the_same() -> None:
    sheet = flat()
    assert (extract(sheet.gray).walls == extract(255 - sheet.gray).walls).all()


def test_the_outline_holds_the_rooms_and_not_the_margin() -> None:
    sheet = flat()
    outline = extract(sheet.gray).outline
    assert outline[250, 300]
    assert outline[500, 500]
    assert not outline[650:].any()
    truth = np.zeros_like(outline)
    truth[100:600, 100:900] = True
    assert (outline & truth).sum() / (outline | truth).sum() > 0.97


def test_layers_share_no_pixel_and_hold_all_ink() -> None:
    sheet = flat()
    layers = extract(sheet.gray).layers
    total = np.sum([mask.astype(int) for mask in layers.values()], axis=0)
    assert total.max() == 1
    assert total[sheet.gray < 128].all()
    assert not total[sheet.gray == 255].any()
    assert layers["text"][640:].sum() > 0.95 * (sheet.gray[640:] < 128).sum()


@pytest.mark.parametrize("value", [255, 0, 128])
def test_a_sheet_of_one_colour_has_nothing(value: int) -> None:
    found = extract(np.full((200, 300), value, dtype=np.uint8))
    assert not found.walls.any()
    assert found.doors == []


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (3, 3), (40, 7)])
def test_tiny_pictures_are_taken(shape: tuple[int, int]) -> None:
    gray = np.full(shape, 255, dtype=np.uint8)
    gray[0, 0] = 0
    assert extract(gray).walls.shape == shape


def test_noise_is_taken() -> None:
    gray = np.random.default_rng(7).integers(0, 256, (300, 400)).astype(np.uint8)
    assert extract(gray).walls.shape == (300, 400)


def test_what_is_no_grey_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="grey picture"):
        extract(np.zeros((4, 4, 3), dtype=np.uint8))


def test_walls_of_two_lines_that_are_open_at_their_ends_are_solid() -> None:
    """As where windows are left out: the room in the wall is one with the room outside."""
    gray = np.full((700, 1000), 255, dtype=np.uint8)
    truth = np.zeros(gray.shape, dtype=np.bool_)
    for x0, y0, x1, y1 in ((200, 200, 215, 560), (200, 545, 700, 560), (440, 200, 455, 546)):
        cv2.rectangle(gray, (x0, y0), (x1, y1), 0, 2)
        truth[y0 : y1 + 1, x0 : x1 + 1] = True
    for a, b in ((170, 185), (600, 615)):  # two walls outside, nothing at their ends
        for y in (a, b):
            cv2.line(gray, (140, y), (860, y), 0, 2)
        truth[a : b + 1, 140:861] = True
    walls = extract(gray, resolution=0.01).walls
    missed = truth & ~cv2.dilate(walls.astype(np.uint8), np.ones((7, 7))).astype(np.bool_)
    false = walls & ~cv2.dilate(truth.astype(np.uint8), np.ones((7, 7))).astype(np.bool_)
    assert missed.sum() < 0.03 * truth.sum()
    assert false.sum() < 0.03 * truth.sum()


STYLED = (
    "coloured rooms",
    "hollow, double lines",
    "cross-hatched",
    "thin hollow, dimensioned",
    "hollow, turned by 7 degrees",
)


@pytest.mark.parametrize("style", STYLED)
def test_the_drawing_style_does_not_matter(style: str) -> None:
    sheet = STYLES[style]()
    found = extract(sheet.gray)
    assert score_walls(found.walls, sheet.walls).f1_3px > 0.98
    assert score_doors(found.doors, [door.sector() for door in sheet.doors]).f1 > 0.94


def test_the_outline_holds_a_room_with_a_glazed_front_and_no_terrace() -> None:
    sheet = Sheet.of(700, 1100)
    for box in ((100, 100, 900, 118), (100, 100, 118, 500), (100, 482, 900, 500)):
        sheet.wall(*box)
    sheet.wall(500, 100, 518, 500)
    for x in (880, 888, 898):  # the room on the right is shut by glass alone
        cv2.line(sheet.gray, (x, 118), (x, 482), 0, 1)
    cv2.line(sheet.gray, (100, 640), (500, 640), 0, 1)  # a terrace below
    for x in (100, 500):
        cv2.line(sheet.gray, (x, 500), (x, 640), 0, 1)
    outline = extract(sheet.gray, resolution=0.012).outline
    assert outline[300, 300]
    assert outline[300, 700]
    assert not outline[570, 300]
    assert not outline[300, 1000]


def test_a_round_wall_in_two_lines_is_no_door() -> None:
    sheet = STYLES["hollow, curved and slanted"]()
    bay = [d for d in extract(sheet.gray).doors if d.hinge[1] < 145 and d.opened[1] < 145]
    assert bay == []


def test_a_leaf_and_arc_drawn_as_bold_as_walls_are_a_door() -> None:
    sheet = Sheet.of(400, 500)
    for x0, x1 in ((20, 180), (320, 480)):
        cv2.rectangle(sheet.gray, (x0, 300), (x1, 314), 0, -1)
    door = Door((180, 300), (320, 300), -np.pi / 2)
    cv2.polylines(sheet.gray, [np.rint(door.sector()[1:]).astype(np.int32)], False, 0, 7)
    cv2.line(sheet.gray, (180, 300), (180, 160), 0, 7)
    found = extract(sheet.gray, resolution=0.9 / 140).doors
    assert score_doors(found, [door.sector()]).recall == 1.0
