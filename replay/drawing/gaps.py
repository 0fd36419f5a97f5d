"""Gaps in walls, at any turn: where a wall ends or turns, and the wall across the opening.

A swing door is known by its arc wherever it lies; what slides, folds or is drawn without an arc is
looked for where the walls leave room for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.ink import Bits

Doubles = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint8]
STRAIGHT = (0.035, 0.07)  # door widths: how far a wall's edge may leave a straight line, in turn
ENDS = (0.05, 0.7)  # door widths: thickness of a wall that ends
SIDE = 0.2  # door widths: the shortest side of a wall that ends
SQUARE = 0.5  # cosine of the least angle of a wall's corner
PARALLEL = 0.9  # cosine of the largest angle between the two sides of a wall that ends
WIDTHS = (0.55, 2.6)  # door widths: openings
THIN = 0.12  # door widths: thickness taken for the wall beside a corner
FINE = 96  # px that an opening has in its patch, at least


@dataclass(frozen=True, slots=True)
class Gap:
    """An opening between a wall's end or corner and the wall across.

    Attributes:
        start, stop: (x, y) px, the middle of the wall's end and the place across.
        thick: px, of the wall; of a corner THIN door widths.
        ends: whether a wall ends here, rather than turns.
    """

    start: tuple[float, float]
    stop: tuple[float, float]
    thick: float
    ends: bool = True

    @property
    def width(self) -> float:
        """Px, from wall to wall."""
        return hypot(self.stop[0] - self.start[0], self.stop[1] - self.start[1])

    def at(self, u: float, v: float) -> tuple[float, float]:
        """The point u widths along the opening and v widths to its left on the picture."""
        (x, y), (a, b) = self.start, self.stop
        return x + u * (a - x) + v * (b - y), y + u * (b - y) - v * (a - x)


@dataclass(frozen=True, slots=True)
class Patch:
    """A gap's surroundings, turned so that the opening lies along the rows.

    Attributes:
        ink: (rows, cols); the opening runs along the middle row.
        unit: px of the patch for the opening's width.
        left: column where the opening starts.
        middle: row of its middle.
        thick: of the wall, in widths of the opening.
    """

    ink: Bits
    unit: float
    left: int
    middle: int
    thick: float

    def along(self, start: Doubles, stop: Doubles, samples: int = 48) -> Doubles:
        """Share of ink on straight ways, (n,); ends (n, 2) in widths: u along, v to the left."""
        t = np.linspace(0.0, 1.0, samples)[None, :]
        u = start[:, :1] + t * (stop[:, :1] - start[:, :1])
        v = start[:, 1:] + t * (stop[:, 1:] - start[:, 1:])
        return np.asarray(self.values(u, v).mean(axis=1))

    def values(self, u: Doubles, v: Doubles) -> Bits:
        """Ink at places; none beyond the patch."""
        cols = np.rint(self.left + u * self.unit).astype(np.int64)
        rows = np.rint(self.middle - v * self.unit).astype(np.int64)
        inside = (rows >= 0) & (rows < self.ink.shape[0]) & (cols >= 0)
        inside &= cols < self.ink.shape[1]
        out = np.zeros(u.shape, dtype=np.uint8)
        out[inside] = self.ink[rows[inside], cols[inside]]
        return out


def find_gaps(walls: Bits, door: float) -> list[Gap]:
    """Openings of 0.55 to 2.6 door widths before a wall's end or beside its corner, each once.

    Args:
        walls: (H, W).
        door: px, the usual width of a leaf.
    """
    contours, _ = cv2.findContours(walls, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    ends: list[Gap] = []
    turns: list[Gap] = []
    for contour in contours:
        if len(contour) < 0.5 * door:
            continue
        for rough in STRAIGHT:
            shape = cv2.approxPolyDP(contour, max(1.5, rough * door), True)[:, 0, :]
            corners = shape.astype(np.float64)
            for found, starts in ((ends, _ends), (turns, _corners)):
                for start, outwards, thick in starts(corners, walls, door):
                    far = _faced(walls, start, outwards, thick, door)
                    if far is not None:
                        stop = start + far * outwards
                        found.append(Gap(_point(start), _point(stop), thick, found is ends))
    return _once(ends + turns)


def patch(lines: Bits, gap: Gap, along: float = 1.3, across: float = 1.3) -> Patch:
    """The ink about a gap: `along` widths beyond either end, `across` to either side."""
    unit = max(float(FINE), gap.width) if gap.width < 2 * FINE else 2.0 * FINE
    coarse = gap.width / unit
    rows, cols = round(2 * across * unit) + 1, round((1 + 2 * along) * unit) + 1
    left, middle = round(along * unit), rows // 2
    (x, y), (a, b) = gap.start, gap.stop
    ux, uy = (a - x) / unit, (b - y) / unit
    # patch column and row to picture: start + (col - left) * u + (row - middle) * across
    back = np.array([[ux, -uy, x - left * ux + middle * uy], [uy, ux, y - left * uy - middle * ux]])
    corners = np.array([[0, cols, 0, cols], [0, 0, rows, rows], [1, 1, 1, 1]])
    spread = back @ corners
    low = np.clip(np.floor(spread.min(axis=1)).astype(int) - 2, 0, None)
    high = np.ceil(spread.max(axis=1)).astype(int) + 3
    source = np.ascontiguousarray(lines[low[1] : high[1], low[0] : high[0]])
    if source.size == 0:
        soft = np.zeros((rows, cols), dtype=np.uint8)
    else:
        back[:, 2] -= low
        if coarse > 1.0:
            source = np.asarray(cv2.dilate(source, np.ones((2, 2), np.uint8)), dtype=np.uint8)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        warped = cv2.warpAffine(source * np.uint8(255), back, (cols, rows), flags=flags)
        soft = np.asarray(warped, dtype=np.uint8)
    return Patch((soft > 100).astype(np.uint8), unit, left, middle, gap.thick / gap.width)


def _point(p: Doubles) -> tuple[float, float]:
    return float(p[0]), float(p[1])


def _ends(corners: Doubles, walls: Bits, door: float) -> list[tuple[Doubles, Doubles, float]]:
    """Ends of walls along a contour: middle, way outwards, thickness.

    An end is what lies between two sides that lead there and back: an edge, or up to three where
    it is ragged.
    """
    n = len(corners)
    if n < 4:
        return []
    edges = np.roll(corners, -1, axis=0) - corners
    long = np.hypot(edges[:, 0], edges[:, 1]) + 1e-9
    out = []
    for there in range(n):
        for short in (1, 2, 3):
            back = (there + short + 1) % n
            between = [(there + k) % n for k in range(1, short + 1)]
            if back == there or max(long[between]) > ENDS[1] * door:
                break
            if min(long[there], long[back]) < max(SIDE * door, long[between].max()):
                continue
            a, b = edges[there] / long[there], edges[back] / long[back]
            if float(a @ b) > -PARALLEL:
                continue
            outwards = edges[there] - edges[back]  # the longer side tells more
            outwards = outwards / hypot(*outwards)
            across = np.array([-outwards[1], outwards[0]])
            tips = corners[[(there + k) % n for k in range(1, short + 2)]]
            thick = float(np.ptp(tips @ across)) + 1.0
            if not ENDS[0] * door <= thick <= ENDS[1] * door:
                continue
            middle = across * float((tips @ across).max() + (tips @ across).min()) / 2
            middle = middle + outwards * float((tips @ outwards).max())
            if float(np.ptp(tips @ outwards)) < thick and _free(walls, middle + 2.5 * outwards):
                out.append((middle, outwards, thick))
                break
    return out


def _free(walls: Bits, place: Doubles) -> bool:
    """Whether a place is on the picture and no wall."""
    col, row = round(float(place[0])), round(float(place[1]))
    inside = 0 <= row < walls.shape[0] and 0 <= col < walls.shape[1]
    return inside and not walls[row, col]


def _corners(corners: Doubles, walls: Bits, door: float) -> list[tuple[Doubles, Doubles, float]]:
    """Corners that stick out, each with the two ways that go on beyond its sides."""
    n = len(corners)
    if n < 3:
        return []
    thick = THIN * door
    out = []
    for k in range(n):
        for other, third in (((k - 1) % n, (k + 1) % n), ((k + 1) % n, (k - 1) % n)):
            side, next_side = corners[k] - corners[other], corners[third] - corners[k]
            long, next_long = hypot(*side), hypot(*next_side)
            if min(long, next_long) < SIDE * door:
                continue
            outwards, inwards = side / long, next_side / next_long
            if abs(float(outwards @ inwards)) > SQUARE:
                continue
            start = corners[k] + 0.5 * thick * inwards
            if _free(walls, start + 2.5 * outwards) and not _free(walls, start - 2.5 * outwards):
                out.append((start, outwards, thick))
    return out


def _faced(
    walls: Bits, start: Doubles, outwards: Doubles, thick: float, door: float
) -> float | None:
    """Px from a wall's end to the wall across, if that is an opening's width away."""
    steps = np.arange(2.0, WIDTHS[1] * door + 1)
    across = np.array([-outwards[1], outwards[0]])
    sides = np.array([[[-0.3 * thick]], [[0.0]], [[0.3 * thick]]])
    way = np.rint(start + sides * across + steps[:, None] * outwards).astype(np.int64)
    x, y = way[..., 0], way[..., 1]
    inside = (x >= 0) & (y >= 0) & (x < walls.shape[1]) & (y < walls.shape[0])
    on = np.zeros(inside.shape, dtype=np.bool_)
    on[inside] = walls[y[inside], x[inside]] > 0
    hits = steps[on.argmax(axis=1)][on.any(axis=1)].tolist()
    if len(hits) < 2 or hits[len(hits) // 2] < WIDTHS[0] * door:
        return None
    return float(sorted(hits)[len(hits) // 2])


def _once(gaps: list[Gap]) -> list[Gap]:
    """Gaps that lie on each other are one."""
    kept: list[Gap] = []
    known = np.zeros((len(gaps), 3))  # x and y of the middle, width
    for gap in gaps:
        x, y = gap.at(0.5, 0.0)
        wide = known[: len(kept), 2]
        near = np.hypot(known[: len(kept), 0] - x, known[: len(kept), 1] - y) < 0.3 * wide
        if not (near & (np.abs(gap.width - wide) < 0.3 * wide)).any():
            known[len(kept)] = x, y, gap.width
            kept.append(gap)
    return kept
