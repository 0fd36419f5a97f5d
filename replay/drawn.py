"""A drawing as a plan: its extracted walls instead of its ink, its doors and windows beside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.plan_file import Plan
from replay.cells import leaves_unknown
from replay.drawing import Drawing, extract, shows_doors

Mask = npt.NDArray[np.bool_]
PlanMethod = Literal["auto", "ink", "structural", "georgiou"]


@dataclass(frozen=True, slots=True)
class Openings:
    """Where a drawing has doors and windows: masks (H, W) of the openings in the walls."""

    doors: Mask
    windows: Mask


def taken_apart(plan: Plan, method: PlanMethod, notes: Notes) -> tuple[Plan, Openings | None]:
    """The plan whose walls are walls, and its openings where they were looked for.

    "auto" extracts the walls of drawings, which are known by their door symbols; of a plan that
    shows none (a structural plan, a map) the dark ink is wall, as it is by "ink".

    Args:
        plan: as opened.
        method: what is done with it.
        notes: told what was done.
    """
    if method == "auto":
        drawing = not leaves_unknown(plan) and shows_doors(plan.grey, plan.resolution)
        method = "structural" if drawing else "ink"
    if method == "ink":
        return plan, None
    found = extract(plan.grey, resolution=plan.resolution, method=method)
    windows = found.layers.get("windows", np.zeros_like(found.walls))
    notes.info(
        plan.path, f"a drawing: its walls and {len(found.doors)} doors extracted by {method}"
    )
    occupancy = np.where(found.walls | windows, np.int8(100), np.int8(0))
    return replace(plan, occupancy=occupancy), Openings(door_openings(found), windows)


def door_openings(drawing: Drawing) -> Mask:
    """The openings that doors shut: a bar along each shut leaf, a fifth of its width thick."""
    import cv2

    bars = np.zeros(drawing.walls.shape, dtype=np.uint8)
    for door in drawing.doors:
        ends = [tuple(round(v) for v in point) for point in (door.hinge, door.end)]
        cv2.line(bars, ends[0], ends[1], 1, max(1, round(door.width / 5)))
    return (bars > 0) & ~drawing.walls
