"""Grids as Rerun draws them: where they lie, shades of cells, and named classes of cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import rerun as rr

from formats.grid import Geometry
from replay.pictures import FALSE, FOUND, MISSED, thinning

PLAN_CLASSES = (
    ("wall of the plan", (60, 60, 60, 90)),
    ("door of the plan", (86, 180, 233, 200)),
    ("window of the plan", (0, 158, 115, 200)),
)
ERROR_CLASSES = (("found", FOUND), ("missed", MISSED), ("false", FALSE))


def placed(geometry: Geometry) -> Any:
    """Cells to metres of the plan's frame."""
    cell = geometry.resolution * thinning(geometry.shape)
    return rr.Transform3D(translation=[geometry.x, geometry.y, 0], scale=cell)


def classes(classes: Sequence[tuple[str, tuple[int, ...]]]) -> Any:
    """Names and colours of the classes of cells from 1; 0 is clear."""
    clear = rr.AnnotationInfo(0, color=(0, 0, 0, 0))
    named = [rr.AnnotationInfo(i, name, colour) for i, (name, colour) in enumerate(classes, 1)]
    return rr.AnnotationContext([clear, *named])


def greys(cells: npt.NDArray[np.uint8], draw_order: float) -> Any:
    """Shades of cells, not as PNG: of those that change, the web viewer shows none."""
    thin = thinning((cells.shape[0], cells.shape[1]))
    return rr.Image(cells[::thin, ::thin], color_model="L", draw_order=draw_order)


def segments(cells: npt.NDArray[np.uint8], draw_order: float) -> Any:
    """Classes of cells; clear ones let through what lies below, which a PNG does not everywhere."""
    thin = thinning((cells.shape[0], cells.shape[1]))
    return rr.SegmentationImage(cells[::thin, ::thin], draw_order=draw_order)
