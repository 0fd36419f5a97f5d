"""The compiled part of the maps of particles: readings and walls drawn into tiles."""

from __future__ import annotations

from math import ceil, cos, exp, sin

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from formats.jit import njit
from replay.localise.pool import BLOCK, CELL, SIDE, Pool, mine

REACH = 4  # cells that an occupied cell is felt around it
SIGMA = 0.08  # m of the normal
FALL = -0.5 * (CELL / SIGMA) ** 2  # exponent of the normal a squared cell
HIT, MISS = 85, -41  # 1/100 nat: P(occupied) 0.7 and 0.4
MOST, LEAST = 1000, -400  # log-odds that a cell may come to: what moved away is forgotten again
DRAWN = 152  # of a wall that the plan shows: P(occupied) 0.82
FULL = 255  # likelihood of 1
PART = 200  # of a cell: the unit of a hit's place in it
FREED = 4096  # cells that one reading frees, at most, of which what is around is put right
POINT = 32  # bits behind the point of a place along a beam
ONE = float(1 << POINT)
SHIFT, MASK = 5, SIDE - 1  # a cell's tile and its place in it: SIDE is a power of two
Counts = npt.NDArray[np.int64]


@njit
def insert(
    pool: Pool,
    first: int,
    poses: Floats,
    ends: Floats,
    origin: Floats,
    corner: Floats,
    state: Counts,
    freed: Counts,
) -> int:
    """A reading into the maps of particles, from where `state` is; the tiles that it lacks.

    Beams pass what is before their ends; the cells of the ends are hit. Before a beam is begun,
    there must be tiles for all that it may write to: where there are not, it is told how many, and
    the caller goes on with the same state when there are.

    Args:
        pool: of tiles.
        first: particle of the first pose.
        poses: (n, 3) of the body.
        ends: (2, b) m where the beams end, in the body's frame.
        origin: (2,) of the sensor in the body's frame.
        corner: (2,) m of the tables.
        state: (3,) pose, beam, and cells freed by this pose's beams; zeros at the beginning.
        freed: (FREED, 2) room for them.
    """
    while state[0] < poses.shape[0]:
        particle, pose = first + state[0], poses[state[0]]
        c, s = cos(pose[2]) / CELL, sin(pose[2]) / CELL
        x0, y0 = (pose[0] - corner[0]) / CELL, (pose[1] - corner[1]) / CELL
        from_x = x0 + c * origin[0] - s * origin[1]
        from_y = y0 + s * origin[0] + c * origin[1]
        while state[1] < ends.shape[1]:
            u, v = ends[0, state[1]], ends[1, state[1]]
            x, y = x0 + c * u - s * v, y0 + s * u + c * v
            steps = max(ceil(max(abs(x - from_x), abs(y - from_y))), 1)
            needed = 2 * (steps // SIDE + 2) + 4
            if pool.spare[0] < needed:
                return needed
            state[2] = _beam(pool, particle, from_x, from_y, x, y, steps, freed, state[2])
            state[1] += 1
        for n in range(state[2]):
            row, col = freed[n]
            tile = pool.tables[particle, row >> SHIFT, col >> SHIFT]
            if pool.odds[tile, row & MASK, col & MASK] <= 0:
                _fade(pool, particle, row, col)
        state[0] += 1
        state[1] = state[2] = 0
    return 0


@njit
def _beam(
    pool: Pool,
    particle: int,
    from_x: float,
    from_y: float,
    x: float,
    y: float,
    steps: int,
    freed: Counts,
    count: int,
) -> int:
    """One beam, in cells; how many cells it and those before it freed."""
    end_row, end_col = int(y), int(x)
    row_at, col_at = int(from_y * ONE), int(from_x * ONE)
    down, aside = int((y - from_y) / steps * ONE), int((x - from_x) / steps * ONE)
    last_row, last_col = -1, -1
    odds = pool.odds[0]
    for _ in range(steps):
        row, col = row_at >> POINT, col_at >> POINT
        row_at += down
        col_at += aside
        if row >> SHIFT != last_row or col >> SHIFT != last_col:
            last_row, last_col = row >> SHIFT, col >> SHIFT
            tile = pool.tables[particle, last_row, last_col]
            if tile == 0 or pool.owners[tile] != 1:
                tile = mine(pool, particle, last_row, last_col)
            odds = pool.odds[tile]
        r, c = np.uint64(row & MASK), np.uint64(col & MASK)
        before = odds[r, c]
        if before > LEAST and (row != end_row or col != end_col):
            odds[r, c] = max(before + MISS, LEAST)
            if 0 < before <= -MISS and count < FREED:
                freed[count, 0], freed[count, 1] = row, col
                count += 1
    reserve(pool, particle, end_row, end_col)
    _hit(pool, particle, x, y)
    return count


@njit
def reserve(pool: Pool, particle: int, row: int, col: int) -> None:
    """Make the tiles around a cell the particle's own, as far as the cell is felt."""
    tile = pool.tables[particle, row >> SHIFT, col >> SHIFT]
    inside = REACH <= row & MASK < SIDE - REACH and REACH <= col & MASK < SIDE - REACH
    if inside and tile > 0 and pool.owners[tile] == 1:
        return
    _, rows, cols = pool.tables.shape
    for a in range(max(row - REACH, 0) >> SHIFT, min((row + REACH) >> SHIFT, rows - 1) + 1):
        for b in range(max(col - REACH, 0) >> SHIFT, min((col + REACH) >> SHIFT, cols - 1) + 1):
            mine(pool, particle, a, b)


@njit
def _hit(pool: Pool, particle: int, x: float, y: float) -> None:
    """A beam ends at x, y (in cells)."""
    row, col = int(y), int(x)
    tile = pool.tables[particle, row >> SHIFT, col >> SHIFT]
    r, c = row & MASK, col & MASK
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
    home = pool.tables[particle, row >> SHIFT, col >> SHIFT]
    u = pool.place[home, row & MASK, col & MASK, 0] / PART
    v = pool.place[home, row & MASK, col & MASK, 1] / PART
    beside = np.empty(2 * REACH + 1)  # the normal's part along x; it is the product of two
    for k in range(2 * REACH + 1):
        beside[k] = FULL * exp(FALL * (k - REACH - u) ** 2)
    for a in range(max(row - REACH, 0), min(row + REACH + 1, rows)):
        along = exp(FALL * (a - row - v) ** 2)
        for b in range(max(col - REACH, 0), min(col + REACH + 1, cols)):
            tile = pool.tables[particle, a >> SHIFT, b >> SHIFT]
            r, c = a & MASK, b & MASK
            value = int(along * beside[b - col + REACH] + 0.5)
            if tile > 0 and value > pool.likely[tile, r, c]:
                pool.likely[tile, r, c] = value
                r, c = r // BLOCK, c // BLOCK
                pool.coarse[tile, r, c] = max(pool.coarse[tile, r, c], value)


@njit
def _value(square: float) -> int:
    """Likelihood at a squared distance, in cells, from what is hit."""
    return int(FULL * exp(FALL * square) + 0.5)


@njit
def _fade(pool: Pool, particle: int, row: int, col: int) -> None:
    """A cell was occupied and is no longer: only others are felt around it.

    Tiles that are not the particle's own are left as they are, until they are seen themselves. The
    coarse layer stays: it need only be no lower than the fine one.
    """
    rows, cols = pool.tables.shape[1] * SIDE, pool.tables.shape[2] * SIDE
    home = pool.tables[particle, row >> SHIFT, col >> SHIFT]
    pool.hits[home, row & MASK, col & MASK] = 0
    pool.place[home, row & MASK, col & MASK] = 0
    most = np.empty(REACH + 1)  # part of what the cell can have made of those so far away
    for k in range(REACH + 1):
        most[k] = exp(FALL * max(k - 0.5, 0.0) ** 2)
    stale, lacking = np.empty(((2 * REACH + 1) ** 2, 2), dtype=np.int64), 0
    for a in range(max(row - REACH, 0), min(row + REACH + 1, rows)):
        for b in range(max(col - REACH, 0), min(col + REACH + 1, cols)):
            tile = pool.tables[particle, a >> SHIFT, b >> SHIFT]
            likely = pool.likely[tile, a & MASK, b & MASK]
            if tile == 0 or pool.owners[tile] != 1 or likely == 0:
                continue
            if likely <= int(FULL * most[abs(a - row)] * most[abs(b - col)] + 0.5):
                stale[lacking, 0], stale[lacking, 1] = a, b  # else another cell made it so
                lacking += 1
    if lacking == 0:
        return
    places, count = np.empty(((4 * REACH + 1) ** 2, 2)), 0
    for a in range(max(row - 2 * REACH, 0), min(row + 2 * REACH + 1, rows)):
        for b in range(max(col - 2 * REACH, 0), min(col + 2 * REACH + 1, cols)):
            tile = pool.tables[particle, a >> SHIFT, b >> SHIFT]
            if pool.odds[tile, a & MASK, b & MASK] > 0:
                places[count, 0] = a + pool.place[tile, a & MASK, b & MASK, 1] / PART
                places[count, 1] = b + pool.place[tile, a & MASK, b & MASK, 0] / PART
                count += 1
    for k in range(lacking):
        a, b = stale[k]
        nearest = 1e9
        for n in range(count):
            down, aside = abs(a - places[n, 0]), abs(b - places[n, 1])
            if max(down, aside) < REACH + 0.5:
                nearest = min(nearest, down * down + aside * aside)
        tile = pool.tables[particle, a >> SHIFT, b >> SHIFT]
        pool.likely[tile, a & MASK, b & MASK] = _value(nearest)


@njit
def draw(pool: Pool, at: Floats, start: int) -> int:
    """Cells (2, n) that a plan shows as wall, into the first map; how many of them have tiles.

    What is felt around them is put right when all of them have.
    """
    for k in range(start, at.shape[1]):
        if pool.spare[0] < 4:
            return k
        row, col = int(at[1, k]), int(at[0, k])
        reserve(pool, 0, row, col)
        pool.odds[pool.tables[0, row >> SHIFT, col >> SHIFT], row & MASK, col & MASK] = DRAWN
    for k in range(at.shape[1]):
        _feel(pool, 0, int(at[1, k]), int(at[0, k]))
    return at.shape[1]
