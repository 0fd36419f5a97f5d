"""A plan or map as it was read: what of it is wall, and where it lies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from formats.errors import UsageError
from formats.frame import Pose
from formats.plans.raster import Grey

Cells = npt.NDArray[np.int8]
Mask = npt.NDArray[np.bool_]
Extent = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Plan:
    """A plan or map: pixels in rows, row 0 on top, and their place.

    The plan's own frame is the yaml's frame turned by the origin's yaw, so that the picture is
    axis-aligned in it; `frame` is its pose in the yaml's frame.

    Attributes:
        path: of the picture.
        grey: (H, W) uint8, 0 black to 255 white, as it is shown.
        occupancy: (H, W) int8, P(occupied) in per cent, -1 unknown (as OccupancyGrid has it).
        resolution: m a pixel, None where it is not known.
        origin: pose of the picture's lower left corner in the yaml's frame: m, m, rad.
        placed: a yaml or an option says the origin.
        inputs: path -> SHA-256 of every file that was read.
        in_log: it is a map in a log, which is an input but too large to keep with results.
    """

    path: Path
    grey: Grey
    occupancy: Cells
    resolution: float | None
    origin: Pose
    placed: bool
    inputs: dict[str, str]
    in_log: bool = False

    @property
    def wall(self) -> Mask:
        """(H, W) pixels that are wall: P(occupied) above one half."""
        return self.occupancy > 50

    @property
    def known(self) -> Mask:
        """(H, W) pixels that say anything."""
        return self.occupancy >= 0

    @property
    def frame(self) -> Pose:
        """Pose of the plan's frame in the yaml's frame: a turn only."""
        return Pose(0.0, 0.0, self.origin.yaw)

    @property
    def corner(self) -> tuple[float, float]:
        """x, y in m of the picture's lower left corner in the plan's frame."""
        if self.origin.yaw == 0.0:
            return self.origin.x, self.origin.y
        x, y, _ = self.frame.inverse() @ self.origin
        return x, y

    @property
    def scale(self) -> float:
        """The resolution, m a pixel, where the work cannot go on without it.

        Raises:
            UsageError: it is not known.
        """
        if self.resolution is None:
            hint = "give --plan-resolution M_PER_PIXEL, or a map yaml beside it"
            raise UsageError(self.path, "nothing says how large a pixel is", hint=hint)
        return self.resolution

    @property
    def extent(self) -> Extent:
        """x0, y0, x1, y1 in m in the plan's frame.

        Raises:
            UsageError: the resolution is not known.
        """
        x, y = self.corner
        rows, cols = self.occupancy.shape
        return x, y, x + cols * self.scale, y + rows * self.scale


def overlap(a: Extent, b: Extent) -> float:
    """Area in m² that two extents (x0, y0, x1, y1) share; 0 where they lie apart."""
    wide = min(a[2], b[2]) - max(a[0], b[0])
    high = min(a[3], b[3]) - max(a[1], b[1])
    return wide * high if wide > 0 and high > 0 else 0.0
