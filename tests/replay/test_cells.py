"""Pixels join into cells by their centres; the building's outline is where maps are scored."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from math import cos, floor, sin
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.errors import Notes, UsageError
from formats.frame import Pose
from formats.grid import Geometry
from formats.plans.file import Plan
from replay.cells import CellLayers, Rule, cell_layers, enclosed, leaves_unknown, truth_cells

CELLS = {"#": 100, ".": 0, "?": -1, "a": 50, "b": 51}


def plan_of(
    rows: Sequence[str] | npt.NDArray[np.int8],
    resolution: float | None = 0.1,
    origin: Pose = Pose(0.0, 0.0, 0.0),  # noqa: B008 - immutable
) -> Plan:
    """A plan from text, the first line on top."""
    cells = rows if isinstance(rows, np.ndarray) else [[CELLS[c] for c in row] for row in rows]
    occupancy = np.array(cells, dtype=np.int8)
    grey = np.where(occupancy > 50, 0, 255).astype(np.uint8)
    return Plan(Path("plan.png"), grey, occupancy, resolution, origin, True, {})


def counted(plan: Plan, geometry: Geometry) -> tuple[npt.NDArray[np.int64], ...]:
    """The oracle: every pixel's centre by trigonometry, then empty cells by their own centre."""
    found = np.zeros((3, *geometry.shape), dtype=np.int64)
    assert plan.resolution is not None
    (x0, y0), side = plan.corner, plan.resolution
    height, width = plan.occupancy.shape

    def add(row: int, col: int, value: int) -> None:
        found[:, row, col] += (1, value > 50, value >= 0)

    for r in range(height):
        for c in range(width):
            x, y = x0 + (c + 0.5) * side, y0 + (height - r - 0.5) * side
            col = floor((x - geometry.x) / geometry.resolution + 1e-6)
            row = floor((y - geometry.y) / geometry.resolution + 1e-6)
            if 0 <= row < geometry.rows and 0 <= col < geometry.cols:
                add(row, col, int(plan.occupancy[r, c]))
    for row in range(geometry.rows):
        for col in range(geometry.cols):
            if found[0, row, col] == 0:
                x = geometry.x + (col + 0.5) * geometry.resolution
                y = geometry.y + (row + 0.5) * geometry.resolution
                c, up = floor((x - x0) / side + 1e-6), floor((y - y0) / side + 1e-6)
                if 0 <= c < width and 0 <= up < height:
                    add(row, col, int(plan.occupancy[height - 1 - up, c]))
    return found[0], found[1], found[2]


def agree(plan: Plan, geometry: Geometry) -> CellLayers:
    layers = cell_layers(plan, geometry)
    pixels, wall, known = counted(plan, geometry)
    assert np.array_equal(layers.pixels, pixels)
    assert np.array_equal(layers.wall, wall)
    assert np.array_equal(layers.known, known)
    return layers


def test_two_by_two_pixels_a_cell_by_hand() -> None:
    plan = plan_of(["#...", "....", "??#.", "?.##"], 0.1)
    layers = cell_layers(plan, Geometry(2, 2, 0.2, 0.0, 0.0))
    assert layers.pixels.tolist() == [[4, 4], [4, 4]]
    assert layers.wall.tolist() == [[0, 3], [1, 0]]  # row 0 is the lowest
    assert layers.known.tolist() == [[1, 4], [4, 4]]
    assert layers.wall_fraction.tolist() == [[0.0, 0.75], [0.25, 0.0]]


def test_a_cell_is_wall_by_rule() -> None:
    """0, 1, 2, 2 and 3 of 4 pixels; and 1 of the 1 that is known."""
    plan = plan_of(["..#.##.###??", "......#..##?"], 0.1)
    layers = cell_layers(plan, Geometry(1, 6, 0.2, 0.0, 0.0))
    assert layers.wall.tolist() == [[0, 1, 2, 2, 3, 1]]
    assert layers.known.tolist() == [[4, 4, 4, 4, 4, 1]]
    assert layers.walls("any").tolist() == [[False, True, True, True, True, True]]
    assert layers.walls("majority").tolist() == [[False, False, False, False, True, True]]
    assert layers.walls("fraction").tolist() == layers.walls("majority").tolist()


def test_majority_counts_the_known_ones() -> None:
    layers = cell_layers(plan_of(["#?", "??"], 0.1), Geometry(1, 1, 0.2, 0.0, 0.0))
    assert layers.walls("majority").tolist() == [[True]]
    assert layers.wall_fraction.tolist() == [[1.0]]


def test_wall_is_above_one_half() -> None:
    layers = cell_layers(plan_of(["ab"], 0.1), Geometry(1, 2, 0.1, 0.0, 0.0))
    assert layers.wall.tolist() == [[0, 1]]


def test_a_lattice_beyond_the_picture() -> None:
    plan = plan_of(["#"], 1.0, Pose(1.0, 1.0, 0.0))
    layers = agree(plan, Geometry(3, 3, 1.0, 0.0, 0.0))
    assert layers.pixels.tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 0]]
    assert layers.outside.tolist() == [[True] * 3, [True, False, True], [True] * 3]


def test_cells_finer_than_pixels_take_the_pixel_under_their_centre() -> None:
    plan = plan_of(["#.", ".?"], 0.1)
    layers = agree(plan, Geometry(4, 4, 0.05, 0.0, 0.0))
    assert layers.wall.tolist() == [[0] * 4, [0] * 4, [1, 1, 0, 0], [1, 1, 0, 0]]
    assert layers.known.tolist() == [[1, 1, 0, 0]] * 2 + [[1] * 4] * 2
    assert (layers.pixels == 1).all()


PIXELS = np.random.default_rng(2).choice([-1, 0, 40, 60, 100], (23, 31)).astype(np.int8)


@given(
    st.sampled_from([0.01, 0.03, 0.05, 0.1]),
    st.sampled_from([0.005, 0.01, 0.02, 0.05, 0.07, 0.1, 0.25, 2.0]),
    st.integers(-40, 40),
    st.integers(-40, 40),
    st.floats(-1, 1),
    st.floats(-1, 1),
)
def test_equal_to_the_plain_loop(
    pixel: float, cell: float, left: int, low: int, x: float, y: float
) -> None:
    plan = plan_of(PIXELS, pixel, Pose(x, y, 0.0))
    x0, y0, x1, y1 = plan.extent
    whole = Geometry.covering(x0, y0, x1, y1, cell)
    near = Geometry(20, 25, cell, left * cell, low * cell)
    for geometry in (whole, near):
        if geometry.rows * geometry.cols < 30_000:
            agree(plan, geometry)


@pytest.mark.parametrize("pixel", [0.01, 0.05, 0.1])
@pytest.mark.parametrize("shift", [0.0, 0.005, 0.025, 0.05])
def test_edges_on_edges_lose_no_pixel(pixel: float, shift: float) -> None:
    """Pixels' centres on cells' edges, where rounding could go either way."""
    plan = plan_of(PIXELS, pixel, Pose(shift - 7.3, shift + 100.1, 0.0))
    layers = agree(plan, Geometry.covering(*plan.extent, 0.05))
    if pixel <= 0.05:
        assert (layers.pixels[1:-1, 1:-1] == round(0.05 / pixel) ** 2).all()
        assert int(layers.wall.sum()) >= int((PIXELS > 50).sum())


@pytest.mark.parametrize("yaw", [0.3, -1.2, np.pi / 2, 3.0])
@pytest.mark.parametrize("cell", [0.02, 0.05, 0.3])
def test_a_lattice_turned_against_the_picture(yaw: float, cell: float) -> None:
    """A truth with a yaml of another yaw: centres turned one by one."""
    plan = plan_of(PIXELS, 0.05, Pose(0.4, -0.3, yaw))
    geometry = Geometry.covering(-2.0, -2.0, 2.0, 2.0, cell)
    layers = cell_layers(plan, geometry, frame=Pose(0.0, 0.0, 0.1))
    pixels = np.zeros(geometry.shape, dtype=np.int64)
    for r in range(23):
        for c in range(31):
            u, v = (c + 0.5) * 0.05, (23 - r - 0.5) * 0.05
            x = 0.4 + u * cos(yaw) - v * sin(yaw)
            y = -0.3 + u * sin(yaw) + v * cos(yaw)
            x, y = x * cos(0.1) + y * sin(0.1), -x * sin(0.1) + y * cos(0.1)
            pixels[
                floor((y - geometry.y) / cell + 1e-6), floor((x - geometry.x) / cell + 1e-6)
            ] += 1
    held = pixels > 0
    assert np.array_equal(layers.pixels[held], pixels[held])
    assert (layers.pixels[~held] <= 1).all()
    area = (layers.pixels > 0).sum() * cell**2
    assert area == pytest.approx(23 * 31 * 0.05**2, abs=4 * cell * 2.8)


def test_the_plans_own_yaw_leaves_the_picture_straight() -> None:
    straight = cell_layers(plan_of(PIXELS, 0.05), Geometry(23, 31, 0.05, 0.0, 0.0))
    plan = plan_of(PIXELS, 0.05, Pose(3.0, 4.0, 0.7))
    x, y = plan.corner
    turned = cell_layers(plan, Geometry(23, 31, 0.05, x, y))
    assert np.array_equal(turned.wall, straight.wall)


def test_the_resolution_must_be_known() -> None:
    with pytest.raises(UsageError, match="--plan-resolution"):
        cell_layers(plan_of(["#."], None), Geometry(1, 2, 0.1, 0.0, 0.0))


# ---- the building

FLAT = [
    "....................",
    ".####.#####..######.",
    ".#....#...........#.",
    ".#....#...........#.",
    ".#....#....#......#.",
    ".#.........#......#.",
    ".###################",
    "....................",
]


def inside_of(rows: list[str]) -> list[str]:
    """The footprint as text, from cells of 0.5 m: gaps of 2 cells (1 m) count as closed."""
    layers = cell_layers(plan_of(rows, 0.5), Geometry(len(rows), len(rows[0]), 0.5, 0.0, 0.0))
    return ["".join("x" if c else "." for c in row) for row in layers.footprint[::-1]]


def test_the_outline_closes_doors_and_windows() -> None:
    assert inside_of(FLAT) == [
        "....................",
        ".xxxx.xxxxx..xxxxxx.",  # between the jambs the outside reaches in
        ".xxxxxxxxxxxxxxxxxx.",
        ".xxxxxxxxxxxxxxxxxx.",
        ".xxxxxxxxxxxxxxxxxx.",
        ".xxxxxxxxxxxxxxxxxx.",
        ".xxxxxxxxxxxxxxxxxxx",
        "....................",
    ]


def test_a_wide_opening_means_the_whole_picture_and_says_so() -> None:
    """Open to the right over the whole height: nothing is enclosed."""
    rows = [
        "............",
        ".#########..",
        ".#..........",
        ".#..........",
        ".#########..",
        "." * 12,
    ]
    rows = [rows[0], rows[1], *[rows[2]] * 5, rows[4], rows[5]]
    notes = Notes()
    geometry = Geometry(len(rows), 12, 0.5, 0.0, 0.0)
    layers = cell_layers(plan_of(rows, 0.5), geometry, notes=notes)
    assert layers.footprint.all()
    assert [n.problem for n in notes] == [
        "footprint: the whole picture, since its outer walls are not closed"
    ]


@pytest.mark.parametrize(("gap", "closed"), [(1.0, True), (1.1, True), (1.3, False), (1.5, False)])
def test_gaps_of_1_2_m_are_closed(gap: float, closed: bool) -> None:
    """A room of 4 m x 6 m with a wall of 0.2 m and one opening, at 5 cm."""
    wall = np.zeros((160, 200), dtype=bool)
    wall[20:100, 20:140] = True
    wall[24:96, 24:136] = False
    half = round(gap / 0.05) // 2
    wall[96:100, 80 - half : 80 - half + round(gap / 0.05)] = False
    outline = enclosed(np.ones_like(wall), wall, 0.6 / 0.05)
    if closed:
        assert outline is not None
        assert outline[24:90, 24:136].all()  # a bulge of the outside may reach into the opening
        assert not outline[:20].any()
        assert not outline[104:].any()
    else:
        assert outline is None


def test_a_word_beside_the_building_is_no_building() -> None:
    rows = [row + "....." for row in FLAT] + ["." * 25] * 3
    rows[0] = rows[0][:23] + "#" + rows[0][24:]
    found = inside_of(rows)
    assert found[0] == "." * 25
    assert found[3] == ".xxxxxxxxxxxxxxxxxx......"


def test_a_speck_of_ink_outside_is_still_a_wall_cell() -> None:
    rows = [row + "....." for row in FLAT]
    rows[0] = rows[0][:23] + "#" + rows[0][24:]
    layers = cell_layers(plan_of(rows, 0.5), Geometry(8, 25, 0.5, 0.0, 0.0))
    assert not layers.footprint[7, 23]
    assert layers.walls()[7, 23]
    assert not layers.outside[7, 23]


def test_a_plan_without_a_wall_in_the_lattice() -> None:
    layers = cell_layers(plan_of(["#..."], 1.0), Geometry(1, 2, 1.0, 2.0, 0.0))
    assert layers.footprint.all()


def test_the_known_part_of_a_map() -> None:
    """A cell counts where at least half of it is known, or some of it is wall."""
    plan = plan_of(["..????????", ".?????????", "??...?#???", "??..??????"] + ["?" * 10] * 6, 0.1)
    layers = cell_layers(plan, Geometry(5, 5, 0.2, 0.0, 0.0))
    assert leaves_unknown(plan)
    found = ["".join("x" if c else "." for c in row) for row in layers.footprint[::-1]]
    assert found == ["x....", ".x.x.", ".....", ".....", "....."]


def test_thin_unknown_seams_leave_no_region_unknown() -> None:
    """Grey edges of drawn lines, two pixels wide, on a map that is known otherwise."""
    occupancy = np.zeros((100, 100), dtype=np.int8)
    occupancy[:, 50] = 100
    occupancy[:, 51:53] = occupancy[:, 48:50] = -1
    assert not leaves_unknown(plan_of(occupancy))
    occupancy[60:80, 60:80] = -1
    assert leaves_unknown(plan_of(occupancy))


def test_outside_is_neither_building_nor_wall() -> None:
    layers = cell_layers(plan_of(FLAT, 0.5), Geometry(10, 22, 0.5, -0.5, -0.5))
    assert np.array_equal(layers.outside, ~layers.footprint & ~layers.walls())
    assert layers.outside[0].all()  # beyond the picture


# ---- the truth


@pytest.mark.parametrize("rule", ["any", "majority", "fraction"])
def test_the_truth_by_the_rule_of_the_prior(rule: Rule) -> None:
    plan = plan_of(["#...", "....", "??#.", "?.##"], 0.1)
    wall, scored = truth_cells(plan, Geometry(2, 3, 0.2, 0.0, 0.0), rule)
    assert wall.tolist() == [[False, True, False], [rule == "any", False, False]]
    assert scored.tolist() == [[True, True, False], [True, True, False]]


def test_the_truth_may_have_a_resolution_and_an_origin_of_its_own() -> None:
    """The same room drawn at 10 cm from (0, 0) and at 2 cm from (-0.3, -0.2)."""
    room = np.zeros((20, 20), dtype=np.int8)
    room[2:18, 2:18] = 100
    room[4:16, 4:16] = 0
    fine = np.pad(room.repeat(5, 0).repeat(5, 1), ((0, 10), (15, 0)))
    geometry = Geometry(20, 20, 0.1, 0.0, 0.0)
    coarse = truth_cells(plan_of(room, 0.1), geometry)
    other = truth_cells(plan_of(fine, 0.02, Pose(-0.3, -0.2, 0.0)), geometry)
    assert np.array_equal(coarse[0], other[0])
    assert coarse[0].sum() == 16**2 - 12**2
    assert np.array_equal(coarse[1], other[1])


# ---- size


@pytest.mark.slow
def test_10_000_x_7_000_pixels_in_bounds(tmp_path: Path) -> None:
    """Open, join at 5 cm and build the prior: under 1 GB at the peak, and under 20 s."""
    pixels = np.full((7_000, 10_000, 3), 255, np.uint8)
    for k in range(0, 7_000, 350):
        pixels[k : k + 12] = pixels[:, k : k + 12] = 0
    assert cv2.imwrite(str(tmp_path / "plan.png"), pixels)
    code = """
import sys, time
start = time.perf_counter()
from formats.errors import Notes
from formats.grid import Geometry
from formats.plans.file import open_plan
from replay.cells import cell_layers
from replay.prior import build_prior
plan = open_plan(sys.argv[1], Notes(), resolution=0.01)
prior = build_prior(cell_layers(plan, Geometry.covering(*plan.extent, 0.05)))
assert prior.values.shape == (1400, 2000)
peak = [line for line in open("/proc/self/status") if line.startswith("VmHWM")][0].split()[1]
print(time.perf_counter() - start, int(peak) / 1e6)
"""
    if not Path("/proc/self/status").exists():
        pytest.skip("the peak of memory is read from /proc")
    root = Path(__file__).resolve().parents[2]
    run = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "plan.png")],
        cwd=root,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    seconds, gigabytes = map(float, run.stdout.split())
    assert gigabytes < 1.0
    assert seconds < 20


@pytest.mark.parametrize(("resolution", "warned"), [(0.05, True), (0.5, False)])
def test_a_word_on_a_page_is_told_from_a_building(resolution: float, warned: bool) -> None:
    """A word on a page encloses 8 x 6 cells of 5 cm; a hut of that shape, 4 x 3 m."""
    rows = (
        ["." * 12] * 3 + ["..########.."] + ["..#......#.."] * 4 + ["..########.."] + ["." * 12] * 3
    )
    notes = Notes()
    geometry = Geometry(len(rows), 12, resolution, 0.0, 0.0)
    cell_layers(plan_of(rows, resolution), geometry, notes=notes)
    said = [note.problem for note in notes]
    assert any("0.1 m², less than a room" in line for line in said) == warned
    assert any(line.startswith("footprint: the") for line in said)
