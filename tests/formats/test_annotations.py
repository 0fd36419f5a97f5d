import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from formats.errors import FormatError
from formats.plans.annotations import filled, read_truth

SVG = """<?xml version="1.0"?>
<svg xmlns="http://www.w3.org/2000/svg" version="1.1"><width>12</width><height>10</height>
<polygon class="Wall" points="1,1 8,1 8,2 1,2 " />
<polygon class="Wall" points="1,1 1,6 2,6 2,1" />
<polygon class="Door" points="4,2 7,2 4,5" />
<polygon class="Window" points="9,1 10,1 10,2 9,2" />
<polygon class="Sofa-1" points="5,5 6,5 6,6" />
</svg>"""


def test_polygons_of_an_svg_become_walls_doors_and_windows(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    path.write_text(SVG)
    truth = read_truth(path, (10, 12))
    expected = np.zeros((10, 12), dtype=bool)
    expected[1:3, 1:9] = True
    expected[1:7, 1:3] = True
    assert (truth.walls == expected).all()
    assert [d.tolist() for d in truth.doors] == [[[4, 2], [7, 2], [4, 5]]]
    assert len(truth.windows) == 1
    assert truth.has_doors


def test_the_annotation_of_another_drawing_is_refused_with_both_sizes(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    path.write_text(SVG)
    with pytest.raises(FormatError, match="drawing of 12x10, not 12x11"):
        read_truth(path, (11, 12))


def test_wall_rectangles_of_a_json_are_scaled_and_turned_upside_down(tmp_path: Path) -> None:
    table = {
        "floor": {"7": {"image": "a.png", "scale": 10.0}, "8": {"image": "b.png", "scale": 1.0}},
        "rect": {
            "1": {"floorID": 7, "x": [0.1, 0.1, 0.4, 0.4], "y": [-0.2, -0.3, -0.3, -0.2]},
            "2": {"floorID": 8, "x": [0, 0, 9, 9], "y": [0, -9, -9, 0]},
        },
    }
    path = tmp_path / "fp.json"
    path.write_text(json.dumps(table))
    truth = read_truth(path, (6, 8), drawing=tmp_path / "a.png")
    expected = np.zeros((6, 8), dtype=bool)
    expected[2:4, 1:5] = True
    assert (truth.walls == expected).all()
    assert not truth.has_doors
    with pytest.raises(FormatError, match=r"no walls for the drawing 'c\.png'"):
        read_truth(path, (6, 8), drawing="c.png")


def test_dark_pixels_of_a_mask_are_walls(tmp_path: Path) -> None:
    walls = np.zeros((5, 6), dtype=bool)
    walls[2, :] = True
    path = tmp_path / "mask.png"
    cv2.imwrite(str(path), np.where(walls, 0, 255).astype(np.uint8))
    assert (read_truth(path, (5, 6)).walls == walls).all()
    with pytest.raises(FormatError, match="drawing of 6x5, not 5x6"):
        read_truth(path, (6, 5))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"<svg>", "broken XML"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a/>', "defines entities"),
        (b"<svg/>", "no polygon of class Wall"),
        (b'<svg><polygon class="Wall" points="1,1 2"/></svg>', "points of a polygon"),
        (b'<svg><polygon class="Wall" points="1,1 2,2"/></svg>', "no polygon"),
        (b'<svg><polygon class="Wall" points="1,1 2,nan 3,3"/></svg>', "no polygon"),
        (b'{"floor": 3}', "not the JSON of MLSTRUCT-FP"),
        (b"{", "not the JSON of MLSTRUCT-FP"),
        (b"", "neither an annotation nor a picture"),
        (b"\x89PNG\r\n\x1a\n", "neither an annotation nor a picture"),
    ],
)
def test_what_is_no_annotation_is_said_in_one_line(
    tmp_path: Path, content: bytes, problem: str
) -> None:
    path = tmp_path / "bad"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=problem) as error:
        read_truth(path, (5, 5), drawing="a.png")
    assert "\n" not in str(error.value)


def test_a_missing_annotation_is_an_error_of_ours(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot be read"):
        read_truth(tmp_path / "none.svg", (5, 5))


def test_a_polygon_that_leaves_the_picture_is_cut_at_its_edge() -> None:
    mask = filled([np.array([[-5.0, -5.0], [2.0, -5.0], [2.0, 1.0], [-5.0, 1.0]])], (4, 4))
    assert mask.sum() == 6


def test_real_annotations_lie_on_the_ink(shared_data: Path) -> None:
    folder = shared_data / "plans_gt" / "cvc_fp"
    if not folder.is_dir():
        pytest.skip(f"no CVC-FP at {folder}")
    gray = cv2.imread(str(folder / "IId_CT0401.png"), cv2.IMREAD_GRAYSCALE)
    assert gray is not None
    truth = read_truth(folder / "IId_CT0401_gt_3.svg", (gray.shape[0], gray.shape[1]))
    ink = np.asarray(gray) < 128  # this drawing's walls are filled
    assert (ink & truth.walls).sum() / truth.walls.sum() > 0.9
    assert (ink & ~truth.walls).sum() / ink.sum() < 0.35
