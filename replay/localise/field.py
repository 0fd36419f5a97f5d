"""What localisation needs of a plan: how far every place is from a wall, and where a robot fits."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes
from formats.frame import Floats
from formats.grid import Geometry
from formats.plans.file import Plan
from replay.cells import cell_layers

Mask = npt.NDArray[np.bool_]
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
    parts = max(1, ceil(plan.scale / CELL - 1e-6))  # of a pixel, along a side
    pixel = plan.scale / parts
    step = max(1, floor(CELL / pixel + 1e-6))
    rows, cols = (-(-size * parts // step) for size in plan.occupancy.shape)
    if rows * cols > MOST_CELLS:
        raise FormatError(plan.path, f"{rows * cols:,} cells are too many to localise on")
    wall = plan.wall[::-1].repeat(parts, axis=0).repeat(parts, axis=1)  # row 0 lowest
    # Distances are between centres of pixels: a face lies half a pixel before. One side of the
    # faces at a time, since a sheet's distances take four times its own size.
    mean = _means(~wall, step) - _means(wall, step) + _faces(wall, step)
    mean *= pixel
    geometry = Geometry(rows, cols, step * pixel, *plan.corner)
    layers = cell_layers(plan, geometry, notes=notes)
    free = np.flatnonzero(layers.footprint & (layers.wall == 0))
    if not free.size:
        raise FormatError(plan.path, "no free space in which a robot could be")
    return Field(geometry, mean, free)


def _means(mask: Mask, step: int) -> npt.NDArray[np.float32]:
    """Mean over squares of `step` of the distance, px, from pixels of a mask to the others."""
    import cv2

    far = cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return block_means(np.asarray(far, np.float32), step)


def _faces(wall: Mask, step: int) -> npt.NDArray[np.float32]:
    """What the half pixels add: -0.5 of squares that are free, 0.5 of those that are wall."""
    return block_means(wall, step) - np.float32(0.5)


def block_means(values: npt.NDArray[Any], step: int) -> npt.NDArray[np.float32]:
    """Means of squares of `step` values; what sticks out goes on as its last row and column do.

    Without a copy of the whole, which may be a sheet of hundreds of megapixels.
    """
    out = np.empty(tuple(-(-size // step) for size in values.shape), dtype=np.float32)
    for row in range(out.shape[0]):
        band = values[row * step : (row + 1) * step]
        ragged = ((0, step - band.shape[0]), (0, out.shape[1] * step - band.shape[1]))
        blocks = np.pad(band, ragged, mode="edge").reshape(step, -1, step)
        out[row] = blocks.mean(axis=(0, 2), dtype=np.float64)
    return out
