"""What stands at a simulated place: a raster of solid pixels, and where it lies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError
from formats.frame import Pose
from formats.grid import Geometry
from formats.plans.plan import Plan

Mask = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]
SPAN = 255  # pixels, the widest clearance that is stored
MOST_PIXELS = 100_000_000  # the sheet of a large building at 200 dots an inch is a third of that


@dataclass(frozen=True, slots=True)
class Site:
    """Solid squares in the plane; rays end at them.

    Attributes:
        geometry: of the pixels, in the plan's frame; row 0 lowest.
        solid: (rows, cols) what a ray ends at.
        clear: (rows, cols) uint8, 0 where solid, else n: the square of 2 n - 1 pixels around this
            one is free (Chebyshev distance to the nearest solid pixel, at most SPAN).
    """

    geometry: Geometry
    solid: Mask
    clear: Bytes

    @classmethod
    def of(cls, solid: Mask, resolution: float, x: float = 0.0, y: float = 0.0) -> Site:
        """A site of solid pixels (rows, cols), row 0 lowest; x, y (m) of its lower left corner."""
        geometry = Geometry(solid.shape[0], solid.shape[1], resolution, x, y)
        return cls(geometry, solid, clearance(solid))

    @classmethod
    def of_plan(cls, plan: Plan) -> Site:
        """A plan's walls, as they are drawn.

        Raises:
            FormatError: it has too many pixels. UsageError: its resolution is not known.
        """
        if plan.occupancy.size > MOST_PIXELS:
            problem = f"{plan.occupancy.size:,} pixels are too many to simulate in"
            raise FormatError(plan.path, problem, hint=f"{MOST_PIXELS:,} at most: scale it down")
        return cls.of(np.ascontiguousarray(plan.wall[::-1]), plan.scale, *plan.corner)

    def with_solid(self, solid: Mask) -> Site:
        """The same place with other things in it."""
        return replace(self, solid=solid, clear=clearance(solid))

    def pixel(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of the pixel at a place (m, the plan's frame); None outside."""
        g = self.geometry
        row, col = int(np.floor((y - g.y) / g.resolution)), int(np.floor((x - g.x) / g.resolution))
        return (row, col) if 0 <= row < g.rows and 0 <= col < g.cols else None

    def place(self, pose: Pose) -> tuple[float, float]:
        """A pose's place in pixels from the lower left corner."""
        g = self.geometry
        return (pose.x - g.x) / g.resolution, (pose.y - g.y) / g.resolution


def clearance(solid: Mask) -> Bytes:
    """Chebyshev distance to the nearest solid pixel: 0 there, 1 beside it, at most SPAN."""
    import cv2

    far = cv2.distanceTransform((~solid).view(np.uint8), cv2.DIST_C, 3)
    return np.asarray(np.clip(np.nan_to_num(far, posinf=SPAN), 0, SPAN), dtype=np.uint8)
