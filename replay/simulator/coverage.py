"""Ways that see everything: the nearest place not yet visited, again and again, clear of walls."""

from __future__ import annotations

from heapq import heappop, heappush
from math import ceil, inf

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, UsageError
from formats.errors import Path as AnyPath
from formats.frame import Floats
from formats.jit import njit
from replay.simulator.site import Mask, Site

STEP = 0.1  # m, cells that ways are planned on
MOST = 4_000_000  # such cells
Ints = npt.NDArray[np.int64]
# right, left, up, down, then the diagonals
MOVES = np.array([[0, 1], [0, -1], [1, 0], [-1, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
LENGTHS = np.array([1.0] * 4 + [2.0**0.5] * 4)


class Ground:
    """Where a round robot can stand: cells of STEP m whose centres keep `radius` from walls.

    Args:
        site: what stands there.
        radius: m, of the robot.
        inside: (rows, cols) pixels of the site that it may come to; None: all.
        about: the plan's file, for errors.

    Raises:
        FormatError: there is no place for it, or the site is too large.
    """

    def __init__(
        self, site: Site, radius: float, inside: Mask | None = None, about: AnyPath = ""
    ) -> None:
        import cv2

        g = site.geometry
        self.step = max(STEP, g.resolution)
        self.x, self.y, self.about, self.radius = g.x, g.y, about, radius
        rows = max(1, int(g.rows * g.resolution / self.step))
        cols = max(1, int(g.cols * g.resolution / self.step))
        if rows * cols > MOST:
            problem = f"{rows * cols:,} places of {self.step:g} m are too many to plan a way over"
            raise FormatError(about, problem, hint="give a smaller plan")
        far = cv2.distanceTransform(
            (~site.solid).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
        )
        far = np.minimum(np.nan_to_num(far, posinf=1e6), 1e6) * g.resolution
        far -= 0.5 * g.resolution  # to the pixel's edge
        at = self.step / g.resolution
        row, col = (
            np.minimum(((np.arange(n) + 0.5) * at).astype(np.int64), most - 1)
            for n, most in ((rows, g.rows), (cols, g.cols))
        )
        self.clearance = far[np.ix_(row, col)].astype(np.float64)
        free = self.clearance > radius
        if inside is not None:
            free &= inside[np.ix_(row, col)]
        if not free.any():
            hint = "is it a plan of walls, its pixel size right? or give a smaller --robot-radius"
            raise FormatError(about, f"no room for a robot of radius {radius:g} m", hint=hint)
        count, parts = cv2.connectedComponents(free.view(np.uint8), connectivity=4)
        self.parts = parts
        self.largest = 1 + int(np.argmax(np.bincount(parts.ravel(), minlength=count)[1:]))

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Of a place; it may lie beyond the ground."""
        return int((y - self.y) // self.step), int((x - self.x) // self.step)

    def point(self, row: int, col: int) -> tuple[float, float]:
        """The centre of a cell, m."""
        return self.x + (col + 0.5) * self.step, self.y + (row + 0.5) * self.step

    def start(self) -> tuple[int, int]:
        """The widest place of the largest part."""
        room = np.where(self.parts == self.largest, self.clearance, -1.0)
        row, col = np.unravel_index(int(np.argmax(room)), room.shape)
        return int(row), int(col)

    def checked(self, x: float, y: float) -> tuple[int, int]:
        """The free cell of a place.

        Raises:
            UsageError: a wall is there, or too near, or the place lies outside.
        """
        row, col = self.cell(x, y)
        rows, cols = self.parts.shape
        if not (0 <= row < rows and 0 <= col < cols):
            x1, y1 = self.x + cols * self.step, self.y + rows * self.step
            hint = f"the plan reaches x {self.x:.2f} to {x1:.2f}, y {self.y:.2f} to {y1:.2f} m"
            raise UsageError(self.about, f"{x:g},{y:g} lies outside the plan", hint=hint)
        if self.parts[row, col] == 0:
            hint = f"the nearest free place is {self._nearest(row, col)}"
            raise UsageError(
                self.about, f"at {x:g},{y:g} there is no room for the robot", hint=hint
            )
        return row, col

    def _nearest(self, row: int, col: int) -> str:
        free = np.argwhere(self.parts > 0)
        k = int(np.argmin(((free - [row, col]) ** 2).sum(axis=1)))
        x, y = self.point(int(free[k, 0]), int(free[k, 1]))
        return f"{x:.2f},{y:.2f}"

    def nodes(self, part: int, spacing: float) -> Ints:
        """Cells (n, 2) to visit: of every square of `spacing` m the widest."""
        side = max(1, ceil(spacing / self.step))
        rows, cols = np.nonzero(self.parts == part)
        block = (rows // side) * (self.parts.shape[1] // side + 1) + cols // side
        order = np.lexsort((-self.clearance[rows, cols], block))
        first = order[np.diff(block[order], prepend=-1) > 0]
        return np.stack((rows[first], cols[first]), axis=1)

    def way(self, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[float, float]]:
        """The shortest way between two free cells, straightened, m.

        Raises:
            UsageError: none leads there.
        """
        goals = np.zeros(self.parts.shape, dtype=np.bool_)
        goals[goal] = True
        cells = trace(self.parts > 0, *start, goals)
        if not len(cells):
            a, b = self.point(*start), self.point(*goal)
            problem = f"no way leads from {a[0]:.2f},{a[1]:.2f} to {b[0]:.2f},{b[1]:.2f}"
            raise UsageError(self.about, problem)
        return [self.point(*cell) for cell in self.straightened(cells)]

    def straightened(self, cells: Ints) -> list[tuple[int, int]]:
        """A way with only the corners that it needs."""
        free = self.parts > 0
        kept, at = [(int(cells[0, 0]), int(cells[0, 1]))], 0
        while at < len(cells) - 1:
            ahead = at + 1
            for k in range(at + 2, len(cells)):
                if not sees(free, *cells[at], *cells[k]):
                    break
                ahead = k
            at = ahead
            kept.append((int(cells[at, 0]), int(cells[at, 1])))
        return kept

    def cover(
        self, start: tuple[int, int], spacing: float, metres: float = inf
    ) -> list[tuple[float, float]]:
        """Waypoints from a free cell to every part of the ground that it reaches, m.

        Greedy: to the nearest place that is not visited; a place that the way passes within half
        of the spacing counts as visited.

        Args:
            start: a free cell.
            spacing: m between the places.
            metres: stop planning once the way is longer.
        """
        free = self.parts > 0
        nodes = self.nodes(int(self.parts[start]), spacing)
        left = np.ones(len(nodes), dtype=np.bool_)
        out, driven, here = [self.point(*start)], 0.0, start
        near = 0.5 * spacing / self.step
        left[((nodes - start) ** 2).sum(axis=1) <= near * near] = False
        while left.any() and driven < metres:
            goals = np.zeros(free.shape, dtype=np.bool_)
            goals[nodes[left, 0], nodes[left, 1]] = True
            corners = self.straightened(trace(free, *here, goals))
            for corner in corners[1:]:
                a, b = np.array(here, dtype=float), np.array(corner, dtype=float)
                driven += float(np.hypot(*(b - a))) * self.step
                left &= _from_line(nodes, a, b) > near
                here = corner
                out.append(self.point(*corner))
            left &= (nodes != here).any(axis=1)
        return out


def _from_line(points: Ints, a: Floats, b: Floats) -> Floats:
    """Distances (n,) of points from a piece of a line."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(*(points - a - share[:, None] * along).T), dtype=np.float64)


@njit
def trace(free: Mask, row: int, col: int, goals: Mask) -> Ints:
    """Cells (n, 2) of the shortest way to the nearest goal, both ends in; none where none leads.

    Dijkstra over the eight neighbours; a diagonal move needs both cells beside it free.
    """
    rows, cols = free.shape
    far = np.full(rows * cols, inf)
    came = np.full(rows * cols, -1)
    far[row * cols + col] = 0.0
    heap = [(0.0, row * cols + col)]
    while len(heap) > 0:
        d, cell = heappop(heap)
        if d > far[cell]:
            continue
        r, c = cell // cols, cell % cols
        if goals[r, c]:
            n, at = 0, cell
            while at >= 0:
                n, at = n + 1, came[at]
            out = np.empty((n, 2), dtype=np.int64)
            at = cell
            for k in range(n - 1, -1, -1):
                out[k, 0], out[k, 1] = at // cols, at % cols
                at = came[at]
            return out
        for m in range(8):
            i, j = r + MOVES[m, 0], c + MOVES[m, 1]
            if not (0 <= i < rows and 0 <= j < cols and free[i, j]):
                continue
            if m >= 4 and not (free[r, j] and free[i, c]):
                continue
            longer = d + LENGTHS[m]
            if longer < far[i * cols + j] - 1e-9:
                far[i * cols + j] = longer
                came[i * cols + j] = cell
                heappush(heap, (longer, i * cols + j))
    return np.empty((0, 2), dtype=np.int64)


@njit
def sees(free: Mask, r0: int, c0: int, r1: int, c1: int) -> bool:
    """Whether the straight way between two cells' centres stays on free cells."""
    n = 4 * max(abs(r1 - r0), abs(c1 - c0))
    for k in range(1, n):
        r = r0 + 0.5 + (r1 - r0) * k / n
        c = c0 + 0.5 + (c1 - c0) * k / n
        if not free[int(r), int(c)]:
            return False
    return True
