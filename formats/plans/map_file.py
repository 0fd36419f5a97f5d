"""map_server's pixels: a picture with its yaml to cells of P(occupied), and a grid to both files.

Rules of nav2's map_server: https://github.com/ros-navigation/navigation2, nav2_map_server.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.grid import Grid
from formats.output import atomic
from formats.plans.map_yaml import MapYaml
from formats.plans.raster import Pixels, Raster, strips

Cells = npt.NDArray[np.int8]  # P(occupied) in per cent, -1 unknown, as OccupancyGrid has it
Mask = npt.NDArray[np.bool_]
UNKNOWN, FREE, OCCUPIED = 205, 254, 0
HERE = Pose(0.0, 0.0, 0.0)


def cells_of(path: AnyPath, raster: Raster, values: MapYaml, notes: Notes) -> Cells:
    """P(occupied) of every pixel in per cent (H, W), -1 unknown: nav2's rules.

    The shade is the mean of the colours, in trinary also of the opacity; occupied is 1 - shade
    (shade, if negated). trinary: 100 above occupied_thresh, 0 below free_thresh, else unknown.
    scale: between the thresholds 0 to 100 in proportion, not opaque is unknown. raw: the value of
    the pixel, above 100 unknown; negate means nothing there.

    Of ours: the grey 205 of a trinary map is unknown, whatever free_thresh says, since ROS 1
    saves unknown so; with 0.25, the default of ROS 2, it would turn into free space.
    """
    if values.mode == "raw" and values.negate:
        notes.warn(path, "negate means nothing in mode raw and is ignored")
    averaged = raster.alpha if values.mode == "trinary" else None
    hidden = raster.alpha if values.mode == "scale" else None
    channels = 3 if raster.pixels.ndim == 3 else 1
    table = _table(values, raster.full * (channels if averaged is None else 4))
    grey, above = divmod(205 * (len(table) - 1), 255)  # the sum of channels that is grey 205
    watched = values.mode == "trinary" and not values.negate and not above and table[grey] == 0
    turned_free = 0
    height, width = raster.pixels.shape[:2]
    cells = np.empty((height, width), dtype=np.int8)
    for rows in strips(height, width):
        key = _key(raster.pixels[rows], None if averaged is None else averaged[rows])
        part = table[key]
        if watched:
            unknown = key == grey
            turned_free += int(np.count_nonzero(unknown))
            part[unknown] = -1
        if hidden is not None:
            part[hidden[rows] != raster.full] = -1
        cells[rows] = part
    if turned_free:
        share = f"{100 * turned_free / cells.size:.2g} % of the pixels are grey 205"
        limit = f"free_thresh {values.free_thresh:g} would make them free"
        notes.warn(path, f"{share}: taken as unknown, though {limit}")
    return cells


def _key(pixels: Pixels, alpha: Pixels | None) -> npt.NDArray[np.uint32]:
    """Sum of the channels, what a pixel's shade is looked up by."""
    if alpha is None:
        wide = pixels.astype(np.uint32)
        return wide if pixels.ndim == 2 else wide.sum(axis=2, dtype=np.uint32)
    colours = pixels.sum(axis=2, dtype=np.uint32) if pixels.ndim == 3 else 3 * pixels.astype("u4")
    return np.asarray(colours + alpha, dtype=np.uint32)


def _table(values: MapYaml, top: int) -> Cells:
    """The cell of every sum of channels, 0 to `top`."""
    shade = np.arange(top + 1) / top
    if values.mode == "raw":
        raw = np.rint(255 * shade)
        return np.where(raw <= 100, raw, -1).astype(np.int8)
    occupied = shade if values.negate else 1 - shade
    low, high = values.free_thresh, values.occupied_thresh
    between = (
        np.full(top + 1, -1.0)
        if values.mode == "trinary"
        else np.rint((occupied - low) / (high - low) * 100)
    )
    cells = np.where(high < occupied, 100, np.where(occupied < low, 0, between))
    return cells.astype(np.int8)


def write_map(
    stem: AnyPath,
    grid: Grid,
    observed: Mask | None = None,
    *,
    mode: Literal["trinary", "scale"] = "trinary",
    fill_prior: bool = False,
    frame: Pose = HERE,
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> tuple[Path, Path]:
    """Write a map as map_server's picture and yaml, row 0 on top.

    trinary: a PGM of 0 occupied, 205 unknown, 254 free, with 0.65 / 0.196. scale: the
    probabilities as 255 (1 - P(occupied)), with thresholds 1 and 0, so that nothing is clamped; a
    PNG, since unknown is transparent there.

    Args:
        stem: the path without suffix.
        grid: log-odds of empty.
        observed: (rows, cols) cells that some reading saw; the others are unknown. None: all.
        mode: "trinary" or "scale".
        fill_prior: cells that no reading saw show the grid too; where it says 0.5 in trinary, they
            stay unknown.
        frame: pose of the grid's frame in the map's frame (a plan's `frame`).
        force: replace existing files.
        inputs: files that are read, never to be replaced.

    Returns:
        The paths of the picture and of the yaml.

    Raises:
        FormatError: as `output.atomic`.
    """
    image = Path(f"{stem}.pgm" if mode == "trinary" else f"{stem}.png")
    text = Path(f"{stem}.yaml")
    seen = np.ones(grid.geometry.shape, dtype=np.bool_) if observed is None else observed
    sources = list(inputs)
    encode = _trinary if mode == "trinary" else _scale
    with atomic(image, force=force, inputs=sources) as image_part:
        image_part.write_bytes(encode(grid, seen, fill_prior))
        with atomic(text, force=force, inputs=sources) as text_part:
            text_part.write_text(_yaml_text(image.name, grid, mode, frame), encoding="utf-8")
    return image, text


def _trinary(grid: Grid, seen: Mask, fill_prior: bool) -> bytes:
    """The PGM."""
    shown = seen | (grid.values != 0.0) if fill_prior else seen
    pixels = np.where(grid.occupied(), np.uint8(OCCUPIED), np.uint8(FREE))
    pixels[~shown] = UNKNOWN
    geometry = grid.geometry
    head = f"P5\n# replay {geometry.resolution:.3f} m/pix\n{geometry.cols} {geometry.rows}\n255\n"
    return head.encode() + pixels[::-1].tobytes()


def _scale(grid: Grid, seen: Mask, fill_prior: bool) -> bytes:
    """The PNG, grey in three channels and opacity."""
    import cv2

    grey = np.rint(255 * (1 - grid.p_occupied())).astype(np.uint8)
    opaque = np.full_like(grey, 255) if fill_prior else np.where(seen, 255, 0).astype(np.uint8)
    ok, data = cv2.imencode(".png", np.dstack([grey, grey, grey, opaque])[::-1])
    if not ok:
        raise FormatError("", "the map could not be encoded as a PNG")
    return bytes(data)


def _yaml_text(image: str, grid: Grid, mode: str, frame: Pose) -> str:
    """The yaml, numbers in full so that they read back to the same cells."""
    corner = frame @ Pose(grid.geometry.x, grid.geometry.y, 0.0)
    occupied, free = ("0.65", "0.196") if mode == "trinary" else ("1.0", "0.0")
    name = image if re.fullmatch(r"[A-Za-z][\w.+-]*", image) else json.dumps(image)
    return (
        f"image: {name}\n"
        f"mode: {mode}\n"
        f"resolution: {grid.geometry.resolution!r}\n"
        f"origin: [{corner.x!r}, {corner.y!r}, {corner.yaw!r}]\n"
        f"negate: 0\n"
        f"occupied_thresh: {occupied}\n"
        f"free_thresh: {free}\n"
    )
