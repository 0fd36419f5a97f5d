"""Edits by hand on a drawing that was taken apart: walls, windows, doors and regions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import hypot

import cv2
import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.plans.edits import Edit, PlanEdits
from replay.drawing.shapes import Door, Drawing, Mask

OPENED = 0.6  # of a door's width: thickness of the wall that an added door opens
REACH = 0.5  # of its width: how far from a door's sector a place still means it
SUB = 4  # bits of sub-pixel places


def edited(drawing: Drawing, edits: PlanEdits, steps: Iterable[Edit], notes: Notes) -> Drawing:
    """The drawing after edits, in their order.

    What an edit takes away from walls goes to the layer "edited", so that it can be seen.

    Args:
        drawing: as extracted; it stays as it is.
        edits: the file, for what is said of it.
        steps: its edits in pixels, `edits.on(plan)`.
        notes: told of a door to be removed where there is none.
    """
    steps, walls = list(steps), drawing.walls.copy()
    windows = drawing.layers.get("windows", np.zeros_like(walls)).copy()
    doors = list(drawing.doors)
    for step in steps:
        match step.thing, step.verb:
            case "wall", "add":
                band = banded(walls.shape, step)
                walls |= band
                windows &= ~band
            case "wall", _:
                band = banded(walls.shape, step)
                walls &= ~band
                windows &= ~band
            case "window", "add":
                band = banded(walls.shape, step)
                windows |= band
                walls &= ~band
            case "window", _:
                windows &= ~banded(walls.shape, step)
            case "door", "add":
                door = added(step)
                gap = banded(walls.shape, replace(step, thick=OPENED * door.width))
                walls &= ~gap
                windows &= ~gap
                doors.append(door)
            case "door", _:
                doors = without(doors, step, edits, notes)
            case "region", verb:
                if verb != "add":
                    inside = region(walls.shape, step)
                    walls &= ~inside
                    windows &= ~inside
                    doors = [door for door in doors if not covers(inside, door)]
    inside, outside = regions(walls.shape, steps)
    outline = (drawing.outline | inside) & ~outside | walls
    layers = _layers(drawing, walls, windows)
    return replace(drawing, walls=walls, doors=doors, outline=outline, layers=layers)


def regions(shape: tuple[int, ...], steps: Iterable[Edit]) -> tuple[Mask, Mask]:
    """What the edits make building, and what they make none: (H, W) each; the last one holds."""
    inside, outside = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    for step in steps:
        if step.thing == "region":
            here = region(shape, step)
            inside = inside & ~here if step.verb == "remove" else inside | here
            outside = outside | here if step.verb == "remove" else outside & ~here
    return inside, outside


def banded(shape: tuple[int, ...], step: Edit) -> Mask:
    """(H, W): the band of a thickness along a way, square at its ends, mitred by discs."""
    out = np.zeros(shape, dtype=np.uint8)
    half = step.thick / 2
    for a, b in zip(step.points[:-1], step.points[1:], strict=True):
        long = hypot(*(b - a))
        if long == 0:
            continue
        across = np.array([a[1] - b[1], b[0] - a[0]]) * (half / long)
        _fill(out, np.array([a + across, b + across, b - across, a - across]))
    for x, y in step.points[1:-1]:
        centre = round(x * (1 << SUB)), round(y * (1 << SUB))
        cv2.circle(out, centre, round(half * (1 << SUB)), 1, -1, cv2.LINE_8, SUB)
    return out > 0


def region(shape: tuple[int, ...], step: Edit) -> Mask:
    """(H, W): inside of a region."""
    out = np.zeros(shape, dtype=np.uint8)
    _fill(out, step.points)
    return out > 0


def added(step: Edit) -> Door:
    """The door of an edit."""
    hinge, end = ((float(x), float(y)) for x, y in step.points)
    return Door(hinge, end, step.swing)


def without(doors: list[Door], step: Edit, edits: PlanEdits, notes: Notes) -> list[Door]:
    """All doors but the one at a place; a warning where there is none."""
    x, y = step.points[0]
    far = [
        -cv2.pointPolygonTest(door.sector().astype(np.float32), (float(x), float(y)), True)
        for door in doors
    ]
    at = int(np.argmin(far)) if far else -1
    if at < 0 or far[at] > REACH * doors[at].width:
        notes.warn(edits.path, f"line {step.line}: there is no door at this place to remove")
        return doors
    return doors[:at] + doors[at + 1 :]


def covers(inside: Mask, door: Door) -> bool:
    """Whether the middle of a door's opening lies in a region."""
    col = round((door.hinge[0] + door.end[0]) / 2)
    row = round((door.hinge[1] + door.end[1]) / 2)
    rows, cols = inside.shape
    return 0 <= row < rows and 0 <= col < cols and bool(inside[row, col])


def _fill(out: npt.NDArray[np.uint8], corners: npt.NDArray[np.float64]) -> None:
    cv2.fillPoly(out, [np.rint(corners * (1 << SUB)).astype(np.int32)], 1, shift=SUB)


def _layers(drawing: Drawing, walls: Mask, windows: Mask) -> dict[str, Mask]:
    """The layers of ink: what became wall is wall, what is none any more was edited."""
    if not drawing.layers:
        return {"windows": windows} if windows.any() else {}
    gone = drawing.layers.get("walls", drawing.walls) & ~walls
    gone |= drawing.layers.get("windows", np.zeros_like(walls)) & ~windows & ~walls
    drawn = np.logical_or.reduce(list(drawing.layers.values()))
    out = {
        name: layer & ~walls & ~windows
        for name, layer in drawing.layers.items()
        if name not in ("walls", "windows")
    }
    out["walls"] = walls & drawn
    out["windows"] = windows
    out["edited"] = gone & ~windows
    return out
