from __future__ import annotations

from math import pi

import numpy as np
import pytest

from formats.frame import Floats, Pose
from replay.localise.poses import carried, compose, inverse, joined


def poses(count: int, seed: int = 0) -> Floats:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-5, 5, (count, 2)), rng.uniform(-3, 3, count)])


def test_compose_and_inverse_are_those_of_single_poses() -> None:
    a, b = poses(20), poses(20, 1)
    for left, right, both, undone in zip(a, b, compose(a, b), inverse(a), strict=True):
        assert both == pytest.approx(Pose(*left) @ Pose(*right))
        assert undone == pytest.approx(Pose(*left).inverse())


def test_exact_odometry_is_followed_exactly_whatever_its_frame() -> None:
    truth = poses(9)
    odometry = compose(np.tile([[3.0, -2.0, 2.5]], (9, 1)), truth)
    times = np.arange(9, dtype=np.int64) * 100
    rows = np.array([2, 5])
    found = carried(times, odometry, rows, truth[rows])
    assert found[:, :2] == pytest.approx(truth[:, :2])
    assert np.cos(found[:, 2] - truth[:, 2]) == pytest.approx(np.ones(9))


def test_between_updates_the_correction_is_shared_by_time() -> None:
    odometry = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0]])
    times = np.array([0, 10, 40, 50, 60], dtype=np.int64)
    estimates = np.array([[1.0, 0.2, 0.0], [3.0, -0.2, 0.0]])
    found = carried(times, odometry, np.array([1, 3]), estimates)
    # from the first update on y = 0.2, back from the second y = -0.2; 30 of 40 ns are over
    assert found == pytest.approx(
        np.array([[0, 0.2, 0], [1, 0.2, 0], [2, -0.1, 0], [3, -0.2, 0], [4, -0.2, 0]], dtype=float)
    )


def test_headings_are_shared_the_short_way_round() -> None:
    odometry = np.zeros((3, 3))
    times = np.array([0, 10, 20], dtype=np.int64)
    found = carried(
        times, odometry, np.array([0, 2]), np.array([[0, 0, pi - 0.1], [0, 0, 0.1 - pi]])
    )
    assert abs(found[1, 2]) == pytest.approx(pi)


def test_a_teleport_is_taken_for_another_step_like_the_one_before() -> None:
    """By hand: half a metre a step along x; then the counter is at 10, 20 and goes up along y."""
    times = np.arange(6) * 100_000_000
    turned = pi / 2
    odometry = np.array(
        [
            [0.0, 0.0, 0.0],
            [0.5, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [10.0, 20.0, turned],
            [10.0, 20.5, turned],
            [10.0, 21.0, turned],
        ]
    )
    expected = np.column_stack([np.arange(6) * 0.5, np.zeros(6), np.zeros(6)])
    assert joined(times, odometry) == pytest.approx(expected)
    assert joined(times[:3], odometry[:3]) == pytest.approx(odometry[:3])
    # 22 m in 20 s is a drive.
    slow = np.array([0, 1, 2, 22, 23, 24]) * 1_000_000_000
    assert np.array_equal(joined(slow, odometry), odometry)
    # Nothing is known of a step before the first.
    begun = joined(times[:3], odometry[2:5])
    assert begun == pytest.approx(np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.5, 0.0, 0.0]]))
