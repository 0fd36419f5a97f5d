"""A drawing as a plan: its extracted walls instead of its ink, its doors and windows beside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.plans.edits import PlanEdits
from formats.plans.file import Plan
from replay.cells import leaves_unknown
from replay.drawing import Drawing, extract, shows_doors
from replay.drawing.confidence import confidence
from replay.drawing.editing import edited, regions

Mask = npt.NDArray[np.bool_]
PlanMethod = Literal["auto", "ink", "structural", "georgiou"]


@dataclass(frozen=True, slots=True)
class Openings:
    """What a drawing says beside its walls: masks (H, W).

    Attributes:
        doors, windows: the openings in its walls.
        inside, outside: regions that edits by hand made building, and that they made none.
        confidence: 0 to 1, see `replay.drawing.confidence`; what was edited by hand is sure.
    """

    doors: Mask
    windows: Mask
    inside: Mask
    outside: Mask
    confidence: npt.NDArray[np.float32]


def taken_apart(
    plan: Plan, method: PlanMethod, notes: Notes, edits: PlanEdits | None = None
) -> tuple[Plan, Openings | None]:
    """The plan whose walls are walls, and its openings where they were looked for.

    "auto" extracts the walls of drawings, which are known by their door symbols; of a plan that
    shows none (a structural plan, a map) the dark ink is wall, as it is by "ink".

    Args:
        plan: as opened.
        method: what is done with it.
        notes: told what was done.
        edits: by hand, on whatever was found.

    Raises:
        FormatError: an edit does not fit the plan.
    """
    if method == "auto":
        drawing = not leaves_unknown(plan) and shows_doors(plan.grey, plan.resolution)
        method = "structural" if drawing else "ink"
    if method == "ink":
        if edits is None:
            return plan, None
        found = Drawing(plan.wall, [], np.zeros_like(plan.wall), {})
    else:
        found = extract(plan.grey, resolution=plan.resolution, method=method)
        notes.info(
            plan.path, f"a drawing: its walls and {len(found.doors)} doors extracted by {method}"
        )
    sure = confidence(found) if method != "ink" else np.ones(plan.wall.shape, dtype=np.float32)
    before = found
    steps = edits.on(plan) if edits is not None else ()
    if edits is not None:
        found = edited(found, edits, steps, notes)
        notes.info(plan.path, f"edited by hand: {len(edits.edits)} edits")
        plan = replace(plan, inputs={**plan.inputs, str(edits.path): edits.sha256})
    sure[before.walls != found.walls] = 1.0
    windows = found.layers.get("windows", np.zeros_like(found.walls))
    wall = found.walls | windows
    occupancy = np.where(wall, np.int8(100), np.int8(0))
    if method == "ink":  # what is neither wall nor made free stays as it is, perhaps unknown
        occupancy = np.where(wall == plan.wall, plan.occupancy, occupancy)
    openings = Openings(door_openings(found), windows, *regions(wall.shape, steps), sure)
    return replace(plan, occupancy=occupancy), openings


def door_openings(drawing: Drawing) -> Mask:
    """The openings that doors shut: a bar along each shut leaf, a fifth of its width thick."""
    import cv2

    bars = np.zeros(drawing.walls.shape, dtype=np.uint8)
    for door in drawing.doors:
        ends = [tuple(round(v) for v in point) for point in (door.hinge, door.end)]
        cv2.line(bars, ends[0], ends[1], 1, max(1, round(door.width / 5)))
    return (bars > 0) & ~drawing.walls
