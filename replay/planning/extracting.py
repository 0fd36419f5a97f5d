"""What `replay plan` does: a drawing taken apart, shown, written for others, and scored."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.errors import Path as AnyPath
from formats.grid import Geometry, Grid, logit
from formats.output import check_output, is_folder, write_image, write_text
from formats.plans.annotations import read_truth
from formats.plans.edits import PlanEdits, read_plan_edits
from formats.plans.file import Plan, open_plan
from formats.plans.map_file import write_map
from replay.drawing import Drawing, Method, extract
from replay.drawing.editing import edited
from replay.planning.pictures import overlay
from replay.planning.scores import score

DOOR = 0.85  # m, the middle of the door widths that are built, 0.7 to 1.0
SPREAD = 0.15  # m, to either side of it


@dataclass(frozen=True, slots=True)
class Reading:
    """A plan file taken apart.

    Attributes:
        plan: as opened.
        drawing: walls, doors, outline and removed ink.
        resolution: m a pixel; None where neither the file nor a door tells.
        how: where the resolution comes from.
        seconds: that the extraction took.
    """

    plan: Plan
    drawing: Drawing
    resolution: float | None
    how: str
    seconds: float


def read_drawing(
    plan: Plan,
    method: Method = "structural",
    edits: PlanEdits | None = None,
    notes: Notes | None = None,
) -> Reading:
    """Take a plan apart; where its scale is not known, its doors estimate it.

    Args:
        plan: as opened.
        method: "structural" or "georgiou".
        edits: by hand, on what was found.
        notes: told where an edit finds nothing to do.

    Raises:
        FormatError: an edit does not fit the plan.
    """
    steps = edits.on(plan) if edits is not None else ()
    start = perf_counter()
    drawing = extract(plan.grey, resolution=plan.resolution, method=method)
    seconds = perf_counter() - start
    if edits is not None:
        drawing = edited(drawing, edits, steps, Notes() if notes is None else notes)
    if notes is not None and not drawing.walls.any():
        notes.warn(plan.path, "no wall is found in it; is it a plan, and the right page?")
    if plan.resolution is not None:
        return Reading(plan, drawing, plan.resolution, "given", seconds)
    if drawing.doors and drawing.door_width > 0:
        how = f"from door widths, +-{SPREAD / DOOR:.0%}"
        return Reading(plan, drawing, DOOR / drawing.door_width, how, seconds)
    return Reading(plan, drawing, None, "not known: no door tells it", seconds)


def geojson(reading: Reading) -> str:
    """Walls and doors as polygons, in metres of the plan's frame where the scale is known.

    Without a scale coordinates are pixels, y down, and `units` says so.
    """
    import cv2

    drawing, scale = reading.drawing, reading.resolution
    rows = drawing.walls.shape[0]
    corner = reading.plan.corner

    def place(points: npt.NDArray[Any]) -> list[list[float]]:
        ring = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if scale is not None:
            # Pixel centres are at whole numbers; the picture's lower left corner is `corner`.
            x = corner[0] + (ring[:, 0] + 0.5) * scale
            y = corner[1] + (rows - 0.5 - ring[:, 1]) * scale
            ring = np.column_stack((x, y))
        return [[round(a, 4), round(b, 4)] for a, b in [*ring.tolist(), ring[0].tolist()]]

    def feature(kind: str, rings: list[list[list[float]]], **facts: Any) -> dict[str, Any]:
        shape = {"type": "Polygon", "coordinates": rings}
        return {"type": "Feature", "properties": {"kind": kind, **facts}, "geometry": shape}

    features = []
    contours, family = cv2.findContours(
        drawing.walls.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE
    )
    for i, contour in enumerate(contours):
        if family[0][i][3] >= 0 or len(contour) < 3:  # a hole belongs to its wall
            continue
        holes, at = [], int(family[0][i][2])
        while at >= 0:
            holes.append(contours[at])
            at = int(family[0][at][0])
        rings = [place(ring) for ring in (contour, *holes) if len(ring) >= 3]
        features.append(feature("wall", rings))
    for door in drawing.doors:
        width = door.width * scale if scale is not None else door.width
        facts = {"type": door.kind, "width": round(width, 4), "confidence": door.confidence}
        features.append(feature("door", [place(door.sector())], **facts))
    units = "m" if scale is not None else "px"
    return json.dumps({"type": "FeatureCollection", "units": units, "features": features})


def wall_grid(reading: Reading, resolution: float) -> tuple[Grid, npt.NDArray[np.bool_]]:
    """Walls as a map, one cell a pixel, and the cells that are known: the footprint."""
    rows, cols = reading.drawing.walls.shape
    walls = reading.drawing.walls[::-1]
    values = np.where(walls, logit(0.01), logit(0.99))
    grid = Grid(Geometry(rows, cols, resolution, *reading.plan.corner), values)
    return grid, reading.drawing.outline[::-1] | walls


def plan(
    path: AnyPath,
    *,
    method: Method = "structural",
    truth: AnyPath | None = None,
    edits: AnyPath | None = None,
    output: AnyPath | None = None,
    plan_resolution: float | None = None,
    plan_page: int = 1,
    plan_dpi: float | None = None,
    drawing_scale: float | None = None,
    plan_distance: tuple[float, float, float, float, float] | None = None,
    force: bool = False,
    notes: Notes | None = None,
) -> dict[str, Any]:
    """Walls, doors and outline of a drawing: pictures, map, GeoJSON and, with a truth, scores.

    Args:
        path: the drawing.
        method: "structural" or "georgiou".
        truth: CVC-FP's SVG, mlstructfp's JSON, or a mask.
        edits: a file of edits by hand, see `formats.plans.edits`.
        output: stem of the files' names; None: the drawing's, in the current folder.
        plan_resolution: m a pixel.
        plan_page: of a PDF, from 1.
        plan_dpi: pixels an inch that a PDF or SVG is rendered at, or a picture was scanned at.
        drawing_scale: 200 of 1:200.
        plan_distance: x1, y1, x2, y2 in pixels, and the m between.
        force: replace files that exist.
        notes: gets what was odd.

    Returns:
        what `replay plan --json` prints.

    Raises:
        FormatError: the drawing, the truth or the edits cannot be read, or a file cannot be
            written.
    """
    notes = Notes() if notes is None else notes
    inputs = [path, *(other for other in (truth, edits) if other)]
    stem = Path(output) if output else Path(Path(path).stem)
    if is_folder(stem):
        stem = stem / Path(path).stem
    names = {kind: Path(f"{stem}_{kind}") for kind in ("overlay.png", "plan.geojson", "walls.pgm")}
    for name in names.values():
        check_output(name, force=force, inputs=inputs)
    by_hand = read_plan_edits(edits) if edits else None
    opened = open_plan(
        path,
        notes,
        resolution=plan_resolution,
        page=plan_page - 1,
        dpi=plan_dpi,
        drawing_scale=drawing_scale,
        distance=plan_distance,
    )
    reading = read_drawing(opened, method, by_hand, notes)
    drawing = reading.drawing
    facts: dict[str, Any] = {
        "plan": str(path),
        "method": method,
        "wall_pixels": int(drawing.walls.sum()),
        "doors_count": len(drawing.doors),
        "resolution": reading.resolution,
        "resolution_from": reading.how,
        "edits": len(by_hand.edits) if by_hand else 0,
        "seconds": round(reading.seconds, 3),
    }
    if truth is not None:
        shape = (drawing.walls.shape[0], drawing.walls.shape[1])
        facts |= score(drawing, read_truth(Path(truth), shape, Path(path)))
    write_image(names["overlay.png"], overlay(reading.drawing), force=force, inputs=inputs)
    write_text(names["plan.geojson"], geojson(reading), force=force, inputs=inputs)
    written = [names["overlay.png"], names["plan.geojson"]]
    if reading.resolution is not None:
        grid, known = wall_grid(reading, reading.resolution)
        written += write_map(
            f"{stem}_walls", grid, known, frame=opened.frame, force=force, inputs=inputs
        )
    return {**facts, "written": [str(name) for name in written]}


def counted(number: int, thing: str) -> str:
    """One door, two doors."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


LINES: dict[str, Callable[[dict[str, Any]], str]] = {
    "plan": lambda f: (
        f"{Path(f['plan']).name}: {counted(f['doors_count'], 'door')}, by {f['method']}"
        + (f", {counted(f['edits'], 'edit')} by hand" if f["edits"] else "")
    ),
    "scale": lambda f: (
        f"{f['resolution']:.4f} m/px ({f['resolution_from']})"
        if f["resolution"] is not None
        else f["resolution_from"]
    ),
}


def report(facts: dict[str, Any]) -> str:
    """The same for a person."""
    lines = [f"{word:<8}{line(facts)}" for word, line in LINES.items()]
    for part in ("walls", "doors", "doors_hinge"):
        if part in facts:
            values = "   ".join(f"{name} {value:.3f}" for name, value in facts[part].items())
            lines.append(f"{part:<12}{values}")
    return "\n".join([*lines, *(f"wrote   {name}" for name in facts["written"])])
