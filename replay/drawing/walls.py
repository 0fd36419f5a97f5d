"""Walls from ink: solid strokes, hatched bands, cavities, and the room between double lines.

All lengths are in door widths, the drawing's own scale, so that no thickness in pixels is fixed.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.cells import Cells, stacked
from replay.drawing.ink import Bits, closed, grown, opened, straight

LINE = 0.06  # door widths: no line is thicker
LETTER = 0.8  # door widths: smaller lone strokes are text, dots and ticks
COLUMN = 0.13  # door widths: a solid rectangle of that side is a column, not a letter
THINNEST = 0.04  # door widths: a wall of 3 cm
HATCH = 0.22  # door widths: the widest slit of a hatching
DIAMONDS = 60  # of a band: fewer are no crossed hatching
DIAMOND = (0.35, 0.72)  # of its box that a square fills which stands on a corner
DIAGONAL = 22.0  # degrees about 45 that a hatching may run
BLOCK = 0.75  # door widths: what is thicker in both directions is furniture, stairs or paving
BRIDGE = 4.0  # door widths: gaps between walls of one building, for windows and porches
SCRAP = 0.04  # of the largest building's walls: less is no building
ALL_BOLD = 0.7  # of the bent hollow bands' area: bold lines are what tells walls
BOLD = 1.3  # times the usual line: the lines of walls where these are drawn bold
ENDLESS = 40.0  # square door widths: a larger cell is a room, not the room in a wall
BAND = 0.5  # door widths: but the wall about a building may be as large, being no wider
FIGURES = 0.02  # of a cell is letters: then it is no wall; a dashed axis across one is less
CAVITY = 0.5  # of narrow cells' area: where more lie side by side, these are cavity walls
BOTH = 1.7  # of a band's length is drawn along its two sides
ALIKE = 1.25  # ratio within which the widths of walls are alike
GAP = 0.01  # of the ink: what a gap between the thickness of lines and of walls may hold
LONG = 2.5  # door widths: strokes of letters are shorter
SOLID_INK = 0.1  # of all ink: less solid wall than this is no style
OUTER = 0.19  # door widths: no outer wall is thinner (15 cm)
OUTER_SHARE = 0.45  # of the solid walls' area: with less as thick as that, hollow is the style


def letters(ink: Bits, door: float) -> Bits:
    """Lone small strokes: text, dots, ticks. Solid rectangles stay, they are columns."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(ink, connectivity=8)
    wide, high, area = stats[:, 2], stats[:, 3], stats[:, 4]
    least, most = np.minimum(wide, high), np.maximum(wide, high)
    solid = (area > 0.85 * wide * high) & (least > COLUMN * door) & (most < 2 * least)
    small = (most < LETTER * door) & ~solid
    small[0] = False
    return small.astype(np.uint8)[labels]


def line_thickness(ink: Bits, door: float) -> int:
    """The thickness in px that most of the lines' length has; lines are at most 5 cm thick."""
    most = min(9, max(2, round(LINE * door)))
    areas = [float(ink.sum()), *(float(opened(ink, k).sum()) for k in range(2, most + 2))]
    lost = np.array(areas[:-1]) - np.array(areas[1:])
    return 1 + int(np.argmax(lost / np.arange(1, len(areas))))


def solid_side(ink: Bits, line: int, door: float) -> int:
    """Side of the square that solid walls pass and lines do not: the first gap in thickness.

    Strokes are either lines or walls (from about 3 cm on). The square grows until one step more
    loses hardly any ink; where there is no such gap, to where it loses least.
    """
    low = max(2, round(THINNEST * door), round(1.5 * line))
    high = max(low + 1, round(0.085 * door))
    areas = np.array([float(opened(ink, side).sum()) for side in range(low, high + 2)])
    lost = areas[:-1] - areas[1:]
    gap = np.flatnonzero(lost < GAP * float(ink.sum()))
    return low + 1 + int(gap[0] if len(gap) else np.argmin(lost))


def find_walls(ink: Bits, door: float) -> tuple[Bits, dict[str, Bits]]:
    """Walls, solid, and what was told apart on the way.

    Args:
        ink: (H, W), without frame and title block.
        door: px, the usual width of a leaf.
    """
    layers = {"text": letters(ink, door)}
    ink = ink & (1 - layers["text"])
    line = line_thickness(ink, door)
    side = solid_side(ink, line, door)
    solid = ink & grown(opened(ink, side), 3)
    cells = Cells.of(ink, ENDLESS * door * door, BAND * door)
    hatched = _hatched(ink, cells, solid, door)
    walls = solid | hatched
    if _is_hollow_style(ink, walls, line, door):
        hollow = _hollow(ink, cells, walls, layers["text"], line, door)
        hollow |= _open_bands(ink, cells, hollow, layers["text"], door)
        walls = opened(walls | hollow | ink, side) & grown(walls | hollow, 2 * side + 1)
    walls = _with_cavities(ink, cells, walls, door, side)
    layers["hatching"] = hatched & (1 - solid)
    walls = _buildings(walls, door)
    return walls, layers


def _hatched(ink: Bits, cells: Cells, solid: Bits, door: float) -> Bits:
    """Bands filled by slanted slits between two lines, or by the diamonds of crossed ones."""
    off = np.abs(np.abs(np.degrees(cells.angle)) - 45)
    slit = (cells.width <= HATCH * door) & (off < DIAGONAL) & (cells.long > 1.5 * cells.short)
    slit &= (cells.area < 0.4 * door * door) & (cells.long < 0.9 * door) & ~cells.outside
    stands = (cells.boxed > DIAMOND[0]) & (cells.boxed < DIAMOND[1])
    diamond = stands & (cells.width <= HATCH * door) & (cells.long < 2 * cells.short)
    diamond &= (cells.area < 0.015 * door * door) & (cells.area > 3) & ~cells.outside
    return _bands(ink, cells, slit, door, 1) | _bands(ink, cells, diamond, door, DIAMONDS)


def _bands(
    ink: Bits, cells: Cells, marking: npt.NDArray[np.bool_], door: float, least: int
) -> Bits:
    """Bands a good part of which are marking cells, so many at least."""
    marks = cells.pick(marking)
    tiny = cells.pick(
        (cells.width <= HATCH * door) & (cells.area < 0.4 * door * door) & ~cells.outside
    )
    near = grown(marks, max(3, round(0.12 * door)) | 1)
    band = opened((ink | marks | (tiny & near)) & near, max(3, round(0.07 * door)))
    band &= 1 - opened(band, round(BLOCK * door))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(band, connectivity=8)
    marked = (marks > 0) & (labels > 0)
    covered = np.bincount(labels[marked], minlength=count)
    each = np.unique(np.column_stack((labels[marked], cells.labels[marked])), axis=0)
    good = np.bincount(each[:, 0], minlength=count) >= least
    good &= (covered > 0.3 * stats[:, 4]) & (np.maximum(stats[:, 2], stats[:, 3]) > 0.5 * door)
    good[0] = False
    return good.astype(np.uint8)[labels]


def _is_hollow_style(ink: Bits, walls: Bits, line: int, door: float) -> bool:
    """Whether double lines stand for walls here: what is solid is too thin for outer walls."""
    if float(walls.sum()) < SOLID_INK * float(ink.sum()):
        return True
    factor = max(1, round(door / 16))
    long = round(LONG * door / factor)
    thick = opened(walls, max(round(OUTER * door), 3 * line + 1))
    area = [float(straight(_coarse(m, factor), long).sum()) for m in (thick, walls)]
    return area[0] <= OUTER_SHARE * area[1]


def _coarse(mask: Bits, factor: int) -> Bits:
    """A smaller mask: a pixel for each block that holds any."""
    small = cv2.resize(mask, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    return (
        cv2.resize(mask * 255, (small.shape[1], small.shape[0]), interpolation=cv2.INTER_AREA) > 60
    ).astype(np.uint8)


def _hollow(ink: Bits, cells: Cells, solid: Bits, text: Bits, line: int, door: float) -> Bits:
    """Cells between the two lines of a wall, told from windows and furniture by their lines.

    Where walls have a solid lining, cells along it and cells that turn a corner are wall. Where
    walls are drawn in bold lines, cells between bold lines are. Else every long narrow cell is.
    """
    narrow = (cells.width <= 0.5 * door) & (cells.width > 0.03 * door)
    narrow &= cells.length > 1.2 * cells.width
    bent = narrow & (cells.length > 2.5 * door) & (cells.short > 1.6 * cells.width)
    lined = cells.bordering(grown(solid, 3)) > 0.2
    lined &= narrow & (cells.length > 1.2 * door) & (cells.width > 0.08 * door)
    thick = sum(opened(ink, k).astype(np.float32) for k in range(1, 3 * line + 3))
    bold = narrow & (cells.bordering(np.asarray(thick)) > BOLD * line)
    area = {
        name: float(cells.area[which].sum())
        for name, which in (("bent", bent), ("lined", lined), ("bold", bold))
    }
    if area["lined"] > 0.3 * area["bent"] and solid.any():
        for _ in range(2):  # the outer leaf lies beside the cavity, which lies beside the lining
            taken = cells.pick(bent | lined)
            beside = cells.bordering(grown(taken, 2 * line + 3))
            lined |= narrow & (beside > 0.3) & (cells.length > 0.3 * door)
        return cells.pick(bent | lined)
    if float(cells.area[bold & bent].sum()) > ALL_BOLD * area["bent"]:
        return cells.pick(bold)
    long = narrow & (cells.length > 2 * cells.width)
    slim = (cells.width <= 0.5 * door) & (cells.length > 2 * cells.width)
    slim &= cells.short <= 1.6 * cells.width + 2  # straight
    panes = stacked(cells, slim, line) & long
    if float(cells.area[panes].sum()) < CAVITY * float(cells.area[long].sum()):
        long &= ~panes
    long &= ~_lettered(cells, text)
    chosen = cells.pick(long)
    return chosen & (1 - opened(chosen | ink, round(BLOCK * door)))


def _lettered(cells: Cells, text: Bits) -> npt.NDArray[np.bool_]:
    """Which cells hold letters, as those between dimension lines do, and walls do not."""
    figures = np.bincount(cells.labels[text > 0], minlength=len(cells.area))
    return np.asarray(figures > FIGURES * cells.area)


def _open_bands(ink: Bits, cells: Cells, hollow: Bits, text: Bits, door: float) -> Bits:
    """Walls whose two lines are not closed at the ends: long bands as wide as the other walls.

    Between dimension lines there are figures.
    """
    walls = np.bincount(cells.labels[hollow > 0], minlength=len(cells.area)) > 0
    walls &= cells.length > LONG * door
    walls[0] = False
    if not walls.any():
        return np.zeros_like(ink)
    least, most = float(cells.width[walls].min()), float(cells.width[walls].max())
    white = cells.pick(cells.area > ENDLESS * door * door)
    band = white & (1 - opened(white, round(ALIKE * most)))
    bands = Cells.of(1 - band, float(ink.size))
    alike = (bands.width > least / ALIKE) & (bands.width < most * ALIKE)
    alike &= (bands.length > 2 * LONG * door) & ~bands.outside
    drawn = bands.bordering(ink) * bands.edges()
    alike &= (drawn > BOTH * bands.length) & ~_lettered(bands, text)
    return bands.pick(alike)


def _with_cavities(ink: Bits, cells: Cells, walls: Bits, door: float, side: int) -> Bits:
    """Fill the cells that walls enclose: the gap between a hatched leaf and its lining."""
    for _ in range(2):
        around = cells.bordering(grown(walls, 5))
        inside = (around > 0.85) & (cells.width <= 0.35 * door) & ~cells.outside
        filled = walls | cells.pick(inside)
        walls = walls | (closed(filled, 2 * side + 1) & (ink | filled))
        walls = opened(walls, side)
    return walls


def _buildings(walls: Bits, door: float) -> Bits:
    """Straight walls and columns that hang together over doors and windows, without scraps."""
    factor = max(1, round(door / 24))
    small = door / factor
    coarse = _coarse(walls, factor)
    lines = straight(coarse, round(0.6 * small))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(coarse, connectivity=8)
    column = (stats[:, 4] > 0.7 * stats[:, 2] * stats[:, 3]) & (
        np.minimum(stats[:, 2], stats[:, 3]) > COLUMN * small
    )
    column[0] = False
    kept = grown(lines, 2 * round(0.15 * small) + 1) & coarse | column.astype(np.uint8)[labels]
    reach = grown(kept, 2 * round(BRIDGE * small / 2) + 1)
    count, labels = cv2.connectedComponents(reach, connectivity=8)
    mass = np.bincount(labels[lines > 0], minlength=count).astype(np.float64)
    mass[0] = 0
    kept &= (mass > SCRAP * mass.max()).astype(np.uint8)[labels]
    full = cv2.resize(kept, walls.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return walls & grown(full, 2 * factor + 1)
