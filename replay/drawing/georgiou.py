"""Algorithm 1 of Georgiou et al. (2017): from the corners of a drawing to its doors and walls.

The tolerances are not printed in the paper; ours stand in corners.py, triangles.py and here.
"""

from __future__ import annotations

from math import atan2, hypot
from time import perf_counter

import cv2
import numpy as np

from replay.drawing.corners import Doubles, harris_corners
from replay.drawing.ink import Bits, Gray, binarise, distance, grown, straight_runs, upright
from replay.drawing.layers import outline
from replay.drawing.shapes import Door, Drawing, turn_between
from replay.drawing.sheet import LARGE, enlarged
from replay.drawing.structural import DOOR_M
from replay.drawing.triangles import Triangle, Whole, doors_of

DOORS_M = (0.6, 1.3)  # m, bounds of a leaf where the scale is known
DOORS_SHARE = (1 / 60, 1 / 9)  # of the picture's longer side, where it is not
SAME = 0.25  # of the width: triangles whose three corners lie so near are one door
EMPTY = 0.12  # of a triangle's inside that may be ink: doors are drawn as outlines
ODD = 1.7  # ratio to the usual width from which a triangle is no door of this drawing
JAMB = 0.12  # of the width: so near to straight ink both ends of the shut leaf lie
RUN = 0.6  # of the usual width: the shortest straight line that is a wall


def georgiou(gray: Gray, resolution: float | None = None) -> Drawing:
    """Algorithm 1, step by step.

    Args:
        gray: (H, W) uint8.
        resolution: m / px where it is known: bounds doors in m, else they are bounded relative to
            the picture.
    """
    started = perf_counter()
    gray = upright(gray)
    if gray.size > LARGE:
        small = cv2.resize(gray, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        half = georgiou(np.asarray(small, dtype=np.uint8), 2 * resolution if resolution else None)
        return enlarged(half, (gray.shape[0], gray.shape[1]))
    ink = binarise(gray)
    low, high = bounds(gray, resolution)
    candidates = shortlist(gray, ink, low, high)
    seconds = {"doors": perf_counter() - started}
    usual = float(np.median([door.width for door in candidates])) if candidates else 0.0
    door = DOOR_M / resolution if resolution else usual or low
    runs = straight_runs(ink, RUN * door)
    outer = outer_walls(runs, door)
    doors = without_false_positives(candidates, ink, runs, outline(outer, door), usual)
    walls = walls_from_doors(runs, outer, doors)
    seconds["walls"] = perf_counter() - started - seconds["doors"]
    layers = {"walls": ink & walls, "removed": ink & (1 - walls)}
    return Drawing(
        walls.astype(np.bool_),
        doors,
        outline(walls, door).astype(np.bool_),
        {name: layer.astype(np.bool_) for name, layer in layers.items()},
        usual,
        seconds,
    )


def bounds(gray: Gray, resolution: float | None) -> tuple[float, float]:
    """Shortest and longest leaf in px."""
    if resolution:
        return DOORS_M[0] / resolution, DOORS_M[1] / resolution
    return DOORS_SHARE[0] * max(gray.shape), DOORS_SHARE[1] * max(gray.shape)


def shortlist(gray: Gray, ink: Bits, low: float, high: float) -> list[Door]:
    """DoorsShortlist (D6): the empty isosceles triangles of corners, one for each place."""
    corners = harris_corners(gray)
    return without_duplicates(corners, doors_of(corners, grown(ink, 3), low, high), ink)


def without_duplicates(corners: Doubles, triangles: list[Triangle], ink: Bits) -> list[Door]:
    """One door for each cluster of triangles that are empty inside: the most right-angled."""
    filled = _inside_ink(corners, triangles, ink)
    doors = [
        _door(corners, triangle, ink, 1.0 - share)
        for triangle, share in zip(triangles, filled.tolist(), strict=True)
        if share <= EMPTY
    ]
    doors.sort(key=lambda door: (-door.confidence, abs(abs(door.swing) - np.pi / 2), door.hinge))
    kept: list[Door] = []
    for door in doors:
        if not any(_same(door, other) for other in kept):
            kept.append(door)
    return kept


def _door(corners: Doubles, triangle: Triangle, ink: Bits, confidence: float) -> Door:
    """A triangle as a door that shuts along its side with less ink: the other one is the leaf."""
    apex, first, second = (tuple(corners[k].tolist()) for k in triangle)
    drawn = [_side_ink(ink, apex, end) for end in (first, second)]
    end, leaf = (first, second) if drawn[0] <= drawn[1] else (second, first)
    shut = atan2(end[1] - apex[1], end[0] - apex[0])
    opened = atan2(leaf[1] - apex[1], leaf[0] - apex[0])
    return Door(apex, end, turn_between(shut, opened), "unknown", confidence)


def _inside_ink(corners: Doubles, triangles: list[Triangle], ink: Bits) -> Doubles:
    """Share of ink at 36 places well inside each triangle."""
    steps = np.linspace(0.1, 0.8, 8)
    places = np.array([(u, v) for u in steps for v in steps if u + v < 0.95])
    number = np.array(triangles, dtype=np.int64).reshape(-1, 3)
    a, b, c = (corners[number[:, k]][:, None, :] for k in range(3))
    points = a + places[:, :1] * (b - a) + places[:, 1:] * (c - a)
    cols, rows = (np.rint(points[..., k]).astype(np.int64) for k in (0, 1))
    return np.asarray(ink[rows, cols].mean(axis=1), dtype=np.float64)


def _side_ink(ink: Bits, a: tuple[float, float], b: tuple[float, float]) -> float:
    """Share of the straight side between two corners that is ink."""
    t = np.linspace(0.1, 0.9, 30)
    cols = np.rint(a[0] + t * (b[0] - a[0])).astype(np.int64)
    rows = np.rint(a[1] + t * (b[1] - a[1])).astype(np.int64)
    return float(_beside(ink, rows, cols).mean())


def _base_ink(ink: Bits, door: Door) -> float:
    """Share of the side opposite the hinge that is ink, straight or as an arc."""
    arc = np.rint(door.sector()[2:-1]).astype(np.int64)
    straight = _side_ink(ink, door.end, door.opened)
    return max(straight, float(_beside(ink, arc[:, 1], arc[:, 0]).mean()))


def _beside(ink: Bits, rows: Whole, cols: Whole) -> Bits:
    """Ink at pixels or beside them."""
    out = np.zeros(len(rows), dtype=np.uint8)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            r = np.clip(rows + dy, 0, ink.shape[0] - 1)
            out |= ink[r, np.clip(cols + dx, 0, ink.shape[1] - 1)]
    return out


def _same(a: Door, b: Door) -> bool:
    """Whether two triangles cover one door."""
    near = SAME * max(a.width, b.width)
    hinge = hypot(a.hinge[0] - b.hinge[0], a.hinge[1] - b.hinge[1])
    middles = np.hypot(*(a.triangle().mean(axis=0) - b.triangle().mean(axis=0)))
    return hinge < near and bool(middles < near)


def outer_walls(runs: Bits, door: float) -> Bits:
    """DetectOuterWalls (D7): straight ink that the border sees once openings are shut."""
    inside = outline(runs, door)
    rim = inside & grown(1 - inside, 5)
    _, labels = cv2.connectedComponents(runs, connectivity=8)
    seen = np.zeros(int(np.asarray(labels).max()) + 1, dtype=np.bool_)
    counted = np.bincount(np.asarray(labels)[rim > 0], minlength=len(seen))
    seen[counted > 2 * door] = True
    seen[0] = False
    return np.asarray(seen[labels], dtype=np.uint8)


def without_false_positives(
    doors: list[Door], ink: Bits, runs: Bits, inside: Bits, usual: float
) -> list[Door]:
    """RemoveFalsePositiveDoors (D8).

    A door is of about the usual width, in the building, and both ends of its shut leaf lie on
    straight ink.
    """
    far = distance(1 - runs)
    kept = []
    for door in doors:
        ends = [(round(y), round(x)) for x, y in (door.hinge, door.end)]
        on_walls = all(far[row, col] <= max(3.0, JAMB * door.width) for row, col in ends)
        in_building = all(inside[row, col] for row, col in ends)
        alike = usual / ODD <= door.width <= usual * ODD
        # two walls that meet in a corner make a triangle too, but nothing joins their far ends
        corner = _side_ink(ink, door.hinge, door.end) > 0.85 and _base_ink(ink, door) < 0.6
        if on_walls and in_building and alike and not corner:
            kept.append(door)
    return kept


def walls_from_doors(runs: Bits, outer: Bits, doors: list[Door]) -> Bits:
    """FindWalls (D9): straight ink that hangs on the outer walls or on a door's jambs.

    Neither thickness nor darkness counts (D10). The doors' own leaves are taken out first.
    """
    left = runs.copy()
    for door in doors:
        hinge, opened = np.rint([door.hinge, door.opened]).astype(int)
        cut = np.rint(hinge + 0.15 * (opened - hinge)).astype(int)
        cv2.line(left, cut.tolist(), opened.tolist(), 0, 5)
    _, labels = cv2.connectedComponents(left, connectivity=8)
    chosen = np.zeros(int(np.asarray(labels).max()) + 1, dtype=np.bool_)
    chosen[np.unique(np.asarray(labels)[outer > 0])] = True
    for door in doors:
        reach = max(3, round(JAMB * door.width))
        for x, y in (door.hinge, door.end):
            row, col = max(0, round(y) - reach), max(0, round(x) - reach)
            chosen[np.unique(labels[row : row + 2 * reach + 1, col : col + 2 * reach + 1])] = True
    chosen[0] = False
    return np.asarray(chosen[labels], dtype=np.uint8)
