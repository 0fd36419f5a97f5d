"""Rays end at the edges of solid pixels, to rounding."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin

import numpy as np
import pytest

from formats.frame import Pose
from replay.simulator.casting import cast
from replay.simulator.site import Site, clearance


def room(rows: int = 60, cols: int = 100, step: float = 0.1) -> Site:
    """A room of 9.8 x 5.8 m inside walls of one pixel, its lower left corner at (-1, 2)."""
    solid = np.ones((rows, cols), dtype=bool)
    solid[1:-1, 1:-1] = False
    return Site.of(solid, step, -1.0, 2.0)


def analytic(x: float, y: float, angle: float) -> float:
    """Distance from inside the room to its walls, by the four lines."""
    c, s = cos(angle), sin(angle)
    across = (8.9 - x) / c if c > 0 else (-0.9 - x) / c if c < 0 else inf
    along = (7.9 - y) / s if s > 0 else (2.1 - y) / s if s < 0 else inf
    return min(across, along)


@pytest.mark.parametrize("pose", [Pose(0.0, 3.0, 0.3), Pose(8.5, 7.7, -2.0), Pose(4.0, 5.0, 0.0)])
def test_a_room_as_its_four_lines_say(pose: Pose) -> None:
    bearings = np.linspace(-pi, pi, 361)
    expected = [analytic(pose.x, pose.y, pose.yaw + b) for b in bearings]
    assert cast(room(), pose, bearings, 30.0) == pytest.approx(expected, abs=1e-9)


def test_beyond_its_range_there_is_nothing() -> None:
    found = cast(room(), Pose(0.0, 3.0, 0.0), np.array([0.0, pi]), 5.0)
    assert found.tolist() == [inf, pytest.approx(0.9)]


def test_rays_that_leave_the_picture_hit_nothing() -> None:
    site = Site.of(np.eye(3, dtype=bool)[::-1], 1.0)  # solid from upper left to lower right
    found = cast(site, Pose(0.5, 0.5, 0.0), np.array([pi, -pi / 2, 0.0, pi / 2]), 100.0)
    assert found.tolist() == [inf, inf, 1.5, 1.5]


def test_from_outside_a_ray_enters_the_picture() -> None:
    found = cast(room(), Pose(-3.0, 4.0, 0.0), np.array([0.0, pi, 0.1]), 30.0)
    assert found.tolist() == [pytest.approx(2.0), inf, pytest.approx(2.0 / cos(0.1))]
    assert cast(room(), Pose(-3.0, 4.0, 0.0), np.array([pi / 2, -pi / 2]), 30.0).min() == inf


def test_inside_a_wall_every_distance_is_0() -> None:
    assert cast(room(), Pose(-0.95, 4.0, 0.0), np.linspace(0, 6, 7), 30.0).tolist() == [0.0] * 7


def boxes(site: Site, pose: Pose, angle: float) -> float:
    """The nearest of all solid pixels as boxes, one by one (slab method)."""
    g, best = site.geometry, inf
    x, y = site.place(pose)
    u, v = cos(angle + pose.yaw), sin(angle + pose.yaw)
    for row, col in np.argwhere(site.solid).tolist():
        a, b = (col - x) / u, (col + 1 - x) / u
        c, d = (row - y) / v, (row + 1 - y) / v
        near, leave = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
        if max(near, 0.0) < leave:
            best = min(best, max(near, 0.0))
    return best * g.resolution


@pytest.mark.parametrize("share", [0.002, 0.02, 0.2])
def test_random_pixels_as_boxes_one_by_one(share: float) -> None:
    rng = np.random.default_rng(round(1000 * share))
    solid = rng.random((70, 90)) < share
    site = Site.of(solid, 0.05, 3.0, -2.0)
    for _ in range(20):
        pose = Pose(3.0 + 4.5 * rng.random(), -2.0 + 3.5 * rng.random(), 6.0 * rng.random())
        bearings = rng.random(20) * 2 * pi
        expected = [boxes(site, pose, float(b)) for b in bearings]
        assert cast(site, pose, bearings, 100.0) == pytest.approx(expected, abs=1e-9)


def test_clearance_counts_pixels_as_a_king_moves() -> None:
    solid = np.zeros((5, 7), dtype=bool)
    solid[1, 2] = True
    expected = [[max(abs(row - 1), abs(col - 2)) for col in range(7)] for row in range(5)]
    assert clearance(solid).tolist() == expected
    assert clearance(np.zeros((2, 2), dtype=bool)).min() >= 1  # nothing solid at all


def test_a_long_empty_hall_is_crossed_in_wide_steps() -> None:
    solid = np.zeros((3, 1200), dtype=bool)
    solid[:, -1] = True
    site = Site.of(solid, 0.02)
    assert cast(site, Pose(0.01, 0.03, 0.0), np.zeros(1), 99.0)[0] == pytest.approx(23.97)
    assert hypot(*site.place(Pose(0.02, 0.0, 0.0))) == pytest.approx(1.0)
