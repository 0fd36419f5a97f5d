"""A plan's wall cells as straight walls: two faces, a thickness, samples along them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.bool_]
Doubles = npt.NDArray[np.float64]
Cell = npt.NDArray[np.int32]
BEND = 1.0  # cells that a straight wall's outline may bend
SHORTEST = 0.3  # m: shorter straight parts are ends and jambs
THICKEST = 0.8  # m: beyond it the other face is another wall's
ALIKE = 30.0  # degrees between directions that count as one


@dataclass(frozen=True)
class Straight:
    """A straight wall in cells of the lattice: x to the right, y up, cell centres at whole numbers.

    Attributes:
        at: (n, 2) outermost wall cells of its left face, a cell apart, from start to end.
        along: (2,) unit vector from start to end; its left face looks to (-along y, along x).
        thick: cells from face to face.
        deep: thicker than any wall: the right face is not known.
    """

    at: Doubles
    along: Doubles
    thick: int
    deep: bool

    @property
    def left(self) -> Doubles:
        """(2,) unit vector out of the left face."""
        return np.array([-self.along[1], self.along[0]])


def straights(wall: Mask, resolution: float) -> list[Straight]:
    """The straight walls of a plan, the longest first; ends and specks are left out.

    Outlines of the wall's parts are simplified to polygons (Douglas and Peucker); each side is a
    face, and the two faces of a wall are joined to one.

    Args:
        wall: (rows, cols) cells, row 0 lowest.
        resolution: m, a cell's side.
    """
    contours, _ = cv2.findContours(wall.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    sides: list[tuple[float, Doubles, Doubles]] = []
    for contour in contours:
        outline = np.asarray(contour, np.int32).reshape(-1, 2)
        corners = np.asarray(cv2.approxPolyDP(outline, BEND, True), np.int32).reshape(-1, 2)
        for first, last in pairwise(_along(outline, corners)):
            a, b = outline[first % len(outline)], outline[last % len(outline)]
            if (float(np.hypot(*(b - a))) + 1.0) * resolution >= SHORTEST:
                part = np.roll(outline, -first, axis=0)[: last - first + 1]
                sides.append(_line(part))
    sides.sort(key=lambda side: (-side[0], *side[1], *side[2]))
    taken = np.full(wall.shape, np.nan, np.float32)  # direction of the wall that a cell is part of
    found: list[Straight] = []
    most = max(1, round(THICKEST / resolution))  # of cells larger than any wall, one
    for _, a, b in sides:
        found += _joined(wall, taken, a, b, most, SHORTEST / resolution)
    return found


def _along(outline: Cell, corners: Cell) -> list[int]:
    """Where on an outline each corner of its polygon comes, and the first one again.

    A thin wall's outline comes by the same cells twice: the shortest way round is the right one.
    """
    ways = []
    for start in np.flatnonzero((outline == corners[0]).all(axis=1)).tolist():
        way = [start]
        for corner in [*corners[1:], corners[0]]:
            here = np.flatnonzero((outline == corner).all(axis=1))
            way.append(way[-1] + 1 + int(((here - way[-1] - 1) % len(outline)).min()))
        ways.append(way)
    return min(ways, key=lambda way: way[-1] - way[0])


def _line(part: Cell) -> tuple[float, Doubles, Doubles]:
    """Length and ends of the line through a part of an outline.

    A polygon's side may run across a wall's end; the line by Welsch's weights does not.
    """
    u, v, x, y = cv2.fitLine(part, cv2.DIST_WELSCH, 0.5, 0.01, 0.01).ravel().astype(np.float64)
    on = (part - [x, y]) @ [u, v]
    near = np.abs((part - [x, y]) @ [-v, u]) <= BEND
    on = on[near] if near.any() else on
    low, high = float(on.min()), float(on.max())
    return high - low, np.array([x + low * u, y + low * v]), np.array([x + high * u, y + high * v])


def _joined(
    wall: Mask, taken: npt.NDArray[np.float32], a: Doubles, b: Doubles, most: int, shortest: float
) -> list[Straight]:
    """The parts of a side that no other wall has taken, with their thickness."""
    length = float(np.hypot(*(b - a)))
    if length + 1.0 < shortest:
        return []
    along = (b - a) / length
    at = a + np.arange(round(length) + 1)[:, None] * along
    left = np.array([-along[1], along[0]])
    if lookup(wall, at + 1.5 * left).sum() > lookup(wall, at - 1.5 * left).sum():
        at, along, left = at[::-1], -along, -left  # so that its outer face is on the left
    steps = np.arange(-2, 3)[:, None, None] * left + at  # the outline runs within a cell of it
    outer = (np.where(lookup(wall, steps), np.arange(-2, 3)[:, None], -9)).max(axis=0)
    at = at + float(np.clip(np.median(outer), -1, 1)) * left
    inward = at - np.arange(most + 1)[:, None, None] * left
    solid = lookup(wall, inward)
    solid[0] = True
    depth = np.where(solid.all(axis=0), most + 1, solid.argmin(axis=0))
    thick = int(np.median(depth))
    deep = thick > most
    thick = min(thick, most)
    angle = np.degrees(np.arctan2(along[1], along[0])) % 180.0
    middle = np.rint(at - 0.5 * (thick - 1) * left).astype(np.int64)
    rows, cols = (np.clip(middle[:, i], 0, wall.shape[1 - i] - 1) for i in (1, 0))
    with np.errstate(invalid="ignore"):
        off = np.abs((taken[rows, cols] - angle + 90.0) % 180.0 - 90.0)
    free = ~(off < ALIKE)
    for k in range(thick):
        cells = np.rint(at - k * left).astype(np.int64)
        inside = lookup(wall, cells.astype(np.float64))
        taken[cells[inside, 1], cells[inside, 0]] = angle
    out = []
    for first, last in runs(free):
        if last - first >= shortest:
            out.append(Straight(at[first:last], along, thick, deep))
    return out


def lookup(mask: Mask, at: Doubles) -> Mask:
    """The cells of a mask under points (..., 2); False beyond it."""
    cells = np.rint(at).astype(np.int64)
    x, y = cells[..., 0], cells[..., 1]
    inside = (x >= 0) & (y >= 0) & (x < mask.shape[1]) & (y < mask.shape[0])
    found: Mask = inside & mask[np.where(inside, y, 0), np.where(inside, x, 0)]
    return found


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First and one past the last of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
