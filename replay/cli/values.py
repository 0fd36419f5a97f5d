"""Option values of our own, and how a verb ends: what every verb shares."""

from __future__ import annotations

import json
from importlib import import_module
from math import isnan
from typing import Any

import click
from click.shell_completion import CompletionItem

from formats.errors import Notes
from formats.frame import Pose

SCHEMA = 1  # of every --json answer
FARTHEST = 1e8  # m; beyond it, nothing on Earth has a place


class PoseType(click.ParamType[Pose]):
    """X,Y or X,Y,YAW in metres and radians."""

    name = "X,Y,YAW"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Pose:
        """The pose, or a usage error that shows the form."""
        if isinstance(value, Pose):
            return value
        try:
            numbers = [float(part) for part in str(value).split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3) or not all(abs(number) < FARTHEST for number in numbers):
            self.fail(f"{value!r} is not X,Y or X,Y,YAW (metres, radians)", param, ctx)
        return Pose(*numbers, *[0.0] * (3 - len(numbers)))


class SpanType(click.ParamType[tuple[float, float]]):
    """LOW,HIGH in metres."""

    name = "LOW,HIGH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """The two heights, or a usage error that shows the form."""
        if isinstance(value, tuple):
            return value
        try:
            low, high = (float(part) for part in str(value).split(","))
        except ValueError:
            low = high = 0.0
        if not -FARTHEST < low < high < FARTHEST:
            self.fail(f"{value!r} is not LOW,HIGH (metres)", param, ctx)
        return low, high


class CovarianceType(click.ParamType[tuple[float, float, float]]):
    """XX,YY,AA: variances in m², m², rad²."""

    name = "XX,YY,AA"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float]:
        """The three variances, or a usage error that shows the form."""
        if isinstance(value, tuple):
            return value
        try:
            xx, yy, aa = (float(part) for part in str(value).split(","))
        except ValueError:
            xx = yy = aa = -1.0
        if not all(0.0 <= number < FARTHEST for number in (xx, yy, aa)):
            self.fail(f"{value!r} is not XX,YY,AA (variances: m², m², rad²)", param, ctx)
        return xx, yy, aa


class TableOption(click.Option):
    """An option whose values are the names of a table; the help lists them as they are.

    Args:
        table: "module:NAME", or "module:function" that lists them; imported only for the help, and
            where the shell completes.
    """

    def __init__(self, *args: Any, table: str, **options: Any) -> None:
        super().__init__(*args, **options)
        self.table = table

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """As click has it, with the names behind."""
        record = super().get_help_record(ctx)
        return record and (record[0], f"{record[1]} {', '.join(self.names())}.")

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The names that begin so."""
        return [CompletionItem(name) for name in self.names() if name.startswith(incomplete)]

    def names(self) -> list[str]:
        """Of the table."""
        module, _, name = self.table.partition(":")
        table = getattr(import_module(module), name)
        return list(table() if callable(table) else table)


class Number(click.FloatRange):
    """A number within a range; nan, which click lets pass, is none."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number."""
        number = super().convert(value, param, ctx)
        if isnan(number):
            self.fail(f"{value!r} is not a number", param, ctx)
        return number


PROBABILITY = Number(0.0, 1.0)
POSITIVE = Number(0.0, min_open=True)
NOT_NEGATIVE = Number(0.0)


def say(notes: Notes) -> None:
    """Warnings, skipped and lost data on stderr, one line for each distinct problem."""
    for kind in ("warning", "skipped", "lost"):
        for note in notes.of(kind):
            click.echo(f"{kind}: {note}", err=True)


def answer(value: dict[str, Any]) -> None:
    """One JSON object on stdout; what is not a number is null, as JSON wants it."""
    click.echo(json.dumps({**value, "schema": SCHEMA}, default=str, allow_nan=False))


def ending(notes: Notes) -> int:
    """The exit code: 3 where input data were unreadable and lost."""
    return 3 if notes.total("lost") else 0
