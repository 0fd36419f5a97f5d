"""Tiles that particles share: the same as a map of its own for each."""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest

from formats.frame import Floats
from replay.localise import tile_kernels
from replay.localise.pool import BLOCK, CELL, SIDE
from replay.localise.tile_kernels import FULL, HIT, LEAST, MISS, MOST, REACH
from replay.localise.tiles import Maps

ORIGIN = np.array([0.1, 0.0])


def fan(seed: int, beams: int = 40) -> Floats:
    """Ends (2, b) of beams up to 3 m long."""
    rng = np.random.default_rng(seed)
    angles, ranges = np.linspace(-2.0, 2.0, beams), rng.uniform(0.5, 3.0, beams)
    return ORIGIN[:, None] + ranges * np.stack([np.cos(angles), np.sin(angles)])


def put(maps: Maps, particle: int, pose: Floats, ends: Floats) -> None:
    maps.cover(pose[:2] - 4.0, pose[:2] + 4.0)
    maps.insert(pose[None], ends, ORIGIN, particle)


def whole(maps: Maps, particle: int, layer: str) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """A layer as one array, row 0 lowest, from the tables' corner."""
    tables = maps.pool.tables[particle]
    side = SIDE // BLOCK if layer == "coarse" else SIDE
    parts = getattr(maps.pool, layer)[tables].astype(np.int64)
    rows, cols = tables.shape
    return parts.transpose(0, 2, 1, 3).reshape(rows * side, cols * side)


def slow_odds(maps: Maps, drives: list[tuple[Floats, Floats]]) -> dict[tuple[int, int], int]:
    """Log-odds by cell, one beam and one cell after the other."""
    odds: dict[tuple[int, int], int] = {}
    for pose, ends in drives:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        turn, corner = np.array([[c, -s], [s, c]]), np.array([maps.x, maps.y])
        x0, y0 = (turn @ ORIGIN + pose[:2] - corner) / CELL
        for x1, y1 in ((turn @ ends + pose[:2, None] - corner[:, None]) / CELL).T:
            steps = max(ceil(max(abs(x1 - x0), abs(y1 - y0))), 1)
            end = int(y1), int(x1)
            for i in range(steps):
                cell = int(y0 + i * (y1 - y0) / steps), int(x0 + i * (x1 - x0) / steps)
                if cell != end:
                    odds[cell] = max(odds.get(cell, 0) + MISS, LEAST)
            odds[end] = min(odds.get(end, 0) + HIT, MOST)
    return odds


POSES = [np.array([0.2, -0.1, 0.3]), np.array([0.9, 0.2, 1.0]), np.array([-1.4, 0.5, -2.0])]


def test_beams_pass_and_hit_cells_as_they_do_one_by_one() -> None:
    maps, drives = Maps(1), []
    maps.cover(np.array([-6.0, -6.0]), np.array([6.0, 6.0]))
    for k in range(12):
        drives.append((POSES[k % 3] + 0.01 * k, fan(k)))
        put(maps, 0, *drives[-1])
    wanted = np.zeros_like(whole(maps, 0, "odds"))
    for cell, odds in slow_odds(maps, drives).items():
        wanted[cell] = odds
    assert np.array_equal(whole(maps, 0, "odds"), wanted)


def test_a_beam_is_likely_to_end_near_what_was_hit_and_nowhere_else() -> None:
    """One hit at each of three places; the nearest counts, by a normal around the hit itself."""
    maps = Maps(1)
    ends = np.array([[1.0, 1.23, 2.04], [0.02, 0.02, 1.51]])
    put(maps, 0, np.zeros(3), ends)
    found = whole(maps, 0, "likely")
    for row, col in np.argwhere(found > 0):
        x, y = maps.x + (col + 0.5) * CELL, maps.y + (row + 0.5) * CELL
        square = np.min((ends[0] - x) ** 2 + (ends[1] - y) ** 2)
        assert found[row, col] == pytest.approx(FULL * np.exp(-0.5 * square / 0.08**2), abs=6)
    assert found.max() > 0.9 * FULL
    hit = found[int((0.02 - maps.y) / CELL), int((1.0 - maps.x) / CELL)]
    assert hit > 0.8 * FULL


def test_what_moved_away_is_felt_no_longer() -> None:
    maps = Maps(1)
    wall = np.array([[2.0] * 9, np.linspace(-0.4, 0.4, 9)])
    pillar = np.array([[1.0], [0.0]])
    put(maps, 0, np.zeros(3), np.hstack([wall, pillar]))
    at = int((0.0 - maps.y) / CELL), int((1.0 - maps.x) / CELL)
    assert whole(maps, 0, "likely")[at] > 0
    for _ in range(4):  # beams pass where it stood
        put(maps, 0, np.zeros(3), wall)
    around = whole(maps, 0, "likely")[at[0] - REACH : at[0] + REACH, at[1] - REACH : at[1] + REACH]
    assert not around.any()
    assert whole(maps, 0, "likely").max() > 0.8 * FULL  # the wall is


def test_the_coarse_layer_is_never_below_the_fine_one() -> None:
    maps = Maps(1)
    for k in range(12):
        put(maps, 0, POSES[k % 3] + 0.01 * k, fan(k))
    fine = whole(maps, 0, "likely")
    rows, cols = fine.shape
    blocks = fine.reshape(rows // BLOCK, BLOCK, cols // BLOCK, BLOCK).max(axis=(1, 3))
    assert np.all(whole(maps, 0, "coarse") >= blocks)
    assert blocks.any()


def test_particles_that_share_tiles_do_not_see_each_other_s_readings() -> None:
    """Through resampling, three particles' maps stay those that each would have alone."""
    rng = np.random.default_rng(3)
    maps, pasts = Maps(3), [[], [], []]  # type: tuple[Maps, list[list[tuple[Floats, Floats]]]]
    for k in range(10):
        for p in range(3):
            pose = POSES[k % 3] + rng.normal(0.0, 0.2, 3)
            put(maps, p, pose, fan(k))
            pasts[p].append((pose, fan(k)))
        if k % 3 == 2:
            drawn = np.array([[1, 1, 2], [0, 0, 0], [2, 1, 2]][k // 3 % 3])
            maps.keep(drawn)
            pasts = [list(pasts[p]) for p in drawn]
    for p in range(3):
        alone = Maps(1)
        alone.cover(np.array([maps.x, maps.y]) + 1.0, np.array([maps.x, maps.y]) + 2.0)
        alone.x, alone.y = maps.x, maps.y
        alone.pool = alone.pool._replace(tables=np.zeros_like(maps.pool.tables[:1]))
        for pose, ends in pasts[p]:
            alone.insert(pose[None], ends, ORIGIN)
        for layer in ("odds", "hits"):
            assert np.array_equal(whole(maps, p, layer), whole(alone, 0, layer))


def test_tiles_are_counted_by_their_owners_and_given_back() -> None:
    maps = Maps(4)
    for k in range(6):
        for p in range(4):
            put(maps, p, POSES[(k + p) % 3], fan(k))
    maps.keep(np.array([2, 2, 2, 2]))
    assert maps.tiles == np.unique(maps.pool.tables[maps.pool.tables > 0]).size
    for p in range(4):
        put(maps, p, POSES[p % 3], fan(p))
    maps.keep(np.array([0, 3, 3, 1]))
    used, counts = np.unique(maps.pool.tables, return_counts=True)
    owners = dict(zip(used.tolist(), counts.tolist(), strict=True))
    owners.pop(0, None)
    assert maps.tiles == len(owners)
    assert all(maps.pool.owners[tile] == count for tile, count in owners.items())
    spare = maps.pool.spare[1 : maps.pool.spare[0] + 1].tolist()
    assert len(set(spare)) == len(spare)
    assert not set(spare) & set(owners)
    assert not maps.pool.likely[0].any()  # the empty tile stays empty


def test_a_plan_s_walls_are_shared_until_they_are_seen_not_to_be() -> None:
    maps = Maps(3)
    y = np.arange(-1.0, 1.0, CELL)
    maps.draw(np.full(y.size, 1.52), y)
    before = maps.tiles
    assert np.array_equal(whole(maps, 0, "likely"), whole(maps, 2, "likely"))
    assert whole(maps, 1, "likely").max() == FULL
    beyond = np.array([[2.5], [0.0]])
    for _ in range(5):
        put(maps, 1, np.zeros(3), beyond)
    at = [int((0.0 - maps.y) / CELL), int((1.52 - maps.x) / CELL)]
    assert whole(maps, 0, "odds")[*at] == tile_kernels.DRAWN
    assert whole(maps, 1, "odds")[*at] == tile_kernels.DRAWN + 5 * MISS
    assert before < maps.tiles < 3 * before + 20
