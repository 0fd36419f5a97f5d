"""Ways over free space: clear of walls, through doors, everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from formats.errors import FormatError, UsageError
from replay.simulator.coverage import Ground, trace
from replay.simulator.driving import drive
from replay.simulator.site import Mask, Site

ROOMS = """
##############################
#..............#.............#
#..............#.............#
#..............#.............#
#..............#.............#
#............................#
#............................#
#............................#
#............................#
#..............#.............#
#..............#.............#
#..............#.............#
##############################
"""


def site(text: str = ROOMS, scale: int = 2, step: float = 0.1) -> Site:
    lines = [line for line in text.splitlines() if line]
    solid = np.array([[c == "#" for c in line] for line in lines[::-1]])
    return Site.of(np.kron(solid, np.ones((scale, scale), dtype=bool)) > 0, step)


def far(place: Site) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Metres to the nearest solid pixel's centre."""
    found = distance_transform_edt(~place.solid)
    return np.asarray(found) * place.geometry.resolution


def test_the_whole_of_both_rooms_is_come_near_and_no_wall_is() -> None:
    place, radius, spacing = site(), 0.25, 0.8
    ground = Ground(place, radius)
    way = drive(ground.cover(ground.start(), spacing))
    poses = way.at(np.arange(0.0, way.seconds, 0.02))
    rooms = far(place)
    for x, y, _ in poses:
        row, col = place.pixel(x, y) or (0, 0)
        assert rooms[row, col] > radius - 0.05
    reachable = np.argwhere(ground.parts > 0)
    centres = np.array([ground.point(int(r), int(c)) for r, c in reachable])
    gaps = np.hypot(*(centres[:, None] - poses[None, ::5, :2]).transpose(2, 0, 1)).min(axis=1)
    # A cell's node lies in its square of 0.8 m, and the way comes within 0.4 m of the node.
    assert gaps.max() < spacing * 2**0.5 + spacing / 2
    assert np.median(gaps) < 0.3


def test_a_budget_stops_the_plan_of_the_way() -> None:
    ground = Ground(site(), 0.25)
    whole, part = (drive(ground.cover(ground.start(), 0.8, m)) for m in (1e9, 3.0))
    assert 3.0 <= part.metres < 6.0 < whole.metres


def test_the_shortest_way_leads_through_the_door() -> None:
    ground = Ground(site(), 0.25)
    points = ground.way(ground.checked(0.65, 2.05), ground.checked(5.45, 2.05))
    length = np.hypot(*np.diff(points, axis=0).T).sum()
    by_the_door = 2 * np.hypot(2.4, 2.05 - 1.35)  # its upper corner, kept clear of by the radius
    assert by_the_door - 0.15 < length < by_the_door + 0.5
    assert len(points) <= 5


def test_a_wide_robot_stays_in_its_room() -> None:
    ground = Ground(site(), 0.5)  # the door is 0.8 m wide
    with pytest.raises(UsageError, match="no way leads from"):
        ground.way(ground.checked(1.0, 1.2), ground.checked(5.0, 1.2))
    x, y = np.array(ground.cover(ground.start(), 0.8)).T
    assert (x < 3.0).all() or (x > 3.2).all()
    assert len(y) > 3


def test_the_way_keeps_out_of_where_it_may_not_go() -> None:
    inside = np.zeros(site().geometry.shape, dtype=bool)
    inside[:, :30] = True
    ground = Ground(site(), 0.2, inside)
    assert max(x for x, _ in ground.cover(ground.start(), 0.8)) < 3.0


@pytest.mark.parametrize(
    ("x", "y", "problem"),
    [(99.0, 1.0, "lies outside the plan"), (0.05, 1.0, "there is no room for the robot")],
)
def test_a_bad_start_is_said_with_what_would_do(x: float, y: float, problem: str) -> None:
    with pytest.raises(UsageError, match=problem) as caught:
        Ground(site(), 0.25).checked(x, y)
    hint = {99.0: "the plan reaches x 0.00 to 6.00", 0.05: "the nearest free place is 0.55,0.95"}
    assert hint[x] in str(caught.value)


@pytest.mark.parametrize("solid", [np.ones((40, 40), bool), np.ones((1, 1), bool)])
def test_no_room_at_all(solid: Mask) -> None:
    with pytest.raises(FormatError, match=r"no room for a robot of radius 0\.25 m"):
        Ground(Site.of(solid, 0.1), 0.25)


def dijkstra(free: Mask, start: tuple[int, int]) -> dict[tuple[int, int], float]:
    """Lengths to every cell, relaxed until nothing changes."""
    far = {start: 0.0}
    changed = True
    while changed:
        changed = False
        for (r, c), d in list(far.items()):
            for i, j in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]:
                to = (r + i, c + j)
                if not (0 <= to[0] < free.shape[0] and 0 <= to[1] < free.shape[1]):
                    continue
                if free[to] and free[r + i, c] and free[r, c + j]:
                    longer = d + (i * i + j * j) ** 0.5
                    if longer < far.get(to, np.inf) - 1e-9:
                        far[to], changed = longer, True
    return far


def test_ways_are_shortest_by_a_slow_search() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        free = rng.random((12, 15)) > 0.3
        free[0, 0] = True
        far_away = dijkstra(free, (0, 0))
        for goal in [(11, 14), (5, 7), (0, 14)]:
            goals = np.zeros_like(free)
            goals[goal] = True
            cells = trace(free, 0, 0, goals)
            assert (len(cells) > 0) == (goal in far_away)
            if len(cells):
                length = np.hypot(*np.diff(cells, axis=0).T).sum()
                assert length == pytest.approx(far_away[goal])
                assert tuple(cells[0]) == (0, 0)
                assert tuple(cells[-1]) == goal
