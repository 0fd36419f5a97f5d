"""Drawings as SVG: shapes in grey by resvg, without text, and the scale that its text names."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import numpy as np

from formats.picture_header import INCH, PictureError
from formats.plans.paper import Asked, Sheet, page_dpi, scales_in

LARGEST = 100 << 20  # bytes of text
MOST_PIXELS = 100_000_000  # resvg holds four bytes of each, more than once
UNITS = {"": 96.0, "px": 96.0, "in": 1.0, "mm": 25.4, "cm": 2.54, "pt": 72.0, "pc": 6.0, "q": 101.6}
LENGTH = re.compile(r"\s*\+?(\d*\.?\d+(?:[eE][+-]?\d+)?)\s*([a-zA-Z]*)\s*")
SVG = "http://www.w3.org/2000/svg"
XLINK = "http://www.w3.org/1999/xlink"


def render(data: bytes, asked: Asked) -> Sheet:
    """The shapes of an SVG; nothing outside of the file is opened.

    Raises:
        PictureError: no XML, no size, or too large.
    """
    import cv2
    import resvg_py

    if len(data) > LARGEST:
        raise PictureError(f"{len(data):,} bytes of SVG are too many", "save it as PNG")
    try:
        root = ElementTree.fromstring(data)  # expat opens nothing, and bounds what entities grow to
    except (ElementTree.ParseError, ValueError) as error:
        raise PictureError(f"is no sound XML ({error})", "save it again, or as PNG") from None
    width, height = size(root)
    scales = scales_in("\n".join("".join(t.itertext()) for t in root.iter(f"{{{SVG}}}text")))
    dpi, remarks = page_dpi(asked, width, height, scales, MOST_PIXELS)
    outside = without_links(root)
    if outside:
        remarks = (*remarks, f"{outside} linked pictures are left out")
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", XLINK)
    if "viewBox" not in root.attrib:
        root.set("viewBox", f"0 0 {width * UNITS['px']:.9g} {height * UNITS['px']:.9g}")
    for name, inches in (("width", width), ("height", height)):
        root.set(name, str(max(1, math.ceil(inches * dpi - 1e-3))))
    try:
        made = resvg_py.svg_to_bytes(
            svg_string=ElementTree.tostring(root, encoding="unicode"),
            background="#ffffff",
            skip_system_fonts=True,
            dpi=UNITS["px"],
        )
    except ValueError as error:
        raise PictureError(f"the SVG is damaged: {error}", "save it again, or as PNG") from None
    grey = cv2.imdecode(np.frombuffer(made, np.uint8), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise PictureError("the SVG shows nothing")
    return Sheet(grey.astype(np.uint8), width * INCH / grey.shape[1], scales, remarks=remarks)


def size(root: ElementTree.Element) -> tuple[float, float]:
    """Width and height in inches: as stated, else the view box's units as pixels, 96 an inch.

    Raises:
        PictureError: it is no SVG, or says no size.
    """
    if root.tag != f"{{{SVG}}}svg":
        raise PictureError("is XML, but no SVG (no <svg xmlns=...> at its root)")
    try:
        box = [float(n) for n in re.split(r"[\s,]+", root.get("viewBox", "").strip())]
    except ValueError:
        box = []
    sides = [_inches(root.get(name, "")) for name in ("width", "height")]
    if len(box) == 4 and box[2] > 0 and box[3] > 0:
        width, height = sides
        if width is None and height is None:
            return box[2] / UNITS["px"], box[3] / UNITS["px"]
        # A view box keeps its shape; the side that is not stated follows from the other.
        width = (height or 0.0) * box[2] / box[3] if width is None else width
        return width, width * box[3] / box[2] if height is None else height
    if sides[0] is None or sides[1] is None:
        raise PictureError("the SVG says no size", "give it width and height, or a viewBox")
    return sides[0], sides[1]


def _inches(text: str) -> float | None:
    """A length; None where it is missing, or a share of the window."""
    found = LENGTH.fullmatch(text)
    per_inch = UNITS.get(found[2].lower()) if found else None
    return float(found[1]) / per_inch if found and per_inch else None


def without_links(root: ElementTree.Element) -> int:
    """Take out pictures that are not in the file itself; how many they were."""
    count = 0
    for parent in root.iter():
        for node in list(parent):
            if node.tag not in (f"{{{SVG}}}image", f"{{{SVG}}}feImage"):
                continue
            links = [node.get("href", ""), node.get(f"{{{XLINK}}}href", "")]
            if any(link and not link.lstrip().startswith(("data:", "#")) for link in links):
                parent.remove(node)
                count += 1
    return count
