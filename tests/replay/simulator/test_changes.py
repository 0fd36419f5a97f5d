"""Walls gone, collapsed and displaced; clutter that cuts nothing off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, label

from formats.errors import UsageError
from replay.simulator import changes
from replay.simulator.coverage import Ground
from replay.simulator.site import Mask, Site

STEP = 0.05


def house() -> tuple[Mask, Mask]:
    """8 x 5 m, walls of 0.2 m; an inner wall across with a door, one upright. And its inside."""
    solid = np.zeros((120, 180), dtype=bool)
    solid[10:110, 10:170] = True
    solid[14:106, 14:166] = False
    solid[58:62, 14:80] = True
    solid[58:62, 98:166] = True  # a door of 0.9 m between
    solid[62:106, 120:124] = True
    solid[62:80, 120:124] = False  # another one
    inside = np.zeros_like(solid)
    inside[10:110, 10:170] = True
    return solid, inside


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_pieces_are_the_straight_inner_walls() -> None:
    solid, inside = house()
    found = changes.pieces(solid, inside, STEP)
    boxes = [(p.rows.start, p.cols.start, *p.mask.shape) for p in found]
    assert boxes == [(58, 14, 4, 66), (58, 98, 4, 68), (80, 120, 26, 4)]
    assert all(piece.mask.all() for piece in found)


def test_a_share_of_their_length_is_chosen() -> None:
    found = changes.pieces(*house(), STEP)
    assert changes.chosen(found, 0.0, rng()) == []
    assert len(changes.chosen(found, 1.0, rng())) == 3
    halves = [sum(max(p.mask.shape) for p in changes.chosen(found, 0.5, rng(s))) for s in range(40)]
    assert 0.3 * 160 < np.mean(halves) < 0.7 * 160
    mask = changes.mask_of(found[:1], house()[0].shape)
    assert mask.sum() == 4 * 66


def test_the_wall_along_a_line() -> None:
    solid, _ = house()
    geometry = Site.of(solid, STEP).geometry
    found = changes.wall_at(solid, (0.7, 3.0, 3.5, 3.1), geometry)
    rows, cols = np.nonzero(found)
    assert (rows.min(), rows.max()) == (58, 61)
    assert (cols.min(), cols.max()) == (14, 69)  # the outer wall, x < 0.7 m, stays
    with pytest.raises(UsageError, match=r"no wall lies within 0\.3 m of 2,2,3,2"):
        changes.wall_at(solid, (2.0, 2.0, 3.0, 2.0), geometry)
    with pytest.raises(UsageError, match="no wall lies"):
        changes.wall_at(solid, (900.0, 2.0, 901.0, 2.0), geometry)


def test_a_collapsed_wall_leaves_rubble_about_it() -> None:
    solid, inside = house()
    wall = changes.mask_of(changes.pieces(solid, inside, STEP)[:1], solid.shape)
    found = changes.collapsed(solid, wall, inside, STEP, rng())
    rubble = found & ~(solid & ~wall)
    assert 0.3 * wall.sum() < rubble.sum() < 0.9 * wall.sum()
    assert (found & wall).sum() < 0.7 * wall.sum()
    assert not (rubble & ~inside).any()
    far = binary_dilation(wall, iterations=round(1.2 / STEP))
    assert not (rubble & ~far).any()
    assert (found >= (solid & ~wall)).all()


def test_walls_stand_off_by_so_much() -> None:
    """Of a comb of upright lines each row shows how far it moved."""
    solid = np.zeros((400, 600), dtype=bool)
    solid[:, 100::100] = True
    solid |= np.roll(solid, 1, axis=1)
    found = changes.displaced(solid, 0.05, 0.3, rng(3))
    moves = []
    for row in found[20:-20]:
        cols = np.flatnonzero(row & ~np.roll(row, 1))
        moves += [(col - 100 * round(col / 100)) * 0.05 for col in cols if 40 < col < 560]
    # 0.3 m of displacement are 0.21 m along each axis
    assert np.std(moves) == pytest.approx(0.3 / 2**0.5, rel=0.25)
    assert (changes.displaced(solid, 0.05, 1e-6, rng(3)) == solid).all()


def test_speckle_turns_over_its_share() -> None:
    solid, _ = house()
    found = changes.speckled(np.tile(solid, (4, 4)), 0.02, rng())
    assert (found ^ np.tile(solid, (4, 4))).mean() == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_clutter_stands_inside_and_cuts_no_room_off(seed: int) -> None:
    solid, inside = house()
    found = changes.cluttered(solid, inside, 0.12, STEP, 0.2, rng(seed))
    new = found & ~solid
    assert new.any()
    assert not (new & ~inside).any()
    before = Ground(Site.of(solid, STEP), 0.2, inside)
    after = Ground(Site.of(found, STEP), 0.2, inside)
    assert before.parts.max() == 1
    # What robots can come to is one part but for the insides of hollow boxes.
    sizes = np.bincount(after.parts.ravel())[1:]
    assert np.sort(sizes)[:-1].sum() < 0.05 * sizes.max()
    halves = after.parts == after.largest
    assert halves[: 60 // 2].any()
    assert halves[60 // 2 :].any()


def test_clutter_covers_its_share_of_the_floor() -> None:
    solid, inside = house()
    found = changes.cluttered(solid, inside, 0.1, STEP, 0.2, rng())
    floor = inside & ~solid
    parts, _ = label(floor & ~found)
    walked = parts == np.argmax(np.bincount(parts[parts > 0]))
    assert (floor & ~walked).sum() / floor.sum() == pytest.approx(0.1, abs=0.025)
    assert label(found & ~solid)[1] > 3
    assert (found & ~solid).sum() < 0.8 * (floor & ~walked).sum()  # they are hollow


def test_the_same_seed_gives_the_same_house() -> None:
    solid, inside = house()
    one, two = (changes.cluttered(solid, inside, 0.1, STEP, 0.2, rng(5)) for _ in range(2))
    assert (one == two).all()
