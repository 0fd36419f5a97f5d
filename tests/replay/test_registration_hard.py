"""What a map and a plan can do to each other: bent, halved, mirrored, alike, empty, all ink."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from formats.errors import FormatError, UsageError
from replay.registration.placing import Pin, pinned
from replay.registration.register import align
from replay.registration.seen import Seen
from tests.commands import replay
from tests.pictures import png
from tests.plans_and_maps import FLAT, SIDE, case, files, plan_of, run

SAMPLES = Path(__file__).resolve().parent.parent.parent / "sample_logs"
CORRIDOR = """
#########################
#.......................#
#.......................#
###..###..###..###..#####
#..#...#...#...#...#....#
#..#...#...#...#...#....#
"""  # its doors come every four characters
TWOFOLD = """
##############################
#.........#........#.........#
#.........#........#.........#
#....................###.#####
#####.###....................#
#.........#........#.........#
#.........#........#.........#
##############################
"""  # turned by 180 degrees it is itself


def printed(walls: npt.NDArray[np.bool_]) -> bytes:
    return png(np.where(walls, 0, 255).astype(np.uint8))


def test_a_stretch_of_a_corridor_is_refused() -> None:
    """Moved by a door, it fits as well."""
    walls, seen, true = case(CORRIDOR, 1.0, 15.0, False, (0.42, 0.25, 0.62, 0.75))
    found = align(seen, walls, scale=1.0)
    assert not found.confident
    middle = np.array([seen.free.shape[1] / 2, seen.free.shape[0] / 2, 1.0])
    along = [((p.matrix - true) @ middle)[0] / (4 * SIDE) for p in found.places]
    assert min(abs(doors) for doors in along) < 0.05
    assert any(0.7 < abs(doors) < 1.1 for doors in along)


def test_a_building_that_is_itself_when_turned_round_is_refused() -> None:
    text = TWOFOLD.split()
    assert "".join(text) == "".join(text)[::-1]
    walls, seen, _ = case(TWOFOLD, 0.9, 20.0, False, (0, 0, 1, 1))
    found = align(seen, walls)
    assert not found.confident
    first, second = found.places[:2]
    assert first.score == pytest.approx(second.score, abs=0.01)
    assert abs((first.turn_deg - second.turn_deg) % 360 - 180) < 0.5


def test_a_log_of_another_building_exits_1(tmp_path: Path) -> None:
    (tmp_path / "flat.png").write_bytes(printed(plan_of(FLAT)))
    log = str(SAMPLES / "turtlebot.mcap")
    code, stdout, stderr = run(log, "--prior", str(tmp_path / "flat.png"), "--json")
    assert code == 1
    assert json.loads(stdout)["confident"] is False
    assert "no place on the plan is clearly the best" in stderr


@pytest.mark.parametrize(("mirrored", "size"), [(True, 1.0), (False, 0.5)])
def test_a_log_on_a_plan_turned_over_and_on_one_of_half_size(
    tmp_path: Path, mirrored: bool, size: float
) -> None:
    """By the plan's own yaml a metre is 50 px, and (-2.4, -4.4) m the lower left corner."""
    grey = cv2.imread(str(SAMPLES / "plan.png"), cv2.IMREAD_GRAYSCALE)
    assert grey is not None
    small = cv2.resize(grey, None, fx=size, fy=size, interpolation=cv2.INTER_AREA)
    grey = small.astype(np.uint8)[:, :: -1 if mirrored else 1]
    (tmp_path / "p.png").write_bytes(png(grey))
    log = str(SAMPLES / "turtlebot.mcap")
    code, stdout, _ = run(log, "--prior", str(tmp_path / "p.png"), "--json")
    assert code == 0
    said = json.loads(stdout)
    assert said["mirrored"] is mirrored
    k, (rows, cols) = 50.0 * size, grey.shape
    true = np.array([[k, 0.0, 2.4 * k - 0.5], [0.0, -k, rows - 0.5 - 4.4 * k]])
    if mirrored:
        true[0] = [-k, 0.0, cols - 0.5 - 2.4 * k]
    corners = np.array([[-2, -4, 1], [9, -4, 1], [-2, 4, 1], [9, 4, 1]], dtype=float)
    assert np.abs(corners @ (np.array(said["matrix"]) - true).T).max() < 3.0 * size
    assert said["scale"] == pytest.approx(k, rel=0.005)


def test_a_map_that_drifted_finds_its_place() -> None:
    """Bent by a bow of 12 px over a flat of 416 px; the best similarity leaves 5 px of it."""
    walls, seen, true = case(FLAT, 1.0, 37.0, False, (0, 0, 1, 1))
    high, wide = seen.free.shape
    rows, cols = (np.asarray(a, np.float32) for a in np.mgrid[:high, :wide])
    bow = np.asarray(12.0 * np.sin(np.pi * cols / wide), np.float32)
    to = (cols, rows + bow)
    occupied, free = (
        cv2.remap(m.astype(np.uint8), to[0], to[1], interpolation=cv2.INTER_NEAREST) > 0
        for m in (seen.occupied, seen.free)
    )
    found = align(Seen(occupied, free), walls)
    assert found.confident
    # rows + bow of the bent map are rows of the straight one: compare in the middle of the bow
    points = np.column_stack((cols[::20, ::20].ravel(), rows[::20, ::20].ravel()))
    straight = points + np.column_stack((np.zeros(len(points)), bow[::20, ::20].ravel()))
    moved = [p @ m[:, :2].T + m[:, 2] for p, m in ((points, found.best.matrix), (straight, true))]
    assert np.median(np.hypot(*(moved[0] - moved[1]).T)) < 6.0


def test_a_map_of_one_wall_is_refused() -> None:
    occupied, free = np.zeros((120, 200), np.bool_), np.zeros((120, 200), np.bool_)
    free[20:80, 20:180] = True
    occupied[80, 20:180] = True
    for scale in (None, 1.0):
        assert not align(Seen(occupied, free), plan_of(FLAT), scale=scale).confident


def test_an_empty_map_is_said_to_be_one(tmp_path: Path) -> None:
    (tmp_path / "flat.png").write_bytes(printed(plan_of(FLAT)))
    (tmp_path / "empty.png").write_bytes(png(np.full((200, 300), 205, np.uint8)))
    done = replay("align", "empty.png", "--prior", "flat.png", cwd=tmp_path)
    assert done.returncode == 1
    assert "empty.png: every pixel is grey 205" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(("grey", "word"), [(0, "nothing but ink"), (255, "next to no ink")])
def test_a_plan_of_one_colour_holds_no_place(tmp_path: Path, grey: int, word: str) -> None:
    walls, seen, _ = case(FLAT, 0.8, 37.0, False, (0, 0, 1, 1))
    with pytest.raises(FormatError, match=word):
        align(seen, np.full(walls.shape, grey == 0))
    files(tmp_path, walls, seen)
    (tmp_path / "one.png").write_bytes(png(np.full((300, 400), grey, np.uint8)))
    done = replay("align", "map.pgm", "--prior", "one.png", cwd=tmp_path)
    assert done.returncode == 1
    assert "one.png: every pixel is" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_plan_that_is_next_to_nothing_holds_no_place() -> None:
    """Of a map made as small as a dot, everything lies on the dot."""
    _, seen, _ = case(FLAT, 0.8, 37.0, False, (0, 0, 1, 1))
    dot = np.zeros((300, 400), np.bool_)
    dot[100, 200] = True
    with pytest.raises(FormatError, match="next to no ink"):
        align(seen, dot)
    dot[100:112, 200:212] = True
    with pytest.raises(FormatError, match="no place on the plan fits"):
        align(seen, dot)


def test_a_plan_of_dense_hatching_is_refused() -> None:
    """Ink on every third line: everything fits everywhere."""
    _, seen, _ = case(FLAT, 0.8, 37.0, False, (0, 0, 1, 1))
    walls = np.zeros((400, 500), np.bool_)
    walls[20:-20:3, 20:-20] = True
    assert not align(seen, walls).confident


def test_pins_that_contradict_each_other_are_refused() -> None:
    """Plan = 2 * map; the third pin was set on the wrong corner, 100 px off."""
    good: list[Pin] = [(0.0, 0.0, 0.0, 0.0), (200.0, 0.0, 100.0, 0.0), (0.0, 160.0, 0.0, 80.0)]
    assert pinned(good, metres=False) == pytest.approx(np.array([[2, 0, 0], [0, 2, 0]]))
    wrong = [*good, (200.0, 60.0, 100.0, 80.0)]
    with pytest.raises(UsageError, match=r"contradict.*200,60=100,80"):
        pinned(wrong, metres=False)
    nearly = [*good, (203.0, 158.0, 100.0, 80.0)]  # as hands set them
    assert pinned(nearly, metres=False)[0, 0] == pytest.approx(2.0, rel=0.01)
