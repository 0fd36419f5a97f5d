"""Maps of many particles in shared tiles: copied only where one of them writes (copy on write).

A cell holds the log-odds of occupied, how many beams ended in it and where on average, and how
likely a beam is to end at it: 1 where it is occupied, falling off as a normal around the mean of
what hit it. That last layer is kept up to date as the map grows, so that weighing a pose costs one
look-up a beam.
"""

from __future__ import annotations

from math import ceil, exp
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from formats.jit import njit

CELL = 0.05  # m
SIDE = 32  # cells of a tile along a side
BLOCK = 4  # cells of the coarse layer's cells along a side
REACH = 4  # cells that an occupied cell is felt around it
SIGMA = 0.08  # m of the normal
HIT, MISS = 85, -41  # 1/100 nat: P(occupied) 0.7 and 0.4
MOST, LEAST = 1000, -400  # log-odds that a cell may come to: what moved away is forgotten again
DRAWN = 152  # of a wall that the plan shows: P(occupied) 0.82
FULL = 255  # likelihood of 1
PART = 200  # of a cell: the unit of a hit's place in it
FREED = 4096  # cells that one reading frees, at most, of which what is around is put right
MARGIN = 16  # tiles around what is asked for when tables grow
Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int32]


class Pool(NamedTuple):
    """Tiles and who has them; tile 0 is the empty one, which nobody writes.

    Attributes:
        odds: (n, SIDE, SIDE) int16, 1/100 nat, above 0 is occupied.
        hits: (n, SIDE, SIDE) uint8, how many, 255 for more.
        place: (n, SIDE, SIDE, 2) int8 mean of the hits from the cell's centre, x and y, in PART.
        likely: (n, SIDE, SIDE) uint8, FULL at an occupied cell.
        coarse: (n, SIDE / BLOCK, SIDE / BLOCK) uint8, at least the most likely of its cells.
        owners: (n,) tables that show it.
        spare: (n + 1,) free tiles; the first number is how many.
        tables: (particles, rows, cols) which tile lies where.
    """

    odds: npt.NDArray[np.int16]
    hits: Bytes
    place: npt.NDArray[np.int8]
    likely: Bytes
    coarse: Bytes
    owners: Ints
    spare: Ints
    tables: Ints


class Maps:
    """One map for each of several particles.

    Args:
        particles: how many.

    Attributes:
        pool: of tiles; another one after `make_room`.
        x, y: m, the lower left corner of the tables.
    """

    def __init__(self, particles: int) -> None:
        self.pool = _empty(256, np.zeros((particles, 2, 2), dtype=np.int32))
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

    def _grow(self, least: int) -> None:
        """More tiles: at least so many spare ones."""
        old, count = self.pool, len(self.pool.owners)
        more = max(count, least)
        fresh = _empty(more, old.tables)
        pairs: Any = zip(old[:6], fresh[:6], strict=True)
        layers: list[Any] = [np.concatenate(pair) for pair in pairs]
        spare = np.zeros(count + more + 1, dtype=np.int32)
        kept = int(old.spare[0])
        spare[1 : more + 1] = np.arange(count + more - 1, count - 1, -1)
        spare[more + 1 : more + 1 + kept] = old.spare[1 : kept + 1]
        spare[0] = more + kept
        self.pool = Pool._make([*layers, spare, old.tables])

    def insert(self, particle: int, pose: Floats, ends: Floats, origin: Floats) -> None:
        """One reading into one particle's map.

        Args:
            particle: which.
            pose: (3,) of the body; the tables reach as far as its beams do.
            ends: (2, b) m where the beams end, in the body's frame.
            origin: (2,) of the sensor in the body's frame.
        """
        c, s = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[c, -s], [s, c]])
        corner = np.array([self.x, self.y])
        at = (turn @ ends + pose[:2, None] - corner[:, None]) / CELL
        start = (turn @ origin + pose[:2] - corner) / CELL
        while (lacking := _own(self.pool, particle, start, at)) > 0:
            self._grow(lacking)
        _trace(self.pool, particle, start, at)

    def draw(self, x: Floats, y: Floats) -> None:
        """Occupied cells that all particles start from: a plan's walls at x, y (n,) m."""
        self.cover(np.array([x.min(), y.min()]), np.array([x.max(), y.max()]))
        at = np.stack([(x - self.x) / CELL, (y - self.y) / CELL])
        alone = self.pool._replace(tables=self.pool.tables[:1].copy())
        particles, self.pool = len(self.pool.tables), alone
        while (lacking := _own(self.pool, 0, at[:, 0], at, ends_only=True)) > 0:
            self._grow(lacking)
        _draw(self.pool, at)
        shared = self.pool.tables[0]
        self.pool.owners[np.unique(shared[shared > 0])] = particles
        self.pool = self.pool._replace(tables=np.repeat(self.pool.tables, particles, axis=0))

    def keep(self, drawn: npt.NDArray[np.int64]) -> None:
        """After resampling: particle i goes on with the map of particle drawn[i]."""
        tables = self.pool.tables[drawn]
        _let_go(self.pool, np.bincount(drawn, minlength=len(drawn)).astype(np.int32))
        self.pool = self.pool._replace(tables=tables)


def _empty(count: int, tables: Ints) -> Pool:
    spare = np.zeros(count + 1, dtype=np.int32)
    spare[0] = count - 1
    spare[1:count] = np.arange(count - 1, 0, -1)
    shape = (count, SIDE, SIDE)
    return Pool(
        np.zeros(shape, dtype=np.int16),
        np.zeros(shape, dtype=np.uint8),
        np.zeros((*shape, 2), dtype=np.int8),
        np.zeros(shape, dtype=np.uint8),
        np.zeros((count, SIDE // BLOCK, SIDE // BLOCK), dtype=np.uint8),
        np.zeros(count, dtype=np.int32),
        spare,
        tables,
    )


@njit
def _let_go(pool: Pool, heirs: Ints) -> None:
    """Tiles have as many more owners as their particles have heirs; those of none are spare."""
    count, rows, cols = pool.tables.shape
    for p in range(count):
        for row in range(rows):
            for col in range(cols):
                tile = pool.tables[p, row, col]
                if tile > 0:
                    pool.owners[tile] += heirs[p] - 1
    for p in range(count):
        if heirs[p] > 0:
            continue
        for row in range(rows):
            for col in range(cols):
                tile = pool.tables[p, row, col]
                if tile > 0 and pool.owners[tile] == 0:
                    pool.owners[tile] = -1  # once only
                    pool.spare[0] += 1
                    pool.spare[pool.spare[0]] = tile
    for p in range(count):
        if heirs[p] > 0:
            continue
        for row in range(rows):
            for col in range(cols):
                tile = pool.tables[p, row, col]
                if tile > 0 and pool.owners[tile] < 0:
                    pool.owners[tile] = 0


@njit
def _mine(pool: Pool, particle: int, row: int, col: int) -> int:
    """Make the tile at a row and column of the table the particle's own; 1 where there is none."""
    tile = pool.tables[particle, row, col]
    if tile > 0 and pool.owners[tile] == 1:
        return 0
    if pool.spare[0] == 0:
        return 1
    new = pool.spare[pool.spare[0]]
    pool.spare[0] -= 1
    pool.odds[new] = pool.odds[tile]
    pool.hits[new] = pool.hits[tile]
    pool.place[new] = pool.place[tile]
    pool.likely[new] = pool.likely[tile]
    pool.coarse[new] = pool.coarse[tile]
    pool.owners[new] = 1
    if tile > 0:
        pool.owners[tile] -= 1
    pool.tables[particle, row, col] = new
    return 0


@njit
def _own(pool: Pool, particle: int, start: Floats, ends: Floats, ends_only: bool = False) -> int:
    """Make all tiles that a reading writes to the particle's own; how many more are needed.

    Args:
        pool: of tiles.
        particle: whose.
        start: (2,) in cells.
        ends: (2, b) in cells.
        ends_only: not the ways to them.
    """
    _, rows, cols = pool.tables.shape
    lacking = 0
    for k in range(ends.shape[1]):
        dx, dy = ends[0, k] - start[0], ends[1, k] - start[1]
        steps = 0 if ends_only else max(ceil(max(abs(dx), abs(dy))), 1)
        last_row, last_col = -1, -1
        for i in range(steps):
            share = i / steps
            row = int(start[1] + share * dy) // SIDE
            col = int(start[0] + share * dx) // SIDE
            if (row != last_row or col != last_col) and 0 <= row < rows and 0 <= col < cols:
                lacking += _mine(pool, particle, row, col)
                last_row, last_col = row, col
        # A cell may turn free anywhere on the way, and is felt around: so are the ends.
        for i in range(2):
            for j in range(2):
                row = (int(ends[1, k]) + (2 * i - 1) * REACH) // SIDE
                col = (int(ends[0, k]) + (2 * j - 1) * REACH) // SIDE
                if 0 <= row < rows and 0 <= col < cols:
                    lacking += _mine(pool, particle, row, col)
    return lacking


@njit
def _trace(pool: Pool, particle: int, start: Floats, ends: Floats) -> None:
    """Beams pass what is before their ends; the cells of the ends are hit."""
    freed = np.empty((FREED, 2), dtype=np.int64)
    count = 0
    for k in range(ends.shape[1]):
        dx, dy = ends[0, k] - start[0], ends[1, k] - start[1]
        steps = max(ceil(max(abs(dx), abs(dy))), 1)
        end_row, end_col = int(ends[1, k]), int(ends[0, k])
        last_row, last_col, tile = -1, -1, 0
        for i in range(steps):
            share = i / steps
            row, col = int(start[1] + share * dy), int(start[0] + share * dx)
            if row == end_row and col == end_col:
                continue
            if row // SIDE != last_row or col // SIDE != last_col:
                last_row, last_col = row // SIDE, col // SIDE
                tile = pool.tables[particle, last_row, last_col]
            before = pool.odds[tile, row % SIDE, col % SIDE]
            if before > LEAST:
                pool.odds[tile, row % SIDE, col % SIDE] = max(before + MISS, LEAST)
                if before > 0 >= before + MISS and count < FREED:
                    freed[count, 0], freed[count, 1] = row, col
                    count += 1
        _hit(pool, particle, ends[0, k], ends[1, k])
    for n in range(count):
        row, col = freed[n]
        tile = pool.tables[particle, row // SIDE, col // SIDE]
        if pool.odds[tile, row % SIDE, col % SIDE] <= 0:
            _fade(pool, particle, row, col)


@njit
def _hit(pool: Pool, particle: int, x: float, y: float) -> None:
    """A beam ends at x, y (in cells)."""
    row, col = int(y), int(x)
    tile = pool.tables[particle, row // SIDE, col // SIDE]
    r, c = row % SIDE, col % SIDE
    n = min(pool.hits[tile, r, c] + 1, 255)
    u, v = (x - col - 0.5) * PART, (y - row - 0.5) * PART
    pool.hits[tile, r, c] = n
    pool.place[tile, r, c, 0] += np.int8(round((u - pool.place[tile, r, c, 0]) / n))
    pool.place[tile, r, c, 1] += np.int8(round((v - pool.place[tile, r, c, 1]) / n))
    before = pool.odds[tile, r, c]
    pool.odds[tile, r, c] = min(before + HIT, MOST)
    if pool.odds[tile, r, c] > 0 and (before <= 0 or n & (n - 1) == 0):
        _feel(pool, particle, row, col)


@njit
def _feel(pool: Pool, particle: int, row: int, col: int) -> None:
    """An occupied cell makes those around it likely."""
    rows, cols = pool.tables.shape[1] * SIDE, pool.tables.shape[2] * SIDE
    home = pool.tables[particle, row // SIDE, col // SIDE]
    u = pool.place[home, row % SIDE, col % SIDE, 0] / PART
    v = pool.place[home, row % SIDE, col % SIDE, 1] / PART
    for a in range(max(row - REACH, 0), min(row + REACH + 1, rows)):
        for b in range(max(col - REACH, 0), min(col + REACH + 1, cols)):
            tile = pool.tables[particle, a // SIDE, b // SIDE]
            r, c = a % SIDE, b % SIDE
            value = _value((a - row - v) ** 2 + (b - col - u) ** 2)
            if tile > 0 and value > pool.likely[tile, r, c]:
                pool.likely[tile, r, c] = value
                r, c = r // BLOCK, c // BLOCK
                pool.coarse[tile, r, c] = max(pool.coarse[tile, r, c], value)


@njit
def _value(square: float) -> int:
    """Likelihood at a squared distance, in cells, from what is hit."""
    return int(FULL * exp(-0.5 * (CELL / SIGMA) ** 2 * square) + 0.5)


@njit
def _fade(pool: Pool, particle: int, row: int, col: int) -> None:
    """A cell was occupied and is no longer: only others are felt around it.

    Tiles that are not the particle's own are left as they are, until they are seen themselves. The
    coarse layer stays: it need only be no lower than the fine one.
    """
    rows, cols = pool.tables.shape[1] * SIDE, pool.tables.shape[2] * SIDE
    home = pool.tables[particle, row // SIDE, col // SIDE]
    pool.hits[home, row % SIDE, col % SIDE] = 0
    pool.place[home, row % SIDE, col % SIDE] = 0
    places, count = np.empty(((4 * REACH + 1) ** 2, 2)), 0
    for a in range(max(row - 2 * REACH, 0), min(row + 2 * REACH + 1, rows)):
        for b in range(max(col - 2 * REACH, 0), min(col + 2 * REACH + 1, cols)):
            tile = pool.tables[particle, a // SIDE, b // SIDE]
            if pool.odds[tile, a % SIDE, b % SIDE] > 0:
                places[count, 0] = a + pool.place[tile, a % SIDE, b % SIDE, 1] / PART
                places[count, 1] = b + pool.place[tile, a % SIDE, b % SIDE, 0] / PART
                count += 1
    for a in range(max(row - REACH, 0), min(row + REACH + 1, rows)):
        for b in range(max(col - REACH, 0), min(col + REACH + 1, cols)):
            tile = pool.tables[particle, a // SIDE, b // SIDE]
            if tile == 0 or pool.owners[tile] != 1 or pool.likely[tile, a % SIDE, b % SIDE] == 0:
                continue
            near_row, near_col = max(abs(a - row) - 0.5, 0.0), max(abs(b - col) - 0.5, 0.0)
            if pool.likely[tile, a % SIDE, b % SIDE] > _value(near_row**2 + near_col**2):
                continue  # another cell made it so
            nearest = 1e9
            for n in range(count):
                square = (a - places[n, 0]) ** 2 + (b - places[n, 1]) ** 2
                reached = max(abs(a - places[n, 0]), abs(b - places[n, 1])) < REACH + 0.5
                if reached and square < nearest:
                    nearest = square
            pool.likely[tile, a % SIDE, b % SIDE] = _value(nearest)


@njit
def _draw(pool: Pool, at: Floats) -> None:
    """Cells that a plan shows as wall."""
    for k in range(at.shape[1]):
        row, col = int(at[1, k]), int(at[0, k])
        tile = pool.tables[0, row // SIDE, col // SIDE]
        pool.odds[tile, row % SIDE, col % SIDE] = DRAWN
    for k in range(at.shape[1]):
        _feel(pool, 0, int(at[1, k]), int(at[0, k]))
