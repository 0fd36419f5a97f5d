"""A plan's pixels joined into the cells of a lattice: how much of each is wall, known, outside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, floor, sin
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.frame import Pose
from formats.grid import Geometry
from formats.jit import njit
from formats.plans.file import Plan

Rule = Literal["any", "majority", "fraction"]
Counted = npt.NDArray[np.uint32]
Mask = npt.NDArray[np.bool_]
GAP = 1.2  # m: openings of the outline up to this width count as closed
ENCLOSED = 0.2  # of the walls' bounding box, which an outline must enclose to be one
SPECK = 0.05  # of the largest part: smaller ones outside of it are text, not buildings
ROOM = 2.5  # m²: less is no building, but a word or a legend
TINY = 1e-6  # of a cell: a pixel's centre on a cell's edge belongs to the upper cell


@dataclass(frozen=True, slots=True)
class CellLayers:
    """What a plan says of each cell; all arrays are (rows, cols), row 0 lowest.

    Attributes:
        geometry: the lattice.
        pixels: the plan's pixels whose centres lie in the cell; 1 where only the pixel under the
            cell's centre counts; 0 beyond the picture.
        wall: those of them that are wall.
        known: those of them that say anything.
        footprint: the building, where maps are scored.
        confidence: 0 to 1, how far the plan is believed: scales the prior's log-odds. None: all of
            it wholly. With it cells of one kind have not one prior, so that no exact front and no
            re-scoring by groups holds (`uniform` is False).
    """

    geometry: Geometry
    pixels: Counted
    wall: Counted
    known: Counted
    footprint: Mask
    confidence: npt.NDArray[np.float64] | None = None

    @property
    def uniform(self) -> bool:
        """Whether all cells of one kind have one prior, as exact fronts and re-scoring need."""
        return self.confidence is None

    @property
    def outside(self) -> Mask:
        """Neither building nor wall: the prior knows nothing there (p_outside)."""
        return ~self.footprint & (self.wall == 0)

    @property
    def wall_fraction(self) -> npt.NDArray[np.float64]:
        """Wall among the known pixels, 0 where none is known."""
        return self.wall / np.maximum(self.known, 1)

    def walls(self, rule: Rule = "any") -> Mask:
        """Cells that are wall.

        any: at least one pixel is (PAPER A16). majority: more than half of the known ones are, and
        likewise for "fraction", where one answer is wanted.
        """
        if rule == "any":
            return self.wall > 0
        return 2 * self.wall > self.known


def cell_layers(
    plan: Plan,
    geometry: Geometry,
    *,
    frame: Pose | None = None,
    notes: Notes | None = None,
) -> CellLayers:
    """Join a plan's pixels into cells. A pixel belongs to the cell that its centre lies in.

    Cells that hold no pixel's centre (cells finer than the pixels) take the pixel under their own
    centre. A lattice may be finer, coarser or turned against the picture.

    Args:
        plan: its resolution must be known.
        geometry: the lattice.
        frame: pose of the lattice's frame in the frame of the plan's yaml; None: the plan's own
            frame. Another plan's `frame` puts both onto one lattice.
        notes: told how the footprint was found.

    Raises:
        UsageError: the plan's resolution is not known.
    """
    pixels, wall, known = _joined(plan, geometry, plan.frame if frame is None else frame)
    footprint = find_footprint(plan, geometry, pixels, wall, known, notes or Notes())
    return CellLayers(geometry, pixels, wall, known, footprint)


def mean_values(
    plan: Plan, values: npt.NDArray[np.floating], geometry: Geometry
) -> npt.NDArray[np.float64]:
    """Mean by cell of values (H, W) within 0 to 1, in steps of a tenth; 1 beyond the picture."""
    out = np.zeros(geometry.shape)
    for step in range(1, 11):
        over = np.where(values >= (step - 0.5) / 10, np.int8(100), np.int8(0))
        out += count_walls(replace(plan, occupancy=over), geometry) / 10
    pixels, _, _ = _joined(plan, geometry, plan.frame)
    return np.where(pixels > 0, out, 1.0)


def count_walls(
    plan: Plan, geometry: Geometry, frame: Pose | None = None
) -> npt.NDArray[np.float64]:
    """Share of each cell that is wall, (rows, cols); the arguments as of `cell_layers`."""
    pixels, wall, _ = _joined(plan, geometry, plan.frame if frame is None else frame)
    return wall / np.maximum(pixels, 1)


def _joined(plan: Plan, geometry: Geometry, frame: Pose) -> tuple[Counted, Counted, Counted]:
    """Pixels, wall pixels and known pixels of each cell."""
    pixels, wall, known = (np.zeros(geometry.shape, dtype=np.uint32) for _ in range(3))
    to_cells = _pixel_to_cell(plan, geometry, frame)
    _count(plan.occupancy, to_cells, pixels, wall, known)
    _fill(plan.occupancy, np.linalg.inv(to_cells).astype(np.float64), pixels, wall, known)
    return pixels, wall, known


def _pixel_to_cell(plan: Plan, geometry: Geometry, frame: Pose) -> npt.NDArray[np.float64]:
    """(3, 3) affine: (column, row from the top) of the picture, in pixels -> (col, row) of cells.

    Whole numbers are edges on both sides.
    """
    x, y = plan.corner
    rows = plan.occupancy.shape[0]
    picture = np.array([[plan.scale, 0, x], [0, -plan.scale, y + rows * plan.scale], [0, 0, 1]])
    turn = frame.inverse() @ plan.frame
    c, s = cos(turn.yaw), sin(turn.yaw)
    turned = np.array([[c, -s, turn.x], [s, c, turn.y], [0, 0, 1]])
    side = geometry.resolution
    lattice = np.array([[1 / side, 0, -geometry.x / side], [0, 1 / side, -geometry.y / side]])
    return np.vstack([lattice, [0, 0, 1]]) @ turned @ picture


@njit
def _count(
    occupancy: npt.NDArray[np.int8],
    to_cells: npt.NDArray[np.float64],
    pixels: Counted,
    wall: Counted,
    known: Counted,
) -> None:
    """Count each pixel in the cell of its centre."""
    rows, cols = pixels.shape
    for r in range(occupancy.shape[0]):
        for c in range(occupancy.shape[1]):
            u, v = c + 0.5, r + 0.5
            col = floor(to_cells[0, 0] * u + to_cells[0, 1] * v + to_cells[0, 2] + TINY)
            row = floor(to_cells[1, 0] * u + to_cells[1, 1] * v + to_cells[1, 2] + TINY)
            if 0 <= row < rows and 0 <= col < cols:
                pixels[row, col] += 1
                if occupancy[r, c] >= 0:
                    known[row, col] += 1
                    if occupancy[r, c] > 50:
                        wall[row, col] += 1


@njit
def _fill(
    occupancy: npt.NDArray[np.int8],
    to_pixels: npt.NDArray[np.float64],
    pixels: Counted,
    wall: Counted,
    known: Counted,
) -> None:
    """Give cells without a pixel's centre the pixel under their own centre."""
    high, wide = occupancy.shape
    for row in range(pixels.shape[0]):
        for col in range(pixels.shape[1]):
            if pixels[row, col] > 0:
                continue
            u, v = col + 0.5, row + 0.5
            c = floor(to_pixels[0, 0] * u + to_pixels[0, 1] * v + to_pixels[0, 2] + TINY)
            r = floor(to_pixels[1, 0] * u + to_pixels[1, 1] * v + to_pixels[1, 2] - TINY)
            if 0 <= r < high and 0 <= c < wide:
                pixels[row, col] = 1
                if occupancy[r, c] >= 0:
                    known[row, col] = 1
                    if occupancy[r, c] > 50:
                        wall[row, col] = 1


def find_footprint(
    plan: Plan, geometry: Geometry, pixels: Counted, wall: Counted, known: Counted, notes: Notes
) -> Mask:
    """Cells of the building.

    A map that leaves a region unknown: its known part, that is cells of which at least half is
    known, and walls. Else what cannot be reached from beyond the picture once gaps of 1.2 m are
    closed. Else the whole picture. The choice goes to the notes.
    """
    inside = pixels > 0
    if leaves_unknown(plan):
        return (inside & (2 * known >= pixels)) | (wall > 0)
    outline = enclosed(inside, wall > 0, 0.5 * GAP / geometry.resolution)
    if outline is not None:
        area = outline.sum() * geometry.resolution**2
        if area < ROOM:
            what = f"what is drawn in it encloses {area:.1f} m², less than a room"
            notes.warn(plan.path, f"{what}: is it a plan, the right page and the right scale?")
        notes.info(plan.path, f"footprint: the {area:.0f} m² inside the outer walls")
        return outline
    notes.info(plan.path, "footprint: the whole picture, since its outer walls are not closed")
    return inside


def leaves_unknown(plan: Plan) -> bool:
    """Whether a region is unknown: 1 % of the picture or more, thin seams along lines aside."""
    import cv2

    unknown = (plan.occupancy < 0).view(np.uint8)
    if 100 * int(cv2.countNonZero(unknown)) < unknown.size:
        return False
    region = cv2.erode(unknown, np.ones((5, 5), np.uint8))
    return 100 * int(cv2.countNonZero(region)) >= unknown.size


def enclosed(inside: Mask, wall: Mask, radius: float) -> Mask | None:
    """Cells that cannot be reached from outside by a disc, walls among them.

    Args:
        inside: cells of the picture.
        wall: cells of wall.
        radius: of the disc in cells; it does not fit through gaps narrower than its diameter.

    Returns:
        None where the walls enclose next to nothing.
    """
    import cv2

    if not wall.any():
        return None
    margin = int(radius) + 2  # so that the disc can walk round the picture
    walls = np.pad(wall, margin).view(np.uint8)
    clearance = cv2.distanceTransform(1 - walls, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    _, parts = cv2.connectedComponents((clearance > radius).astype(np.uint8), connectivity=4)
    centres = (parts == parts[0, 0]).astype(np.uint8)
    reach = cv2.distanceTransform(1 - centres, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    building = ((reach > radius) | (walls > 0)).astype(np.uint8)
    _, parts, stats, _ = cv2.connectedComponentsWithStats(building, connectivity=8)
    areas = stats[1:, cv2.CC_STAT_AREA]
    kept = np.concatenate([[False], areas >= SPECK * areas.max()])
    inner = (slice(margin, -margin), slice(margin, -margin))
    outline: Mask = kept[parts[inner]] & inside
    rows, cols = np.flatnonzero(wall.any(axis=1)), np.flatnonzero(wall.any(axis=0))
    box = (rows[-1] - rows[0] + 1) * (cols[-1] - cols[0] + 1)
    return outline if (outline & ~wall).sum() >= ENCLOSED * box else None


def truth_cells(
    truth: Plan,
    geometry: Geometry,
    rule: Rule = "any",
    *,
    frame: Pose | None = None,
    notes: Notes | None = None,
) -> tuple[Mask, Mask]:
    """The truth by cell: which are wall, and which are scored.

    Args:
        truth: a map or plan, in the same yaml frame as the lattice's plan.
        geometry: the lattice.
        rule: as for the prior: any wall pixel makes a wall by default.
        frame: the lattice's frame, that is the prior plan's `frame`.
        notes: told how the scored region was found.

    Returns:
        wall, scored: (rows, cols) each.
    """
    layers = cell_layers(truth, geometry, frame=frame, notes=notes)
    return layers.walls(rule), layers.footprint
