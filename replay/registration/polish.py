"""A rough place made exact, and how well it explains both pictures.

Iterated closest points along the walls' normals with falling weights (Welsch), which keeps clutter
and bent ends from pulling; all four parameters of the similarity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formats.jit import njit
from replay.registration.fields import Floats, field_of, towards_free
from replay.registration.seen import Doubles, Mask, Seen, points_of

MOST_POINTS = 2500
WEIGHT = 0.6  # of what is confirmed against what is explained: drawings show more than walls
THICKEST = 0.025  # of the plan's longer side, that a wall may be thick
MARGIN = 64  # px around the plan's ink, where cells may still lie near a wall


@njit
def target(
    point: Doubles,
    facing: Doubles,
    matrix: Doubles,
    near: npt.NDArray[np.int32],
    at: Floats,
    across: Floats,
) -> tuple[int, float, float]:
    """The edge that a point belongs to, and x, y from the point to it; -1 beyond the field."""
    u, v = point[0], point[1]
    x = matrix[0, 0] * u + matrix[0, 1] * v + matrix[0, 2]
    y = matrix[1, 0] * u + matrix[1, 1] * v + matrix[1, 2]
    c, r = int(np.rint(x)), int(np.rint(y))
    if not (0 <= r < near.shape[0] and 0 <= c < near.shape[1]):
        return -1, 0.0, 0.0
    k = near[r, c]
    dx, dy = at[k, 0] - x, at[k, 1] - y
    gx = matrix[0, 0] * facing[0] + matrix[0, 1] * facing[1]
    gy = matrix[1, 0] * facing[0] + matrix[1, 1] * facing[1]
    if gx * across[k, 0] + gy * across[k, 1] > 0.0:  # it was seen from the wall's other side
        dx, dy = dx + across[k, 0], dy + across[k, 1]
    return k, dx, dy


@njit
def _step(
    points: Doubles,
    facing: Doubles,
    matrix: Doubles,
    flip: float,
    near: npt.NDArray[np.int32],
    at: Floats,
    normal: Floats,
    across: Floats,
    sigma: float,
) -> tuple[Doubles, Doubles]:
    """Normal equations (4, 4) and right side (4,) of a change of (a, b, x, y)."""
    left, right = np.zeros((4, 4)), np.zeros(4)
    j = np.zeros(4)
    for i in range(points.shape[0]):
        k, dx, dy = target(points[i], facing[i], matrix, near, at, across)
        square = dx * dx + dy * dy
        if k < 0 or square > 16.0 * sigma * sigma:
            continue
        nx, ny = normal[k, 0], normal[k, 1]
        w = np.exp(-0.5 * square / (sigma * sigma))
        e = nx * dx + ny * dy
        u, fv = points[i, 0], flip * points[i, 1]
        j[0], j[1], j[2], j[3] = nx * u + ny * fv, ny * u - nx * fv, nx, ny
        for p in range(4):
            right[p] += w * j[p] * e
            for q in range(4):
                left[p, q] += w * j[p] * j[q]
    return left, right


@njit
def _near(
    points: Doubles,
    facing: Doubles,
    matrix: Doubles,
    near: npt.NDArray[np.int32],
    at: Floats,
    across: Floats,
    sigma: float,
) -> float:
    """Mean closeness of points to the edges they belong to, 0 to 1."""
    total = 0.0
    for i in range(points.shape[0]):
        k, dx, dy = target(points[i], facing[i], matrix, near, at, across)
        if k >= 0:
            total += np.exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma))
    return total / points.shape[0]


@njit
def _confirmed(
    wall: Floats, inverse: Doubles, far: Floats, known: npt.NDArray[np.bool_], sigma: float
) -> tuple[float, float]:
    """Of the walls that the map could see: the sum of closeness, and how many they are."""
    good, count = 0.0, 0.0
    rows, cols = far.shape
    for i in range(wall.shape[0]):
        u, v = wall[i, 0], wall[i, 1]
        c = int(np.rint(inverse[0, 0] * u + inverse[0, 1] * v + inverse[0, 2]))
        r = int(np.rint(inverse[1, 0] * u + inverse[1, 1] * v + inverse[1, 2]))
        if 0 <= r < rows and 0 <= c < cols and known[r, c]:
            good += np.exp(-0.5 * (far[r, c] / sigma) ** 2)
            count += 1.0
    return good, count


def _one_each(points: Doubles, side: float) -> Doubles:
    """The first of the points in each square of a side."""
    cells = np.floor(points / side).astype(np.int64)
    _, first = np.unique(cells[:, 0] * (1 << 24) + cells[:, 1], return_index=True)
    return np.ascontiguousarray(points[np.sort(first)])


@dataclass(frozen=True)
class Fit:
    """A polished place.

    Attributes:
        matrix: (2, 3) map cells -> plan pixels.
        explained: share of the occupied cells that lie on walls, softly.
        confirmed: share of the walls that the map can see which it shows, softly.
        seen: walls that the map can see, px of the bench.
    """

    matrix: Doubles
    explained: float
    confirmed: float
    seen: float

    @property
    def score(self) -> float:
        """The weighted harmonic mean of both shares (van Rijsbergen's F)."""
        both = WEIGHT * self.explained + self.confirmed
        return (1 + WEIGHT) * self.explained * self.confirmed / max(both, 1e-9)

    @property
    def scale(self) -> float:
        """Plan pixels a map cell."""
        return float(np.hypot(self.matrix[0, 0], self.matrix[1, 0]))

    @property
    def mirrored(self) -> bool:
        """Whether it turns the map over."""
        return bool(np.linalg.det(self.matrix[:, :2]) < 0)


class Bench:
    """Map and plan, prepared for polishing and weighing many places.

    Args:
        seen: the map.
        walls: (H, W) the plan's ink.
        side: px, to which the plan's longer side is brought where it is larger.
    """

    def __init__(self, seen: Seen, walls: Mask, side: int = 1600) -> None:
        ink = points_of(walls)
        self.low = ink.min(axis=0)
        self.unit = max(1.0, float((ink.max(axis=0) - self.low).max() + 1) / side)
        cells = np.floor((ink - self.low) / self.unit).astype(np.int64) + MARGIN
        cols, rows = cells.max(axis=0) + 1 + MARGIN
        small = np.zeros((rows, cols), np.bool_)
        small[cells[:, 1], cells[:, 0]] = True
        self.plan = field_of(small, THICKEST * max(small.shape))
        self.map = field_of(seen.occupied)
        self.known = seen.occupied | seen.free
        points = seen.points
        self.points = np.ascontiguousarray(points[:: max(1, len(points) // MOST_POINTS)])
        self.facing = towards_free(seen.free, self.points)
        size = points.max(axis=0) - points.min(axis=0)
        self.diagonal = float(np.hypot(*size))  # map cells
        self.tolerance = max(1.0, 0.006 * self.diagonal)  # map cells
        self.even = _one_each(points, max(2.0, self.tolerance))
        self.even_facing = towards_free(seen.free, self.even)

    def inside(self, matrix: Doubles) -> Doubles:
        """A matrix to plan pixels as one to this bench's pixels."""
        out = matrix / self.unit
        out[:, 2] = (matrix[:, 2] - self.low + 0.5) / self.unit - 0.5 + MARGIN
        return out

    def outside(self, points: Doubles) -> Doubles:
        """Points (n, 2) of this bench as pixels of the plan."""
        out: Doubles = (points - MARGIN + 0.5) * self.unit - 0.5 + self.low
        return out

    def _back(self, matrix: Doubles) -> Doubles:
        out = matrix * self.unit
        out[:, 2] = (matrix[:, 2] - MARGIN + 0.5) * self.unit - 0.5 + self.low
        return out

    def polish(
        self,
        matrix: Doubles,
        rounds: tuple[float, ...],
        within: tuple[float, float] = (0.0, np.inf),
    ) -> Doubles:
        """The place after some rounds, each with its multiple of the tolerance.

        Args:
            matrix: (2, 3) map cells -> plan pixels.
            rounds: multiples of the tolerance.
            within: least and most plan pixels a map cell.
        """
        flip = -1.0 if np.linalg.det(matrix[:, :2]) < 0 else 1.0
        now = self.inside(matrix)
        scale = float(np.hypot(now[0, 0], now[1, 0]))
        middle = self.points.mean(axis=0)
        centred = self.points - middle
        now[:, 2] += now[:, :2] @ middle
        spread = float(np.square(centred).sum(axis=1).mean())
        for times in rounds:
            sigma = max(0.7, times * self.tolerance * scale)
            p = self.plan
            left, right = _step(
                centred, self.facing, now, flip, p.near, p.at, p.normal, p.across, sigma
            )
            weak = 1e-3 * (left[2, 2] + left[3, 3] + 1.0)
            left[np.diag_indices(4)] += weak * np.array([spread, spread, 1.0, 1.0])
            a, b, x, y = np.linalg.solve(left, right)
            a, b = now[0, 0] + a, now[1, 0] + b
            size = self.unit * float(np.hypot(a, b))
            kept = min(max(size, within[0]), within[1]) / max(size, 1e-12)
            a, b = kept * a, kept * b
            now = np.array([[a, -b * flip, now[0, 2] + x], [b, a * flip, now[1, 2] + y]])
        now[:, 2] -= now[:, :2] @ middle
        return self._back(now)

    def size(self, fit: Fit) -> float:
        """Plan pixels that the map's diagonal takes."""
        return fit.scale * self.diagonal

    def spread(self, matrix: Doubles) -> float:
        """Share of what was seen that lies on walls, by length: dense cells count no more.

        `Fit.explained` counts cells, most of which lie where the robot stood long.
        """
        inside, p = self.inside(matrix), self.plan
        scale = float(np.hypot(inside[0, 0], inside[1, 0]))
        sigma = max(0.7, self.tolerance * scale)
        return _near(self.even, self.even_facing, inside, p.near, p.at, p.across, sigma)

    def weigh(self, matrix: Doubles, times: float = 1.0) -> Fit:
        """How well a place explains both pictures."""
        inside = self.inside(matrix)
        scale = float(np.hypot(inside[0, 0], inside[1, 0]))
        sigma = times * self.tolerance
        p = self.plan
        explained = _near(
            self.points, self.facing, inside, p.near, p.at, p.across, max(0.7, sigma * scale)
        )
        back = np.linalg.inv(np.vstack([inside, [0, 0, 1]]))[:2]
        good, count = _confirmed(p.wall, back, self.map.far, self.known, max(sigma, 0.7 / scale))
        share = good / count if count else 0.0
        return Fit(matrix, explained, share, count * len(p.at) / len(p.wall))
