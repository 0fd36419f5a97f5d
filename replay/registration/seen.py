"""What a robot saw, as a picture: occupied and free cells, row 0 on top; and its directions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError
from formats.grid import Evidence
from formats.plans.file import Plan

Mask = npt.NDArray[np.bool_]
Doubles = npt.NDArray[np.float64]
LEAST = 50  # occupied cells, below which no place can be told
HERE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
BESIDE = 3  # cells from a free one, within which a surface is drawn
FRAME, FRAME_DEPTH = 0.95, 0.02  # of each side that a frame covers; of the map, its thickness
LARGE = 2000  # px
BINS = 180  # of a degree, directions of walls


@dataclass(frozen=True)
class Seen:
    """What a robot saw, as a picture.

    Attributes:
        occupied, free: (H, W) cells, row 0 on top; the others are unknown.
        to_cells: (2, 3) from the user's coordinates (pixels of a map picture, metres of a log's
            map frame with y up) to cells, x right, y down, cell centres at whole numbers.
        resolution: m a cell, None where it is not known.
    """

    occupied: Mask
    free: Mask
    to_cells: Doubles = field(default_factory=lambda: HERE.copy())
    resolution: float | None = None

    @property
    def points(self) -> Doubles:
        """(n, 2) x, y of the occupied cells."""
        return points_of(self.occupied)


def points_of(mask: Mask) -> Doubles:
    """(n, 2) x, y of the pixels of a mask."""
    rows, cols = np.nonzero(mask)
    return np.column_stack((cols, rows)).astype(np.float64)


def seen_in_map(plan: Plan) -> Seen:
    """A map picture, read as any plan is.

    Raises:
        FormatError: it shows no free space, or next to no walls.
    """
    free = plan.known & ~plan.wall
    wall = unframed(plan.wall) & beside(free)
    return _checked(Seen(wall, free, HERE.copy(), plan.resolution), str(plan.path))


def beside(free: Mask) -> Mask:
    """Cells within reach of a free one: others are no surface that a robot saw, but a frame."""
    import cv2

    square = np.ones((2 * BESIDE + 1, 2 * BESIDE + 1), np.uint8)
    return np.asarray(cv2.dilate(free.astype(np.uint8), square)) > 0


def unframed(wall: Mask) -> Mask:
    """A map without the frame around it: a rectangle along its border that encloses all else."""
    import cv2

    rows, cols = np.flatnonzero(wall.any(axis=1)), np.flatnonzero(wall.any(axis=0))
    if len(rows) == 0:
        return wall
    box = wall[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    sides = (box[0].mean(), box[-1].mean(), box[:, 0].mean(), box[:, -1].mean())
    if min(sides) < FRAME:
        return wall
    depth = max(1, round(FRAME_DEPTH * max(box.shape)))
    inner = np.zeros_like(wall)
    inner[rows[0] + depth : rows[-1] + 1 - depth, cols[0] + depth : cols[-1] + 1 - depth] = True
    _, labels = cv2.connectedComponents(wall.astype(np.uint8), connectivity=8)
    frame = np.unique(labels[wall & ~inner])
    along = np.isin(labels, frame) & wall
    if (along & inner).any():  # the walls of the building itself
        return wall
    return wall & ~along


def seen_in_log(evidence: Evidence, name: str) -> Seen:
    """The evidence of a log, hits against misses (levels 0 and 1 of the beam model).

    Raises:
        FormatError: it shows no free space, or next to no walls.
    """
    hits, misses = evidence.counts[0], evidence.counts[-1]
    total = evidence.total((0.3, 0.6))
    occupied, free = (hits > 0) & (total < 0), (misses > 0) & (total > 0)
    g = evidence.geometry
    known = np.nonzero(occupied | free)
    if len(known[0]) == 0:
        raise FormatError(name, "its scans show nothing")
    low, high = known[0].min(), known[0].max() + 1
    left, right = known[1].min(), known[1].max() + 1
    box = (slice(low, high), slice(left, right))
    x, y = g.x + left * g.resolution, g.y + high * g.resolution  # the upper left corner
    k = 1.0 / g.resolution
    to_cells = np.array([[k, 0.0, -x * k - 0.5], [0.0, -k, y * k - 0.5]])
    return _checked(Seen(occupied[box][::-1], free[box][::-1], to_cells, g.resolution), name)


def _checked(seen: Seen, name: str) -> Seen:
    if int(seen.occupied.sum()) < LEAST:
        raise FormatError(name, "too few occupied cells to find its place by")
    if not seen.free.any():
        raise FormatError(name, "no free space in it", hint="is it a map?")
    return seen


def directions(mask: Mask) -> Doubles:
    """(BINS,) how much of a mask's outline runs in each direction of [0, 180) degrees.

    Clockwise from the x axis with y down; smoothed over about 1 degree.
    """
    import cv2

    image: npt.NDArray[np.float32] = mask.astype(np.float32)
    if (factor := max(mask.shape) / LARGE) > 1.0:  # a sheet scanned fine has no more directions
        smaller = (round(mask.shape[1] / factor), round(mask.shape[0] / factor))
        image = np.asarray(cv2.resize(image, smaller, interpolation=cv2.INTER_AREA), np.float32)
    smooth = cv2.GaussianBlur(image, (0, 0), 2.0)
    gx, gy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    size = np.hypot(gx, gy)
    strong = size > 0.05 * float(size.max())
    angle = (np.degrees(np.arctan2(gy[strong], gx[strong])) + 90.0) % 180.0
    bins = np.rint(angle * (BINS / 180.0)).astype(np.int64) % BINS
    histogram = np.bincount(bins, weights=size[strong], minlength=BINS)
    kernel = np.array([0.25, 0.5, 0.25])
    around = np.concatenate((histogram[-1:], histogram, histogram[:1]))
    smoothed: Doubles = np.convolve(around, kernel, "valid")
    return smoothed / max(float(smoothed.sum()), 1e-12)
