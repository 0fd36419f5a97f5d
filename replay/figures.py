"""Figures for reports and the docs: the one module that speaks matplotlib, without a screen.

Every function draws one figure from arrays and returns its PNG; the same arrays give the same
bytes. Colours are those of Okabe and Ito, told apart with any colour vision.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY = (
    *("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9"),
    "#777777",
)
COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY)
DPI = 110


class Line(NamedTuple):
    """A curve of a chart.

    Attributes:
        name: in the legend; "" for none.
        x, y: (n,).
        style: of matplotlib: "-", "--", ":", "o".
        colour: "" for the next one.
    """

    name: str
    x: npt.ArrayLike
    y: npt.ArrayLike
    style: str = "-"
    colour: str = ""


class Surface(NamedTuple):
    """A colour map over (p_wall, p_space).

    Attributes:
        title: above it.
        values: (walls, spaces).
        p_wall, p_space: of rows and columns.
        points: (n, 2) pairs to mark in black.
        crosses: (n, 2) pairs to mark with a cross.
        span: least and most of the colours; None: of the values.
        labels: of the two axes, rows and columns.
    """

    title: str
    values: Floats
    p_wall: Floats
    p_space: Floats
    points: Floats | None = None
    crosses: Floats | None = None
    span: tuple[float, float] | None = (0.0, 1.0)
    labels: tuple[str, str] = ("p_wall", "p_space")


def sheet(rows: int, cols: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """An empty figure of rows x cols panels, each so many inches, and the panels row by row."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(cols * width, rows * height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(np.atleast_1d(figure.subplots(rows, cols)).ravel())


def png(figure: Figure) -> bytes:
    """The figure as PNG, without what changes from run to run."""
    out = io.BytesIO()
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def surfaces(panels: Sequence[Surface], cols: int = 3, size: float = 3.4) -> bytes:
    """Colour maps side by side, each with its own scale."""
    cols = min(cols, len(panels))
    figure, axes = sheet(-(-len(panels) // cols), cols, size * 1.15, size)
    for ax, panel in zip(axes, panels, strict=False):
        _surface(figure, ax, panel)
    for ax in axes[len(panels) :]:
        ax.axis("off")
    return png(figure)


def _surface(figure: Figure, ax: Axes, panel: Surface) -> None:
    wall, space = panel.p_wall, panel.p_space
    low, high = panel.span or (float(np.min(panel.values)), float(np.max(panel.values)))
    dw, ds = (float(p[1] - p[0]) / 2 if len(p) > 1 else 0.05 for p in (wall, space))
    image = ax.imshow(
        panel.values,
        origin="lower",
        extent=(space[0] - ds, space[-1] + ds, wall[0] - dw, wall[-1] + dw),
        vmin=low,
        vmax=high,
        cmap="viridis",
        aspect="auto",
        interpolation="nearest",
    )
    for points, marker, colour in ((panel.points, ".", "black"), (panel.crosses, "x", "white")):
        if points is not None and len(points):
            ax.plot(points[:, 1], points[:, 0], marker, color=colour, markersize=7)
    ax.set_title(panel.title, fontsize=9)
    ax.set(xlabel=panel.labels[1], ylabel=panel.labels[0])
    figure.colorbar(image, ax=ax, shrink=0.85)


class Chart(NamedTuple):
    """Axes with lines.

    Attributes:
        title, x, y: what they show.
        lines: in it.
        x_range, y_range: of the axes; None: as the lines need.
    """

    title: str
    x: str
    y: str
    lines: Sequence[Line]
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


def charts(
    panels: Sequence[Chart], cols: int = 2, width: float = 5.0, height: float = 3.4
) -> bytes:
    """Charts side by side."""
    cols = min(cols, len(panels))
    figure, axes = sheet(-(-len(panels) // cols), cols, width, height)
    for ax, panel in zip(axes, panels, strict=False):
        _chart(ax, panel)
    for ax in axes[len(panels) :]:
        ax.axis("off")
    return png(figure)


def _chart(ax: Axes, panel: Chart) -> None:
    for k, line in enumerate(panel.lines):
        colour = line.colour or COLOURS[k % len(COLOURS)]
        dots = line.style in ("o", ".", "s", "x", "^", "*")
        ax.plot(
            np.asarray(line.x),
            np.asarray(line.y),
            marker=line.style if dots else "",
            linestyle="" if dots else line.style,
            color=colour,
            label=line.name or None,
            markersize=4 if line.style != "*" else 11,
            linewidth=1.6,
        )
    ax.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
    if panel.x_range:
        ax.set_xlim(*panel.x_range)
    if panel.y_range:
        ax.set_ylim(*panel.y_range)
    ax.grid(True, color="#dddddd", linewidth=0.6)
    ax.set_axisbelow(True)
    if any(line.name for line in panel.lines):
        ax.legend(fontsize=8, framealpha=0.9)


def bars(
    title: str,
    groups: Sequence[str],
    values: Mapping[str, Sequence[float]],
    y: str = "F2",
    width: float = 8.0,
) -> bytes:
    """Bars side by side: a group a label, a colour a name."""
    figure, (ax,) = sheet(1, 1, width, 3.2)
    each = 0.8 / len(values)
    for k, (name, heights) in enumerate(values.items()):
        at = np.arange(len(groups)) + (k - (len(values) - 1) / 2) * each
        found = ax.bar(at, heights, each * 0.92, label=name, color=COLOURS[k % len(COLOURS)])
        ax.bar_label(found, fmt="%.2f", fontsize=7)
    ax.set_xticks(np.arange(len(groups)), groups)
    ax.set(title=title, ylabel=y, ylim=(0.0, 1.12))
    ax.legend(fontsize=8, ncols=len(values))
    return png(figure)


class Picture(NamedTuple):
    """A map or drawing.

    Attributes:
        title: above it.
        grey: (H, W) 0 black to 1 white, row 0 on top, or (H, W, 3).
    """

    title: str
    grey: npt.NDArray[Any]


def pictures(panels: Sequence[Picture], cols: int = 3, width: float = 4.0) -> bytes:
    """Pictures side by side, pixels square."""
    cols = min(cols, len(panels))
    tallest = max(panel.grey.shape[0] / panel.grey.shape[1] for panel in panels)
    figure, axes = sheet(-(-len(panels) // cols), cols, width, width * tallest + 0.35)
    for ax, panel in zip(axes, panels, strict=False):
        ax.imshow(panel.grey, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
        ax.set_title(panel.title, fontsize=10)
        ax.set_xticks([])
        ax.set_yticks([])
    for ax in axes[len(panels) :]:
        ax.axis("off")
    return png(figure)


def scatter(
    title: str, groups: Mapping[str, Floats], centres: Floats | None = None, size: float = 4.6
) -> bytes:
    """Pairs (p_wall, p_space) by group, and the centres of their clusters."""
    figure, (ax,) = sheet(1, 1, size, size)
    for k, (name, points) in enumerate(groups.items()):
        ax.plot(
            points[:, 1],
            points[:, 0],
            "o",
            color=COLOURS[k % len(COLOURS)],
            markersize=5,
            alpha=0.7,
            label=name,
        )
    if centres is not None and len(centres):
        ax.plot(centres[:, 1], centres[:, 0], "kx", markersize=10, markeredgewidth=2)
    ax.set(title=title, xlabel="p_space", ylabel="p_wall", xlim=(0.05, 1.05), ylim=(0.05, 1.05))
    ax.grid(True, color="#dddddd", linewidth=0.6)
    ax.legend(fontsize=8)
    return png(figure)
