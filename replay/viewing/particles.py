"""Which particles of a localiser are seen when."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from formats.frame import Floats, Particles
from replay.viewing.scene import Block

STALE = 1.0  # m that the robot has gone on, when particles of before say nothing any more
NOTHING = np.empty((0, 2))


class Trail:
    """Samples of particles along a run: each is shown until the next, or until it is stale.

    Args:
        samples: ascending in time, in the plan's frame.
    """

    def __init__(self, samples: Sequence[Particles]) -> None:
        self._samples = list(samples)
        self._from: Floats | None = None  # (2,) m, where the robot was when those shown were so

    def rows(self, block: Block) -> list[tuple[int, Floats]]:
        """Rows of the next block at which what is shown changes, and its places (n, 2) from then.

        Of several samples between two frames the last one is shown.
        """
        stamps = np.array([sample.time_ns for sample in self._samples], dtype=np.int64)
        first = np.searchsorted(block.times_ns, stamps)
        due = {
            int(row): sample.poses[:, :2]
            for row, sample in zip(first, self._samples, strict=True)
            if row < len(block.times_ns)
        }
        self._samples = self._samples[int(np.sum(first < len(block.times_ns))) :]
        out: list[tuple[int, Floats]] = []
        for start, stop in pairwise([*sorted({0, *due}), len(block.times_ns)]):
            if start in due:
                out.append((start, due[start]))
                self._from = block.poses[start, :2]
            out += self._stale(block, start, stop)
        return out

    def _stale(self, block: Block, start: int, stop: int) -> list[tuple[int, Floats]]:
        """The row from which on nothing is shown, where there is one."""
        if self._from is None:
            return []
        gone = np.hypot(*(block.poses[start:stop, :2] - self._from).T) > STALE
        if not gone.any():
            return []
        self._from = None
        return [(start + int(np.argmax(gone)), NOTHING)]
