"""Correlative matching: equal to trying every pose of the window, then polished."""

from __future__ import annotations

import numpy as np
import pytest

from formats.frame import Floats, Pose
from replay.localise.likelihood import pick
from replay.localise.matching import match
from replay.localise.pool import CELL, SIDE
from replay.localise.searching import TRUST
from replay.localise.tile_kernels import FULL
from replay.localise.tiles import Maps
from tests.localising import MOUNT, OFFICE, ROUND, WIDE, drive, way

SPREAD = np.array([0.2, 0.3, 0.2])


@pytest.fixture(scope="module")
def office() -> Maps:
    """A map of the office from its true poses."""
    maps, truth = Maps(1), way(ROUND)
    maps.cover(np.array([-1.0, -1.0]), np.array([17.0, 9.0]))
    for k, sighting in enumerate(drive(OFFICE, truth, truth, cell=WIDE)):
        if k % 3 == 0:
            points = pick(sighting.scan, MOUNT, 90).points
            maps.insert(np.array(truth[k])[None], points, np.array(MOUNT[:2]))
    return maps


def seen(k: int) -> tuple[Floats, Floats]:
    """Where the robot was, and the ends (2, b) of its beams."""
    truth = way(ROUND)[k : k + 1]
    sighting = next(iter(drive(OFFICE, truth, truth, seed=k + 1, cell=WIDE)))
    return np.array(truth[0]), pick(sighting.scan, MOUNT, 90).points


def fine(maps: Maps) -> Floats:
    """The likelihoods as one array from the tables' corner."""
    tables = maps.pool.tables[0]
    rows, cols = tables.shape
    parts = maps.pool.likely[tables].astype(float)
    return parts.transpose(0, 2, 1, 3).reshape(rows * SIDE, cols * SIDE) / FULL


def slow_search(
    maps: Maps, guess: Floats, ends: Floats, window: float, angle: float
) -> tuple[float, Floats]:
    """Every pose of the window, one after the other: the best worth, and its pose."""
    table, reach = fine(maps), round(window / CELL)
    step = max(CELL / max(float(np.hypot(*ends).max()), 1.0), 0.004)
    best, winner = -np.inf, guess
    for turn in step * np.arange(-(angle // step), angle // step + 1):
        c, s = np.cos(guess[2] + turn), np.sin(guess[2] + turn)
        x = guess[0] + c * ends[0] - s * ends[1] - maps.x
        y = guess[1] + s * ends[0] + c * ends[1] - maps.y
        cols, rows = np.floor(x / CELL).astype(int), np.floor(y / CELL).astype(int)
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                a, b = rows + i, cols + j
                inside = (a >= 0) & (b >= 0) & (a < table.shape[0]) & (b < table.shape[1])
                fit = table[a[inside], b[inside]].sum() / ends.shape[1]
                off = np.array([j * CELL, i * CELL, turn]) / SPREAD
                worth = TRUST * fit - 0.5 * off @ off
                if worth > best + 1e-9:
                    best, winner = worth, guess + np.array([j * CELL, i * CELL, turn])
    return best, winner


@pytest.mark.parametrize("k", [5, 40, 70])
def test_the_search_is_that_of_every_pose(office: Maps, k: int) -> None:
    truth, ends = seen(k)
    guess = truth + np.array([0.17, -0.12, 0.11])
    best, winner = slow_search(office, guess, ends, 0.3, 0.2)
    found = match(office, 0, guess, ends, SPREAD, 0.3, 0.2)
    assert found.worth >= best - 0.02 * TRUST  # interpolated, no longer at whole cells
    assert np.hypot(*(found.pose - winner)[:2]) < 1.5 * CELL
    assert np.hypot(*(found.pose - truth)[:2]) < 0.03
    assert abs(found.pose[2] - truth[2]) < 0.01


def test_polishing_alone_finds_what_is_near(office: Maps) -> None:
    truth, ends = seen(40)
    found = match(office, 0, truth + np.array([0.04, -0.03, 0.02]), ends, SPREAD, 0.0, 0.0)
    assert np.hypot(*(found.pose - truth)[:2]) < 0.02
    assert abs(found.pose[2] - truth[2]) < 0.005
    assert found.fit > 0.6


def test_the_pose_cannot_be_bettered_by_a_small_step(office: Maps) -> None:
    truth, ends = seen(40)
    found = match(office, 0, truth + np.array([0.04, -0.03, 0.02]), ends, SPREAD, 0.3, 0.2)
    for axis, size in ((0, 0.03), (1, 0.03), (2, 0.015)):
        for side in (-size, size):
            moved = found.pose.copy()
            moved[axis] += side
            other = match(office, 0, moved, ends, np.full(3, 1e-6), 0.0, 0.0)
            assert other.fit < found.fit


def test_where_nothing_is_the_guess_stays_and_is_no_surer(office: Maps) -> None:
    guess = np.array([300.0, -200.0, 1.0])
    found = match(office, 0, guess, seen(5)[1], SPREAD, 0.3, 0.2)
    assert found.pose == pytest.approx(guess)
    assert found.fit == 0.0
    assert np.linalg.inv(found.information) == pytest.approx(np.diag(SPREAD**2))


def test_a_wall_says_nothing_of_the_way_along_it() -> None:
    """Its information is large across and as small as the motion's along."""
    maps = Maps(1)
    wall = np.stack([np.linspace(-2.0, 2.0, 81), np.full(81, 1.02)])
    maps.cover(np.array([-4.0, -4.0]), np.array([4.0, 4.0]))
    maps.insert(np.zeros((1, 3)), wall, np.zeros(2))
    some = wall[:, 20:61]
    found = match(maps, 0, np.array([0.05, 0.05, 0.0]), some, np.full(3, 0.1), 0.3, 0.1)
    along, across, _ = np.sqrt(np.diag(np.linalg.inv(found.information)))
    assert across < 0.06
    assert 0.06 < along <= 0.1
    assert abs(found.pose[1]) < 0.01
    assert abs(found.pose[0] - 0.05) < 0.06  # it stays where the motion says


def test_beams_of_one_end_are_enough_and_none_changes_nothing(office: Maps) -> None:
    one = match(
        office, 0, np.array(Pose(2.0, 5.2, 0.0)), np.array([[1.0], [0.0]]), SPREAD, 0.1, 0.1
    )
    assert np.isfinite(one.pose).all()
    none = match(office, 0, np.array(Pose(2.0, 5.2, 0.0)), np.empty((2, 0)), SPREAD, 0.0, 0.0)
    assert none.pose == pytest.approx([2.0, 5.2, 0.0])
