"""What is not wall: the building's outline, and the remaining ink by what it was taken for."""

from __future__ import annotations

import cv2
import numpy as np

from replay.drawing.cells import Cells
from replay.drawing.ink import Bits, closed, grown, opened, opened_by, shrunk, square
from replay.drawing.shapes import Door

OPENINGS = (1.5, 3.0, 6.0)  # door widths: gaps closed in turn until the walls enclose something
NEARLY = 0.8  # of the most that a closing encloses
GLAZING = (0.12, 0.4)  # door widths: lines so far apart, from first to last
SHUT = 0.8  # of what is about a room is wall or glazing; a terrace has less
WINDOW = 3.5  # door widths: the widest opening in which ink is a window
TREADS = 4  # cells alike side by side that make stairs
TREAD = (0.2, 0.5)  # door widths: depth of a tread


def outline(walls: Bits, door: float, lines: Bits | None = None) -> Bits:
    """The footprint: what the picture's border does not reach once the openings are closed.

    Of the closings tried it is the smallest that encloses nearly as much as the largest. Where all
    lines are given, rooms with a glazed front belong to it, too.
    """
    factor = max(1, round(door / 16))
    small = shrunk(walls, factor)
    found = [_enclosed(small, round(gap * door / factor / 2)) for gap in OPENINGS]
    most = max(float(mask.sum()) for mask in found)
    chosen = next(mask for mask in found if float(mask.sum()) >= NEARLY * most)
    if lines is not None:
        chosen = _with_glazed(small, shrunk(lines, factor), chosen, door / factor)
    full = cv2.resize(chosen, walls.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return np.asarray(full, dtype=np.uint8) | walls


def _with_glazed(walls: Bits, lines: Bits, inside: Bits, door: float) -> Bits:
    """The footprint with the rooms beside it that glazing shuts where they have no wall.

    Glazing is drawn in two lines or more; a terrace's edge is one.
    """
    barrier = closed(walls, round(OPENINGS[0] * door) | 1) | closed(lines, 3) | inside
    glazing = opened(closed(lines, round(GLAZING[1] * door)), max(3, round(GLAZING[0] * door)))
    rooms = Cells.of(barrier, 0.0)
    shut = rooms.bordering(grown(walls | glazing, 5)) > SHUT
    shut &= (rooms.area > door * door) & ~rooms.outside
    return _enclosed(inside | grown(rooms.pick(shut), 3), 0)


def _enclosed(walls: Bits, reach: int) -> Bits:
    """Walls and what they enclose when gaps of twice `reach` px are shut."""
    wide = cv2.copyMakeBorder(walls, *(reach + 2,) * 4, cv2.BORDER_CONSTANT, value=0)
    sealed = cv2.dilate(wide, square(2 * reach + 1))
    edge = np.zeros((sealed.shape[0] + 2, sealed.shape[1] + 2), dtype=np.uint8)
    cv2.floodFill(sealed, edge, (0, 0), 2)
    inside = cv2.erode((np.asarray(sealed) != 2).astype(np.uint8), square(2 * reach + 1))
    cut = slice(reach + 2, -reach - 2)
    return np.asarray(inside, dtype=np.uint8)[cut, cut] | walls


def sorted_ink(
    lines: Bits,
    walls: Bits,
    inside: Bits,
    doors: list[Door],
    casements: list[Door],
    known: dict[str, Bits],
    door: float,
) -> dict[str, Bits]:
    """Every pixel of ink in one layer: the known ones first, then doors, windows, stairs, the rest.

    Ink inside the outline that is nothing else is furniture, outside it dimension lines.
    """
    left = lines & (1 - walls)
    out = {"walls": lines & walls}
    kinds = {
        **known,
        "doors": _swept(doors, lines.shape, door),
        "windows": _swept(casements, lines.shape, door) | _openings(walls, door),
        "stairs": _stairs(lines, door),
        "furniture": inside,
        "dimensions": np.ones_like(inside),
    }
    for name, where in kinds.items():
        out[name] = left & where
        left &= 1 - where
    return out


def _swept(doors: list[Door], shape: tuple[int, ...], door: float) -> Bits:
    """The sectors of leaves, a little grown so that arc and leaf lie inside."""
    out = np.zeros(shape, dtype=np.uint8)
    for one in doors:
        cv2.fillPoly(out, [np.rint(one.sector()).astype(np.int32)], 1)
    return grown(out, 2 * round(0.06 * door) + 1)


def _openings(walls: Bits, door: float) -> Bits:
    """Gaps in walls that run on behind them, along the picture's axes."""
    factor = max(1, round(door / 24))
    small = shrunk(walls, factor)
    length = round(WINDOW * door / factor)
    out = np.zeros_like(small)
    for size in ((length, 1), (1, length)):
        line = np.ones(size, dtype=np.uint8)
        pad = cv2.copyMakeBorder(small, *(length,) * 4, cv2.BORDER_CONSTANT, value=0)
        bridged = np.asarray(cv2.morphologyEx(pad, cv2.MORPH_CLOSE, line), dtype=np.uint8)
        gap = bridged[length:-length, length:-length] & (1 - small)
        room = round(0.8 * door / factor)  # thicker than any wall: not an opening in one
        out |= gap & (1 - opened_by(gap, (room, 1) if size[0] == 1 else (1, room)))
    full = cv2.resize(out, walls.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return np.asarray(full, dtype=np.uint8)


def _stairs(lines: Bits, door: float) -> Bits:
    """Runs of equal treads: at least four cells alike side by side, and the lines about them."""
    cells = Cells.of(lines, door * door)
    tread = (cells.width > TREAD[0] * door) & (cells.width < TREAD[1] * door)
    tread &= (cells.long > 1.5 * cells.short) & (cells.area > 0.75 * cells.long * cells.short)
    tread &= (cells.long > 0.7 * door) & (cells.long < 2 * door)
    runs = grown(cells.pick(tread), 7)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(runs, connectivity=8)
    many = stats[:, cv2.CC_STAT_AREA] > TREADS * TREAD[0] * 0.7 * 2 * door * door
    many[0] = False
    return many.astype(np.uint8)[labels]
