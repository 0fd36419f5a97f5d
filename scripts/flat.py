"""A small flat in metres: its plan, what really stands there, and a drive through it.

Everything is a box (x0, y0, x1, y1), so that pictures and ray casts are exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Box = tuple[float, float, float, float]
Floats = npt.NDArray[np.float64]

OUTER = 0.2  # m, thickness of the outer walls
INNER = 0.12
WIDTH, DEPTH = 11.0, 8.0
LEFT, LOW = -2.0, -4.0  # the flat's lower left corner in the map frame: the robot starts at (0, 0)


def _wall(x0: float, y0: float, x1: float, y1: float, *doors: float) -> list[Box]:
    """An inner wall along one axis with door openings of 0.9 m whose centres are given."""
    across = x1 - x0 > y1 - y0
    start, end = (x0, x1) if across else (y0, y1)
    pieces, at = [], start
    for door in sorted(doors):
        pieces.append((at, door - 0.45))
        at = door + 0.45
    pieces.append((at, end))
    half = INNER / 2
    if across:
        return [(a, y0 - half, b, y0 + half) for a, b in pieces]
    return [(x0 - half, a, x0 + half, b) for a, b in pieces]


def _legs(x0: float, y0: float, x1: float, y1: float) -> list[Box]:
    """What a lidar near the floor sees of a table."""
    leg = 0.06
    return [(x, y, x + leg, y + leg) for x in (x0, x1 - leg) for y in (y0, y1 - leg)]


def _shell(x0: float, y0: float, x1: float, y1: float) -> list[Box]:
    """What is solid as far as a robot can know: boards around what stands there."""
    board = 0.06
    return [
        (x0, y0, x1, y0 + board),
        (x0, y1 - board, x1, y1),
        (x0, y0, x0 + board, y1),
        (x1 - board, y0, x1, y1),
    ]


OUTSIDE_WALLS: list[Box] = [
    (0, 0, WIDTH, OUTER),
    (0, DEPTH - OUTER, WIDTH, DEPTH),
    (0, 0, OUTER, DEPTH),
    (WIDTH - OUTER, 0, WIDTH, DEPTH),
]
INSIDE_WALLS: list[Box] = [
    *_wall(OUTER, 3.4, WIDTH - OUTER, 3.4, 2.0, 5.6, 9.4),  # rooms to the south of the corridor
    *_wall(OUTER, 4.7, WIDTH - OUTER, 4.7, 3.4, 6.6, 9.6),  # rooms to the north
    *_wall(7.5, OUTER, 7.5, 3.4),
    *_wall(5.0, 4.7, 5.0, DEPTH - OUTER),
    *_wall(8.2, 4.7, 8.2, DEPTH - OUTER, 6.6),
]
GONE: list[Box] = _wall(4.0, OUTER, 4.0, 3.34)  # drawn in the plan, torn down since
FURNITURE: list[Box] = [
    *_shell(0.35, 0.3, 2.3, 1.1),  # sofa
    *_legs(1.0, 1.7, 1.9, 2.2),  # low table
    *_shell(5.3, 0.25, 7.4, 0.85),  # kitchen counter
    *_legs(5.4, 1.3, 6.7, 2.2),  # dining table
    *_shell(9.3, 0.3, 10.7, 2.3),  # bed
    *_shell(0.3, 6.0, 0.9, 7.7),  # wardrobe
    *_shell(2.0, 6.4, 3.6, 7.7),  # bed
    *_shell(5.2, 7.1, 6.9, 7.7),  # desk
    *_shell(8.4, 7.0, 10.6, 7.7),  # shelves
    *_shell(10.3, 3.6, 10.7, 4.5),  # coat rack at the corridor's end
]
WAYPOINTS = [
    (2.0, 4.0),
    (2.0, 2.8),
    (3.2, 1.6),
    (4.7, 1.2),
    (5.6, 2.9),
    (5.6, 4.05),
    (6.6, 4.05),
    (6.6, 6.0),
    (6.3, 6.5),
    (6.6, 5.4),
    (6.6, 4.05),
    (3.4, 4.05),
    (3.4, 5.3),
    (1.6, 5.5),
    (3.4, 5.3),
    (3.4, 4.05),
    (8.6, 4.05),
]


def shifted(boxes: list[Box]) -> Floats:
    """Boxes (n, 4) in the map frame."""
    return np.array(boxes, dtype=np.float64) + np.array([LEFT, LOW, LEFT, LOW])


def plan_boxes() -> Floats:
    """What the architect drew: no furniture, and the wall that is gone."""
    return shifted(OUTSIDE_WALLS + INSIDE_WALLS + GONE)


def real_boxes() -> Floats:
    """What stands there."""
    return shifted(OUTSIDE_WALLS + INSIDE_WALLS + FURNITURE)


def picture(boxes: Floats, resolution: float, border: float = 0.4) -> npt.NDArray[np.uint8]:
    """Black boxes on white, row 0 on top; `border` m of paper around the flat."""
    rows = round((DEPTH + 2 * border) / resolution)
    cols = round((WIDTH + 2 * border) / resolution)
    out = np.full((rows, cols), 255, dtype=np.uint8)
    x0, y0 = LEFT - border, LOW - border
    for box in boxes:
        left, low, right, high = np.round((box - [x0, y0, x0, y0]) / resolution).astype(int)
        out[rows - high : rows - low, left:right] = 0
    return out


# Doors of the inner walls: hinge, where the shut leaf ends, where the open one does.
DOORS = [
    *[((x - 0.45, 3.4), (x + 0.45, 3.4), (x - 0.45, 2.5)) for x in (2.0, 5.6, 9.4)],
    *[((x - 0.45, 4.7), (x + 0.45, 4.7), (x - 0.45, 5.6)) for x in (3.4, 6.6, 9.6)],
    ((8.2, 6.15), (8.2, 7.05), (9.1, 6.15)),
]
ROOMS = [
    ("LIVING", 2.5, 2.6),
    ("KITCHEN", 6.1, 2.6),
    ("BED 1", 8.4, 2.7),
    ("HALL", 4.0, 3.95),
    ("BED 2", 0.9, 5.3),
    ("STUDY", 5.3, 5.6),
    ("BOX", 9.6, 6.1),
]


def drawing(resolution: float, border: float = 0.4) -> npt.NDArray[np.uint8]:
    """The architect's whole sheet: walls, doors with arcs, furniture, names, a dimension line."""
    import cv2

    out = picture(plan_boxes(), resolution, border)
    rows = out.shape[0]

    def at(x: float, y: float) -> tuple[int, int]:
        return round((x + border) / resolution), rows - round((y + border) / resolution)

    for x0, y0, x1, y1 in FURNITURE:
        cv2.rectangle(out, at(x0, y1), at(x1, y0), 0, 1)
    for hinge, shut, opened in DOORS:
        cv2.line(out, at(*hinge), at(*opened), 0, 2)
        start, end = (np.arctan2(p[1] - hinge[1], p[0] - hinge[0]) for p in (shut, opened))
        angles = np.linspace(
            start, start + np.arctan2(np.sin(end - start), np.cos(end - start)), 40
        )
        arc = [at(hinge[0] + 0.9 * np.cos(a), hinge[1] + 0.9 * np.sin(a)) for a in angles]
        cv2.polylines(out, [np.array(arc)], False, 0, 1, cv2.LINE_AA)
    for name, x, y in ROOMS:
        cv2.putText(out, name, at(x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.006 / resolution, 0, 1)
    cv2.line(out, at(0, -0.2), at(WIDTH, -0.2), 0, 1)
    cv2.putText(out, "11.00", at(5.2, -0.18), cv2.FONT_HERSHEY_SIMPLEX, 0.004 / resolution, 0, 1)
    return out


def cast(boxes: Floats, x: float, y: float, angles: Floats, far: float) -> Floats:
    """Distances (n,) from a point along angles (n,) to the nearest box; inf beyond `far`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None, :]
        low = (boxes[None, :, :2] - [x, y]) * inverse
        high = (boxes[None, :, 2:] - [x, y]) * inverse
    near = np.minimum(low, high).max(axis=2)
    leave = np.maximum(low, high).min(axis=2)
    hit = np.where((near <= leave) & (near > 0), near, np.inf).min(axis=1)
    return np.where(hit <= far, hit, np.inf)


@dataclass
class Drive:
    """True poses of the base in the map frame: times (n,) s, poses (n, 3) m, m, rad."""

    times: Floats
    poses: Floats


def drive(speed: float = 0.35, turn: float = 0.9, rate: float = 50.0) -> Drive:
    """Along the waypoints: turn on the spot, then straight on, sampled at `rate` Hz."""
    points = np.array(WAYPOINTS) + np.array([LEFT, LOW])
    poses = [(*points[0], 0.0)]
    for a, b in pairwise(points):
        x, y, yaw = poses[-1]
        goal = np.arctan2(b[1] - a[1], b[0] - a[0])
        delta = np.arctan2(np.sin(goal - yaw), np.cos(goal - yaw))
        steps = max(1, round(abs(delta) / turn * rate))
        poses += [(x, y, yaw + delta * i / steps) for i in range(1, steps + 1)]
        steps = max(1, round(float(np.hypot(*(b - a))) / speed * rate))
        poses += [(*(a + (b - a) * i / steps), yaw + delta) for i in range(1, steps + 1)]
    return Drive(np.arange(len(poses)) / rate, np.array(poses))
