"""Truth of drawings: CVC-FP's SVG polygons, MLSTRUCT-FP's JSON of walls, plain masks.

Everything is in the drawing's pixels, x to the right and y down, the centre of the first pixel
at (0, 0). Sources: de las Heras et al. (2015), CVC-FP; Pizarro et al. (2023), MLSTRUCT-FP.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError

Mask = npt.NDArray[np.bool_]
Polygon = npt.NDArray[np.float64]
LARGEST = 64 << 20  # bytes of an annotation; CVC-FP's largest has 60 kB


@dataclass(frozen=True, slots=True)
class Truth:
    """What an annotator says a drawing shows.

    Attributes:
        walls: (H, W), class Wall alone; windows stand apart.
        doors, windows, rooms: polygons (n, 2) of x, y in px; a door is what its leaf
            sweeps, with the opening in the wall.
        has_doors: whether doors were annotated at all; a mask of walls says nothing of them.
    """

    walls: Mask
    doors: tuple[Polygon, ...] = ()
    windows: tuple[Polygon, ...] = ()
    rooms: tuple[Polygon, ...] = ()
    has_doors: bool = True


def filled(polygons: Sequence[Polygon], shape: tuple[int, int]) -> Mask:
    """The union of polygons as a mask (H, W), outlines included; corners rounded to pixels."""
    import cv2

    out = np.zeros(shape, dtype=np.uint8)
    for polygon in polygons:
        cv2.fillPoly(out, [np.rint(polygon).astype(np.int32)], 1)
    return out.astype(np.bool_)


def read_truth(path: str | Path, shape: tuple[int, int], drawing: str | Path = "") -> Truth:
    """The truth of a drawing, by what the file holds: SVG, JSON or a picture.

    Args:
        path: a CVC-FP SVG, an MLSTRUCT-FP JSON, or a picture whose dark pixels are walls.
        shape: (H, W) of the drawing.
        drawing: the drawing's file name, by which a JSON of many drawings is searched.

    Raises:
        FormatError: not readable, not of this drawing, or of another size.
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error
    if len(data) > LARGEST:
        raise FormatError(path, f"an annotation of more than {LARGEST >> 20} MiB")
    head = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1]
    if head == b"<":
        return _from_svg(path, data, shape)
    if head == b"{":
        return _from_json(path, data, shape, Path(drawing).name)
    return _from_mask(path, data, shape)


def _from_svg(path: str | Path, data: bytes, shape: tuple[int, int]) -> Truth:
    """CVC-FP: <polygon class="Wall" points="x,y x,y ..."> with <width> and <height> beside."""
    if b"<!ENTITY" in data:
        raise FormatError(path, "an SVG that defines entities is not read")
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise FormatError(path, f"broken XML: {error}") from error
    found: dict[str, list[Polygon]] = {}
    size: dict[str, str] = {}
    for element in root.iter():
        tag = element.tag.rpartition("}")[2]
        if tag in ("width", "height"):
            size[tag] = (element.text or "").strip()
        elif tag == "polygon":
            points = _points(path, element.get("points") or "")
            found.setdefault(element.get("class") or "", []).append(points)
    _same_size(path, (size.get("height", ""), size.get("width", "")), shape)
    if "Wall" not in found:
        raise FormatError(path, "no polygon of class Wall", hint="give an annotation of CVC-FP")
    return Truth(
        filled(found["Wall"], shape),
        tuple(found.get("Door", ())),
        tuple(found.get("Window", ())),
        tuple(found.get("Room", ())),
    )


def _points(path: str | Path, text: str) -> Polygon:
    """`x,y x,y ...` as (n, 2)."""
    try:
        points = np.array([float(v) for v in text.replace(",", " ").split()]).reshape(-1, 2)
    except ValueError as error:
        raise FormatError(path, f"points of a polygon cannot be read: {text[:40]!r}") from error
    if len(points) < 3 or not np.isfinite(points).all() or np.abs(points).max() > 1e6:
        raise FormatError(path, f"points that are no polygon: {text[:40]!r}")
    return points


def _same_size(path: str | Path, said: tuple[str, str], shape: tuple[int, int]) -> None:
    """Refuse the annotation of another picture; a size that is not said is taken to fit."""
    if all(text.isdigit() for text in said) and (int(said[0]), int(said[1])) != shape:
        raise FormatError(
            path,
            f"made for a drawing of {said[1]}x{said[0]}, not {shape[1]}x{shape[0]}",
            hint="give the drawing it belongs to",
        )


def _from_json(path: str | Path, data: bytes, shape: tuple[int, int], drawing: str) -> Truth:
    """MLSTRUCT-FP: wall rectangles in m; px = x * scale, py = -y * scale; no doors."""
    try:
        table: dict[str, Any] = json.loads(data)
        scales = {
            int(key): float(floor["scale"])
            for key, floor in table["floor"].items()
            if floor["image"] == drawing
        }
        corners = [
            np.column_stack((rect["x"], -np.asarray(rect["y"], dtype=np.float64)))
            * scales[rect["floorID"]]
            for rect in table["rect"].values()
            if rect["floorID"] in scales
        ]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise FormatError(path, f"not the JSON of MLSTRUCT-FP: {error!r}") from error
    if not corners:
        raise FormatError(path, f"no walls for the drawing {drawing!r}")
    return Truth(filled(corners, shape), has_doors=False)


def _from_mask(path: str | Path, data: bytes, shape: tuple[int, int]) -> Truth:
    """A picture of the walls alone: every pixel darker than the middle grey is wall."""
    import cv2

    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error as error:
        raise FormatError(path, "neither an annotation nor a picture") from error
    if picture is None:
        raise FormatError(path, "neither an annotation nor a picture")
    _same_size(path, (str(picture.shape[0]), str(picture.shape[1])), shape)
    return Truth(np.asarray(picture) < 128, has_doors=False)
