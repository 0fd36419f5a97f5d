"""The plan against the building: what stands, what moved, what is not there, what is new."""

from __future__ import annotations

import json
from math import hypot
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from formats.errors import FormatError
from formats.frame import Frame, Pose, Scan
from formats.grid import Evidence, Geometry, Grid, logit
from formats.result import Counts, Curve, Split, Step
from formats.results.file import ResultWriter
from replay import deviation
from replay.cli.deviation import command
from replay.mapper import Mapper
from replay.surveying.compare import Wall
from replay.surveying.deviations import Deviations, deviations
from replay.surveying.found import extras
from replay.surveying.segments import straights
from scripts.flat import cast

Floats = npt.NDArray[np.float64]
SIDE = 0.15  # m a character: three cells
CELL = 0.05
BEAM = (0.3, 0.6)  # P(empty) of hit and miss
# In the plan a wall hangs from the top at x 1.8 to 1.95 m, and one stands at x 3.6 to 3.75 m; the
# room on the right has no door.
PLAN = """
##############################################
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#...........#.....................#..........#
#.................................#..........#
#.................................#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
#.......................#.........#..........#
##############################################
"""
# The first is gone, the second 0.15 m farther right, and one of 1.35 m is new at y 1.35 to 1.5 m.
BUILT = """
##############################################
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#.................................#..........#
#........................#........#..........#
#...#########............#........#..........#
#........................#........#..........#
#........................#........#..........#
#........................#........#..........#
#........................#........#..........#
#........................#........#..........#
#........................#........#..........#
#........................#........#..........#
#........................#........#..........#
##############################################
"""
HIGH, WIDE = 24 * SIDE, 46 * SIDE
STOPS = [(0.8, 2.8), (2.8, 2.9), (4.4, 2.7), (0.6, 0.7), (2.9, 0.8), (4.6, 0.6), (3.0, 1.6)]


def boxes(text: str) -> Floats:
    """x0, y0, x1, y1 of each #, m."""
    rows = text.split()
    return np.array(
        [
            (c * SIDE, HIGH - (r + 1) * SIDE, (c + 1) * SIDE, HIGH - r * SIDE)
            for r, row in enumerate(rows)
            for c, char in enumerate(row)
            if char == "#"
        ]
    )


def cells(text: str, geometry: Geometry) -> npt.NDArray[np.bool_]:
    """Cells whose centres lie in a #."""
    rows = text.split()
    out = np.zeros(geometry.shape, np.bool_)
    for r in range(geometry.rows):
        for c in range(geometry.cols):
            x = geometry.x + (c + 0.5) * CELL
            y = geometry.y + (r + 0.5) * CELL
            row, col = int((HIGH - y) // SIDE), int(x // SIDE)
            inside = 0 <= row < len(rows) and 0 <= col < len(rows[0])
            out[r, c] = inside and rows[row][col] == "#"
    return out


def driven(text: str, geometry: Geometry, noise: float = 0.0) -> tuple[Evidence, list[Frame]]:
    """What a laser saw from STOPS, ten times each."""
    mapper = Mapper(geometry, "beam")
    rng = np.random.default_rng(1)
    angles = np.linspace(-np.pi, np.pi, 1440, endpoint=False)
    solid, frames = boxes(text), []
    for i, (x, y) in enumerate(STOPS):
        far = cast(solid, x, y, angles, 20.0)
        for k in range(10):
            ranges = (far + rng.normal(0.0, noise, len(far))).astype(np.float32)
            scan = Scan(angles, np.full(1440, 2 * np.pi / 1440), ranges, 0.05, 20.0)
            frames.append(Frame((10 * i + k + 1) * 100_000_000, Pose(x, y, 0.0), scan))
            mapper.insert(frames[-1])
    return mapper.evidence, frames


def geometry_of() -> Geometry:
    return Geometry.covering(-0.5, -0.5, WIDE + 0.5, HIGH + 0.5, CELL)


def found_in(plan: str, built: str, noise: float = 0.0) -> Deviations:
    geometry = geometry_of()
    evidence, _ = driven(built, geometry, noise)
    return deviations(evidence, {"wall": cells(plan, geometry)}, BEAM)


def near(found: Deviations, x: float, y: float) -> Wall:
    """The wall whose centre line passes by a point."""

    def away(wall: Wall) -> float:
        a, b = np.array(wall.start), np.array(wall.end)
        t = np.clip(np.dot([x, y] - a, b - a) / max(wall.length**2, 1e-9), 0.0, 1.0)
        return hypot(*(a + t * (b - a) - [x, y]))

    return min(found.walls, key=away)


def rightwards(wall: Wall) -> float:
    """How far an upright wall has moved in +x, whichever way its ends are named."""
    up = wall.end[1] > wall.start[1]
    return -wall.moved if up else wall.moved


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_what_was_built_otherwise_is_told_apart(noise: float) -> None:
    found = found_in(PLAN, BUILT, noise)
    gone = near(found, 1.875, 2.7)
    assert gone.state == "not there"
    assert gone.length == pytest.approx(1.5, abs=0.1)  # rows 1 to 10
    assert gone.thickness == pytest.approx(SIDE)
    assert [gone.start[0], gone.end[0]] == pytest.approx([1.875] * 2, abs=0.03)

    moved = near(found, 3.675, 0.9)
    assert moved.state == "moved"
    assert rightwards(moved) == pytest.approx(0.15, abs=CELL / 2)
    assert moved.length == pytest.approx(1.5, abs=0.3)
    assert not moved.hidden  # its planned place was seen free

    for x, y in ((5.175, 1.8), (2.0, HIGH - 0.075), (2.0, 0.075), (0.075, 1.8)):
        wall = near(found, x, y)
        assert wall.state == "confirmed", (x, y)
        assert abs(wall.moved) < CELL
    for x, y in ((WIDE - 0.075, 1.8), (6.0, 0.075), (6.0, HIGH - 0.075)):  # the room on the right
        assert near(found, x, y).state == "unseen", (x, y)

    assert len(found.found) == 1
    new = found.found[0]
    assert new.length == pytest.approx(1.35, abs=0.11)
    assert new.thickness == pytest.approx(SIDE, abs=CELL)
    for (x, y), at in ((min(new.start, new.end), 0.6), (max(new.start, new.end), 1.95)):
        assert x == pytest.approx(at, abs=0.08)
        assert y == pytest.approx(1.425, abs=CELL)


def test_what_was_built_as_planned_is_confirmed() -> None:
    found = found_in(PLAN, PLAN)
    assert {wall.state for wall in found.walls} == {"confirmed", "unseen"}
    assert found.found == []
    metres = found.facts()["metres"]
    # Seen are the outer walls left of the room: 2 * (34 - 1) + 24 - 2 characters, the room's own
    # wall of 24, and the two of 10; ends of walls are not counted to the centimetre.
    assert metres["confirmed"] == pytest.approx((66 + 22 + 22 + 20) * SIDE, rel=0.05)
    assert found.facts()["confirmed_off"] <= CELL / 2  # faces lie on the edges of cells


def test_the_tolerance_decides_what_has_moved() -> None:
    geometry = geometry_of()
    evidence, _ = driven(BUILT, geometry)
    layers = {"wall": cells(PLAN, geometry)}
    assert near(deviations(evidence, layers, BEAM, 0.2), 3.675, 0.9).state == "confirmed"
    assert near(deviations(evidence, layers, BEAM, 0.1), 3.675, 0.9).state == "moved"


def test_a_cupboard_hides_a_wall_and_does_not_move_it() -> None:
    """0.3 m deep, along 2.1 of the upper wall's 5.1 m: less than half of what was seen of it."""
    rows = BUILT.split()
    rows[1:3] = [row[:14] + "#" * 14 + row[28:] for row in rows[1:3]]
    found = found_in(PLAN, "\n".join(rows))
    hidden = near(found, 3.2, HIGH - 0.075)
    assert hidden.state == "unseen"
    assert hidden.hidden
    assert near(found, 1.0, HIGH - 0.075).state == "confirmed"


def test_straight_walls_of_a_turned_plan() -> None:
    """A rectangle of 8 x 4 m, its walls 0.2 m thick, turned by 30 degrees: four walls."""
    image = np.zeros((240, 240), np.uint8)
    box = cv2.boxPoints(((120.0, 120.0), (160.0, 80.0), 30.0))
    cv2.polylines(image, [np.rint(box).astype(np.int32)], True, 1, 4)
    found = straights(image > 0, CELL)
    lengths = sorted(len(straight.at) * CELL for straight in found if len(straight.at) > 20)
    assert lengths == pytest.approx([4.0, 4.0, 8.0, 8.0], abs=0.3)
    angles = sorted(np.degrees(np.arctan2(*s.along[::-1])) % 180 for s in found if len(s.at) > 20)
    assert angles == pytest.approx([30, 30, 120, 120], abs=0.7)
    assert {s.thick for s in found if len(s.at) > 20} <= {4, 5, 6}


def test_a_line_of_one_cell_is_one_wall() -> None:
    """Its outline comes by each cell twice, and no side leads across the room."""
    image = np.zeros((80, 80), np.uint8)
    image[10, 10:71] = image[70, 10:71] = image[10:71, 10] = 1
    found = straights(image > 0, CELL)
    assert sorted(len(straight.at) for straight in found) == pytest.approx([61, 61, 61], abs=2)
    assert {straight.thick for straight in found} == {1}


def result(folder: Path, *, plan: bool = True) -> Path:
    """A result file of the world above, whose plan lies at (10, 20, 90 degrees) of the map."""
    geometry = geometry_of()
    evidence, frames = driven(BUILT, geometry)
    wall = cells(PLAN, geometry)
    odds = np.where(wall, logit(0.2), logit(0.9)) if plan else np.zeros(geometry.shape)
    prior = Grid(geometry, odds)
    nothing = Grid(geometry, np.zeros(geometry.shape))
    counts = {"none": Split(Counts(1, 1, 1, 1), Counts(1, 1, 1, 1))}
    path = folder / "a.replay.mcap"
    with ResultWriter(
        path,
        geometry=geometry,
        curves={"none": Curve(nothing, BEAM), "bayes": Curve(prior, BEAM)},
        layers={"wall": wall.astype(float)} if plan else {},
        map_to_plan=Pose(10.0, 20.0, np.pi / 2),
        facts={"plan": "plan.png"},
    ) as writer:
        for i, frame in enumerate(frames):
            writer.write(Step(i, frame, {}, counts, i == len(frames) - 1, evidence))
        writer.finish()
    return path


def run(*arguments: str) -> tuple[Any, str]:
    done = CliRunner().invoke(command, list(arguments), standalone_mode=False)
    if done.exception:
        raise done.exception
    return done.return_value, done.stdout


def test_the_verb_needs_the_result_alone(tmp_path: Path) -> None:
    source = result(tmp_path)
    code, stdout = run(str(source), "-o", str(tmp_path), "--json")
    assert code == 0
    said = json.loads(stdout)
    assert said["schema"] == 1
    states = {wall["state"] for wall in said["walls"]}
    assert states == {"confirmed", "moved", "not there", "unseen"}
    assert said["written"] == [str(tmp_path / f"a_deviation.{end}") for end in ("png", "geojson")]
    shapes = json.loads((tmp_path / "a_deviation.geojson").read_text())
    assert shapes["units"] == "m"
    kinds = [feature["properties"]["kind"] for feature in shapes["features"]]
    assert kinds == ["wall"] * len(said["walls"]) + ["found"]
    gone = [f for f in shapes["features"] if f["properties"].get("state") == "not there"]
    assert len(gone) == 1
    assert np.array(gone[0]["geometry"]["coordinates"])[:, 0] == pytest.approx(1.875, abs=0.03)
    picture = cv2.imread(str(tmp_path / "a_deviation.png"))
    assert picture is not None
    for name, colour in (("moved", (0, 159, 230)), ("not there", (0, 94, 213))):
        assert (picture == colour).all(axis=2).sum() > 100, name


def test_coordinates_in_the_frame_of_the_map(tmp_path: Path) -> None:
    """The plan's x becomes y, 20 m on; its y becomes -x, 10 m on."""
    facts = deviation(result(tmp_path), tmp_path, frame="map")
    gone = next(wall for wall in facts["walls"] if wall["state"] == "not there")
    assert [gone["from"][1], gone["to"][1]] == pytest.approx([21.875] * 2, abs=0.03)
    assert sorted([gone["from"][0], gone["to"][0]]) == pytest.approx([10 - 3.45, 8.05], abs=0.1)


def test_the_table_for_a_person(tmp_path: Path) -> None:
    _, stdout = run(str(result(tmp_path)), "-o", str(tmp_path))
    rows = {line.split()[0]: line for line in stdout.splitlines() if line.startswith(("W", "F"))}
    moved = next(line for name, line in rows.items() if " moved " in line)
    assert moved.split()[-1] in ("+0.15", "-0.15", "+0.14", "-0.14")
    assert any(" not there " in line for line in rows.values())
    assert "F1" in rows


def test_a_run_without_a_plan_has_nothing_to_compare(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no plan to compare with"):
        deviation(result(tmp_path, plan=False), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.replay.mcap"]


def test_a_wall_two_cells_thick_is_found_whole() -> None:
    """Its middle line runs between two rows of cells, where rounding must not lose every other."""
    new = np.zeros((60, 80), np.bool_)
    new[20:22, 10:43] = True  # 33 x 2 cells
    (found,) = extras(new, np.ones_like(new), CELL, (0.0, 0.0))
    assert found.length == pytest.approx(33 * CELL)
    assert [found.start[1], found.end[1]] == pytest.approx([21 * CELL] * 2)
