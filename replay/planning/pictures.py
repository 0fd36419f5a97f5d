"""The picture of a drawing taken apart: walls, doors with their triangles, outline, removed ink."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing import Drawing

Pixels = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]
# Red, green, blue; after Okabe and Ito, told apart with any colour vision.
PAPER: Colour = (255, 255, 255)
OUTLINE: Colour = (226, 238, 247)
WALLS: Colour = (0, 0, 0)
TRIANGLE: Colour = (213, 94, 0)
LAYERS: dict[str, Colour] = {
    "doors": (0, 114, 178),
    "windows": (86, 180, 233),
    "stairs": (0, 158, 115),
    "furniture": (230, 159, 0),
    "text": (204, 121, 167),
    "dimensions": (170, 140, 90),
    "hatching": (150, 150, 150),
    "frame": (190, 190, 190),
    "title block": (190, 190, 190),
    "edited": (240, 60, 60),
    "removed": (230, 159, 0),
}
LEGEND = 28  # rows of the legend for a picture of 1000 columns


def overlay(drawing: Drawing) -> Pixels:
    """The drawing with what was found: (H + legend, W, 3), blue green red as OpenCV has it.

    Ink that is no wall keeps the colour of what it was taken for; a legend under the picture
    names the colours that are in it.
    """
    colours, shown = [PAPER, OUTLINE], dict[str, Colour]()
    kind = drawing.outline.astype(np.uint8)
    for name, mask in drawing.layers.items():
        if name != "walls" and mask.any():
            shown[name] = LAYERS.get(name, LAYERS["removed"])
            np.putmask(kind, mask, len(colours))
            colours.append(shown[name])
    if drawing.walls.any():
        shown = {"walls": WALLS, **shown}
        np.putmask(kind, drawing.walls, len(colours))
        colours.append(WALLS)
    table = np.zeros((256, 1, 3), dtype=np.uint8)
    table[: len(colours), 0] = colours
    out = np.asarray(cv2.applyColorMap(kind, table), dtype=np.uint8)
    for door in drawing.doors:
        thick = max(1, round(door.width / 20))
        corners = [np.rint(door.triangle()).astype(np.int32)]
        cv2.polylines(out, corners, True, TRIANGLE, thick, cv2.LINE_AA)
    if drawing.doors:
        shown["door triangles"] = TRIANGLE
    picture = np.vstack((out, legend({**shown, "outline": OUTLINE}, out.shape[1])))
    return np.ascontiguousarray(picture[..., ::-1])


def legend(shown: dict[str, Colour], width: int) -> Pixels:
    """Swatches with names, as many rows as they need: (rows, width, 3) red green blue."""
    unit = max(10, round(LEGEND * min(width, 3000) / 1000))
    size = unit / 45
    places, x, row = [], unit // 2, 0
    for name in shown:
        (wide, _), _ = cv2.getTextSize(name, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
        step = wide + 2 * unit
        if x + step > width and x > unit // 2:
            x, row = unit // 2, row + 1
        places.append((x, row * unit))
        x += step
    out = np.full(((row + 1) * unit, width, 3), 255, dtype=np.uint8)
    for (name, colour), (x, y) in zip(shown.items(), places, strict=True):
        corner, side = (x, y + unit // 4), unit // 2
        cv2.rectangle(out, corner, (x + side, y + unit // 4 + side), colour, -1)
        cv2.rectangle(out, corner, (x + side, y + unit // 4 + side), (90, 90, 90), 1)
        at = (x + unit, y + unit // 4 + side)
        cv2.putText(
            out, name, at, cv2.FONT_HERSHEY_SIMPLEX, size, (40, 40, 40), max(1, unit // 30), 16
        )
    return out
