"""Adaptive Monte Carlo localisation on a plan.

Thrun, Burgard and Fox, "Probabilistic Robotics" (2005), Table 8.3, with KLD sampling (Fox 2001) and
sensor resetting (Lenser and Veloso 2000). Parameters that nav2_amcl has too bear its names, and its
defaults unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sqrt
from typing import NamedTuple

import numpy as np

from formats.frame import Floats, Pose
from replay.localise.field import Field
from replay.localise.likelihood import UNIT, Costs, Model, Reading
from replay.localise.motion import Alphas, drive_on, move_between, wrapped
from replay.localise.resampling import BIN, enough, systematic

SETTLED_M, SETTLED_RAD = 0.3, radians(10.0)
NEAR = (0.5, radians(20.0))  # m, rad: around the estimate, whose mean it is
PER_M2 = 400.0  # poses tried on each m² of free space at a global start
MOST_TRIED = 200_000


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


def settled(covariance: Floats) -> bool:
    """Below 0.3 m along the longest axis, and below 10 degrees."""
    place = float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return sqrt(max(place, 0.0)) < SETTLED_M and sqrt(covariance[2, 2]) < SETTLED_RAD


@dataclass(frozen=True, slots=True)
class Parameters:
    """Of the filter; where nav2_amcl has no such thing, or another default, it is said.

    Attributes:
        alphas: noise of the odometry.
        min_particles, max_particles: once settled.
        global_particles: at most, until settled (ours).
        pf_err, pf_z: of KLD sampling.
        resample_interval: updates.
        recovery_alpha_slow, recovery_alpha_fast: of the mean likelihood; nav2 suggests these values
            but has 0 and 0, that is no recovery.
        effective_beams: what the beams of one scan weigh together, since they are not independent
            (ours; nav2 sums cubes instead).
    """

    alphas: Alphas = Alphas()  # noqa: RUF009 (a tuple is immutable)
    min_particles: int = 500
    max_particles: int = 2000
    global_particles: int = 20_000
    pf_err: float = 0.05
    pf_z: float = 0.99
    resample_interval: int = 1
    recovery_alpha_slow: float = 0.001
    recovery_alpha_fast: float = 0.1
    effective_beams: float = 12.0


class Amcl:
    """The filter: particles, moved by odometry and weighed by readings.

    Args:
        field: of the plan.
        model: of the sensor.
        parameters: see Parameters.
        start: in the plan's own frame; None: anywhere on the plan.
        seed: the same one gives the same bits.

    Attributes:
        particles: (n, 3) body poses in the plan's own frame.
        weights: (n,) that sum to 1.
        estimate: after the last update.
    """

    def __init__(
        self,
        field: Field,
        model: Model,
        parameters: Parameters | None = None,
        *,
        start: Estimate | None = None,
        seed: int = 0,
    ) -> None:
        self.field, self.model, self.parameters = field, model, parameters or Parameters()
        self._rng = np.random.default_rng(seed)
        self._odometry: Pose | None = None
        self._updates, self._lost = 0, start is None
        self._slow = self._fast = 0.0
        if start is None:
            count = int(min(max(PER_M2 * field.area, self.parameters.max_particles), MOST_TRIED))
            self.particles = field.scatter(count, self._rng)
        else:
            count = self.parameters.max_particles
            self.particles = self._rng.multivariate_normal(
                start.pose, start.covariance, count, method="eigh"
            )
        self.weights = np.full(count, 1.0 / count)
        self.estimate = summary(self.particles, self.weights)

    def update(self, odometry: Pose, reading: Reading) -> Estimate:
        """One step: move by odometry, weigh by the reading, resample.

        Args:
            odometry: pose of the body as odometry has it; only differences count.
            reading: taken there.
        """
        if self._odometry is not None:
            move = move_between(self._odometry, odometry)
            drive_on(self.particles, move, self.parameters.alphas, self._rng)
        self._odometry = odometry
        if reading.ranges.size:
            self._weigh(reading)
        self.estimate = summary(self.particles, self.weights)
        self._lost = self._lost and not self.estimate.settled
        self._updates += 1
        if self._updates % self.parameters.resample_interval == 0:
            self._resample(reading)
        return self.estimate

    def _weigh(self, reading: Reading) -> None:
        costs = self.model.costs(self.particles, reading)
        likelihood = float(self.weights @ np.exp(costs * (-1.0 / (UNIT * reading.ranges.size))))
        self.weights *= self._likelihoods(costs, reading)
        self.weights /= self.weights.sum()
        if self._lost:
            return
        if self._slow == 0.0:
            self._slow = self._fast = likelihood
        p = self.parameters
        self._slow += p.recovery_alpha_slow * (likelihood - self._slow)
        self._fast += p.recovery_alpha_fast * (likelihood - self._fast)

    def _likelihoods(self, costs: Costs, reading: Reading) -> Floats:
        """Relative to the best particle, tempered to the effective number of beams."""
        temper = min(1.0, self.parameters.effective_beams / reading.ranges.size)
        return np.exp((costs.min() - costs) * (temper / UNIT))

    def _resample(self, reading: Reading) -> None:
        p = self.parameters
        most = p.global_particles if self._lost else p.max_particles
        n = enough(self.particles, self.weights, self._rng, p.min_particles, most, p.pf_err, p.pf_z)
        share = max(0.0, 1.0 - self._fast / self._slow) if self._slow > 0.0 else 0.0
        fresh = round(share * n) if reading.ranges.size else 0
        drawn = systematic(self.weights, n - fresh, self._rng.random())
        self.particles = self.particles[drawn]
        if fresh:
            self.particles = np.vstack([self.particles, self._reset(fresh, reading)])
        self.weights = np.full(n, 1.0 / n)

    def _reset(self, count: int, reading: Reading) -> Floats:
        """Poses (count, 3) drawn by how well the reading fits there."""
        tried = int(min(max(PER_M2 * self.field.area, count), MOST_TRIED))
        poses = self.field.scatter(tried, self._rng)
        likely = self._likelihoods(self.model.costs(poses, reading), reading)
        return poses[systematic(likely, count, self._rng.random())]


def summary(particles: Floats, weights: Floats) -> Estimate:
    """The heaviest cluster's mean, and the covariance of all particles about it.

    Args:
        particles: (n, 3) poses.
        weights: (n,) that sum to 1.
    """
    bins = np.floor(particles / np.array(BIN)).astype(np.int64)
    keys = (bins[:, 0] << 40) ^ ((bins[:, 1] & 0xFFFFF) << 16) ^ (bins[:, 2] & 0xFFFF)
    _, which = np.unique(keys, return_inverse=True)
    inside = which == np.bincount(which, weights).argmax()
    for _ in range(3):
        pose = mean_pose(particles[inside], weights[inside])
        off = difference(particles, pose)
        inside = np.hypot(off[:, 0], off[:, 1]) <= NEAR[0]
        inside &= np.abs(off[:, 2]) <= NEAR[1]
        if not inside.any():
            break
    off = difference(particles, pose)
    return Estimate(pose, (off * weights[:, None]).T @ off)


def mean_pose(particles: Floats, weights: Floats) -> Pose:
    """The weighted mean; headings as on a circle."""
    share = weights / weights.sum()
    x, y, yaw = particles.T
    heading = np.arctan2(share @ np.sin(yaw), share @ np.cos(yaw))
    return Pose(float(share @ x), float(share @ y), wrapped(float(heading)))


def difference(particles: Floats, pose: Pose) -> Floats:
    """Poses (n, 3) less another one, headings within -pi to pi."""
    off = particles - np.array(pose)
    off[:, 2] = np.mod(off[:, 2] + np.pi, 2.0 * np.pi) - np.pi
    return off
