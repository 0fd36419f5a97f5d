"""The odometry motion model (Thrun, Burgard and Fox 2005, Table 5.6), as nav2_amcl has it."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from formats.frame import Floats, Pose
from formats.jit import njit

STILL = 0.01  # m: below, the direction of a move means nothing


class Move(NamedTuple):
    """A turn, a way straight ahead and another turn: rad, m, rad."""

    turn: float
    way: float
    turn_after: float


class Alphas(NamedTuple):
    """Variances of the noise by what causes it; nav2_amcl's alpha1 to alpha4.

    Attributes:
        alpha1: of a turn, by turning.
        alpha2: of a turn, by driving.
        alpha3: of a way, by driving.
        alpha4: of a way, by turning.
    """

    alpha1: float = 0.2
    alpha2: float = 0.2
    alpha3: float = 0.2
    alpha4: float = 0.2


def move_between(before: Pose, after: Pose) -> Move:
    """What odometry says was driven; backwards is a negative way, not two half turns."""
    dx, dy = after.x - before.x, after.y - before.y
    way, turned = hypot(dx, dy), wrapped(after.yaw - before.yaw)
    turn = wrapped(atan2(dy, dx) - before.yaw) if way >= STILL else 0.0
    if abs(turn) > 0.5 * pi:
        turn, way = wrapped(turn + pi), -way
    return Move(turn, way, wrapped(turned - turn))


def spreads(move: Move, alphas: Alphas) -> tuple[float, float, float]:
    """Standard deviations of the three parts: rad, m, rad."""
    a1, a2, a3, a4 = alphas
    turn, way, after = (part * part for part in move)
    return (
        sqrt(a1 * turn + a2 * way),
        sqrt(a3 * way + a4 * (turn + after)),
        sqrt(a1 * after + a2 * way),
    )


def drive_on(particles: Floats, move: Move, alphas: Alphas, rng: np.random.Generator) -> None:
    """Move body poses (n, 3) in place, each with noise of its own."""
    noise = rng.standard_normal((len(particles), 3))
    _move(particles, np.array(move), np.array(spreads(move, alphas)), noise)


@njit
def _move(particles: Floats, move: Floats, spread: Floats, noise: Floats) -> None:
    for i in range(particles.shape[0]):
        turn = move[0] + spread[0] * noise[i, 0]
        way = move[1] + spread[1] * noise[i, 1]
        yaw = particles[i, 2] + turn
        particles[i, 0] += way * cos(yaw)
        particles[i, 1] += way * sin(yaw)
        yaw += move[2] + spread[2] * noise[i, 2]
        particles[i, 2] = (yaw + pi) % (2.0 * pi) - pi


def wrapped(angle: float) -> float:
    """The same angle within -pi to pi."""
    return atan2(sin(angle), cos(angle))
