from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest

from formats.frame import Pose
from replay.localise.motion import Alphas, Move, drive_on, move_between, spreads, wrapped


@pytest.mark.parametrize(
    ("after", "move"),
    [
        (Pose(1.0, 1.0, pi / 2), (pi / 4, sqrt(2), pi / 4)),
        (Pose(0.0, 0.0, 0.3), (0.0, 0.0, 0.3)),
        (Pose(0.005, 0.0, -0.3), (0.0, 0.005, -0.3)),
        (Pose(-2.0, 0.0, 0.0), (0.0, -2.0, 0.0)),  # backwards: not two half turns
        (Pose(-1.0, -1.0, 0.0), (pi / 4, -sqrt(2), -pi / 4)),
    ],
)
def test_a_move_is_a_turn_a_way_and_a_turn(after: Pose, move: tuple[float, ...]) -> None:
    assert move_between(Pose(0, 0, 0), after) == pytest.approx(move)
    elsewhere = Pose(3.0, -4.0, 2.9)
    assert move_between(elsewhere, elsewhere @ after) == pytest.approx(move)


def test_without_noise_particles_go_where_odometry_went() -> None:
    before, after = Pose(1.0, 2.0, 3.0), Pose(1.3, 1.6, -2.8)
    particles = np.array([[0.0, 0.0, 0.0], [5.0, -1.0, 2.0], [1.0, 2.0, 3.0]])
    step = before.inverse() @ after
    expected = [Pose(*p) @ step for p in particles]
    move = move_between(before, after)
    drive_on(particles, move, Alphas(0, 0, 0, 0), np.random.default_rng(0))
    for found, wanted in zip(particles, expected, strict=True):
        assert found[:2] == pytest.approx(wanted[:2])
        assert wrapped(found[2] - wanted.yaw) == pytest.approx(0.0, abs=1e-12)
    assert particles[2] == pytest.approx(after)


def test_spreads_are_the_table_s() -> None:
    found = spreads(Move(0.3, -2.0, 0.1), Alphas(0.1, 0.02, 0.3, 0.04))
    first = sqrt(0.1 * 0.09 + 0.02 * 4.0)
    second = sqrt(0.3 * 4.0 + 0.04 * (0.09 + 0.01))
    assert found == pytest.approx((first, second, sqrt(0.1 * 0.01 + 0.02 * 4.0)))


def test_particles_spread_as_the_noise_says() -> None:
    particles = np.zeros((200_000, 3))
    move, alphas = Move(0.0, 1.0, 0.2), Alphas(0.01, 0.0004, 0.0025, 0.0)
    drive_on(particles, move, alphas, np.random.default_rng(5))
    turn, way, after = spreads(move, alphas)
    assert np.hypot(*particles[:, :2].T).std() == pytest.approx(way, rel=0.01)
    assert np.arctan2(particles[:, 1], particles[:, 0]).std() == pytest.approx(turn, rel=0.01)
    assert particles[:, 2].std() == pytest.approx(sqrt(turn**2 + after**2), rel=0.01)
    assert particles[:, 2].mean() == pytest.approx(0.2, abs=0.001)
