"""Options that tell how large a drawing is, and their values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click

from formats.plans.paper import Distance
from replay.cli.values import POSITIVE


class ScaleType(click.ParamType[float]):
    """1:N or N, the drawing's scale on paper."""

    name = "1:N"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """200 of 1:200, or a usage error that shows the form."""
        try:
            drawn, colon, real = str(value).partition(":")
            scale = float(real) / float(drawn) if colon else float(drawn)
        except (ValueError, ZeroDivisionError):
            scale = math.nan
        if not 0.1 <= scale <= 100_000:
            self.fail(f"{value!r} is not a scale as 1:200", param, ctx)
        return scale


class DistanceType(click.ParamType[Distance]):
    """X1,Y1,X2,Y2=M: two points in pixels and the metres between them."""

    name = "X1,Y1,X2,Y2=M"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Distance:
        """The five numbers, or a usage error that shows the form."""
        if isinstance(value, tuple):
            return value
        points, _, metres = str(value).partition("=")
        try:
            x1, y1, x2, y2 = (float(part) for part in points.split(","))
            length = float(metres)
        except ValueError:
            x1 = y1 = x2 = y2 = length = 0.0
        if not (0 < length < math.inf and 0 < math.hypot(x2 - x1, y2 - y1) < 1e9):
            self.fail(f"{value!r} is not X1,Y1,X2,Y2=M (pixels, metres)", param, ctx)
        return x1, y1, x2, y2, length


SCALE = ScaleType()
DISTANCE = DistanceType()
Command = TypeVar("Command", bound=Callable[..., Any])
OPTIONS = (
    click.option("--plan-resolution", metavar="M", type=POSITIVE, help="Metres a pixel of PLAN."),
    click.option(
        "--drawing-scale", metavar="1:N", type=SCALE, help="Scale of the drawing on paper."
    ),
    click.option(
        "--plan-dpi", metavar="D", type=POSITIVE, help="Dots an inch to render, or scanned."
    ),
    click.option(
        "--plan-distance",
        metavar="X1,Y1,X2,Y2=M",
        type=DISTANCE,
        help="Two points in pixels, y down, and the metres between.",
    ),
    click.option("--plan-page", metavar="N", type=click.IntRange(1), help="Page of a PDF; 1."),
)


def scaled(command: Command) -> Command:
    """A command with the options of a drawing's page and scale; what is not said is None."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command
