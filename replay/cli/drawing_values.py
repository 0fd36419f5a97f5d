"""Option values that tell how large a drawing is."""

from __future__ import annotations

import math
from typing import Any

import click

from formats.paper import Distance


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
