"""Drawings as DXF: the model's lines, curves, blocks and hatches at a size known exactly."""

from __future__ import annotations

import io
import math
import re
import struct
import tempfile
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import ezdxf
import numpy as np
import numpy.typing as npt
from ezdxf import recover
from ezdxf.addons.drawing.backend import Backend
from ezdxf.addons.drawing.config import (
    BackgroundPolicy,
    Configuration,
    HatchPolicy,
    ImagePolicy,
    LinePolicy,
    TextPolicy,
)
from ezdxf.addons.drawing.frontend import Frontend
from ezdxf.addons.drawing.gfxproxy import DXFGraphicProxy
from ezdxf.addons.drawing.properties import RenderContext
from ezdxf.lldxf.const import DXFError

from formats.errors import printable
from formats.picture_header import INCH, MAX_PIXELS, PictureError
from formats.plans.paper import Asked, Sheet

PIXEL = 0.01  # m
COARSEST = 0.25  # m: a wall is no longer seen
LONGEST = 6000  # pixels, where nothing is asked for
MARGIN = 10  # pixels of paper around
MOST_ENTITIES = 1_000_000
MOST_POINTS = 20_000_000
SHIFT = 4  # bits of a pixel's fraction in cv2
FARTHEST = 1e12  # drawing units
# $INSUNITS -> m, of the DXF reference's table of units.
UNITS = {
    1: INCH, 2: 0.3048, 3: 1609.344, 4: 1e-3, 5: 1e-2, 6: 1.0, 7: 1e3, 8: INCH * 1e-6,
    9: INCH * 1e-3, 10: 0.9144, 11: 1e-10, 12: 1e-9, 13: 1e-6, 14: 0.1, 15: 10.0, 16: 100.0,
    21: 1200 / 3937,
}  # fmt: skip
LOOK = Configuration(
    background_policy=BackgroundPolicy.WHITE,
    text_policy=TextPolicy.IGNORE,
    image_policy=ImagePolicy.IGNORE,
    line_policy=LinePolicy.SOLID,
    hatch_policy=HatchPolicy.NORMAL,
    hatching_timeout=10.0,
)
Points = npt.NDArray[np.float64]


class Ink(Backend):
    """What ezdxf's frontend draws, kept as points in drawing units.

    Attributes:
        lines: (N, 2) each.
        fills: rings of one filled shape, and its grey.
    """

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[Points] = []
        self.fills: list[tuple[list[Points], int]] = []
        self.points = 0

    def _kept(self, points: Iterable[Any]) -> Points:
        kept = np.array([(p.x, p.y) for p in points], dtype=np.float64).reshape(-1, 2)
        self.points += len(kept)
        if self.points > MOST_POINTS:
            raise PictureError(f"the DXF draws more than {MOST_POINTS:,} points")
        return kept

    def draw_point(self, pos: Any, properties: Any) -> None:
        """Points mark, they do not draw."""

    def draw_line(self, start: Any, end: Any, properties: Any) -> None:
        """One line."""
        self.lines.append(self._kept((start, end)))

    def draw_solid_lines(self, lines: Iterable[Any], properties: Any) -> None:
        """Many lines: a pattern."""
        for start, end in lines:
            self.draw_line(start, end, properties)

    def draw_path(self, path: Any, properties: Any) -> None:
        """Lines and curves in one."""
        for part in path.sub_paths() if path.has_sub_paths else (path,):
            self.lines.append(self._flat(part))

    def draw_filled_paths(self, paths: Iterable[Any], properties: Any) -> None:
        """Rings and the holes in them."""
        self._fill([self._flat(path) for path in paths], properties)

    def draw_filled_polygon(self, points: Any, properties: Any) -> None:
        """One ring."""
        self._fill([self._kept(points.vertices())], properties)

    def draw_image(self, image_data: Any, properties: Any) -> None:
        """Pictures are outside of the file."""

    def set_background(self, color: str) -> None:
        """Paper is white."""

    def clear(self) -> None:
        """Nothing is kept between drawings."""

    def _flat(self, path: Any) -> Points:
        """A curve as lines, off by a 2000th of its size at most."""
        corners = list(path.control_vertices())
        if len(corners) < 2:
            return self._kept(corners)
        low = [min(p.x for p in corners), min(p.y for p in corners)]
        high = [max(p.x for p in corners), max(p.y for p in corners)]
        extent = max(high[0] - low[0], high[1] - low[1])
        if not 0 < extent < FARTHEST:
            return self._kept(corners[:1])
        return self._kept(path.flattening(extent / 2000, segments=4))

    def _fill(self, rings: list[Points], properties: Any) -> None:
        rings = [ring for ring in rings if len(ring) >= 3]
        found = re.match(r"#(..)(..)(..)", properties.color)
        red, green, blue = (int(part, 16) for part in found.groups()) if found else (0, 0, 0)
        if rings:
            self.fills.append((rings, round(0.299 * red + 0.587 * green + 0.114 * blue)))


class Drawer(Frontend):
    """ezdxf's frontend; `skipped` holds the types of what it cannot draw."""

    skipped: Counter[str]

    def skip_entity(self, entity: Any, msg: str) -> None:
        """Count it, unless it is hidden on purpose."""
        if msg != "invisible":
            self.skipped[entity.dxftype()] += 1

    def draw_entity(self, entity: Any, properties: Any) -> None:
        """Draw it; of a type that ezdxf does not know, only a picture that it brings along."""
        if isinstance(entity, DXFGraphicProxy) and not entity.proxy_graphic:
            self.skip_entity(entity, "unknown")
        else:
            super().draw_entity(entity, properties)


def render(data: bytes, asked: Asked) -> Sheet:
    """The model space of a DXF, one pixel wide lines, y up.

    Raises:
        PictureError: damaged, empty, or of an extent that no building has.
    """
    if not data[-64:].rstrip(b"\0\r\n\t \x1a").endswith(b"EOF"):
        raise PictureError("the DXF is cut (no EOF at its end)", "copy it again")
    try:
        document, auditor = opened(data)
    except (DXFError, ValueError, IndexError, KeyError, struct.error) as error:
        raise PictureError(f"the DXF is damaged: {error}", "save it again, or as PNG") from None
    model = document.modelspace()
    if unfolded(document, model, {}) > MOST_ENTITIES:
        raise PictureError(f"the DXF's blocks unfold to more than {MOST_ENTITIES:,} entities")
    ink = Ink()
    drawer = Drawer(RenderContext(document), ink, config=LOOK)
    drawer.skipped = Counter()
    drawer.draw_layout(model)
    unit = UNITS.get(int(document.header.get("$INSUNITS", 0)))
    sheet = painted(ink, unit, asked)
    remarks = [f"{count} x {kind} is left out" for kind, count in drawer.skipped.items()][:5]
    if auditor.errors:
        remarks.append(f"{len(auditor.errors)} damaged entities are left out")
    return replace(sheet, remarks=(*sheet.remarks, *map(printable, remarks)))


def opened(data: bytes) -> tuple[Any, Any]:
    """The document and what was mended in it; ezdxf mends text alone, and takes binary by file."""
    if not data.startswith(b"AutoCAD Binary DXF"):
        return recover.read(io.BytesIO(data))
    with tempfile.NamedTemporaryFile(suffix=".dxf") as copy:
        copy.write(data)
        copy.flush()
        document = ezdxf.readfile(copy.name)
    return document, document.audit()


def unfolded(document: Any, entities: Iterable[Any], known: dict[str, int]) -> int:
    """How many entities a layout or block stands for, with the blocks in its blocks.

    Args:
        document: holds the blocks.
        entities: of the layout or block.
        known: block -> its number, filled as they are met.

    Raises:
        PictureError: a block holds itself.
    """
    total = 0
    for entity in entities:
        total += 1
        if entity.dxftype() != "INSERT" or (block := document.blocks.get(entity.dxf.name)) is None:
            continue
        name = block.name.lower()
        if name not in known:
            known[name] = -1
            known[name] = unfolded(document, block, known)
        if known[name] < 0:
            raise PictureError(f"the DXF's block {block.name!r} holds itself")
        total += known[name] * max(1, entity.mcount)
    return total


def painted(ink: Ink, unit: float | None, asked: Asked) -> Sheet:
    """Ink on paper.

    Args:
        ink: in drawing units.
        unit: m a drawing unit; None where the file does not say.
        asked: dpi with a scale, or the resolution.

    Raises:
        PictureError: nothing drawn, or too far apart.
    """
    import cv2

    parts = [*ink.lines, *(ring for rings, _ in ink.fills for ring in rings)]
    parts = [part for part in parts if len(part)]
    if not parts:
        raise PictureError("the DXF's model space draws nothing", "is it in a layout alone?")
    low = np.min([part.min(axis=0) for part in parts], axis=0)
    high = np.max([part.max(axis=0) for part in parts], axis=0)
    wide, tall = (float(side) for side in high - low)
    if not np.isfinite([wide, tall]).all() or max(*np.abs(low), *np.abs(high)) > FARTHEST:
        raise PictureError("the DXF has coordinates beyond reason")
    pixel, remarks = pixel_of(wide, tall, unit, asked)
    cols, rows = (math.ceil(side / pixel) + 2 * MARGIN for side in (wide, tall))
    corner = np.array([low[0] - MARGIN * pixel, low[1] - MARGIN * pixel + rows * pixel])
    step = np.array([pixel, -pixel])

    def place(part: Points) -> npt.NDArray[np.int32]:
        at = (part - corner) / step - 0.5  # pixel centres are at whole numbers
        return np.rint(at * (1 << SHIFT)).astype(np.int32).reshape(-1, 1, 2)

    grey = np.full((rows, cols), 255, dtype=np.uint8)
    for rings, shade in ink.fills:
        cv2.fillPoly(grey, [place(ring) for ring in rings], shade, shift=SHIFT)
    for line in ink.lines:
        cv2.polylines(grey, [place(line)], False, 0, 1, cv2.LINE_8, shift=SHIFT)
    return Sheet(grey, resolution=pixel * unit if unit else None, remarks=remarks)


def pixel_of(
    wide: float, tall: float, unit: float | None, asked: Asked
) -> tuple[float, tuple[str, ...]]:
    """Drawing units a pixel, and what is to be said of it.

    Raises:
        PictureError: too large for what is asked for, or for any building.
    """
    extent = max(wide, tall)
    remarks: tuple[str, ...] = ()
    wanted = asked.resolution
    if wanted is None and asked.dpi and asked.drawing_scale:
        wanted = INCH / asked.dpi * asked.drawing_scale
    if unit is None:
        remarks = ("says no unit ($INSUNITS)",)
        pixel = (extent or 1.0) / (LONGEST / 2)
    elif wanted is not None:
        pixel = wanted / unit
    else:
        pixel = max(PIXEL / unit, extent / LONGEST)
        if pixel * unit > COARSEST:
            size = f"{wide * unit / 1000:.4g} x {tall * unit / 1000:.4g} km"
            problem = f"the DXF spans {size}, more than a building"
            raise PictureError(problem, "delete what lies astray, or correct $INSUNITS")
    if (wide / pixel + 2 * MARGIN + 1) * (tall / pixel + 2 * MARGIN + 1) > MAX_PIXELS:
        problem = f"at {pixel * (unit or 1):g} m a pixel, it is over {MAX_PIXELS:,} pixels"
        raise PictureError(problem, "ask for a coarser resolution")
    return pixel, remarks
