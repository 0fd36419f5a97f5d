"""Drawings on paper: how finely a page is rendered, and what its scale says a pixel is."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

from formats.errors import UsageError
from formats.picture_header import INCH, MAX_PIXELS, PictureError
from formats.plans.ink import Picture
from formats.plans.raster import Grey

DPI = 200.0  # of a page, where nothing says another
# Scales that are drawn at: other numbers after "1:" are times of day, slopes, concrete mixes.
SCALES = frozenset(
    {5, 10, 20, 25, 40, 50, 75, 100, 125, 150, 200, 250, 300, 400, 500, 750, 1000, 1250, 2000}
)
RATIO = re.compile(r"(?<![\d.,:/])1\s?:\s?(\d{1,4})(?![\d:/]|[.,]\d)")
NAMED = re.compile(
    r"(?:scale|escala|ma(?:ß|ss)stab|[ée]chelle|scala)\s*:?\s*1\s?/\s?(\d{1,4})(?!\d)",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True)
class Asked:
    """What the user says of a drawing.

    Attributes:
        invert: whether the ink is light; None: look.
        page: of a PDF, from 0.
        dpi: pixels an inch of paper; None: DPI, or what `resolution` asks for.
        resolution: m a pixel.
        drawing_scale: 200 of 1:200; None: as the drawing's text says.
    """

    invert: bool | None = None
    page: int = 0
    dpi: float | None = None
    resolution: float | None = None
    drawing_scale: float | None = None


@dataclass(frozen=True, slots=True)
class Sheet:
    """A rendered drawing.

    Attributes:
        grey: (H, W) uint8 on white paper.
        paper: m of paper a pixel; None where there is no paper.
        scales: drawing scales that its text names, each once.
        resolution: m a pixel, where the drawing itself is in units of the building.
        remarks: what is to be warned of.
    """

    grey: Grey
    paper: float | None = None
    scales: tuple[int, ...] = ()
    resolution: float | None = None
    remarks: tuple[str, ...] = ()


Distance = tuple[float, float, float, float, float]
"""x1, y1, x2, y2 in pixels, y down, and the m between."""
Opened = tuple[Picture, Sheet | None]
"""What an opener gives: grey and occupancy, and the paper that they are of."""


def is_pdf(head: bytes) -> bool:
    """Whether the first bytes are a PDF's; some begin with a few bytes of something else."""
    return b"%PDF-" in head[:1024]


def is_svg(head: bytes) -> bool:
    """Whether the first bytes are an SVG's."""
    return re.match(rb"(\xef\xbb\xbf)?\s*<([^\0]*<)?svg[\s/>:]", head, re.DOTALL) is not None


def is_dxf(head: bytes) -> bool:
    """Whether the first bytes are a DXF's: a section, after comments (999); or binary."""
    text = rb"(\xef\xbb\xbf)?(\s*999\r?\n[^\n]*\n)*\s*0\r?\n\s*SECTION"
    return head.startswith(b"AutoCAD Binary DXF") or re.match(text, head) is not None


def is_drawing(head: bytes) -> bool:
    """Whether the first bytes are those of a drawing of lines."""
    return is_pdf(head) or is_svg(head) or is_dxf(head)


def scales_in(text: str) -> tuple[int, ...]:
    """Drawing scales that a text names ("1:200", "M 1:100", "Scale 1/50"), each once, in order."""
    found = [*RATIO.finditer(text), *NAMED.finditer(text)]
    return tuple(dict.fromkeys(n for match in found if (n := int(match[1])) in SCALES))


def page_dpi(
    asked: Asked, width: float, height: float, scales: tuple[int, ...] = (), most: int = MAX_PIXELS
) -> tuple[float, tuple[str, ...]]:
    """Pixels an inch to render a page at, and what is to be said of it.

    Args:
        asked: its dpi holds; else its resolution where the scale is known; else DPI.
        width, height: of the page, in inches.
        scales: that the text names.
        most: pixels.

    Raises:
        PictureError: no page, or too large at the dpi that was asked for.
    """
    if not (0 < width < math.inf and 0 < height < math.inf):
        raise PictureError(f"its page is {width:g} x {height:g} inches")
    scale = asked.drawing_scale or (scales[0] if len(scales) == 1 else None)
    dpi = asked.dpi or DPI
    exact = asked.dpi is not None
    if not exact and asked.resolution and scale:
        exact = True
        dpi = INCH * scale / asked.resolution
    finest = 0.999 * math.sqrt(most / (width * height))
    # A page that is a line has no area worth a limit, but still has a length.
    finest = min(finest, most / max(width, height))
    if dpi <= finest and max(1.0, width * dpi) * max(1.0, height * dpi) <= most:
        return dpi, ()
    size = f"a page of {width:.6g} x {height:.6g} inches"
    if exact:
        problem = f"{size} at {dpi:g} dpi is over the limit of {most:,} pixels"
        raise PictureError(problem, f"it fits at {finest:.3g} dpi")
    if finest < 1:
        raise PictureError(f"{size} is beyond reason", "is its unit right?")
    return finest, (f"{size} is rendered at {finest:.3g} dpi, not {dpi:.6g}, to fit",)


def resolution_of(sheet: Sheet | None, asked: Asked) -> tuple[float | None, str]:
    """Metres a pixel by the drawing's own size and scale, and what is to be said of it."""
    if sheet is None:
        return None, ""
    if sheet.resolution is not None:
        return sheet.resolution, ""
    scale = asked.drawing_scale
    if scale is None and len(sheet.scales) > 1:
        named = ", ".join(f"1:{n}" for n in sheet.scales)
        return None, f"names the scales {named}; say which holds by --drawing-scale"
    scale = scale or (sheet.scales[0] if sheet.scales else None)
    paper = INCH / asked.dpi if sheet.paper is None and asked.dpi else sheet.paper
    return (paper * scale if paper and scale else None), ""


def measured(path: Path, distance: Distance, resolution: float | None) -> float:
    """Metres a pixel by two points and the metres between them.

    Raises:
        UsageError: a resolution is given too, or there is no way between the points.
    """
    if resolution is not None:
        raise UsageError(path, "a resolution and a distance are given", hint="give one of them")
    x1, y1, x2, y2, metres = distance
    pixels = math.hypot(x2 - x1, y2 - y1)
    if not (0 < pixels < math.inf and 0 < metres < math.inf):
        raise UsageError(path, "the distance is not between two points", hint="X1,Y1,X2,Y2=M")
    return metres / pixels
