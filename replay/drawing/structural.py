"""The structural method: strokes, cells and arcs to walls and doors, on any style of drawing."""

from __future__ import annotations

from time import perf_counter

import cv2
import numpy as np

from replay.drawing.arcs import find_arcs
from replay.drawing.cells import Cells
from replay.drawing.ink import Bits, Gray, grown, opened
from replay.drawing.layers import outline, sorted_ink
from replay.drawing.openings import barred_doors, gap_doors
from replay.drawing.shapes import Door, Drawing
from replay.drawing.sheet import Sheet
from replay.drawing.swing import Leaf, choose_doors, leaves_of, usual_width
from replay.drawing.walls import find_walls

LEAST_DOOR = 8.0  # px: below, walls of 10 cm are less than a pixel
DOOR_M = 0.8  # m, the usual width of a leaf (EN and DIN sizes run from 0.7 to 1.0)
SMALLEST, LARGEST = 1 / 220, 1 / 5  # of the longer side: radii of doors where no scale is known
ALIKE = 1.25  # ratio within which widths of doors are one usual width
WALL_DOORS = 5.0  # walls of 15 cm to a door, where a drawing has walls alone


def structural(gray: Gray, resolution: float | None = None) -> Drawing:
    """Walls, doors and outline of a drawing.

    Args:
        gray: (H, W) uint8, dark on bright or bright on dark.
        resolution: m / px where it is known; else the doors give the scale.
    """
    started = perf_counter()
    sheet = Sheet.of(gray)
    ink, lines = sheet.ink, sheet.lines
    door = DOOR_M / resolution / sheet.scale if resolution else 0.0
    seconds = {"ink": perf_counter() - started}
    leaves = _leaves(sheet, door)
    door = max(LEAST_DOOR, door or usual_width(leaves) or _by_walls(ink))
    seconds["doors"] = perf_counter() - started - seconds["ink"]
    walls, layers = find_walls(ink, door)
    doors, windows = choose_doors(leaves, walls, lines, door)
    doors += gap_doors(walls, lines, doors, windows, door)
    bars = barred_doors(walls, lines, doors, windows, door)
    walls, doors = walls & (1 - _sectors(bars, walls.shape)), doors + bars
    seconds["walls"] = perf_counter() - started - sum(seconds.values())
    inside = outline(walls, door, lines & (1 - layers["text"]))
    layers = sorted_ink(lines, walls, inside, doors, windows, layers, door)
    seconds["layers"] = perf_counter() - started - sum(seconds.values())
    drawing = Drawing(
        walls.view(np.bool_),
        doors,
        inside.view(np.bool_),
        {name: layer.view(np.bool_) for name, layer in layers.items()},
        door,
        seconds,
    )
    return sheet.whole(drawing)


def door_leaves(gray: Gray, resolution: float | None = None) -> list[Leaf]:
    """Arcs with a leaf, before it is asked whether walls carry them; see `structural`."""
    sheet = Sheet.of(gray)
    return _leaves(sheet, DOOR_M / resolution / sheet.scale if resolution else 0.0)


def _leaves(sheet: Sheet, door: float) -> list[Leaf]:
    """Arcs with a leaf, of any plausible size."""
    lines, longer = sheet.lines, max(sheet.shape) / sheet.scale
    low = max(12.0, SMALLEST * longer) if not door else 0.55 * door
    high = LARGEST * longer if not door else 1.8 * door
    thin = lines & (1 - grown(opened(lines, 9), 3))
    return leaves_of(lines, find_arcs(thin, low, high))


def _by_walls(ink: Bits) -> float:
    """Px of a door where none is drawn: five times the usual width of long narrow cells."""
    cells = Cells.of(ink, 0.02 * ink.size)
    long = (cells.length > 8 * cells.width) & (cells.width > 2)
    long[0] = False
    if not long.any():
        return max(ink.shape) / 40
    order = np.argsort(cells.width[long])
    reached = np.cumsum(cells.length[long][order])
    middle = cells.width[long][order][int(np.searchsorted(reached, reached[-1] / 2))]
    return float(WALL_DOORS * (middle + 2))


def _sectors(doors: list[Door], shape: tuple[int, ...]) -> Bits:
    """What doors sweep."""
    out = np.zeros(shape, dtype=np.uint8)
    for one in doors:
        cv2.fillPoly(out, [np.rint(one.sector()).astype(np.int32)], 1)
    return out
