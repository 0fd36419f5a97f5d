"""Doors by the gaps in walls that they shut: what slides or folds, and leaves with a short arc.

Lengths are in widths of the opening: u along it from the wall's end, v to its left on the picture.
"""

from __future__ import annotations

from dataclasses import replace
from math import radians
from typing import NamedTuple

import cv2
import numpy as np

from replay.drawing.gaps import Doubles, Gap, Patch, find_gaps, patch
from replay.drawing.ink import Bits, grown, opened
from replay.drawing.shapes import Door, DoorKind
from replay.drawing.sliding import calm, closing_lines, folding, pocket, sliding

DRAWN = 0.85  # of a stroke is inked
FAIRLY = 0.7  # of a few places along it are
ARC = 0.6  # of a leaf's arc is inked
LENGTHS = np.arange(0.32, 1.1, 0.05)  # of leaves, by the opening's width
LEAVES = (0.8, 1.1)  # of these, what shuts an opening alone
HALVES = (0.3, 0.7)  # and what shuts it with another
SINGLE, DOUBLE = 1.5, 1.2  # door widths: the widest opening of one leaf, the narrowest of two
TURNS = np.radians(np.arange(20.0, 106.0, 5.0))  # from shut to open
WIDE = radians(60.0)  # turns of leaves that are drawn open
SWEPT = (0.15, 0.2)  # share of ink in what a leaf ajar sweeps, and one that is drawn open
ISLAND = 0.4  # door widths: smaller pieces of thick wall are none
THICK = 0.15  # door widths: walls to whose ends sliding leaves are drawn as solid bars


def gap_doors(
    walls: Bits, lines: Bits, doors: list[Door], windows: list[Door], door: float
) -> list[Door]:
    """Doors in gaps that no door has yet.

    Args:
        walls, lines: (H, W); lines is all ink.
        doors, windows: leaves that were found by their arcs.
        door: px, the usual width of a leaf.
    """
    out: list[Door] = []
    swept = np.zeros(walls.shape, dtype=np.uint8)  # open leaves beside a wall slide along none
    for one in (*doors, *windows):
        cv2.fillPoly(swept, [np.rint(one.sector()).astype(np.int32)], 1)
    still = lines & (1 - grown(swept, 2 * round(0.06 * door) + 1))
    kinds = lines & (1 - walls), still, walls
    for gap in find_gaps(walls, door):
        if not any(_shuts(one, gap) for one in (*doors, *windows, *out)):
            out += _read(gap, *(patch(kind, gap) for kind in kinds), door=door)
    return out


def barred_doors(
    walls: Bits, lines: Bits, doors: list[Door], windows: list[Door], door: float
) -> list[Door]:
    """Sliding leaves drawn as bars that were taken for thin walls: gaps in the thick walls alone.

    Args:
        walls, lines, doors, windows, door: as for `gap_doors`.
    """
    thick = opened(walls, max(3, round(THICK * door)))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(thick, connectivity=8)
    large = stats[:, 2:4].max(axis=1) > ISLAND * door  # where leaves overlap they are thick, too
    large[0] = False
    thick = large.astype(np.uint8)[labels]
    out: list[Door] = []
    free = lines & (1 - thick)
    for gap in find_gaps(thick, door):
        if any(_shuts(one, gap) for one in (*doors, *windows, *out)):
            continue
        seen = patch(free, gap)
        share = sliding(seen)
        if share > 0 and closing_lines(seen) < 2 and calm(seen):
            out.append(_across(gap, "sliding", share))
    return out


def _read(gap: Gap, seen: Patch, drawn: Patch, solid: Patch, *, door: float) -> list[Door]:
    """The doors that a gap shows, by its ink without and with the walls' own, and by the walls."""
    if closing_lines(seen) > 1:  # frame and panes of a window
        return []
    quiet = calm(drawn)
    folds = folding(seen) if quiet else 0.0
    swinging = [] if folds > 0 else _swing(gap, seen, door)
    if swinging:
        return swinging
    kinds: tuple[tuple[DoorKind, float], ...] = (
        ("folding", folds),
        ("sliding", sliding(seen) if gap.ends and quiet else 0.0),
        ("pocket", pocket(drawn, solid) if gap.ends and quiet else 0.0),
    )
    for kind, share in kinds:
        if share > 0:
            return [_across(gap, kind, share)]
    return []


def _across(gap: Gap, kind: DoorKind, share: float) -> Door:
    """A door that does not swing: from jamb to jamb."""
    return Door(gap.start, gap.stop, 0.0, kind, share, depth=max(gap.thick, 0.1 * gap.width))


def _shuts(door: Door, gap: Gap) -> bool:
    """Whether a door's shut leaf lies in a gap."""
    ux, uy = gap.stop[0] - gap.start[0], gap.stop[1] - gap.start[1]
    square = ux * ux + uy * uy
    x = (door.hinge[0] + door.end[0]) / 2 - gap.start[0]
    y = (door.hinge[1] + door.end[1]) / 2 - gap.start[1]
    u, v = (x * ux + y * uy) / square, (x * uy - y * ux) / square
    return -0.1 < u < 1.1 and abs(v) < 0.5 * gap.thick / gap.width + 0.35


def _swing(gap: Gap, seen: Patch, door: float) -> list[Door]:
    """A leaf that hangs on a jamb with its arc, or two that shut against each other."""
    wider = replace(seen, ink=grown(seen.ink, 3))  # hinges and turns are tried in steps
    hung = [_hung(wider, seen, jamb) for jamb in (0, 1)]
    if gap.width < SINGLE * door:
        single = [max(leaves, default=None) for leaves in _long(hung, LEAVES[0], 2.0)]
        best = max((leaf for leaf in single if leaf is not None), default=None)
        if best is not None:
            return [_leaf_door(gap, best, "single")]
    pairs = [
        (a, b)
        for a in _long(hung, *HALVES)[0]
        for b in _long(hung, *HALVES)[1]
        if abs(a.length + b.length - 1) < 0.1 and a.side == b.side
    ]
    if pairs and gap.width > DOUBLE * door:
        both = max(pairs, key=lambda pair: (pair[0].score + pair[1].score, pair))
        return [_leaf_door(gap, one, "double") for one in both]
    return []


class _Hung(NamedTuple):
    """A leaf on a jamb: how much is drawn, its length, hinge (u, v), jamb, side and turn."""

    score: float
    length: float
    u: float
    v: float
    jamb: int
    side: int
    turn: float


def _long(hung: list[list[_Hung]], least: float, most: float) -> list[list[_Hung]]:
    return [[leaf for leaf in leaves if least <= leaf.length <= most] for leaves in hung]


def _leaf_door(gap: Gap, leaf: _Hung, kind: DoorKind) -> Door:
    away = 1.0 if leaf.jamb == 0 else -1.0
    hinge, end = gap.at(leaf.u, leaf.v), gap.at(leaf.u + away * leaf.length, leaf.v)
    # v counts to the left on the picture, where turns are negative
    return Door(hinge, end, -leaf.turn * leaf.side * away, kind, min(1.0, leaf.score / 2))


def _hung(seen: Patch, floor: Patch, jamb: int) -> list[_Hung]:
    """Leaves with their arcs that hang on one jamb; the floor is what they sweep."""
    half = 0.5 * seen.thick
    away = 1.0 if jamb == 0 else -1.0
    out: list[_Hung] = []
    for side in (-1, 1):
        hinges = np.array([(u, v * side) for u in (-0.04, 0.02, 0.08) for v in (0.0, half)])
        place, length, turn = (
            a.ravel() for a in np.meshgrid(np.arange(len(hinges)), LENGTHS, TURNS, indexing="ij")
        )
        start = np.column_stack((jamb + away * hinges[place, 0], hinges[place, 1]))
        unit = np.column_stack((away * np.cos(turn), side * np.sin(turn)))
        for samples, drawn in ((8, FAIRLY), (48, DRAWN)):  # few look like a leaf at all
            near, far = (
                start + (0.12 * length)[:, None] * unit,
                start + (0.96 * length)[:, None] * unit,
            )
            leaf = seen.along(near, far, samples)
            good = np.flatnonzero(leaf >= drawn)
            leaf, start, unit = leaf[good], start[good], unit[good]
            length, turn = length[good], turn[good]
        if len(leaf) == 0:
            continue
        beyond = seen.along(
            start + (1.08 * length)[:, None] * unit, start + (1.22 * length)[:, None] * unit
        )
        arc = _arcs(seen, start, length, turn, away, side)
        fill = _swept(floor, start, length, turn, away, side)
        bare = fill < np.where(turn < WIDE, *SWEPT)
        for k in np.flatnonzero((beyond < 0.5) & (arc >= ARC) & bare):
            u, v = start[k].tolist()
            score = float(leaf[k] + arc[k])
            out.append(_Hung(score, float(length[k]), u, v, jamb, side, float(turn[k])))
    return out


def _arcs(
    seen: Patch, start: Doubles, length: Doubles, turn: Doubles, away: float, side: int
) -> Doubles:
    """Share of the arcs from shut to open that is inked, a pixel aside allowed."""
    t = np.linspace(0.08, 0.94, 24)[None, :] * turn[:, None]
    best = np.zeros(len(turn))
    for wide in (-0.02, 0.0, 0.02):
        reach = (length + wide)[:, None]
        u = start[:, :1] + away * reach * np.cos(t)
        v = start[:, 1:] + side * reach * np.sin(t)
        best = np.maximum(best, seen.values(u, v).mean(axis=1))
    return best


def _swept(
    seen: Patch, start: Doubles, length: Doubles, turn: Doubles, away: float, side: int
) -> Doubles:
    """Share of ink within the sectors, clear of leaf, arc and wall: floor, not fixtures."""
    t, r = (a.ravel() for a in np.meshgrid(np.linspace(0.15, 0.85, 12), np.linspace(0.2, 0.85, 16)))
    angle, reach = t[None, :] * turn[:, None], r[None, :] * length[:, None]
    u = start[:, :1] + away * reach * np.cos(angle)
    v = start[:, 1:] + side * reach * np.sin(angle)
    return np.asarray(seen.values(u, v).mean(axis=1))
