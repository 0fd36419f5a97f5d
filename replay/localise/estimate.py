"""What a cloud of particles says: the mean of its heaviest cluster, and its whole covariance."""

from __future__ import annotations

from math import floor, pi, radians, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Pose
from formats.jit import njit
from replay.localise.resampling import bin_key, find_slot, table

SETTLED_M, SETTLED_RAD = 0.3, radians(10.0)
NEAR_M, NEAR_RAD = 0.5, radians(20.0)  # around the estimate, which is the mean of what lies there


class Estimate(NamedTuple):
    """Where the body is.

    Attributes:
        pose: the mean of the heaviest cluster of particles, in the plan's own frame.
        covariance: (3, 3) of x, y, yaw (m², m rad, rad²) of all particles about it.
    """

    pose: Pose
    covariance: Floats

    @property
    def settled(self) -> bool:
        """Whether the particles agree, to 0.3 m and 10 degrees (one standard deviation)."""
        return settled(self.covariance)


def settled(covariance: Floats, times: float = 1.0) -> bool:
    """Below 0.3 m along the longest axis, and below 10 degrees, or so many times that."""
    place = float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    spread = sqrt(max(place, 0.0)) / SETTLED_M, sqrt(covariance[2, 2]) / SETTLED_RAD
    return max(spread) < times


def summary(particles: Floats, weights: Floats) -> Estimate:
    """The heaviest cluster's mean, and the covariance of all particles about it.

    From the heaviest bin (0.5 m, 10 degrees) the mean is shifted to that of the particles around.

    Args:
        particles: (n, 3) poses.
        weights: (n,) that sum to 1.
    """
    mean, covariance = np.empty(3), np.zeros((3, 3))
    slots = table(len(particles))
    _summary(particles, weights, slots, np.zeros(slots.size), mean, covariance)
    return Estimate(Pose(*mean.tolist()), covariance)


@njit
def _off(angle: float) -> float:
    """The same angle within -pi to pi."""
    return angle - 2.0 * pi * floor(angle / (2.0 * pi) + 0.5)


@njit
def _summary(
    particles: Floats,
    weights: Floats,
    slots: npt.NDArray[np.int64],
    sums: Floats,
    mean: Floats,
    covariance: Floats,
) -> None:
    best, top = 0, -1.0
    for i in range(weights.size):
        key = bin_key(particles[i, 0], particles[i, 1], particles[i, 2])
        slot = find_slot(slots, key)
        slots[slot] = key
        sums[slot] += weights[i]
        if sums[slot] > top:
            best, top = i, sums[slot]
    heaviest = bin_key(particles[best, 0], particles[best, 1], particles[best, 2])
    mean[:] = particles[best]
    for turn in range(4):
        x, y, yaw, total = 0.0, 0.0, 0.0, 0.0
        for i in range(weights.size):
            dx, dy = particles[i, 0] - mean[0], particles[i, 1] - mean[1]
            angle = _off(particles[i, 2] - mean[2])
            if turn == 0:
                near = bin_key(particles[i, 0], particles[i, 1], particles[i, 2]) == heaviest
            else:
                near = dx * dx + dy * dy <= NEAR_M * NEAR_M and abs(angle) <= NEAR_RAD
            if near:
                total += weights[i]
                x += weights[i] * dx
                y += weights[i] * dy
                yaw += weights[i] * angle
        if total <= 0.0:
            break
        mean[0] += x / total
        mean[1] += y / total
        mean[2] = _off(mean[2] + yaw / total)
    for i in range(weights.size):
        dx, dy = particles[i, 0] - mean[0], particles[i, 1] - mean[1]
        angle, w = _off(particles[i, 2] - mean[2]), weights[i]
        covariance[0, 0] += w * dx * dx
        covariance[0, 1] += w * dx * dy
        covariance[0, 2] += w * dx * angle
        covariance[1, 1] += w * dy * dy
        covariance[1, 2] += w * dy * angle
        covariance[2, 2] += w * angle * angle
    covariance[1, 0], covariance[2, 0], covariance[2, 1] = (
        covariance[0, 1],
        covariance[0, 2],
        covariance[1, 2],
    )
