"""Swing doors: an arc, and the leaf that joins its centre with one of its ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, hypot, radians, sin

import numpy as np
import numpy.typing as npt

from replay.drawing.arcs import Arc
from replay.drawing.ink import Bits, Floats, distance, grown
from replay.drawing.shapes import Door

LEAF = 0.75  # of the leaf's length is inked
FILLED = 0.7  # of the arc is inked
EXTENT = (radians(55), radians(125))
ALIKE = 1.25  # ratio within which widths of leaves are one usual width
SIZES = (0.5, 1.7)  # times the usual width
ON_WALL = 0.3  # of a leaf's width: so near to a wall hinge and end lie
CLEAR = 0.9  # of arc and leaf is inked: then the hinge may be farther from the wall,
OFF_WALL = 0.55  # of a leaf's width, as a pivot's or one in a frame is,
BUILT = 0.5  # of an arc runs along a wall: no leaf's
BESIDE = 0.09  # of its radius: there the wall is looked for
JAMB = 0.15  # of its width: where the shut leaf's end is so near to a wall


def along(ink: Bits, x: float, y: float, angle: float, start: float, stop: float) -> float:
    """Share of a straight stretch that is inked: from `start` to `stop` px away from x, y."""
    steps = np.arange(start, stop, 1.0)
    if len(steps) == 0:
        return 0.0
    cols = np.rint(x + steps * cos(angle)).astype(np.int64)
    rows = np.rint(y + steps * sin(angle)).astype(np.int64)
    inside = (cols >= 0) & (cols < ink.shape[1]) & (rows >= 0) & (rows < ink.shape[0])
    return float(ink[rows[inside], cols[inside]].sum()) / len(steps)


def leaf(ink: Bits, arc: Arc, angle: float) -> float:
    """How much of a leaf is drawn from an arc's centre to its end at `angle`.

    A leaf has a thickness and a hinge beside the centre: lines a little aside and a little turned
    are tried.
    """
    best = 0.0
    for side in np.linspace(-0.09, 0.09, 7) * arc.radius:
        x, y = arc.x - side * sin(angle), arc.y + side * cos(angle)
        for turn in (-0.06, -0.03, 0.0, 0.03, 0.06):
            best = max(best, along(ink, x, y, angle + turn, 0.15 * arc.radius, 0.95 * arc.radius))
    return best


@dataclass(frozen=True, slots=True)
class Leaf:
    """An arc that may be a door's: how much of a leaf is drawn to its start and to its end."""

    arc: Arc
    drawn: tuple[float, float]


def leaves_of(ink: Bits, arcs: list[Arc]) -> list[Leaf]:
    """The arcs that have a leaf at one end at least."""
    wide = grown(ink, 3)
    out = []
    for arc in arcs:
        if arc.filled < FILLED or not EXTENT[0] <= arc.extent <= EXTENT[1]:
            continue
        drawn = leaf(wide, arc, arc.start), leaf(wide, arc, arc.start + arc.extent)
        if max(drawn) >= LEAF:
            out.append(Leaf(arc, drawn))
    return out


def usual_width(leaves: list[Leaf]) -> float:
    """The radius in px that most leaves share, large ones weighing more; 0 without any.

    Letters and hatchings make many small arcs; the square of the radius outweighs them.
    """
    radii = np.array([leaf.arc.radius for leaf in leaves])
    if len(radii) == 0:
        return 0.0

    def alike(radius: float) -> npt.NDArray[np.float64]:
        return np.asarray(radii[(radii > radius / ALIKE) & (radii < radius * ALIKE)])

    best = max(radii, key=lambda radius: float((alike(radius) ** 2).sum()))
    return float(np.median(alike(best)))


def choose_doors(
    leaves: list[Leaf], walls: Bits, lines: Bits, door: float
) -> tuple[list[Door], list[Door]]:
    """Doors and windows' casements among the leaves: both ends of a shut leaf lie on walls.

    Args:
        leaves: arcs with a leaf.
        walls: (H, W); without any, as where a symbol stands alone, nothing is asked of them.
        lines: (H, W), all ink.
        door: px, the usual width of a leaf.
    """
    far = distance(1 - walls) if walls.any() else np.zeros(walls.shape, dtype=np.float32)
    chosen = []
    for one in leaves:
        arc = one.arc
        if not door * SIZES[0] <= arc.radius <= door * SIZES[1]:
            continue
        if _on_walls(walls, arc) > BUILT:
            continue
        ends = [_at(arc, arc.start), _at(arc, arc.start + arc.extent)]
        clear = arc.filled > CLEAR and max(one.drawn) > CLEAR
        clear &= min(_near(far, *end) for end in ends) < JAMB * arc.radius
        if _near(far, arc.x, arc.y) > (OFF_WALL if clear else ON_WALL) * arc.radius:
            continue
        on_wall = [_near(far, *end) < ON_WALL * arc.radius for end in ends]
        rank = [on_wall[k] + one.drawn[1 - k] - 0.5 * one.drawn[k] for k in (0, 1)]
        shut = int(rank[1] > rank[0])
        chosen.append(_door(arc, shut, one.drawn))
    pairs = _pairs(chosen)
    doors: list[Door] = []
    windows: list[Door] = []
    for k, found in enumerate(chosen):
        end_on_wall = _near(far, *found.end) < ON_WALL * found.width
        if k in pairs:
            glazed = _closing_lines(lines, found, door) >= 2
            (windows if glazed else doors).append(replace(found, kind="double"))
        elif end_on_wall:
            doors.append(found)
    return doors, windows


def _at(arc: Arc, angle: float) -> tuple[float, float]:
    """The point of an arc's circle at an angle."""
    return arc.x + arc.radius * cos(angle), arc.y + arc.radius * sin(angle)


def _on_walls(walls: Bits, arc: Arc) -> float:
    """Share of an arc along which a wall lies, on the side where there is more.

    It is looked at beside the arc, since a bold leaf's arc may be taken for a wall itself.
    """
    turns = arc.start + np.linspace(0.1, 0.9, 40) * arc.extent
    best = 0.0
    for radius in (arc.radius * (1 - BESIDE), arc.radius * (1 + BESIDE)):
        cols = np.rint(arc.x + radius * np.cos(turns)).astype(np.int64)
        rows = np.rint(arc.y + radius * np.sin(turns)).astype(np.int64)
        inside = (cols >= 0) & (cols < walls.shape[1]) & (rows >= 0) & (rows < walls.shape[0])
        best = max(best, float(walls[rows[inside], cols[inside]].sum()) / len(turns))
    return best


def _near(far: Floats, x: float, y: float) -> float:
    """Distance to the nearest wall; endless outside the picture."""
    col, row = round(x), round(y)
    inside = 0 <= row < far.shape[0] and 0 <= col < far.shape[1]
    return float(far[row, col]) if inside else float("inf")


def _pairs(doors: list[Door]) -> set[int]:
    """Leaves that shut against each other: their ends meet, they swing to one side."""
    out: set[int] = set()
    for i, a in enumerate(doors):
        for j in range(i):
            b = doors[j]
            apart = hypot(a.end[0] - b.end[0], a.end[1] - b.end[1])
            span = hypot(a.hinge[0] - b.hinge[0], a.hinge[1] - b.hinge[1])
            wide = a.width + b.width
            if apart < 0.125 * wide and span > 0.8 * wide and a.swing * b.swing < 0:
                out |= {i, j}
    return out


def _closing_lines(lines: Bits, door: Door, usual: float) -> int:
    """How many lines close the opening from jamb to jamb, as a window's frame and panes do."""
    x, y = door.hinge
    angle = atan2(door.end[1] - y, door.end[0] - x)
    count, before = 0, False
    for side in np.arange(-0.6 * usual, 0.6 * usual, 1.0):
        inked = along(
            lines,
            x - side * sin(angle),
            y + side * cos(angle),
            angle,
            0.1 * usual,
            0.9 * door.width,
        )
        now = inked > 0.8
        count += now and not before
        before = now
    return count


def _door(arc: Arc, shut: int, drawn: tuple[float, float]) -> Door:
    """The door that is shut at one end of the arc (0: its start) and open at the other."""
    swing = arc.extent if shut == 0 else -arc.extent
    end = _at(arc, arc.start if shut == 0 else arc.start + arc.extent)
    return Door((arc.x, arc.y), end, swing, "single", arc.filled * drawn[1 - shut])
