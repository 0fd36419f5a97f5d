"""What a building is not as it was drawn: walls gone or collapsed, furniture, walls that stand off.

Pictures here are masks (rows, cols) of solid pixels, row 0 lowest; lengths in pixels unless said.
"""

from __future__ import annotations

from math import cos, hypot, pi, sin
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.errors import UsageError
from formats.grid import Geometry
from replay.simulator.site import Mask

Line = tuple[float, float, float, float]
NEAR = 0.3  # m on either side of a line: the wall that is meant
LEAST = 0.8  # m, the shortest piece of wall that goes by a share
THICK = 0.6  # m: thicker things are no wall
BORDER = 0.3  # m of the outside: walls there bear the house and stay
WAVE = 2.0  # m between the places whose displacements are drawn
BOX = (0.2, 0.9)  # m, sides of a piece of clutter
RUBBLE = (0.05, 0.2)  # m, sides of a piece of rubble
SPREAD = 0.5  # m that rubble lies from where its wall stood
DENSITY = 0.5  # of the wall's own area that lies about as rubble
MARGIN = 0.15  # m around a robot that clutter leaves
BOARD = 0.06  # m: clutter is hollow, since nobody can see what is inside
TRIES = 40  # a piece of clutter


class Piece(NamedTuple):
    """A piece of wall: its bounding box, and its pixels within."""

    rows: slice
    cols: slice
    mask: Mask


def displaced(solid: Mask, resolution: float, spread: float, rng: np.random.Generator) -> Mask:
    """Walls off where they were drawn: a smooth field of displacements, `spread` m (RMS)."""
    import cv2

    rows, cols = solid.shape
    nodes = [max(2, round(n * resolution / WAVE) + 1) for n in (rows, cols)]
    field = rng.standard_normal((*nodes, 2)).astype(np.float32)
    field = np.asarray(cv2.resize(field, (cols, rows), interpolation=cv2.INTER_CUBIC))
    field *= spread / resolution / float(np.sqrt((field.astype(np.float64) ** 2).sum(-1).mean()))
    y, x = np.mgrid[:rows, :cols].astype(np.float32)
    moved = cv2.remap(solid.view(np.uint8), x + field[..., 0], y + field[..., 1], cv2.INTER_NEAREST)
    return np.asarray(moved, dtype=np.bool_)


def speckled(solid: Mask, share: float, rng: np.random.Generator) -> Mask:
    """A picture with a share of its pixels turned over, as dust on a scanner leaves them."""
    return solid ^ (rng.random(solid.shape) < share)


def along(line: Line, geometry: Geometry) -> Mask:
    """Pixels whose centres lie within NEAR of a line, x0, y0, x1, y1 in m of the plan's frame."""
    g = geometry
    x = (g.x + (np.arange(g.cols) + 0.5) * g.resolution - line[0])[None, :]
    y = (g.y + (np.arange(g.rows) + 0.5) * g.resolution - line[1])[:, None]
    u, v = line[2] - line[0], line[3] - line[1]
    length = max(hypot(u, v), 1e-9)
    ahead, aside = (x * u + y * v) / length, (y * u - x * v) / length
    return (ahead >= 0.0) & (ahead <= length) & (np.abs(aside) <= NEAR)


def wall_at(solid: Mask, line: Line, geometry: Geometry) -> Mask:
    """The wall along a line.

    Raises:
        UsageError: there is none.
    """
    found = solid & along(line, geometry)
    if not found.any():
        numbers = ",".join(f"{number:g}" for number in line)
        raise UsageError("", f"no wall lies within {NEAR:g} m of {numbers}")
    return found


def pieces(solid: Mask, inside: Mask, resolution: float) -> list[Piece]:
    """Straight pieces of inner wall along the axes, from the lower left on.

    Args:
        inside: the building, its walls among it.
    """
    import cv2

    image = solid.view(np.uint8)
    least = round(LEAST / resolution) | 1  # an even kernel would open with a shift
    wide = np.ones((1, least), np.uint8)
    across = cv2.morphologyEx(image, cv2.MORPH_OPEN, wide) > 0
    upright = cv2.morphologyEx(image, cv2.MORPH_OPEN, wide.T) > 0
    border = round(BORDER / resolution)
    outside = np.pad((~inside).view(np.uint8), 1, constant_values=1)  # beyond the picture, too
    near = cv2.dilate(outside, np.ones((2 * border + 1,) * 2, np.uint8))[1:-1, 1:-1] > 0
    found = []
    for mask, other, axis in ((across, upright, 0), (upright, across, 1)):
        alone = (mask & ~other).view(np.uint8)  # where two walls cross, the other one stays whole
        count, labels, stats, _ = cv2.connectedComponentsWithStats(alone, connectivity=4)
        for k in range(1, count):
            x, y, w, h = (int(stats[k, i]) for i in range(4))
            if max(w, h) < least or (h, w)[axis] * resolution > THICK:
                continue
            rows, cols = slice(y, y + h), slice(x, x + w)
            part = labels[rows, cols] == k
            if near[rows, cols][part].mean() < 0.5:
                found.append(Piece(rows, cols, part))
    return sorted(found, key=lambda piece: (piece.rows.start, piece.cols.start))


def chosen(found: list[Piece], share: float, rng: np.random.Generator) -> list[Piece]:
    """Pieces at random until their length is a share of the whole."""
    lengths = [max(piece.mask.shape) for piece in found]
    order, taken, out = rng.permutation(len(found)), 0, []
    for k in order.tolist():
        if taken + lengths[k] / 2 > share * sum(lengths):
            break
        taken += lengths[k]
        out.append(found[k])
    return out


def mask_of(some: list[Piece], shape: tuple[int, ...]) -> Mask:
    """Pixels of pieces."""
    out = np.zeros(shape, dtype=np.bool_)
    for piece in some:
        out[piece.rows, piece.cols] |= piece.mask
    return out


def collapsed(
    solid: Mask, wall: Mask, inside: Mask, resolution: float, rng: np.random.Generator
) -> Mask:
    """A wall gone, with rubble of a part of its area about where it stood."""
    import cv2

    left = (solid & ~wall).view(np.uint8).copy()
    rows, cols = np.nonzero(wall)
    todo, tries = DENSITY * rows.size, 0
    while todo > 0 and tries < 100_000:
        tries += 1
        k = int(rng.integers(rows.size))
        x = cols[k] + rng.normal(0.0, SPREAD / 2) / resolution
        y = rows[k] + rng.normal(0.0, SPREAD / 2) / resolution
        wide, deep = rng.uniform(*RUBBLE, 2) / resolution
        piece = box(x, y, wide, deep, rng.uniform(0.0, pi))
        todo -= _area(piece)
        cv2.fillConvexPoly(left, piece, 1)
    return (left > 0) & (inside | solid)


def box(x: float, y: float, wide: float, deep: float, turn: float) -> npt.NDArray[np.int32]:
    """Corners (4, 2) of a turned rectangle about a place, in whole pixels."""
    c, s = cos(turn), sin(turn)
    corners = np.array([(-wide, -deep), (wide, -deep), (wide, deep), (-wide, deep)]) / 2
    return np.rint(corners @ np.array([[c, s], [-s, c]]) + [x, y]).astype(np.int32)


def _area(corners: npt.NDArray[np.int32]) -> float:
    x, y = corners.astype(np.float64).T
    return max(1.0, float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2)


def cluttered(
    solid: Mask,
    inside: Mask,
    share: float,
    resolution: float,
    radius: float,
    rng: np.random.Generator,
) -> Mask:
    """Boxes of BOX m on a share of the free floor; none cuts off what a robot reached before.

    Args:
        inside: where they may stand.
        radius: m, of the robot.
    """
    import cv2

    out, taken, free = solid.copy(), solid.copy(), inside & ~solid
    reach = (radius + MARGIN) / resolution
    rows, cols = np.nonzero(free)
    todo = share * rows.size
    for _ in range(TRIES * max(1, round(todo * resolution**2 / 0.1))):
        if todo <= 0 or not rows.size:
            break
        k = int(rng.integers(rows.size))
        wide, deep = rng.uniform(*BOX, 2) / resolution
        corners = box(cols[k], rows[k], wide, deep, rng.choice([0.0, rng.uniform(0.0, pi)]))
        margin = round((2 * radius + 4 * MARGIN) / resolution) + 2
        low = np.maximum(corners.min(axis=0) - margin, 0)
        high = np.minimum(corners.max(axis=0) + margin + 1, solid.shape[::-1])
        window = (slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0])))
        drawn = np.zeros(out[window].shape, dtype=np.uint8)
        cv2.fillConvexPoly(drawn, corners - low.astype(np.int32), 1)
        new = (drawn > 0) & free[window] & ~taken[window]
        if not new.any() or splits(taken[window], new, reach):
            continue
        taken[window] |= new
        out[window] |= new & ~_inner(drawn, BOARD / resolution)
        todo -= int(np.count_nonzero(new))
    return out


def _inner(drawn: npt.NDArray[np.uint8], depth: float) -> Mask:
    """Pixels of a box deeper in it than its boards are thick."""
    import cv2

    return np.asarray(cv2.distanceTransform(drawn, cv2.DIST_L2, 5) > max(depth, 1.0))


def splits(solid: Mask, new: Mask, radius: float) -> bool:
    """Whether something new parts places that a disc of a radius could go between before."""
    before, after = (_places(mask, radius) for mask in (solid, solid | new))
    pairs = np.unique(np.stack((before[after > 0], after[after > 0])), axis=1)
    return pairs.shape[1] > np.unique(pairs[0]).size


def _places(solid: Mask, radius: float) -> npt.NDArray[np.int32]:
    """Where the disc can be: the parts that are apart from each other, numbered from 1."""
    import cv2

    far = cv2.distanceTransform((~solid).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    free = np.asarray(far > radius)
    return np.asarray(cv2.connectedComponents(free.view(np.uint8), connectivity=4)[1])
