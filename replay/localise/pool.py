"""Tiles of the maps of many particles, and who has which (copy on write).

A cell holds the log-odds of occupied, how many beams ended in it and where on average, and how
likely a beam is to end at it: 1 where it is occupied, falling off as a normal around the mean of
what hit it. That last layer is kept up to date as the map grows, so that weighing a pose costs one
look-up a beam.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.jit import njit

CELL = 0.05  # m
SIDE = 32  # cells of a tile along a side
BLOCK = 4  # cells of the coarse layer's cells along a side
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


def empty(count: int, tables: Ints) -> Pool:
    """So many tiles, all of them spare but the empty one."""
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


def grown(old: Pool, least: int) -> Pool:
    """More tiles: at least so many spare ones."""
    count = len(old.owners)
    more = max(count, least)
    fresh = empty(more, old.tables)
    pairs: Any = zip(old[:6], fresh[:6], strict=True)
    layers: list[Any] = [np.concatenate(pair) for pair in pairs]
    spare = np.zeros(count + more + 1, dtype=np.int32)
    kept = int(old.spare[0])
    spare[1 : more + 1] = np.arange(count + more - 1, count - 1, -1)
    spare[more + 1 : more + 1 + kept] = old.spare[1 : kept + 1]
    spare[0] = more + kept
    return Pool._make([*layers, spare, old.tables])


@njit
def let_go(pool: Pool, heirs: Ints) -> None:
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
def mine(pool: Pool, particle: int, row: int, col: int) -> int:
    """The tile at a row and column of a particle's table, made its own; one must be spare."""
    tile = pool.tables[particle, row, col]
    if tile > 0 and pool.owners[tile] == 1:
        return tile
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
    return new
