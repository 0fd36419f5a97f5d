"""What localisation needs of a plan: how far every place is from a wall, and where a robot fits."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes
from formats.frame import Floats
from formats.grid import Geometry
from formats.plans.file import Plan
from replay.cells import cell_layers

CELL = 0.05  # m: cells are at most this, and whole pixels or whole parts of a pixel
MOST_CELLS = 100_000_000


@dataclass(frozen=True, eq=False)
class Field:
    """A plan as a field of distances.

    Attributes:
        geometry: in the plan's own frame; its corner is the plan's, not on whole cells.
        distance: (rows, cols) float32 m to the nearest face of a wall, below 0 inside of walls; the
            mean over the cell. (A beam ends at a face: deep inside a thick wall nothing is seen.)
        free: (k,) flat indices of cells where the sensor may be: of the building, not wall.
    """

    geometry: Geometry
    distance: npt.NDArray[np.float32]
    free: npt.NDArray[np.int64]

    @property
    def area(self) -> float:
        """m² of free space."""
        return len(self.free) * self.geometry.resolution**2

    def scatter(self, count: int, rng: np.random.Generator) -> Floats:
        """Poses (count, 3) spread evenly over the free space and all headings.

        Stratified: cells and headings are spread by a lattice of rank 1 with a random start, so
        that no part of the building is left out by chance.
        """
        share = (np.arange(count) + rng.random()) / count
        cells = self.free[(share * len(self.free)).astype(np.int64)]
        rows, cols = np.divmod(cells, self.geometry.cols)
        golden = 0.6180339887498949  # headings of neighbours differ as much as they can
        yaw = 2.0 * np.pi * ((np.arange(count) * golden + rng.random()) % 1.0) - np.pi
        within, g = rng.random((2, count)), self.geometry
        x = g.x + (cols + within[0]) * g.resolution
        y = g.y + (rows + within[1]) * g.resolution
        return np.column_stack([x, y, yaw])


def build_field(plan: Plan, notes: Notes | None = None) -> Field:
    """Distances from the plan's walls, in its own frame.

    Args:
        plan: its resolution must be known.
        notes: told how the free space was found.

    Raises:
        UsageError: the plan's resolution is not known.
        FormatError: there is no free space, or too much of it.
    """
    import cv2

    parts = max(1, ceil(plan.scale / CELL - 1e-6))  # of a pixel, along a side
    pixel = plan.scale / parts
    step = max(1, floor(CELL / pixel + 1e-6))
    rows, cols = (-(-size * parts // step) for size in plan.occupancy.shape)
    if rows * cols > MOST_CELLS:
        raise FormatError(plan.path, f"{rows * cols:,} cells are too many to localise on")
    wall = np.kron(plan.wall[::-1], np.ones((parts, parts), dtype=bool))  # row 0 lowest
    # Distances are between centres of pixels: a face lies half a pixel before.
    distance = cv2.distanceTransform((~wall).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    np.subtract(distance, 0.5, out=distance)
    within = cv2.distanceTransform(wall.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    np.subtract(0.5, within, out=distance, where=wall)
    del within  # as large as the plan
    ragged = ((0, rows * step - wall.shape[0]), (0, cols * step - wall.shape[1]))
    blocks = np.pad(distance, ragged, mode="edge").reshape(rows, step, cols, step)
    mean = blocks.mean(axis=(1, 3)) * pixel
    geometry = Geometry(rows, cols, step * pixel, *plan.corner)
    layers = cell_layers(plan, geometry, notes=notes)
    free = np.flatnonzero(layers.footprint & (layers.wall == 0))
    if not free.size:
        raise FormatError(plan.path, "no free space in which a robot could be")
    return Field(geometry, mean.astype(np.float32), free)
