"""Drawings of a report as SVG inside the page: maps with the path on them, and curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Floats, Geometry
from formats.plans.plan import Extent
from replay.pictures import Colour, png
from replay.reporting.markup import data_url, text

MOST_PLACES = 2000  # of a path
MOST_VALUES = 500  # of a curve
WIDTH, HEIGHT = 420, 230  # of a chart, in its own units
LEFT, TOP, RIGHT, BOTTOM = 34, 10, 8, 26  # its margins
PATH = "rgb(0,158,115)"


class Curve(NamedTuple):
    """A line of a chart.

    Attributes:
        name: in the legend.
        colour: red, green, blue.
        y: (n,) values; nan breaks nothing and is left out.
    """

    name: str
    colour: Colour
    y: npt.NDArray[np.float64]


def window(extent: Extent, geometry: Geometry) -> tuple[slice, slice]:
    """Rows and columns of the cells within an extent (m)."""
    x0, y0, x1, y1 = extent
    step = geometry.resolution
    rows = slice(
        max(0, int((y0 - geometry.y) / step)),
        min(geometry.rows, int(np.ceil((y1 - geometry.y) / step))),
    )
    cols = slice(
        max(0, int((x0 - geometry.x) / step)),
        min(geometry.cols, int(np.ceil((x1 - geometry.x) / step))),
    )
    return rows, cols


def map_drawing(
    cells: npt.NDArray[np.uint8], geometry: Geometry, path: Floats, alternative: str
) -> str:
    """A map in metres with the path driven on it.

    Args:
        cells: (rows, cols) shades or (rows, cols, 4) colours, row 0 lowest.
        geometry: of the cells.
        path: (n, 2) m.
        alternative: what it shows, in words.
    """
    x0, y0, x1, y1 = geometry.extent
    every = max(1, len(path) // MOST_PLACES)
    places = " ".join(f"{x - x0:.2f},{y1 - y:.2f}" for x, y in path[::every])
    width, height = x1 - x0, y1 - y0
    line = max(width, height) / 300
    bar = 10.0 ** np.floor(np.log10(max(width, 1e-3) / 2.5))
    left, low = width * 0.03, height - height * 0.03
    scale = (
        f'<path d="M{left:.3f} {low:.3f}h{bar:g}" stroke="#1b1b1b" stroke-width="{2 * line:.3f}"/>'
        f'<text x="{left:.3f}" y="{low - 3 * line:.3f}" font-size="{10 * line:.3f}" fill="#1b1b1b">'
        f"{bar:g} m</text>"
    )
    start = path[:1].tolist()
    dots = "".join(
        f'<circle cx="{x - x0:.2f}" cy="{y1 - y:.2f}" r="{3 * line:.3f}" fill="{PATH}"/>'
        for x, y in start
    )
    return (
        f'<svg viewBox="0 0 {width:.3f} {height:.3f}" role="img" aria-label="{text(alternative)}">'
        f'<rect width="{width:.3f}" height="{height:.3f}" fill="#fff"/>'
        f'<image href="{data_url(png(cells[::-1]))}" width="{width:.3f}" height="{height:.3f}" '
        'style="image-rendering:pixelated" preserveAspectRatio="none"/>'
        f'<polyline points="{places}" fill="none" stroke="{PATH}" stroke-width="{line:.3f}"/>'
        f"{dots}{scale}</svg>"
    )


def chart(x: Floats, curves: Sequence[Curve], unit: str, alternative: str) -> str:
    """Curves from 0 to 1 over x."""
    wide, high = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    low, span = (float(x[0]), max(float(x[-1] - x[0]), 1e-9)) if len(x) else (0.0, 1.0)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{text(alternative)}" '
        'font-size="11" fill="#5f6368">'
    ]
    for tick in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        y = TOP + high * (1 - tick)
        parts.append(f'<path d="M{LEFT} {y:.1f}h{wide}" stroke="#e4e6e9" stroke-width="1"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for share in (0.0, 0.5, 1.0):
        anchor = {0.0: "start", 0.5: "middle", 1.0: "end"}[share]
        label = f"{low + span * share:.4g} {unit}"
        at = LEFT + wide * share
        parts.append(
            f'<text x="{at:.1f}" y="{HEIGHT - 8}" text-anchor="{anchor}">{text(label)}</text>'
        )
    for curve in curves:
        known = np.flatnonzero(np.isfinite(curve.y))
        known = known[:: max(1, len(known) // MOST_VALUES)]
        points = " ".join(
            f"{LEFT + wide * (x[i] - low) / span:.1f},{TOP + high * (1 - curve.y[i]):.1f}"
            for i in known
        )
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="rgb{curve.colour}" '
            'stroke-width="2" stroke-linejoin="round"/>'
        )
    return "".join([*parts, "</svg>"])
