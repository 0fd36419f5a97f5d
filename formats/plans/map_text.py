"""Maps as text, as of CMU's Wean Hall: a table of P(empty), -1 where nothing is known.

robot_specifications->resolution   10           cm a cell
global_map[0]: 800 800                          lines and numbers a line
-1.000 0.953 ...                                a line is one x, its numbers go along y
"""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import numpy as np

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.plans.map_yaml import MapYaml
from formats.plans.paper import Asked, Opened

LARGEST = 64 << 20  # bytes of text
MOST_CELLS = 10_000_000
UNKNOWN_GREY = 205
SIZE = re.compile(rb"^global_map\[0\]:[ \t]*(\d{1,6})[ \t]+(\d{1,6})[ \t]*\r?$", re.MULTILINE)
RESOLUTION = re.compile(rb"^robot_specifications->resolution[ \t]+([0-9.]{1,12})", re.MULTILINE)


def is_map_text(head: bytes) -> bool:
    """Whether the first bytes are such a map's."""
    return head.startswith((b"robot_specifications->", b"global_map[0]:"))


def text_inside(data: bytes) -> bytes:
    """The text of a map packed by gzip; anything else as it is."""
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        text = zlib.decompressobj(wbits=31).decompress(data, LARGEST)
    except zlib.error:
        return data
    return text if is_map_text(text) else data


def values_of(data: bytes) -> MapYaml | None:
    """The scale that such a map states; its lower left corner is the origin. None of others."""
    found = RESOLUTION.search(data, 0, 4096) if is_map_text(data) else None
    try:
        resolution = float(found[1]) / 100 if found else 0.0
    except ValueError:
        return None
    if not resolution > 0:
        return None
    return MapYaml("", resolution, Pose(0.0, 0.0, 0.0), False, 0.65, 0.196, "raw")


def open_map_text(
    path: Path, data: bytes, _values: MapYaml | None, _asked: Asked, _notes: Notes
) -> Opened:
    """Grey and occupancy of such a map.

    Raises:
        FormatError: no size, another number of cells than it says, or numbers that are no share.
    """
    size = SIZE.search(data, 0, 4096)
    if size is None:
        raise FormatError(path, "a map in text without its size", hint="global_map[0]: COLS ROWS")
    lines, numbers = int(size[1]), int(size[2])
    if not 0 < lines * numbers <= MOST_CELLS:
        raise FormatError(path, f"a map of {lines} x {numbers} cells is not read")
    words = data[size.end() :].split()
    if len(words) != lines * numbers:
        said = f"holds {len(words):,} cells, and says {lines} x {numbers}"
        raise FormatError(path, said, hint="is it cut short?")
    try:
        table = np.array(words, dtype=np.float64).reshape(lines, numbers)
    except ValueError as error:
        raise FormatError(path, f"a cell that is no number: {error}") from None
    unknown = table == -1.0
    if not (unknown | ((table >= 0.0) & (table <= 1.0))).all():
        raise FormatError(path, "cells that are neither -1 nor from 0 to 1")
    occupancy = np.where(unknown, -1, np.rint(100 * (1 - table))).astype(np.int8)
    grey = np.where(unknown, UNKNOWN_GREY, np.rint(255 * table)).astype(np.uint8)
    return (_upright(grey), _upright(occupancy)), None


def _upright(table: np.ndarray) -> np.ndarray:
    """Lines of one x become columns, the highest y on top."""
    return np.ascontiguousarray(table.T[::-1])
