"""map_server's pixels are read by nav2's rules, and what we write reads back to the same cells."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.grid import Geometry, Grid
from formats.plans.file import Plan, open_plan
from formats.plans.map_file import cells_of, write_map
from formats.plans.map_yaml import read_map_yaml
from formats.plans.raster import read_raster
from tests import pictures
from tests.map_server import nav2_cell, nav2_map
from tests.pictures import pgm, png

EVERY_GREY = np.arange(256, dtype=np.uint8).reshape(16, 16)


def map_at(folder: Path, picture: bytes, name: str = "map.pgm", **values: object) -> Path:
    """A picture and its yaml; the yaml's path."""
    said: dict[str, object] = {
        "image": name, "resolution": 0.05, "origin": [0, 0, 0], "negate": 0,
        "occupied_thresh": 0.65, "free_thresh": 0.196, **values,
    }  # fmt: skip
    (folder / name).write_bytes(picture)
    text = "".join(f"{key}: {value}\n" for key, value in said.items())
    path = folder / "map.yaml"
    path.write_text(text)
    return path


def cells(path: Path, notes: Notes | None = None) -> list[list[int]]:
    """The lowest row first."""
    found: list[list[int]] = open_plan(path, notes or Notes()).occupancy[::-1].tolist()
    return found


def test_trinary_by_hand(tmp_path: Path) -> None:
    """Occupied is 1 - v / 255: above 0.65 is v <= 89, below 0.196 is v >= 206."""
    row = np.array([[0, 89, 90, 205, 206, 255]], np.uint8)
    assert cells(map_at(tmp_path, pgm(row))) == [[100, 100, -1, -1, 0, 0]]


def test_negated_by_hand(tmp_path: Path) -> None:
    """Occupied is v / 255: above 0.65 is v >= 166, below 0.196 is v <= 49."""
    row = np.array([[0, 49, 50, 165, 166, 255]], np.uint8)
    assert cells(map_at(tmp_path, pgm(row), negate=1)) == [[0, 0, -1, -1, 100, 100]]


def test_scale_by_hand(tmp_path: Path) -> None:
    """With 0.2 and 0.8: v = 204 is 0.2, 0 %; v = 127 is 0.50196, rint(50.3) = 50; v = 51, 100."""
    row = np.array([[255, 204, 127, 51, 0]], np.uint8)
    path = map_at(tmp_path, pgm(row), mode="scale", occupied_thresh=0.8, free_thresh=0.2)
    assert cells(path) == [[0, 0, 50, 100, 100]]


def test_raw_by_hand(tmp_path: Path) -> None:
    row = np.array([[0, 50, 100, 101, 255]], np.uint8)
    notes = Notes()
    assert cells(map_at(tmp_path, pgm(row), mode="raw", negate=1), notes) == [[0, 50, 100, -1, -1]]
    assert "negate means nothing in mode raw" in str(notes.of("warning")[0])


def test_the_first_row_of_the_picture_is_the_highest(tmp_path: Path) -> None:
    path = map_at(tmp_path, pgm(np.array([[0, 255], [255, 205]], np.uint8)))
    plan = open_plan(path, Notes())
    assert plan.occupancy.tolist() == [[100, 0], [0, -1]]
    assert nav2_map(path)[0] == [[0, -1], [100, 0]]


THRESHOLDS = ((0.65, 0.196), (0.65, 0.25), (0.5, 0.1), (1.0, 0.0))
DRESSES = {
    "grey.pgm": pgm(EVERY_GREY),
    "grey.png": png(EVERY_GREY),
    "colours.png": png(
        np.random.default_rng(5).integers(0, 256, (9, 11, 3), dtype=np.uint8), pictures.RGB
    ),
    "rgba.png": png(
        np.random.default_rng(6).choice([0, 60, 205, 255], (9, 11, 4)).astype(np.uint8),
        pictures.RGBA,
    ),
    "alpha.png": png(
        np.random.default_rng(8).choice([0, 60, 205, 255], (9, 11, 2)).astype(np.uint8),
        pictures.GREY_ALPHA,
    ),
}


@pytest.mark.parametrize("name", DRESSES)
@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
@pytest.mark.parametrize("negate", [0, 1])
def test_equal_to_the_pixel_by_pixel_reading(
    tmp_path: Path, name: str, mode: str, negate: int
) -> None:
    for high, low in THRESHOLDS:
        values = {"mode": mode, "negate": negate, "occupied_thresh": high, "free_thresh": low}
        path = map_at(tmp_path, DRESSES[name], name, **values)
        said = read_map_yaml(path, path.read_bytes(), Notes())
        raster = read_raster(name, DRESSES[name], Notes())
        found = cells_of(name, raster, said, Notes())[::-1].tolist()
        assert found == nav2_map(path, grey_205=-1)[0]


def test_grey_205_is_unknown_whatever_ros_2_says(tmp_path: Path) -> None:
    pixels = np.full((10, 10), 205, np.uint8)
    pixels[0], pixels[1] = 0, 254
    notes = Notes()
    found = cells(map_at(tmp_path, pgm(pixels), free_thresh=0.25), notes)
    assert found == [[-1] * 10] * 8 + [[0] * 10] + [[100] * 10]
    said = "80 % of the pixels are grey 205: taken as unknown, though free_thresh 0.25"
    assert said in str(notes.of("warning")[0])
    notes = Notes()
    assert cells(map_at(tmp_path, pgm(pixels), free_thresh=0.196), notes) == found
    assert not list(notes)


@pytest.mark.parametrize(
    "picture",
    [
        png(np.full((2, 2, 3), 205, np.uint8) * np.array([[[1]], [[0]]], np.uint8), pictures.RGB),
        pgm(np.array([[205 * 257] * 2, [0, 0]], np.uint16), 65535),
    ],
)
def test_grey_205_in_colours_and_16_bits(tmp_path: Path, picture: bytes) -> None:
    name = "map.png" if picture[:1] == b"\x89" else "map.pgm"
    assert cells(map_at(tmp_path, picture, name, free_thresh=0.25)) == [[100] * 2, [-1] * 2]


def test_16_bits_count_in_full(tmp_path: Path) -> None:
    """occupied > 0.65 is v < 0.35 * 65535 = 22937.25; 8 bits could not tell these apart."""
    row = np.array([[22937, 22938, 65535]], np.uint16)
    assert cells(map_at(tmp_path, pgm(row, 65535))) == [[100, -1, 0]]


# ---- writing

GEOMETRY = Geometry(3, 4, 0.05, -0.1, 0.2)
VALUES = np.array([[-3.0, 3.0, 0.0, -1e-9], [1e-9, -2.0, 2.0, 0.0], [5.0, -5.0, 1.0, -1.0]])
OBSERVED = np.array([[1, 1, 1, 1], [1, 0, 0, 0], [0, 1, 1, 0]], dtype=bool)


def written(folder: Path, **options: object) -> tuple[Path, Path]:
    return write_map(folder / "out", Grid(GEOMETRY, VALUES), OBSERVED, **options)  # type: ignore[arg-type]


def test_trinary_export_byte_for_byte(tmp_path: Path) -> None:
    picture, text = written(tmp_path)
    assert (picture.name, text.name) == ("out.pgm", "out.yaml")
    top, middle, low = [205, 0, 254, 205], [254, 205, 205, 205], [0, 254, 254, 0]
    head = b"P5\n# replay 0.050 m/pix\n4 3\n255\n"
    assert picture.read_bytes() == head + bytes(top + middle + low)
    assert text.read_text() == (
        "image: out.pgm\nmode: trinary\nresolution: 0.05\norigin: [-0.1, 0.2, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def test_prior_in_unseen_cells_only_when_asked_for(tmp_path: Path) -> None:
    """Unseen cells show the grid, but one that says nothing (0) stays unknown."""
    written(tmp_path, fill_prior=True)
    found, _ = nav2_map(tmp_path / "out.yaml")
    assert found == [[100, 0, 0, 100], [0, 100, 0, -1], [0, 100, 0, 100]]


@pytest.mark.parametrize("fill_prior", [False, True])
def test_scale_export_keeps_the_probabilities(tmp_path: Path, fill_prior: bool) -> None:
    picture, _ = written(tmp_path, mode="scale", fill_prior=fill_prior)
    assert picture.name == "out.png"
    found, values = nav2_map(tmp_path / "out.yaml")
    assert values["mode"] == "scale"
    for r, c in product(range(3), range(4)):
        if fill_prior or OBSERVED[r, c]:
            p = 1 / (1 + np.exp(VALUES[r, c]))
            assert abs(found[r][c] / 100 - p) <= 0.5 / 255 + 0.005
        else:
            assert found[r][c] == -1


@pytest.mark.parametrize("mode", ["trinary", "scale"])
@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_ours_reads_back_what_nav2_reads(tmp_path: Path, mode: str, yaw: float) -> None:
    frame = Pose(0.0, 0.0, yaw)
    _, text = written(tmp_path, mode=mode, frame=frame)
    notes = Notes()
    plan = open_plan(text, notes)
    assert not list(notes)
    assert plan.occupancy[::-1].tolist() == nav2_map(text)[0]
    assert plan.corner == pytest.approx((GEOMETRY.x, GEOMETRY.y), abs=1e-12)
    assert plan.frame == frame
    assert plan.resolution == GEOMETRY.resolution


@given(
    arrays.arrays(np.float64, (5, 7), elements=st.floats(-7, 7)),
    arrays.arrays(np.bool_, (5, 7)),
    st.sampled_from([0.01, 0.03, 0.05, 0.1]),
    st.integers(-3000, 3000),
)
def test_every_map_reads_back_to_its_cells(
    tmp_path_factory: pytest.TempPathFactory,
    values: np.ndarray,
    seen: np.ndarray,
    side: float,
    col: int,
) -> None:
    values[0, 0], seen[0, 0] = -1.0, True  # a plan has a wall
    values[0, 1], seen[0, 1] = 1.0, True
    grid = Grid(Geometry(5, 7, side, col * side, -col * side), values)
    _, text = write_map(tmp_path_factory.mktemp("m") / "m", grid, seen)
    plan = open_plan(text, Notes())
    wanted = np.where(seen, np.where(values < 0, 100, 0), -1)
    assert np.array_equal(plan.occupancy[::-1], wanted)
    assert plan.corner == (grid.geometry.x, grid.geometry.y)


@pytest.mark.parametrize("name", ["a b: #", "0.5", "null", "ä", "[x]", "it's", "~"])
def test_odd_names_are_found_again(tmp_path: Path, name: str) -> None:
    _, text = write_map(tmp_path / name, Grid(GEOMETRY, VALUES), OBSERVED)
    notes = Notes()
    assert isinstance(open_plan(text, notes), Plan)
    assert not list(notes)
    nav2_map(text)


def test_both_files_or_none(tmp_path: Path) -> None:
    (tmp_path / "out.yaml").write_text("mine")
    with pytest.raises(FormatError, match=r"out\.yaml: exists already"):
        written(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["out.yaml"]
    written(tmp_path, force=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.pgm", "out.yaml"]


def test_an_input_is_not_replaced_even_with_force(tmp_path: Path) -> None:
    (tmp_path / "out.yaml").write_text("mine")
    with pytest.raises(FormatError, match="the output is also an input"):
        written(tmp_path, force=True, inputs=[tmp_path / "out.yaml"])
    assert (tmp_path / "out.yaml").read_text() == "mine"


def test_the_same_bytes_twice(tmp_path: Path) -> None:
    for mode in ("trinary", "scale"):
        first = [p.read_bytes() for p in written(tmp_path, mode=mode, force=True)]
        assert [p.read_bytes() for p in written(tmp_path, mode=mode, force=True)] == first


def test_the_oracle_by_hand() -> None:
    """README of nav2_map_server: the alpha channel is averaged in trinary, unknown in scale."""
    trinary = {"mode": "trinary", "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196}
    assert nav2_cell((255, 255, 255, 0), trinary) == -1  # shade 0.75, occupied 0.25
    assert nav2_cell((0, 0, 0, 255), trinary) == 100  # shade 0.25, occupied 0.75
    assert nav2_cell((255, 255), trinary) == 0
    assert nav2_cell((0, 0, 0, 254), {**trinary, "mode": "scale"}) == -1
