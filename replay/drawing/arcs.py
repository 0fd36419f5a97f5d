"""Circular arcs in thin ink: bent stretches of outlines suggest circles, the ink near settles them.

A leaf's arc is the one feature of a door that furniture and text seldom share, so its radius also
gives the drawing's scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, radians
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.bends import bent_stretches
from replay.drawing.ink import Bits, directions, grown

Doubles = npt.NDArray[np.float64]
LEAST = 0.4  # rad, a bent stretch of an outline that is worth a circle
SURE = 0.5  # anisotropy from which a pixel's normal is trusted
BINS = 180  # sectors of 2 degrees by which an arc's extent is measured
NARROWING = (0.08, 0.05, 0.035)  # of the radius: strokes so near bear on the circle, in turn
SIDE = -0.2  # cosine of the largest turn from the seed's middle that bears on the circle
ALONG = 0.96  # cosine of a stroke's normal with the radius
EXTENTS = radians(50), radians(130)
HALF_CIRCLE = radians(200)
GAP = 4  # sectors without ink that do not end an arc (text or a line across it)


@dataclass(frozen=True, slots=True)
class Arc:
    """An inked arc: centre and radius in px, from `start` over `extent` rad (x towards y)."""

    x: float
    y: float
    radius: float
    start: float
    extent: float
    filled: float  # share of the extent that is inked


class Seed(NamedTuple):
    """A circle that a bent stretch suggests: centre and radius in px, its direction, its turn."""

    x: float
    y: float
    radius: float
    middle: float
    turn: float


def find_arcs(thin: Bits, smallest: float, largest: float) -> list[Arc]:
    """Arcs of 50 to 130 degrees with radii between `smallest` and `largest` px."""
    rows, cols = np.nonzero(thin)
    nx, ny, sure = directions(thin, rows, cols)
    straight = sure > SURE
    if not straight.any():
        return []
    points = np.column_stack((cols[straight], rows[straight])).astype(np.float64)
    normals = np.column_stack((nx[straight], ny[straight])).astype(np.float64)
    grid = _Cells(points, normals, 32, thin.shape)
    whole = grown(thin, 3)  # plotted hairlines are often dotted
    candidates = _seeds(thin, smallest, largest) + _seeds(whole, smallest, largest)
    arcs: list[Arc] = []
    for seed in candidates:
        if not any(_covers(arc, seed) for arc in arcs):
            arcs.extend(_fit(grid, seed))
    return _unique(arcs)


def _covers(arc: Arc, seed: Seed) -> bool:
    """Whether a seed lies on an arc that is found already."""
    apart = hypot(arc.x - seed.x, arc.y - seed.y)
    side = cos(seed.middle - arc.start - arc.extent / 2)
    same = apart < 0.1 * seed.radius and abs(arc.radius - seed.radius) < 0.1 * seed.radius
    return same and side > cos(arc.extent / 2)


def _seeds(thin: Bits, smallest: float, largest: float) -> list[Seed]:
    """Circles of the bent stretches of the ink's outlines, longest first."""
    contours, _ = cv2.findContours(thin, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    long = [contour[:, 0, :] for contour in contours if len(contour) >= LEAST * smallest * 2]
    out: list[Seed] = []
    for points, turn in bent_stretches(long, 0.6 / largest, 1.6 / smallest, LEAST):
        circle = _circle(points)
        if circle is None or circle[3] > 0.45 + 0.008 * circle[2]:
            continue
        if smallest <= circle[2] <= largest:
            x, y = points.mean(axis=0) - circle[:2]
            out.append(Seed(*circle[:3], float(np.arctan2(y, x)), turn))
    return sorted(out, key=lambda seed: -seed.turn * seed.radius)


def _circle(points: Doubles) -> tuple[float, float, float, float] | None:
    """The least-squares circle (Kasa 1976) and the points' mean distance from it, in px."""
    middle = points.mean(axis=0)
    p = points - middle
    design = np.column_stack((p, np.ones(len(p))))
    (a, b, c), *_ = np.linalg.lstsq(design, (p**2).sum(axis=1), rcond=None)
    square = c + (a * a + b * b) / 4
    if square <= 0:
        return None
    radius = float(np.sqrt(square))
    off = np.hypot(p[:, 0] - a / 2, p[:, 1] - b / 2) - radius
    spread = float(np.sqrt((off**2).mean()))
    return float(a / 2 + middle[0]), float(b / 2 + middle[1]), radius, spread


class _Cells:
    """Points by square cell, so that those near a circle are found without a look at all."""

    def __init__(
        self, points: Doubles, normals: Doubles, size: int, shape: tuple[int, int]
    ) -> None:
        self.size, self.cols = size, shape[1] // size + 1
        self.rows = shape[0] // size + 1
        key = (points[:, 1] // size).astype(np.int64) * self.cols + (points[:, 0] // size).astype(
            np.int64
        )
        order = np.argsort(key, kind="stable")
        self.points, self.normals = points[order], normals[order]
        self.first = np.searchsorted(key[order], np.arange(self.rows * self.cols + 1))

    def near(self, x: float, y: float, reach: float) -> tuple[Doubles, Doubles]:
        """Points and normals in the square of half side `reach` about x, y."""
        c0, c1 = (
            max(0, int((x - reach) // self.size)),
            min(self.cols - 1, int((x + reach) // self.size)),
        )
        r0, r1 = (
            max(0, int((y - reach) // self.size)),
            min(self.rows - 1, int((y + reach) // self.size)),
        )
        if c1 < c0 or r1 < r0:
            return self.points[:0], self.normals[:0]
        spans = [
            slice(self.first[r * self.cols + c0], self.first[r * self.cols + c1 + 1])
            for r in range(r0, r1 + 1)
        ]
        return np.vstack([self.points[s] for s in spans]), np.vstack(
            [self.normals[s] for s in spans]
        )


def _fit(grid: _Cells, seed: Seed) -> list[Arc]:
    """The circle through the ink near a seed, on the seed's side, and its drawn arc."""
    x, y, radius = seed.x, seed.y, seed.radius
    points, normals = grid.near(x, y, 1.2 * radius + 4)
    for narrow in NARROWING:
        on = _on_circle(points, normals, x, y, radius, max(1.6, narrow * radius))
        turn = np.arctan2(points[:, 1] - y, points[:, 0] - x) - seed.middle
        on &= np.cos(turn) > SIDE
        if on.sum() < 0.5 * radius:
            return []
        circle = _circle(points[on])
        if circle is None or hypot(circle[0] - x, circle[1] - y) > 0.2 * radius:
            return []
        x, y, radius = circle[:3]
    on = _on_circle(points, normals, x, y, radius, max(1.6, 0.025 * radius))
    angle = np.arctan2(points[on, 1] - y, points[on, 0] - x) % (2 * np.pi)
    inked = np.zeros(BINS, dtype=np.bool_)
    inked[(angle * BINS / (2 * np.pi)).astype(np.int64) % BINS] = True
    return [Arc(x, y, radius, *run) for run in _runs(inked)]


def _on_circle(
    points: Doubles, normals: Doubles, x: float, y: float, radius: float, near: float
) -> npt.NDArray[np.bool_]:
    """Stroke pixels within `near` px of a circle that run along it."""
    offset = points - (x, y)
    far = np.hypot(offset[:, 0], offset[:, 1])
    along = np.abs((offset * normals).sum(axis=1)) > ALONG * far
    return np.asarray(along & (np.abs(far - radius) < near))


def _runs(inked: npt.NDArray[np.bool_]) -> list[tuple[float, float, float]]:
    """(start, extent, filled) of every inked run that a leaf may draw, gaps bridged."""
    n, step = len(inked), 2 * np.pi / len(inked)
    if not inked.any():
        return []
    on = np.flatnonzero(inked)
    gaps = np.diff(np.append(on, on[0] + n))
    breaks = np.flatnonzero(gaps > GAP)
    if len(breaks) == 0:
        return []
    out = []
    for k, b in enumerate(breaks):
        first = on[(breaks[k - 1] + 1) % len(on)] if len(breaks) > 1 else on[(b + 1) % len(on)]
        length = (on[b] - first) % n + 1
        extent = length * step
        share = float(inked[(first + np.arange(length)) % n].mean())
        begin = float(first * step)
        if EXTENTS[0] <= extent <= EXTENTS[1]:
            out.append((begin, float(extent), share))
        elif 2 * EXTENTS[0] < extent < HALF_CIRCLE:  # a leaf that swings both ways
            out += [(begin, extent / 2, share), (begin + extent / 2, extent / 2, share)]
    return out


def _unique(arcs: list[Arc]) -> list[Arc]:
    """Arcs that lie on each other are one: the best filled stays."""
    kept: list[Arc] = []
    for arc in sorted(arcs, key=lambda a: -a.filled * a.extent):
        middle = arc.start + arc.extent / 2
        mx, my = arc.x + arc.radius * np.cos(middle), arc.y + arc.radius * np.sin(middle)
        for other in kept:
            turn = other.start + other.extent / 2
            ox, oy = other.x + other.radius * np.cos(turn), other.y + other.radius * np.sin(turn)
            if (
                np.hypot(mx - ox, my - oy) < 0.2 * arc.radius
                and np.hypot(arc.x - other.x, arc.y - other.y) < 0.3 * arc.radius
            ):
                break
        else:
            kept.append(arc)
    return kept
