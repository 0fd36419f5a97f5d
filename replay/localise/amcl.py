"""Adaptive Monte Carlo localisation on a plan.

Thrun, Burgard and Fox, "Probabilistic Robotics" (2005), Table 8.3, with KLD sampling (Fox 2001) and
sensor resetting (Lenser and Veloso 2000). Parameters that nav2_amcl has too bear its names, and its
defaults unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formats.frame import Floats, Pose
from replay.localise.estimate import Estimate, settled, summary
from replay.localise.field import Field
from replay.localise.likelihood import UNIT, Costs, Model, Reading
from replay.localise.motion import Alphas, drive_on, move_between
from replay.localise.resampling import enough, systematic

PER_M2 = 1000.0  # poses tried on each m² of free space at a global start
MOST_TRIED = 300_000
HALF = 0.5  # of the beams' weight until the particles have gathered
GATHERED = 2.0  # times the spread at which they agree
FIRST = 10  # readings that say how well they fit when all is well
WORSE = 0.15  # share by which readings fit less than before, below which nothing is wrong
TRIES = 50  # poses for each particle that is drawn anew


@dataclass(frozen=True, slots=True)
class Parameters:
    """Of the filter; where nav2_amcl has no such thing, or another default, it is said.

    Attributes:
        alphas: noise of the odometry.
        min_particles, max_particles: once settled; nav2 has 500 and 2000, which lose the way in a
            long corridor now and then.
        global_particles: at most, and at least a quarter of it, until they have gathered within
            twice the spread that is settled (ours).
        pf_err, pf_z: of KLD sampling.
        resample_interval: updates.
        recovery_alpha_slow, recovery_alpha_fast: of the mean likelihood, 0.001 and 0.1 where a
            robot may be carried off; 0 and 0 for no recovery, as in nav2, since in a building
            that repeats itself a reading that fits badly may fit better elsewhere.
        effective_beams: what the beams of one scan weigh together, since they are not independent;
            half as much until gathered (ours; nav2 sums cubes instead).
    """

    alphas: Alphas = Alphas()  # noqa: RUF009 (a tuple is immutable)
    min_particles: int = 2000
    max_particles: int = 5000
    global_particles: int = 100_000
    pf_err: float = 0.05
    pf_z: float = 0.99
    resample_interval: int = 1
    recovery_alpha_slow: float = 0.0
    recovery_alpha_fast: float = 0.0
    effective_beams: float = 8.0


class Amcl:
    """The filter: particles, moved by odometry and weighed by readings.

    Args:
        field: of the plan.
        model: of the sensor.
        parameters: see Parameters.
        coarse: of the sensor until the particles have gathered; None: `model`. At first few
            particles lie so near to the truth that a sharp model would know them.
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
        coarse: Model | None = None,
        start: Estimate | None = None,
        seed: int = 0,
    ) -> None:
        self.field, self.model, self.parameters = field, model, parameters or Parameters()
        self._coarse = coarse or model
        self._rng = np.random.default_rng(seed)
        self._odometry: Pose | None = None
        self._updates, self._weighed, self._lost = 0, 0, start is None
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
        self._lost = self._lost and not settled(self.estimate.covariance, GATHERED)
        self._updates += 1
        if self._updates % self.parameters.resample_interval == 0:
            self._resample(reading)
        return self.estimate

    def _weigh(self, reading: Reading) -> None:
        model = self._coarse if self._lost else self.model
        costs = model.costs(self.particles, reading)
        self.weights *= self._likelihoods(costs, reading)
        self.weights /= self.weights.sum()
        # Of a beam, over the particles as they are weighed now: over those of before, as in the
        # book, it would tell the odometry's noise more than the fit.
        likelihood = float(self.weights @ np.exp(costs * (-1.0 / (UNIT * reading.ranges.size))))
        if self._lost:
            return
        self._weighed += 1
        p = self.parameters
        first = 1.0 / self._weighed if self._weighed <= FIRST else 0.0  # a plain mean of the first
        self._slow += max(p.recovery_alpha_slow, first) * (likelihood - self._slow)
        self._fast += max(p.recovery_alpha_fast, first) * (likelihood - self._fast)

    def _likelihoods(self, costs: Costs, reading: Reading) -> Floats:
        """Relative to the best particle, tempered to the effective number of beams."""
        trust = HALF if self._lost else 1.0
        temper = min(1.0, trust * self.parameters.effective_beams / reading.ranges.size)
        return np.exp((costs.min() - costs) * (temper / UNIT))

    def _resample(self, reading: Reading) -> None:
        p = self.parameters
        least, most = p.min_particles, p.max_particles
        if self._lost:  # few particles would soon forget one of two places by chance
            least, most = max(least, p.global_particles // 4), max(most, p.global_particles)
        n = enough(self.particles, self.weights, self._rng, least, most, p.pf_err, p.pf_z)
        worse = 1.0 - self._fast / self._slow if self._slow > 0.0 else 0.0
        fresh = round(worse * n) if worse > WORSE and reading.ranges.size else 0
        drawn = systematic(self.weights, n - fresh, self._rng.random())
        self.particles = self.particles[drawn]
        if fresh:
            self.particles = np.vstack([self.particles, self._reset(fresh, reading)])
        self.weights = np.full(n, 1.0 / n)

    def _reset(self, count: int, reading: Reading) -> Floats:
        """Poses (count, 3) drawn by how well the reading fits there."""
        tried = min(TRIES * count, MOST_TRIED)
        poses = self.field.scatter(tried, self._rng)
        likely = self._likelihoods(self.model.costs(poses, reading), reading)
        return poses[systematic(likely, count, self._rng.random())]
