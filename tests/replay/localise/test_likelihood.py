from __future__ import annotations

from math import cos, exp, inf, log, nan, pi, sin
from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose, Scan
from formats.plans.file import open_plan
from replay.localise.field import Field, block_means, build_field
from replay.localise.likelihood import (
    UNIT,
    BeamModel,
    LikelihoodField,
    Reading,
    expected_range,
    pick,
)
from tests.worlds import world_png

CELL = 0.05
ROOM = """
##########
#........#
#........#
#...##...#
#........#
##########
"""


@pytest.fixture
def room(tmp_path: Path) -> Field:
    """10 x 6 pixels, each a cell."""
    return build_field(open_plan(world_png(tmp_path / "room.png", ROOM), Notes(), resolution=CELL))


def scan(ranges: list[float], near: float = 0.1, far: float = 10.0) -> Scan:
    n = len(ranges)
    bearings = np.linspace(-pi / 2, pi / 2, n) if n > 1 else np.zeros(1)
    return Scan(bearings, np.full(n, 0.1), np.array(ranges, dtype=np.float32), near, far)


def slow_distance(wall: set[tuple[int, int]], row: int, col: int) -> float:
    """In cells to the nearest cell of the other kind, less the half that is its own."""
    inside = (row, col) in wall
    others = [(r, c) for r in range(6) for c in range(10) if ((r, c) in wall) != inside]
    nearest = min(((row - r) ** 2 + (col - c) ** 2) ** 0.5 for r, c in others) - 0.5
    return -nearest if inside else nearest


def test_distances_are_those_of_the_nearest_face_of_a_wall(room: Field) -> None:
    rows = [line for line in ROOM.splitlines() if line][::-1]
    wall = {(r, c) for r, line in enumerate(rows) for c, cell in enumerate(line) if cell == "#"}
    for row in range(6):
        for col in range(10):
            expected = CELL * slow_distance(wall, row, col)
            assert room.distance[row, col] == pytest.approx(expected, abs=1e-6)
    assert set(room.free.tolist()) == {
        r * 10 + c for r in range(6) for c in range(10) if (r, c) not in wall
    }
    assert room.area == pytest.approx((8 * 4 - 2) * CELL**2)


def test_fine_pixels_join_into_cells_of_whole_pixels(tmp_path: Path) -> None:
    picture = np.full((23, 31), 255, dtype=np.uint8)
    picture[0], picture[-1], picture[:, 0], picture[:, -1] = 0, 0, 0, 0
    text = "\n".join("".join("#" if p == 0 else "." for p in line) for line in picture)
    plan = open_plan(world_png(tmp_path / "p.png", text), Notes(), resolution=0.02)
    field = build_field(plan)
    assert (field.geometry.rows, field.geometry.cols) == (12, 16)
    assert field.geometry.resolution == pytest.approx(0.04)
    # pixels (2, 2), (2, 3), (3, 2), (3, 3): 2, 2, 2 and 3 pixels from the wall's centres
    assert field.distance[1, 1] == pytest.approx(0.02 * ((2 + 2 + 2 + 3) / 4 - 0.5))


def test_coarse_pixels_are_parted(tmp_path: Path) -> None:
    plan = open_plan(world_png(tmp_path / "p.png", "#...\n#...\n#...\n"), Notes(), resolution=0.12)
    field = build_field(plan)
    assert (field.geometry.rows, field.geometry.cols) == (9, 12)
    assert field.geometry.resolution == pytest.approx(0.04)
    assert field.distance[4] == pytest.approx([0.04 * (k - 2.5) for k in range(12)])


def test_a_plan_without_room_or_size_is_refused(tmp_path: Path) -> None:
    plan = open_plan(world_png(tmp_path / "room.png", ROOM), Notes())
    with pytest.raises(UsageError, match="how large a pixel"):
        build_field(plan)
    found = open_plan(
        world_png(tmp_path / "big.png", "#" + "." * 19 + "\n" + ("." * 20 + "\n") * 19),
        Notes(),
        resolution=0.1,
    )
    found.occupancy[found.occupancy == 0] = -1  # a wall in the midst of nothing known
    with pytest.raises(FormatError, match="no free space"):
        build_field(found)


def test_scattered_poses_lie_in_free_space_and_cover_it(room: Field) -> None:
    poses = room.scatter(3000, np.random.default_rng(3))
    cols, rows = ((poses[:, :2]) / CELL).astype(int).T
    cells, counts = np.unique(rows * 10 + cols, return_counts=True)
    assert cells.tolist() == sorted(room.free.tolist())
    assert counts.min() >= 99  # 3000 poses in 30 cells, stratified
    assert counts.max() <= 101
    headings, _ = np.histogram(poses[:, 2], bins=12, range=(-pi, pi))
    assert headings.min() > 245
    assert headings.max() < 255


def test_pick_leaves_out_what_is_no_hit_and_spreads_the_rest() -> None:
    reading = pick(scan([1.0, nan, inf, -inf, 0.05, 10.0, 11.0, 2.0]), Pose(0.2, 0.1, 0.5), 60)
    assert reading.ranges.tolist() == [1.0, 2.0]
    assert reading.bearings == pytest.approx([-pi / 2 + 0.5, pi / 2 + 0.5])
    assert reading.longest == 10.0
    many = pick(scan([1.0 + k / 100 for k in range(100)]), Pose(0, 0, 0), 10)
    assert many.ranges == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9])
    near = pick(scan([1.0, 2.0, 3.0]), Pose(0, 0, 0), 9, laser_min_range=1.5, laser_max_range=2.5)
    assert near.ranges.tolist() == [2.0]
    assert pick(scan([nan, nan]), Pose(0, 0, 0), 9).ranges.size == 0


def test_points_are_the_ends_of_the_beams_seen_from_the_body() -> None:
    reading = Reading(Pose(0.2, 0.1, 0.0), np.array([0.0, pi / 2]), np.array([1.0, 2.0]), 10.0)
    assert reading.points == pytest.approx(np.array([[1.2, 0.2], [0.1, 2.1]]))


def test_likelihood_field_equals_the_formula_beam_by_beam(room: Field) -> None:
    rng = np.random.default_rng(1)
    z_hit, z_rand, sigma, most = 0.6, 0.3, 0.08, 0.15
    model = LikelihoodField(
        room, z_hit=z_hit, z_rand=z_rand, sigma_hit=sigma, laser_likelihood_max_dist=most
    )
    particles = np.column_stack(
        [rng.uniform(-0.2, 0.7, 40), rng.uniform(-0.2, 0.5, 40), rng.uniform(-7, 7, 40)]
    )
    bearings, ranges = rng.uniform(-pi, pi, 7), rng.uniform(0.05, 0.4, 7)
    reading = Reading(Pose(0.05, -0.02, 0.3), bearings, ranges, 5.0)
    costs = model.costs(particles, reading)
    beyond = 0
    for (x, y, yaw), cost in zip(particles, costs, strict=True):
        total = 0.0
        for b, r in zip(bearings, ranges, strict=True):
            px = x + cos(yaw) * 0.05 + sin(yaw) * 0.02 + r * cos(yaw + b)
            py = y + sin(yaw) * 0.05 - cos(yaw) * 0.02 + r * sin(yaw + b)
            row, col = int(np.floor(py / CELL)), int(np.floor(px / CELL))
            inside = 0 <= row < 6 and 0 <= col < 10
            beyond += not inside
            d = min(abs(float(room.distance[row, col])), most) if inside else most
            p = z_hit * exp(-0.5 * (d / sigma) ** 2) + z_rand / 5.0
            total += log(z_hit + z_rand / 5.0) - log(p)
        assert cost / UNIT == pytest.approx(total, abs=7 / UNIT)
    assert beyond > 40


def test_expected_range_finds_the_wall(room: Field) -> None:
    # in cells: from (1.5, 2.05) along x to the block at columns 4 and 5 of row 2
    found = expected_range(room.distance, CELL, 1.5, 2.05, 0.0, 10.0)
    assert found == pytest.approx(0.125, abs=0.03)
    assert expected_range(room.distance, CELL, 1.5, 1.5, 0.0, 9.0) == pytest.approx(0.375, abs=0.03)
    assert expected_range(room.distance, CELL, 1.5, 1.5, 0.0, 0.2) == 0.2
    assert expected_range(room.distance, CELL, 30.0, 1.5, 0.0, 4.0) == 4.0


def test_beam_model_equals_the_formula(room: Field) -> None:
    model = BeamModel(
        room, z_hit=0.5, z_short=0.1, z_max=0.05, z_rand=0.4, sigma_hit=0.2, lambda_short=0.3
    )
    particles = np.array([[0.075, 0.075, 0.0], [0.375, 0.225, pi]])
    reading = Reading(Pose(0.0, 0.0, 0.0), np.array([0.0, pi / 2]), np.array([0.2, 0.3]), 5.0)
    for (x, y, yaw), cost in zip(particles, model.costs(particles, reading), strict=True):
        total = 0.0
        for b, r in zip((0.0, pi / 2), (0.2, 0.3), strict=True):
            wanted = expected_range(room.distance, CELL, x / CELL, y / CELL, yaw + b, 5.0)
            p = 0.5 * exp(-0.5 * ((r - wanted) / 0.2) ** 2) + 0.4 / 5.0
            p += 0.1 * 0.3 * exp(-0.3 * r) if r < wanted else 0.0
            total += log(0.5 + 0.1 * 0.3 + 0.4 / 5.0) - log(p)
        assert cost / UNIT == pytest.approx(total, abs=2 / UNIT)


def test_means_of_blocks_by_hand() -> None:
    values = np.array([[1.0, 3.0, 5.0], [5.0, 7.0, 9.0], [2.0, 4.0, 8.0]])
    # what sticks out goes on as its last row and column
    assert block_means(values, 2) == pytest.approx(np.array([[4.0, 7.0], [3.0, 8.0]]))
