"""Straight walls that were seen and that no plan has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from replay.surveying.segments import Doubles, Mask, lookup

LEAST = 1.0  # m: a door's leaf is shorter
GAP = 0.3  # m that a wall's hits may be apart
FULL = 0.6  # of its length that must show hits
THICK = 0.3  # m between the faces of one wall
WIDE = 1.2  # cells that hits lie off the line


Line = tuple[Doubles, Doubles]


@dataclass(frozen=True)
class Extra:
    """A straight face of something that the plan lacks.

    Attributes:
        start, end: x, y, m in the plan's frame.
        thickness: m, one cell where one face was seen.
        inside: whether its middle lies within the plan's building.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    thickness: float
    inside: bool

    @property
    def length(self) -> float:
        """In m."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))


def extras(
    unexplained: Mask, inside: Mask, resolution: float, corner: tuple[float, float]
) -> list[Extra]:
    """Straight runs of occupied cells, the longest first.

    Candidates by the probabilistic Hough transform (Matas et al. 2000; OpenCV's, whose seed is
    fixed), each put through its hits by least squares; a cell belongs to the longest only.

    Args:
        unexplained: (rows, cols) occupied cells away from every planned or moved wall.
        inside: cells of the plan's building.
        resolution: m, a cell's side.
        corner: x, y in m of cell (0, 0)'s lower left corner.
    """
    least, gap = LEAST / resolution, GAP / resolution
    left = unexplained.copy()
    faces: list[Line] = []
    while new := _faces(left, least, gap):
        faces += new
    faces.sort(key=lambda face: -float(np.hypot(*(face[1] - face[0]))))
    out = []
    for (a, b), thick in _walls(faces, THICK / resolution):
        middle = bool(lookup(inside, 0.5 * (a + b)))
        (ax, ay), (bx, by) = ((end + 0.5) * resolution + corner for end in (a, b))
        out.append(Extra((ax, ay), (bx, by), (thick + 1.0) * resolution, middle))
    return sorted(out, key=lambda extra: (-extra.length, extra.start))


def _faces(left: Mask, least: float, gap: float) -> list[Line]:
    """Some straight runs among the cells of `left`, from which they are taken."""
    lines = cv2.HoughLinesP(
        left.astype(np.uint8),
        1.0,
        np.pi / 360,
        max(4, round(FULL * least)),
        minLineLength=round(0.8 * least),
        maxLineGap=max(1, round(gap)),
    )
    if lines is None:
        return []
    ends = np.asarray(lines, np.float64).reshape(-1, 4)
    order = np.argsort(-np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1]), kind="stable")
    faces: list[Line] = []
    for line in ends[order]:
        found = _through(left, line[:2], line[2:], least, gap)
        if found is None:
            continue
        faces.append(found)
    return faces


def _walls(faces: list[Line], most: float) -> Iterator[tuple[Line, float]]:
    """Two faces of one wall joined to its centre line; cells from face to face.

    Args:
        faces: the longest first.
        most: cells that the faces of a wall may be apart.
    """
    left = list(faces)
    while left:
        a, b = left.pop(0)
        length = float(np.hypot(*(b - a)))
        along = (b - a) / length
        aside = np.array([-along[1], along[0]])
        for i, (c, d) in enumerate(left):
            off = (np.array([c, d]) - a) @ aside
            at = np.clip((np.array([c, d]) - a) @ along, 0.0, length)
            if np.abs(off).max() <= most and np.ptp(at) >= 0.5 * np.hypot(*(d - c)):
                del left[i]
                shift = 0.5 * off.mean() * aside
                yield (a + shift, b + shift), abs(float(off.mean()))
                break
        else:
            yield (a, b), 0.0


def _through(left: Mask, a: Doubles, b: Doubles, least: float, gap: float) -> Line | None:
    """The line through the hits near a -> b that are left; they are taken from `left`."""
    low = np.floor(np.minimum(a, b) - 3).astype(int).clip(0)
    high = np.ceil(np.maximum(a, b) + 4).astype(int)
    rows, cols = np.nonzero(left[low[1] : high[1], low[0] : high[0]])
    points = np.column_stack((cols, rows)) + low.astype(np.float64)
    for _ in range(2):
        along = (b - a) / np.hypot(*(b - a))
        aside = np.abs((points - a) @ [-along[1], along[0]])
        near = points[aside <= WIDE]
        if len(near) < FULL * least:
            return None
        middle = near.mean(axis=0)
        direction = np.linalg.svd(near - middle, full_matrices=False)[2][0]
        direction = direction if direction @ along > 0 else -direction
        at = (near - middle) @ direction
        a, b = middle + at.min() * direction, middle + at.max() * direction
    order = np.argsort(at, kind="stable")
    breaks = np.flatnonzero(np.diff(at[order]) > gap) + 1
    parts = np.split(order, breaks)
    best = max(parts, key=lambda part: at[part[-1]] - at[part[0]])
    first, last = at[best[0]], at[best[-1]]
    length = last - first + 1.0
    filled = len(np.unique(np.floor(at[best] - first + 0.5)))
    if length < least or filled < FULL * length:
        return None
    mine = near[best].astype(np.int64)
    left[mine[:, 1], mine[:, 0]] = False
    return middle + (first - 0.5) * direction, middle + (last + 0.5) * direction
