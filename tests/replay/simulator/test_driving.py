"""Drives: times and poses by hand, budgets, drift by its statistics."""

from __future__ import annotations

from math import hypot, pi

import numpy as np
import pytest

from formats.frame import Pose
from replay.simulator.driving import Drift, Way, believed, correction, drive

CORNER = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]


def test_a_corner_by_hand() -> None:
    way = drive(CORNER, speed=0.5, turn_rate=pi / 4)
    assert way.times.tolist() == pytest.approx([0.0, 4.0, 6.0, 8.0])
    assert way.poses.tolist() == [
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 0.0, pytest.approx(pi / 2)],
        [2.0, 1.0, pytest.approx(pi / 2)],
    ]
    assert way.at(np.array([5.0]))[0].tolist() == pytest.approx([2.0, 0.0, pi / 4])
    assert [way.seconds, way.metres] == pytest.approx([8.0, 3.0])


def test_it_turns_first_where_a_heading_is_given_and_the_short_way_round() -> None:
    way = drive([(0.0, 0.0), (-1.0, 0.0)], yaw=-pi / 2, speed=1.0, turn_rate=1.0)
    assert way.poses[-1].tolist() == pytest.approx([-1.0, 0.0, -pi])
    assert way.seconds == pytest.approx(pi / 2 + 1.0)


def test_pauses_at_every_waypoint() -> None:
    way = drive(CORNER, speed=1.0, turn_rate=pi, pause=2.0)
    assert way.seconds == pytest.approx(3.0 + 0.5 + 3 * 2.0)
    assert way.at(np.array([1.9]))[0].tolist() == pytest.approx([0.0, 0.0, 0.0])


def test_one_place_and_the_same_place_twice_stand_still() -> None:
    for points in ([(1.0, 2.0)], [(1.0, 2.0), (1.0, 2.0)]):
        way = drive(points, yaw=0.5)
        assert way.poses.tolist() == [[1.0, 2.0, 0.5]]
        assert (way.seconds, way.metres) == (0.0, 0.0)
    with pytest.raises(ValueError, match="needs a waypoint"):
        drive([])


def test_budgets_of_metres_and_seconds() -> None:
    way = drive(CORNER, speed=0.5, turn_rate=pi / 4)
    short = way.within(metres=2.5)
    assert short.metres == pytest.approx(2.5)
    assert short.seconds == pytest.approx(7.0)
    assert way.within(seconds=5.0).poses[-1].tolist() == pytest.approx([2.0, 0.0, pi / 4])
    assert way.within(metres=99.0, seconds=99.0) is way
    assert way.within(metres=2.0).seconds == pytest.approx(6.0)  # turning costs no metres


def straight(metres: float) -> Way:
    return drive([(0.0, 0.0), (metres, 0.0)], speed=0.5)


def test_without_drift_the_wheels_are_right() -> None:
    way = drive(CORNER)
    belief = believed(way, Drift(0.0, 0.0), 50.0, np.random.default_rng(1))
    assert belief.poses == pytest.approx(way.at(belief.times), abs=1e-9)


@pytest.mark.parametrize("rate", [10.0, 50.0])
def test_drift_grows_with_the_root_of_the_way_at_any_rate(rate: float) -> None:
    rng = np.random.default_rng(7)
    ends = np.array(
        [believed(straight(9.0), Drift(0.02, 0.0), rate, rng).poses[-1] for _ in range(2000)]
    )
    # 3 x 0.02 after 9 m; the estimate of a standard deviation from 2000 is good to 1.6 %
    assert ends[:, 2].std() == pytest.approx(0.06, rel=0.06)
    assert ends[:, 0].std() == pytest.approx(0.06, rel=0.06)
    # y is the integral of the heading's walk: 0.02 * sqrt(L^3 / 3)
    assert ends[:, 1].std() == pytest.approx(0.02 * (9.0**3 / 3) ** 0.5, rel=0.06)
    assert abs(ends[:, 2].mean()) < 0.06 / 2000**0.5 * 4


def test_a_turn_drifts_by_its_own_size() -> None:
    way = Way(np.array([0.0, 4.0]), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 4.0]]))
    rng = np.random.default_rng(3)
    ends = [believed(way, Drift(0.05, 0.0), 20.0, rng).poses[-1, 2] for _ in range(2000)]
    assert np.std(ends) == pytest.approx(0.1, rel=0.06)


def test_a_pull_bends_the_way_into_a_circle() -> None:
    belief = believed(straight(10.0), Drift(0.0, 0.1), 500.0, np.random.default_rng(0))
    x, y, yaw = belief.poses[-1]
    assert yaw == pytest.approx(1.0)
    assert hypot(x, y - 10.0) == pytest.approx(10.0, abs=0.02)  # about (0, 10), radius 1 / 0.1


def test_the_correction_leads_from_belief_to_truth() -> None:
    belief, true = Pose(1.0, 2.0, 0.3), Pose(1.2, 1.9, 0.4)
    assert correction(belief, true) @ belief == pytest.approx(true)
