"""Steps over a corridor drawn as text: what is mapped, scored and kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.frame import Frame, Pose, Scan
from formats.plans.file import Plan, open_plan
from formats.result import Step
from replay.mapper import Mapper
from replay.pipeline import Clock, keyframes, steps
from replay.scoring.scorer import count
from replay.world import World, build_world
from tests.worlds import world_png

ROOM = """
####################
#..................#
#..................#
#..................#
#..................#
#..................#
####################
"""


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    path = world_png(tmp_path / "plan.png", ROOM)
    return open_plan(path, Notes(), resolution=0.1, origin=Pose(0.0, 0.0, 0.0))


MIDDLE = Pose(1.0, 0.35, 0.0)


def frames(n: int, pose: Pose = MIDDLE) -> list[Frame]:
    """A sensor in the middle of the room that sees the walls left and right."""
    bearings = np.array([0.0, np.pi])
    scan = Scan(bearings, np.full(2, 0.1), np.array([0.95, 0.95], np.float32), 0.05, 5.0)
    return [Frame(1_000_000_000 * i, pose, scan) for i in range(n)]


def played(world: World, given: list[Frame]) -> list[Step]:
    mapper = Mapper(world.geometry, "beam", max_range=5.0)
    return list(steps(iter(given), len(given), world, mapper))


def test_counts_are_those_of_the_maps(plan: Plan) -> None:
    world = build_world(plan, None, (1.0, 0.35, 1.0, 0.35), 5.0, Notes(), resolution=0.1)
    (*_, last) = played(world, frames(5))
    assert last.evidence is not None
    observed = last.evidence.visits() > 0
    for name, grid in last.grids.items():
        expected = count(grid.occupied(), world.wall, world.scored, observed)
        assert last.counts[name] == expected
    assert list(last.grids) == ["none", "bayes", "paper"]


def test_the_wall_that_was_hit_is_occupied_without_a_prior(plan: Plan) -> None:
    world = build_world(plan, None, (1.0, 0.35, 1.0, 0.35), 5.0, Notes(), resolution=0.1)
    (*_, last) = played(world, frames(3))
    g = world.geometry
    row, col = int((0.35 - g.y) / 0.1), int((1.95 - g.x) / 0.1)
    assert last.grids["none"].occupied()[row, col]
    assert not last.grids["none"].occupied()[row, col - 3]
    assert last.counts["none"].observed.tp == 2  # one cell of wall on either side


def test_poses_are_brought_into_the_plan(plan: Plan) -> None:
    turned = Pose(10.0, -3.0, 0.7)
    there = turned @ Pose(1.0, 0.35, 0.0)
    world = build_world(
        plan, None, (there.x, there.y, there.x, there.y), 5.0, Notes(), plan_pose=turned
    )
    (*_, last) = played(world, frames(1, there))
    assert last.frame.pose == pytest.approx((1.0, 0.35, 0.0))


def test_a_plan_that_the_run_never_enters_is_an_error_with_both_extents(plan: Plan) -> None:
    with pytest.raises(FormatError, match=r"x 0\.0 to 2\.0 m.*x 50\.0 to 50\.0 m.*do not overlap"):
        build_world(plan, None, (50.0, 0.35, 50.0, 0.35), 5.0, Notes())


def test_a_plan_without_a_place_is_an_error_that_says_what_to_give(tmp_path: Path) -> None:
    bare = open_plan(world_png(tmp_path / "plan.png", ROOM), Notes(), resolution=0.1)
    with pytest.raises(FormatError, match="--plan-origin"):
        build_world(bare, None, (1.0, 0.3, 1.0, 0.3), 5.0, Notes())


def test_too_many_cells_are_refused_before_they_are_made(plan: Plan) -> None:
    with pytest.raises(FormatError, match="coarser --resolution"):
        build_world(plan, None, (1.0, 0.35, 1.0, 0.35), 25.0, Notes(), resolution=0.001)


def test_the_paper_curve_keeps_the_papers_sensor(plan: Plan) -> None:
    bounds = (1.0, 0.35, 1.0, 0.35)
    bayes = build_world(plan, None, bounds, 5.0, Notes())
    assert bayes.curves["bayes"].p_levels == (0.3, 0.6)
    assert bayes.curves["paper"].p_levels == (0.1, 0.9)
    paper = build_world(plan, None, bounds, 5.0, Notes(), update="paper", p_hit=0.8, p_miss=0.2)
    assert {curve.p_levels for curve in paper.curves.values()} == {(0.2, 0.8)}


@pytest.mark.parametrize("frames", [1, 2, 9, 91, 92, 1000, 100_000])
def test_keyframes_are_bounded_dense_at_first_and_hold_both_ends(frames: int) -> None:
    kept = keyframes(frames)
    assert {0, frames - 1} <= kept
    assert max(kept) < frames
    assert len(kept) <= 100
    if frames > 200:
        assert {1, 3, 7, 15} <= kept


def test_the_clock_gives_every_lap_to_its_stage() -> None:
    clock = Clock()
    clock.lap("reading")
    clock.lap("mapping")
    assert sum(clock.seconds.values()) > 0
    assert clock.seconds["writing"] == 0
