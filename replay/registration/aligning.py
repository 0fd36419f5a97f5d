"""align_files(): a log or map and a plan in; a placement, a picture and the answer out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.output import check_output, write_image
from formats.plans.file import Plan, open_plan
from formats.plans.placement import Placement, write_placement
from replay.drawn import taken_apart
from replay.option_ranges import check_options
from replay.registration.overlay import arrows, candidates, overlay
from replay.registration.placing import Pin, metres_of, pinned, placed, posed, seen_in
from replay.registration.register import Alignment, align, align_place, whole_of
from replay.registration.residual import Residual
from replay.registration.residual import residual as fit_residual
from replay.registration.seen import Doubles, Seen

Source = str | PathLike[str]
EXTRACTED = 12_000_000  # px: of larger sheets the ink alone is looked at
Scale = float | tuple[float, float] | Literal["free"] | None


@dataclass(frozen=True)
class Aligned:
    """The answer, what it was found from, and the files that were written."""

    alignment: Alignment
    plan: Plan
    seen: Seen
    placement: Placement
    residual: Residual | None
    written: list[Path]

    @property
    def placed(self) -> Plan:
        """The plan in the frame of the log."""
        return placed(self.plan, self.placement)

    @property
    def facts(self) -> dict[str, Any]:
        """What `--json` prints."""
        found = self.alignment.facts()
        return found if self.residual is None else {**found, "residual": self.residual.facts()}


def align_files(
    source: Source,
    prior: Source,
    *,
    output: Source | None = None,
    picture: Source | None = None,
    force: bool = False,
    scale: Scale = None,
    mirrored: bool | None = None,
    pins: Sequence[Pin] = (),
    plan_pose: Pose | None = None,
    plan_resolution: float | None = None,
    residual: bool = False,
    opened: Plan | None = None,
    notes: Notes | None = None,
    **reading: Any,
) -> Aligned:
    """Find where a plan lies under a log or a map.

    Args:
        source: a log, a map picture, or a map yaml.
        prior: the plan.
        output: gets the placement; None: not written. It is not written where none is clear.
        picture: gets the overlay, or the first four places where none is clear; None: not written.
        force: replace outputs that exist.
        scale: plan pixels a map pixel (a metre of a log), or from and to, or "free"; None: of
            the resolutions where both are known, else free.
        mirrored: whether the plan shows the building mirrored; None: tries both.
        pins: plan x, y (pixels) and map x, y (pixels or metres); two or more settle the place.
        plan_pose: of the plan's frame in the log's; settles the place.
        plan_resolution: m a pixel of the plan.
        residual: fit what the similarity leaves, too, where the place is clear.
        opened: the plan, where it is open already; None: `prior` is opened.
        notes: gets what was odd.
        reading: options of `formats.stream.survey`, for logs.

    Raises:
        FormatError: an input cannot be used, an output cannot be written.
        UsageError: options that contradict each other.
    """
    started = perf_counter()
    notes = Notes() if notes is None else notes
    asked = {"plan_resolution": plan_resolution}
    check_options(asked, asked, {"plan_resolution": (1e-6, 1e3)})
    inputs = [Path(source), Path(prior)]
    for path in (output, picture):
        if path is not None:
            check_output(path, force=force, inputs=inputs)
    plan = opened or open_plan(prior, notes, resolution=plan_resolution)
    seen, map_picture = seen_in(source, notes, **reading)
    metres = map_picture is None
    if pins or plan_pose is not None:
        if pins and plan_pose is not None:
            raise UsageError("", "--pin and --plan-pose both say the place", hint="give one")
        matrix = _posed(plan, plan_pose, map_picture) if plan_pose is not None else None
        if matrix is None:
            matrix = pinned(pins, metres=metres, mirrored=mirrored)
        found = Alignment([align_place(seen, plan.wall, matrix, str(source))], 1.0, 0.0)
    else:
        cells = _scale_in_cells(scale, plan, seen)
        if scale == "free":
            seen = replace(seen, resolution=None) if map_picture is not None else seen
        found = align_drawing(seen, plan, scale=cells, mirrored=mirrored, name=str(source))
    found = replace(found, seconds=perf_counter() - started)
    placement = _placement(found, plan, source, map_picture)
    written = []
    if output is not None and found.confident:
        write_placement(output, placement, force=force, inputs=inputs)
        written.append(Path(output))
    to_pixels = found.best.matrix @ np.linalg.inv(whole_of(seen))
    left = None
    if residual and found.confident:
        metres_a_pixel = _pixel(plan, seen, to_pixels)
        left = fit_residual(seen, plan.wall, to_pixels, metres=metres_a_pixel)
    if picture is not None:
        if left is not None:
            image = arrows(plan.grey, seen, to_pixels, left.nodes, left.moves)
        elif found.confident:
            image = overlay(plan.grey, seen, to_pixels)
        else:
            back = np.linalg.inv(whole_of(seen))
            image = candidates(plan.grey, seen, [place.matrix @ back for place in found.places])
        write_image(picture, image, force=force, inputs=inputs)
        written.append(Path(picture))
    return Aligned(found, plan, seen, placement, left, written)


def align_drawing(
    seen: Seen,
    plan: Plan,
    *,
    scale: float | tuple[float, float] | None = None,
    mirrored: bool | None = None,
    name: str = "",
) -> Alignment:
    """Find a map on the ink of a plan, and on its extracted walls where the ink does not tell.

    Furniture, hatching and text may hide a place; to extract the walls of a drawing takes longer
    than to look at its ink, so that it comes second, and not at all for very large sheets.

    Args:
        seen: what the robot saw.
        plan: as opened.
        scale, mirrored, name: as `align` takes them.

    Raises:
        FormatError: no place fits at all.
    """
    found = align(seen, plan.wall, scale=scale, mirrored=mirrored, name=name)
    if found.confident or plan.occupancy.size > EXTRACTED:
        return found
    walls = taken_apart(plan, "auto", Notes())[0]
    if walls is plan or not walls.wall.any():
        return found
    try:
        again = align(seen, walls.wall, scale=scale, mirrored=mirrored, name=name)
    except FormatError:  # of next to no walls
        return found
    return again if again.confident else found


def _pixel(plan: Plan, seen: Seen, matrix: Doubles) -> float | None:
    """Metres a pixel of the plan: by the robot's own measure, else by the plan's."""
    if seen.resolution is not None:
        return seen.resolution / float(np.hypot(matrix[0, 0], matrix[1, 0]))
    return plan.resolution


def _posed(plan: Plan, pose: Pose, picture: Plan | None) -> Doubles:
    """The matrix that --plan-pose stands for."""
    matrix = posed(plan, pose)
    if picture is None:
        return matrix
    metres = metres_of(picture)
    if metres is None:
        hint = "put a map yaml beside it, or give --pin"
        raise UsageError(picture.path, "--plan-pose is in metres, and it has none", hint=hint)
    back = np.linalg.inv(np.vstack([metres, [0.0, 0.0, 1.0]]))
    out: Doubles = matrix @ back
    return out


def _scale_in_cells(scale: Scale, plan: Plan, seen: Seen) -> float | tuple[float, float] | None:
    """The scale in plan pixels a cell."""
    a_cell = 1.0 / float(np.hypot(seen.to_cells[0, 0], seen.to_cells[1, 0]))
    if isinstance(scale, tuple):
        return scale[0] * a_cell, scale[1] * a_cell
    if isinstance(scale, float | int):
        return float(scale) * a_cell
    if scale is None and plan.resolution and seen.resolution:
        return seen.resolution / plan.resolution
    return None


def _placement(found: Alignment, plan: Plan, source: Source, picture: Plan | None) -> Placement:
    """In metres where the map's frame is known, else in the map's pixels."""
    matrix, metric = found.best.matrix, True
    if picture is not None:
        metres = metres_of(picture)
        metric = metres is not None
        if metres is not None:
            matrix = matrix @ np.vstack([metres, [0.0, 0.0, 1.0]])
    return Placement(
        matrix,
        "metres" if metric else "pixels",
        found.confident,
        plan.path.name,
        plan.inputs.get(str(plan.path), ""),
        Path(source).name,
        {"confidence": found.confidence, "score": found.best.score},
    )
