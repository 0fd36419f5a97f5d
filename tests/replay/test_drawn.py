"""Drawings as plans: told from structural ones, their openings on the lattice, doors drawn shut."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import Notes, UsageError
from formats.frame import Frame, Pose, Scan
from formats.grid import logit
from formats.plans.edits import read_plan_edits
from formats.plans.file import open_plan
from formats.results.file import read_result
from replay import run
from replay.drawn import taken_apart
from replay.mapper import Mapper
from replay.pipeline import steps
from replay.world import build_world
from scripts.flat import DOORS, LEFT, LOW
from tests.worlds import world_png

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
BOUNDS = (0.0, 0.0, 1.0, 0.1)


def test_a_structural_plan_keeps_its_ink() -> None:
    plan = open_plan(SAMPLES / "plan.png", Notes())
    same, openings = taken_apart(plan, "auto", Notes())
    assert same is plan
    assert openings is None


def test_the_doors_of_a_drawing_are_openings_where_they_were_drawn() -> None:
    world = build_world(
        open_plan(SAMPLES / "drawing.png", Notes()), None, BOUNDS, 1.0, Notes(), p_door=0.5
    )
    g, door = world.geometry, world.openings["door"]
    for hinge, shut, _ in DOORS:
        x, y = ((a + b) / 2 + c for a, b, c in zip(hinge, shut, (LEFT, LOW), strict=True))
        row, col = int((y - g.y) / g.resolution), int((x - g.x) / g.resolution)
        assert door[row - 2 : row + 3, col - 2 : col + 3].max() > 0.5
        # 0.5 x 0.9 under the paper's scale (PAPER A5), in the bayes and the paper curve alike
        near = world.curves["bayes"].prior.values[row - 2 : row + 3, col - 2 : col + 3]
        assert np.isclose(near, logit(0.45)).any()
    assert not (door[world.layers.wall == world.layers.pixels] == 1).any()


@pytest.mark.parametrize("method", ["structural", "georgiou"])
def test_a_method_can_be_asked_for(method: str) -> None:
    notes = Notes()
    plan = open_plan(SAMPLES / "drawing.png", Notes())
    drawn, openings = taken_apart(plan, method, notes)  # type: ignore[arg-type]
    assert openings is not None
    assert 0.5 < drawn.wall.sum() / plan.wall.sum() < 1.0
    assert method in notes.of("info")[0].problem


def test_a_door_drawn_shut_is_opened_by_mapping(tmp_path: Path) -> None:
    """PAPER D16: what extraction takes for wall, the robot that drives through it opens."""
    rows = ["#" * 60, *["#" + "." * 29 + "#" + "." * 28 + "#"] * 28, "#" * 60]
    plan = open_plan(
        world_png(tmp_path / "plan.png", "\n".join(rows)),
        Notes(),
        resolution=0.1,
        origin=Pose(0.0, 0.0, 0.0),
    )
    world = build_world(plan, None, (1.0, 1.5, 5.0, 1.5), 5.0, Notes(), resolution=0.1)
    ahead = np.linspace(-0.3, 0.3, 61)
    frames = []
    for i, x in enumerate(np.arange(1.0, 4.0, 0.1)):
        ranges = ((5.95 - x) / np.cos(ahead)).astype(np.float32)  # the far wall, through the door
        scan = Scan(ahead, np.full(61, 0.01), ranges, 0.05, 10.0)
        frames.append(Frame(i, Pose(float(x), 1.5, 0.0), scan))
    mapper = Mapper(world.geometry, max_range=10.0)
    (*_, last) = steps(iter(frames), len(frames), world, mapper)
    g = world.geometry
    col, row, other = (round(v / 0.1) for v in (3.0 - g.x, 1.5 - g.y, 0.3 - g.y))
    door = last.grids["bayes"].occupied()[row, col]
    beside = last.grids["bayes"].occupied()[other, col]
    assert world.layers.walls()[row, col]
    assert not door
    assert beside


EDITS = """unit m
add wall 3,-4.2 3,-2.5 0.2      # a wall that the plan lacks
remove region -3,-5 -1,-5 -1,5 -3,5
"""


@pytest.mark.parametrize("name", ["plan.png", "drawing.png"])
def test_edits_reach_the_prior_and_the_footprint(tmp_path: Path, name: str) -> None:
    (tmp_path / "my.edits").write_text(EDITS)
    edits = read_plan_edits(tmp_path / "my.edits")
    plain, world = (
        build_world(open_plan(SAMPLES / name, Notes()), None, BOUNDS, 1.0, Notes(), plan_edits=one)
        for one in (None, edits)
    )
    g = world.geometry
    x = g.x + (np.arange(g.cols) + 0.5) * g.resolution
    y = g.y + (np.arange(g.rows) + 0.5) * g.resolution
    wall, before = world.layers.walls(), plain.layers.walls()
    band = (np.abs(y - -3.35) < 0.8)[:, None] & (np.abs(x - 3) < 0.09)[None, :]
    assert wall[band].all()
    assert not before[band].all()
    assert np.allclose(world.curves["bayes"].prior.values[band], logit(0.2 * 0.9))
    gone = (np.abs(y) < 4)[:, None] & ((x > -2.9) & (x < -1.1))[None, :]
    assert plain.layers.footprint[gone].any()
    assert not world.layers.footprint[gone].any()
    assert np.allclose(world.curves["bayes"].prior.values[gone], 0.0)  # p_outside
    rest = ~band & ((np.abs(x - 3) > 0.3) & (x > -0.8))[None, :]
    assert (wall == before)[rest].all()


def test_a_run_keeps_its_edits(tmp_path: Path) -> None:
    (tmp_path / "my.edits").write_text(EDITS)
    result = run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        output=tmp_path / "out.mcap",
        plan_edits=tmp_path / "my.edits",
        every=200,
    )
    kept = read_result(result.facts["result"])
    assert kept.attachments["my.edits"].decode() == EDITS
    assert kept.settings["plan_edits"] == str(tmp_path / "my.edits")
    assert str(tmp_path / "my.edits") in kept.facts["inputs"]
    assert any("edited by hand" in line for line in kept.facts["said"]["plan"])


def test_edits_without_a_plan_are_refused(tmp_path: Path) -> None:
    (tmp_path / "my.edits").write_text(EDITS)
    with pytest.raises(UsageError, match="no plan to edit"):
        run(SAMPLES / "turtlebot.mcap", output=tmp_path / "o", plan_edits=tmp_path / "my.edits")


@pytest.mark.parametrize(
    "scale",
    [
        {"plan_distance": (0.0, 0.0, 300.0, 400.0, 10.0)},
        {"plan_dpi": 127.0, "drawing_scale": 100.0},
    ],
)
def test_a_run_takes_the_scale_that_is_said(tmp_path: Path, scale: dict[str, Any]) -> None:
    """2 cm a pixel: by 10 m over 500 px, or by 127 dots an inch of paper at 1:100."""
    bare = tmp_path / "bare.png"
    bare.write_bytes((SAMPLES / "plan.png").read_bytes())
    found = [
        run(
            SAMPLES / "turtlebot.mcap",
            name,
            output=tmp_path / f"{name.stem}.mcap",
            truth=SAMPLES / "truth.png",
            every=100,
            **options,
        ).facts["scores"]
        for name, options in (
            (SAMPLES / "plan.png", {}),
            (bare, {"plan_origin": Pose(-2.4, -4.4, 0.0), **scale}),
        )
    ]
    assert found[0] == found[1]
