"""Maps of many particles in shared tiles: copied only where one of them writes (copy on write)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from replay.localise.pool import CELL, SIDE, empty, grown, let_go
from replay.localise.tile_kernels import FREED, REACH, draw, insert

MARGIN = 16  # tiles around what is asked for when tables grow


class Maps:
    """One map for each of several particles.

    Args:
        particles: how many.

    Attributes:
        pool: of tiles; another one when it has grown.
        x, y: m, the lower left corner of the tables.
    """

    def __init__(self, particles: int) -> None:
        self.pool = empty(256, np.zeros((particles, 2, 2), dtype=np.int32))
        self.x = self.y = -SIDE * CELL

    @property
    def tiles(self) -> int:
        """How many are in use."""
        return len(self.pool.owners) - 1 - int(self.pool.spare[0])

    def cover(self, low: Floats, high: Floats) -> None:
        """Let the tables reach from `low` (2,) to `high` (2,), m."""
        tile, tables = SIDE * CELL, self.pool.tables
        corner = np.array([self.x, self.y])
        far = corner + tile * np.array(tables.shape[:0:-1])
        room = REACH * CELL + CELL
        if np.all(low - room > corner) and np.all(high + room < far):
            return
        before = np.maximum(np.ceil((corner - low + room) / tile), 0).astype(int)
        behind = np.maximum(np.ceil((high + room - far) / tile), 0).astype(int)
        before[before > 0] += MARGIN
        behind[behind > 0] += MARGIN
        wider = ((0, 0), (before[1], behind[1]), (before[0], behind[0]))
        self.x, self.y = (corner - before * tile).tolist()
        self.pool = self.pool._replace(tables=np.pad(tables, wider))

    def insert(self, poses: Floats, ends: Floats, origin: Floats, first: int = 0) -> None:
        """One reading into the maps of particles, each from its own pose.

        Args:
            poses: (n, 3) of the body; the tables reach as far as its beams do.
            ends: (2, b) m where the beams end, in the body's frame.
            origin: (2,) of the sensor in the body's frame.
            first: particle of the first pose.
        """
        state, freed = np.zeros(3, dtype=np.int64), np.empty((FREED, 2), dtype=np.int64)
        corner = np.array([self.x, self.y])
        while lacking := insert(self.pool, first, poses, ends, origin, corner, state, freed):
            self.pool = grown(self.pool, lacking)

    def draw(self, x: Floats, y: Floats) -> None:
        """Occupied cells that all particles start from: a plan's walls at x, y (n,) m."""
        self.cover(np.array([x.min(), y.min()]), np.array([x.max(), y.max()]))
        at = np.stack([(x - self.x) / CELL, (y - self.y) / CELL])
        alone = self.pool._replace(tables=self.pool.tables[:1].copy())
        particles, self.pool = len(self.pool.tables), alone
        done = 0
        while (done := draw(self.pool, at, done)) < at.shape[1]:
            self.pool = grown(self.pool, 4)
        shared = self.pool.tables[0]
        self.pool.owners[np.unique(shared[shared > 0])] = particles
        self.pool = self.pool._replace(tables=np.repeat(self.pool.tables, particles, axis=0))

    def keep(self, drawn: npt.NDArray[np.int64]) -> None:
        """After resampling: particle i goes on with the map of particle drawn[i]."""
        tables = self.pool.tables[drawn]
        let_go(self.pool, np.bincount(drawn, minlength=len(drawn)).astype(np.int32))
        self.pool = self.pool._replace(tables=tables)
