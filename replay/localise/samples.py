"""A bounded sample of a filter's particles through time, for people to look at."""

from __future__ import annotations

from formats.frame import Floats, Particles
from replay.localise.resampling import systematic

MOST, SIZE = 200, 500  # moments; particles of each


class Samples:
    """Evenly spaced ones of a filter's updates, at most MOST, and the last one.

    How many updates will come is not known: beyond MOST every second moment is let go, and from
    then on only every second update is kept. No random number is drawn, so that the filter goes
    its way as without.
    """

    def __init__(self) -> None:
        self._every, self._offered = 1, 0
        self._kept: list[Particles] = []

    def offer(self, time_ns: int, particles: Floats, weights: Floats) -> None:
        """The particles (n, 3) after an update, with weights (n,) that sum to 1."""
        if self._offered % self._every == 0:
            self._kept.append(sample(time_ns, particles, weights))
            if len(self._kept) > MOST:
                self._kept, self._every = self._kept[::2], 2 * self._every
        self._offered += 1

    def finished(self, time_ns: int, particles: Floats, weights: Floats) -> tuple[Particles, ...]:
        """In the order of the updates, with the particles after the last one."""
        if self._kept and self._kept[-1].time_ns == time_ns:
            return tuple(self._kept)
        return *self._kept, sample(time_ns, particles, weights)


def sample(time_ns: int, particles: Floats, weights: Floats) -> Particles:
    """SIZE particles at most, drawn by their weights."""
    return Particles(time_ns, particles[systematic(weights, min(len(particles), SIZE), 0.5)])
