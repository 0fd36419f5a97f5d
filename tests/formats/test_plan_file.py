"""Plans open as a user has them: with or without a yaml, inverted, transparent, pale, broken."""

from __future__ import annotations

import hashlib
import os
from math import pi
from pathlib import Path

import cv2
import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.plans.file import OPENERS, Plan, open_plan, overlap
from tests import pictures
from tests.pictures import chunk, drawn, exif, pgm, png

WORLD = [
    "..........",
    ".########.",
    ".#......#.",
    ".#......#.",
    ".####.###.",
    "..........",
]
ROOM = drawn(WORLD, {"#": 0, ".": 255})
WALL = np.array([[c == "#" for c in row] for row in WORLD])
YAML = """\
image: plan.png
resolution: 0.05
origin: [1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def put(folder: Path, data: bytes, name: str = "plan.png") -> Path:
    (folder / name).write_bytes(data)
    return folder / name


def opened(path: Path, **options: object) -> tuple[Plan, list[str]]:
    notes = Notes()
    plan = open_plan(path, notes, **options)  # type: ignore[arg-type]
    return plan, [note.problem for note in notes]


def refused(path: Path, **options: object) -> str:
    with pytest.raises(FormatError) as caught:
        open_plan(path, Notes(), **options)  # type: ignore[arg-type]
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(path.parent))
    return line


def test_dark_ink_is_wall(tmp_path: Path) -> None:
    plan, said = opened(put(tmp_path, png(ROOM)))
    assert np.array_equal(plan.wall, WALL)
    assert plan.known.all()
    assert np.array_equal(plan.grey, ROOM)
    assert (plan.resolution, plan.placed, plan.origin) == (None, False, Pose(0, 0, 0))
    assert said == []


def test_ink_is_below_half_of_white(tmp_path: Path) -> None:
    plan, _ = opened(put(tmp_path, png(np.array([[0, 126, 127, 128, 129, 255]], np.uint8))))
    assert plan.occupancy.tolist() == [[100, 100, 100, 0, 0, 0]]


def test_every_kind_of_picture_gives_the_same_walls(tmp_path: Path) -> None:
    tall = ROOM.repeat(16, 0).repeat(16, 1)
    for name in ("a.png", "a.pgm", "a.jpg", "a.tiff", "a.bmp"):
        assert cv2.imwrite(str(tmp_path / name), tall)
        assert np.array_equal(opened(tmp_path / name)[0].wall[8::16, 8::16], WALL)


def test_the_suffix_does_not_matter(tmp_path: Path) -> None:
    plan, _ = opened(put(tmp_path, png(ROOM), "plan.dat"))
    assert np.array_equal(plan.wall, WALL)


def test_inputs_are_named_by_their_hash(tmp_path: Path) -> None:
    path, text = put(tmp_path, png(ROOM)), tmp_path / "plan.yaml"
    text.write_text(YAML)
    hashes = {str(f): hashlib.sha256(f.read_bytes()).hexdigest() for f in (path, text)}
    assert opened(path)[0].inputs == hashes
    assert opened(text)[0].inputs == hashes


# ---- where it lies


@pytest.mark.parametrize("suffix", [".yaml", ".yml"])
def test_the_yaml_beside_it_is_found(tmp_path: Path, suffix: str) -> None:
    path = put(tmp_path, png(ROOM))
    (tmp_path / f"plan{suffix}").write_text(YAML)
    plan, said = opened(path)
    assert (plan.resolution, plan.origin, plan.placed) == (0.05, Pose(1.0, 2.0, 0.0), True)
    assert plan.extent == pytest.approx((1.0, 2.0, 1.5, 2.3))
    assert said == []


def test_its_values_hold_whatever_its_image_says(tmp_path: Path) -> None:
    path = put(tmp_path, png(ROOM))
    (tmp_path / "plan.yaml").write_text(YAML.replace("plan.png", "/home/u/other.png"))
    plan, said = opened(path)
    assert plan.resolution == 0.05
    assert said == ["its image says '/home/u/other.png'; its values are taken for plan.png"]
    (tmp_path / "plan.yaml").write_text(YAML.replace("image: plan.png\n", ""))
    assert opened(path)[1] == ["its image is missing; its values are taken for plan.png"]


def test_another_yaml_may_be_given(tmp_path: Path) -> None:
    path = put(tmp_path, png(ROOM))
    (tmp_path / "plan.yaml").write_text(YAML)
    (tmp_path / "other.yaml").write_text(YAML.replace("0.05", "0.1"))
    assert opened(path, yaml=tmp_path / "other.yaml")[0].resolution == 0.1


def test_options_overrule_the_yaml(tmp_path: Path) -> None:
    path = put(tmp_path, png(ROOM))
    (tmp_path / "plan.yaml").write_text(YAML)
    plan, _ = opened(path, resolution=0.1)
    assert (plan.resolution, plan.origin) == (0.1, Pose(1.0, 2.0, 0.0))
    plan, _ = opened(path, origin=Pose(7.0, 8.0, 0.5))
    assert (plan.resolution, plan.origin) == (0.05, Pose(7.0, 8.0, 0.5))


def test_options_do_without_a_yaml(tmp_path: Path) -> None:
    path = put(tmp_path, png(ROOM))
    plan, _ = opened(path, resolution=0.1)
    assert plan.extent == pytest.approx((0.0, 0.0, 1.0, 0.6))
    assert not plan.placed
    assert opened(path, resolution=0.1, origin=Pose(1, 0, 0))[0].placed


def test_no_scale_is_an_error_of_usage_when_it_is_needed(tmp_path: Path) -> None:
    plan, _ = opened(put(tmp_path, png(ROOM)))
    with pytest.raises(UsageError, match=r"plan\.png: nothing says how large.*--plan-resolution"):
        _ = plan.extent


def test_a_yaml_is_followed_to_its_picture(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    put(tmp_path / "sub", png(ROOM), "picture.png")
    (tmp_path / "plan.yaml").write_text(YAML.replace("plan.png", "sub/picture.png"))
    plan, said = opened(tmp_path / "plan.yaml")
    assert (plan.path, said) == (tmp_path / "sub" / "picture.png", [])
    absolute = YAML.replace("plan.png", str(tmp_path / "sub" / "picture.png"))
    (tmp_path / "plan.yaml").write_text(absolute)
    assert opened(tmp_path / "plan.yaml")[0].path == tmp_path / "sub" / "picture.png"


@pytest.mark.parametrize("image", ["/home/u/maps/map.pgm", "./gone.png", "x" * 300, "gone.pgm"])
@pytest.mark.parametrize("beside", ["plan.png", "plan.pgm"])
def test_a_picture_of_its_stem_stands_in(tmp_path: Path, image: str, beside: str) -> None:
    put(tmp_path, png(ROOM) if beside.endswith("g") else pgm(ROOM), beside)
    (tmp_path / "plan.yaml").write_text(YAML.replace("plan.png", image))
    plan, said = opened(tmp_path / "plan.yaml")
    assert plan.path.name == beside
    assert said == [f"its image {image!r} is not there; {beside} beside it is taken"]


def test_a_yaml_without_any_picture(tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(YAML)
    assert "plan.yaml: its image 'plan.png' is not there" in refused(tmp_path / "plan.yaml")


def test_a_yaml_that_names_itself(tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(YAML.replace("plan.png", "plan.yaml"))
    assert "is not a picture that is read" in refused(tmp_path / "plan.yaml")


def test_a_yaml_under_another_name(tmp_path: Path) -> None:
    put(tmp_path, png(ROOM))
    (tmp_path / "map.txt").write_text(YAML)
    assert opened(tmp_path / "map.txt")[0].resolution == 0.05


def test_a_faulty_yaml_beside_it_is_not_passed_over(tmp_path: Path) -> None:
    path = put(tmp_path, png(ROOM))
    (tmp_path / "plan.yaml").write_text(YAML.replace("0.05", "0"))
    assert "plan.yaml:2:13: resolution must be positive" in refused(path)


def test_a_turned_origin_by_hand(tmp_path: Path) -> None:
    """The corner lies at (1, 2); the picture's x axis points along the yaml's y axis."""
    path = put(tmp_path, png(ROOM))
    (tmp_path / "plan.yaml").write_text(YAML.replace("0.0]", f"{pi / 2}]"))
    plan, _ = opened(path)
    assert plan.corner == pytest.approx((2.0, -1.0))
    assert plan.frame == Pose(0.0, 0.0, pi / 2)
    ends = plan.frame.apply([plan.extent[:2], plan.extent[2:]])
    assert ends == pytest.approx(np.array([[1.0, 2.0], [1.0 - 0.3, 2.0 + 0.5]]))


def test_an_exif_turn_is_left_alone_under_a_yaml(tmp_path: Path) -> None:
    path = put(tmp_path, png(ROOM, extra=chunk(b"eXIf", exif(6))))
    assert opened(path)[0].wall.shape == (10, 6)
    (tmp_path / "plan.yaml").write_text(YAML)
    plan, said = opened(path)
    assert np.array_equal(plan.wall, WALL)
    assert said == ["its EXIF turn is ignored, since a map yaml holds for the stored rows"]


def test_overlap() -> None:
    assert overlap((0, 0, 2, 3), (1, 1, 5, 2)) == 1.0
    assert overlap((0, 0, 2, 3), (2, 0, 5, 2)) == 0.0
    assert overlap((0, 0, 2, 3), (0, 4, 2, 5)) == 0.0
    assert overlap((-1, -1, 1, 1), (-9, -9, 9, 9)) == 4.0


# ---- what is ink

LINES = np.full((200, 300), 255, np.uint8)
LINES[20:180, 20:24] = LINES[20:180, 276:280] = LINES[20:24, 20:280] = LINES[176:180, 20:280] = 0


def test_light_lines_on_a_dark_ground_are_turned_over(tmp_path: Path) -> None:
    plan, said = opened(put(tmp_path, png(255 - LINES)))
    assert np.array_equal(plan.wall, LINES == 0)
    assert np.array_equal(plan.grey, LINES)
    assert said == ["light lines on a dark ground: turned over"]


def test_ink_may_be_forced(tmp_path: Path) -> None:
    dark = put(tmp_path, png(255 - LINES), "dark.png")
    light = put(tmp_path, png(LINES), "light.png")
    plan, said = opened(dark, invert=False)
    assert (int(plan.wall.sum()), said) == (int((LINES == 255).sum()), [])
    plan, said = opened(light, invert=True)
    assert (int(plan.wall.sum()), said) == (int((LINES == 255).sum()), [])


def test_rooms_left_white_in_a_black_ground_are_rooms(tmp_path: Path) -> None:
    rooms = np.zeros((200, 300), np.uint8)
    rooms[30:90, 30:120] = rooms[100:180, 30:270] = rooms[85:105, 50:60] = 255
    plan, said = opened(put(tmp_path, png(rooms)))
    assert np.array_equal(plan.wall, rooms == 0)
    assert said == []


def test_black_on_a_transparent_ground(tmp_path: Path) -> None:
    pixels = np.dstack([ROOM * 0] * 3 + [255 - ROOM])
    plan, said = opened(put(tmp_path, png(pixels, pictures.RGBA)))
    assert np.array_equal(plan.wall, WALL)
    assert said == []


def test_white_on_a_transparent_ground(tmp_path: Path) -> None:
    pixels = np.dstack([ROOM * 0 + 255] * 3 + [255 - ROOM])
    plan, said = opened(put(tmp_path, png(pixels, pictures.RGBA)))
    assert np.array_equal(plan.wall, WALL)
    assert said == ["white ink on a transparent ground: its opacity is read as ink"]


def test_pale_ink(tmp_path: Path) -> None:
    pale = drawn(WORLD, {"#": 180, ".": 250})
    plan, said = opened(put(tmp_path, png(pale)))
    assert np.array_equal(plan.wall, WALL)
    assert said == ["its ink is pale: grey below 215 is taken as ink, not below 128"]


@pytest.mark.parametrize("unknown", [127, 128, 205])
def test_a_map_without_its_yaml(tmp_path: Path, unknown: int) -> None:
    pixels = drawn(WORLD, {"#": 0, ".": 254})
    pixels[0] = unknown
    plan, said = opened(put(tmp_path, png(pixels)))
    assert np.array_equal(plan.wall, WALL)
    assert np.array_equal(plan.known, pixels != unknown)
    grey = 205 if unknown == 205 else 127
    assert said == [f"17 % is grey {grey}, as in a map without its yaml: taken as unknown"]


# ---- what is no plan


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.full((9, 9), 255, np.uint8), "every pixel is white (9 x 9 pixels)"),
        (np.zeros((9, 9), np.uint8), "every pixel is black (9 x 9 pixels)"),
        (np.full((9, 9), 77, np.uint8), "every pixel is grey 77"),
        (np.zeros((1, 1), np.uint8), "every pixel is black (1 x 1 pixels)"),
        (np.array([[250, 255]], np.uint8), "no pixel of it is wall"),
        (np.array([[0, 9]], np.uint8), "every pixel of it is wall"),
    ],
)
def test_pictures_that_show_nothing(
    tmp_path: Path, pixels: np.ndarray[tuple[int, int], np.dtype[np.uint8]], words: str
) -> None:
    assert words in refused(put(tmp_path, png(pixels)))


def test_a_wholly_transparent_picture(tmp_path: Path) -> None:
    path = put(tmp_path, png(np.zeros((4, 4, 4), np.uint8), pictures.RGBA))
    assert "every pixel is white" in refused(path)


def test_a_map_without_a_wall(tmp_path: Path) -> None:
    path = put(tmp_path, png(np.array([[254, 205]], np.uint8)))
    (tmp_path / "plan.yaml").write_text(YAML)
    assert "no pixel of it is wall" in refused(path)
    put(tmp_path, png(np.array([[205, 206]], np.uint8)))
    (tmp_path / "plan.yaml").write_text(YAML.replace("0.196", "0.1"))
    assert "nothing in it is known" in refused(path)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"hello", "is not a picture that is read; give PNG"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "Git LFS pointer"),
        (b"%PDF-1.7\n", "the PDF is damaged or cut"),
        (b"<?xml version='1.0'?>\n<!-- x -->\n<svg xmlns=''/>", "is XML, but no SVG"),
        (b"<svg/>", "is XML, but no SVG"),
        (b"<!-- -->" * 500, "is not a picture that is read"),  # and no regex runs away on it
        (b"  0\nSECTION\n", "the DXF is cut"),
        (b"\x89MCAP0\r\n", "is a log"),
        (b"#ROSBAG V2.0\n", "is a log"),
        (b"SQLite format 3\0", "is a log"),
        (png(ROOM)[:40], "is cut at byte 40"),
    ],
)
def test_other_files_are_named(tmp_path: Path, data: bytes, words: str) -> None:
    assert words in refused(put(tmp_path, data))


def test_no_file_to_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder.yaml").mkdir()
    assert "does not exist" in refused(tmp_path / "gone.png")
    assert "does not exist" in refused(tmp_path / "gone.yaml")
    assert "is a folder" in refused(tmp_path / "folder.yaml")
    assert "is a folder" in refused(tmp_path / ".." / tmp_path.name)
    assert "not an ordinary file" in refused(tmp_path / "pipe")
    line = refused(tmp_path / ("x" * 300))
    assert "cannot be read: File name too long" in line or "does not exist" in line  # 3.14
    with pytest.raises(FormatError, match="is a folder"):
        open_plan(".", Notes())


def test_a_file_beyond_reason_is_not_read(tmp_path: Path) -> None:
    path = put(tmp_path, b"")
    os.truncate(path, 10**12)  # a hole: takes no room on the disk
    assert "bytes are too many for a plan" in refused(path)


def test_every_opener_is_tried_here(tmp_path: Path) -> None:
    # A new one needs its own test of a plan: test_map_text.py, test_plan_drawings.py.
    assert len(OPENERS) == 5
    assert OPENERS[0][0](png(ROOM))


# ---- real ones

EMPTY = ("bags/bham_pioneer/map.yaml", "maps/ut_gdc/2_doors.yaml")  # no picture; no map


def test_all_real_plans_open(shared_data: Path) -> None:
    kinds = (".png", ".pgm", ".jpg", ".yaml")
    count = 0
    for folder in ("maps", "plans", "plans_with_logs", "bags"):
        for path in sorted((shared_data / folder).rglob("*")):
            name = str(path.relative_to(shared_data))
            if path.suffix in kinds and path.name != "metadata.yaml" and name not in EMPTY:
                plan, said = opened(path)
                share = float(plan.wall.mean())
                assert 0.001 < share < 0.2, name
                assert len(said) <= 3
                count += 1
    assert count >= 60


def test_real_yamls_with_names_of_other_pictures(shared_data: Path) -> None:
    folder = shared_data / "plans_with_logs" / "uji_tech_building"
    for name in ("plan/TD_n1.yaml", "maps_jordialt/irl_map6.yaml"):
        plan, said = opened(folder / name)
        assert plan.path.stem == Path(name).stem
        assert any("is not there" in line for line in said)


def test_the_turtlebot_map_is_79_per_cent_unknown(shared_data: Path) -> None:
    """DESIGN of the grid: not 99 % free, as free_thresh 0.25 would have it."""
    folder = shared_data / "bags" / "olin_mac_floor1" / "maps"
    plan, said = opened(folder / "mac_1st_floor_final.yaml")
    assert round(float(1 - plan.known.mean()), 2) == 0.79
    assert any("grey 205" in line for line in said)
