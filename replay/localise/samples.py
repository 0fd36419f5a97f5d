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
        self._last: Particles | None = None

    def offer(self, time_ns: int, particles: Floats, weights: Floats) -> None:
        """The particles (n, 3) after an update, with weights (n,) that sum to 1."""
        drawn = systematic(weights, min(len(particles), SIZE), 0.5)
        self._last = Particles(time_ns, particles[drawn])
        if self._offered % self._every == 0:
            self._kept.append(self._last)
            if len(self._kept) > MOST:
                self._kept, self._every = self._kept[::2], 2 * self._every
        self._offered += 1

    def finished(self) -> tuple[Particles, ...]:
        """In the order of the updates."""
        if self._last is None or self._kept[-1] is self._last:
            return tuple(self._kept)
        return *self._kept, self._last
