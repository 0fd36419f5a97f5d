"""The best pose of a window for a reading, by branch and bound over blocks of cells.

Olson, "Real-Time Correlative Scan Matching" (ICRA 2009), with three layers in place of two: the
likelihood, its greatest in blocks, and its greatest in blocks of those.
"""

from __future__ import annotations

from math import cos, floor, sin

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from formats.jit import njit
from replay.localise.pool import BLOCK, CELL, SIDE, Bytes, Ints, Pool
from replay.localise.tile_kernels import FULL

TRUST = 60.0  # nats that a reading which fits perfectly says more than one that fits nowhere
WIDE = 16  # cells along a side of the blocks that a search bounds first
SHIFT = 2  # BLOCK is 1 << SHIFT


@njit
def likelihood(likely: Bytes, tables: Ints, particle: int, row: int, col: int) -> int:
    """Of a beam that ends in a cell, 0 to FULL."""
    if row < 0 or col < 0:
        return 0
    r, c = row // SIDE, col // SIDE
    if r >= tables.shape[1] or c >= tables.shape[2]:
        return 0
    return likely[tables[particle, r, c], row % SIDE, col % SIDE]


@njit
def _dense(
    coarse: Bytes, tables: Ints, particle: int, row: int, col: int, rows: int, cols: int
) -> Bytes:
    """The coarse layer from one of its cells on, 0 where there is no map."""
    side = SIDE // BLOCK
    found = np.zeros((rows, cols), dtype=np.uint8)
    most_rows, most_cols = tables.shape[1] * side, tables.shape[2] * side
    for a in range(max(-row, 0), min(rows, most_rows - row)):
        for b in range(max(-col, 0), min(cols, most_cols - col)):
            tile = tables[particle, (row + a) // side, (col + b) // side]
            found[a, b] = coarse[tile, (row + a) % side, (col + b) % side]
    return found


@njit
def _widest(layer: Bytes, reach: int) -> Bytes:
    """The greatest of each cell and of those up to `reach` further up and right."""
    rows, cols = layer.shape[0] - reach, layer.shape[1] - reach
    along, found = np.empty((layer.shape[0], cols), np.uint8), np.empty((rows, cols), np.uint8)
    for a in range(layer.shape[0]):
        for b in range(cols):
            along[a, b] = layer[a, b : b + reach + 1].max()
    for a in range(rows):
        for b in range(cols):
            found[a, b] = along[a : a + reach + 1, b].max()
    return found


@njit
def _total(
    layer: Bytes, rows: npt.NDArray[np.int64], cols: npt.NDArray[np.int64], row: int, col: int
) -> int:
    """Sum of a layer of blocks over beams that end in these cells, moved by a row and a column."""
    total = 0
    for k in range(len(rows)):
        total += layer[(rows[k] + row) >> SHIFT, (cols[k] + col) >> SHIFT]
    return total


@njit
def _nearest(low: float, high: float) -> float:
    """The least of the absolute values from low to high."""
    return max(low, -high, 0.0)


@njit
def _away(row: int, col: int, side: int, spread: Floats) -> float:
    """Half the squared deviations of the nearest cell of a block from the guess."""
    dy = _nearest(row * CELL, (row + side - 1) * CELL) / spread[1]
    dx = _nearest(col * CELL, (col + side - 1) * CELL) / spread[0]
    return 0.5 * (dx * dx + dy * dy)


@njit
def search(
    pool: Pool,
    particle: int,
    pose: Floats,
    ends: Floats,
    corner: Floats,
    spread: Floats,
    reach: int,
    turns: Floats,
) -> None:
    """Put the best pose of the window into `pose`, which is the guess.

    Blocks of WIDE x WIDE cells are bounded first, then, best first, the smaller ones in them, then
    each cell of those.
    """
    beams, wides = ends.shape[1], 2 * reach // WIDE + 1
    rows = np.empty((turns.size, beams), dtype=np.int64)
    cols = np.empty((turns.size, beams), dtype=np.int64)
    likely, tables = pool.likely, pool.tables
    unit = TRUST / (FULL * max(beams, 1))
    x, y, yaw = (pose[0] - corner[0]) / CELL, (pose[1] - corner[1]) / CELL, pose[2]
    for t in range(turns.size):
        c, s = cos(yaw + turns[t]) / CELL, sin(yaw + turns[t]) / CELL
        for k in range(beams):
            cols[t, k] = floor(x + c * ends[0, k] - s * ends[1, k])
            rows[t, k] = floor(y + s * ends[0, k] + c * ends[1, k])
    # The coarse layer of all that can be reached; rows and columns count from its corner on.
    row, col = (rows.min() - reach) >> SHIFT, (cols.min() - reach) >> SHIFT
    tall = ((rows.max() + reach + WIDE) >> SHIFT) - row + 1 + WIDE // BLOCK
    broad = ((cols.max() + reach + WIDE) >> SHIFT) - col + 1 + WIDE // BLOCK
    dense = _dense(pool.coarse, tables, particle, row, col, tall, broad)
    near, wide = _widest(dense, 1), _widest(dense, WIDE // BLOCK)
    below, left = rows - row * BLOCK, cols - col * BLOCK
    bounds = np.empty(turns.size * wides * wides)
    for t in range(turns.size):
        turned = 0.5 * (turns[t] / spread[2]) ** 2
        for i in range(wides):
            for j in range(wides):
                row, col = i * WIDE - reach, j * WIDE - reach
                total = _total(wide, below[t], left[t], row, col)
                away = _away(row, col, WIDE, spread)
                bounds[(t * wides + i) * wides + j] = unit * total - away - turned
    best, winner = -1e300, (0, 0, 0)
    for n in np.argsort(-bounds, kind="mergesort"):
        if bounds[n] <= best:
            break
        t, i, j = n // (wides * wides), n // wides % wides, n % wides
        turned = 0.5 * (turns[t] / spread[2]) ** 2
        for part in range((WIDE // BLOCK) ** 2):
            row = i * WIDE - reach + part // (WIDE // BLOCK) * BLOCK
            col = j * WIDE - reach + part % (WIDE // BLOCK) * BLOCK
            if row > reach or col > reach:
                continue
            total = _total(near, below[t], left[t], row, col)
            if unit * total - _away(row, col, BLOCK, spread) - turned <= best:
                continue
            for a in range(row, min(row + BLOCK, reach + 1)):
                for b in range(col, min(col + BLOCK, reach + 1)):
                    total = 0
                    for k in range(beams):
                        total += likelihood(
                            likely, tables, particle, rows[t, k] + a, cols[t, k] + b
                        )
                    dx, dy = b * CELL / spread[0], a * CELL / spread[1]
                    worth = unit * total - 0.5 * (dx * dx + dy * dy) - turned
                    if worth > best:
                        best, winner = worth, (t, a, b)
    pose[0] += winner[2] * CELL
    pose[1] += winner[1] * CELL
    pose[2] += turns[winner[0]]
