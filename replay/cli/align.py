"""`replay align`: where a plan lies under a log or a map."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import (
    base_frame_flag,
    file_flag,
    force_flag,
    given,
    map_frame_flag,
    sensor_pose_flag,
)
from replay.cli.values import POSITIVE, PoseType, answer, ending, say


class PinType(click.ParamType[tuple[float, float, float, float]]):
    """PLANX,PLANY=MAPX,MAPY: a pixel of the plan, and where it is in the map."""

    name = "PLANX,PLANY=MAPX,MAPY"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float, float]:
        """Four numbers, or a usage error that shows the form."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = [float(n) for side in str(value).split("=") for n in side.split(",")]
            shape = [len(side.split(",")) for side in str(value).split("=")]
        except ValueError:
            numbers, shape = [], []
        if shape != [2, 2] or not all(map(math.isfinite, numbers)):
            self.fail(f"{value!r} is not {self.name}", param, ctx)
        a, b, c, d = numbers
        return a, b, c, d


class ScaleType(click.ParamType[Any]):
    """A scale, LOW,HIGH or "free"."""

    name = "S|LOW,HIGH|free"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The scale, or a usage error that shows the form."""
        if value == "free" or not isinstance(value, str):
            return value
        try:
            numbers = [float(n) for n in value.split(",")]
        except ValueError:
            numbers = []
        good = all(math.isfinite(n) and n > 0 for n in numbers)
        if len(numbers) not in (1, 2) or not good or numbers[0] > numbers[-1]:
            self.fail(f"{value!r} is not S, LOW,HIGH or free", param, ctx)
        return numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])


@click.command("align")
@click.argument("source", metavar="LOG-or-MAP", type=click.Path(path_type=Path))
@click.option(
    "--prior",
    metavar="PLAN",
    required=True,
    type=click.Path(path_type=Path),
    help="The plan: png, pgm, jpg, tiff, or a map_server yaml.",
)
@file_flag("FILE", "The placement, for `replay run --align`; STEM.align.json here by default.")
@click.option(
    "--picture",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The overlay; the placement's name with .png by default.",
)
@force_flag
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="One JSON object on stdout; files only where -o or --picture is given.",
)
@click.option(
    "--scale",
    type=ScaleType(),
    help="Plan pixels a map pixel (a log: a metre); of the yamls where both have one, else free.",
)
@click.option(
    "--mirror",
    type=click.Choice(["auto", "yes", "no"]),
    default="auto",
    show_default=True,
    help="Whether the plan shows the building mirrored.",
)
@click.option(
    "--pin",
    "pins",
    multiple=True,
    type=PinType(),
    help="A place known by hand; twice or more settle it.",
)
@click.option(
    "--plan-pose", type=PoseType(), help="Of the plan's own frame in the map's; settles it."
)
@click.option("--plan-resolution", metavar="M", type=POSITIVE, help="Metres a pixel of the plan.")
@click.option(
    "--residual",
    is_flag=True,
    help="Fit what scale, turn and shift leave, too: a smooth field, as arrows and in --json.",
)
@click.option("--scan", metavar="TOPIC", help="Of a log; chosen when only one topic fits.")
@click.option("--pose", metavar="TOPIC", help='Where poses come from: a topic, or "tf".')
@map_frame_flag
@base_frame_flag
@sensor_pose_flag
@click.option("--quiet", is_flag=True, help="No hints.")
def command(
    source: Path,
    as_json: bool,
    quiet: bool,
    mirror: str,
    output: Path | None,
    picture: Path | None,
    **options: Any,
) -> int:
    """Find where a plan lies under a LOG or a MAP: scale, turn, shift, mirror.

    \b
    Examples:
      replay align turtlebot.mcap --prior plan.png
      replay align map.pgm --prior plan.png --scale free --json
      replay align map.pgm --prior plan.png --pin 120,80=31,402 --pin 900,80=415,410

    The matrix leads from the map's pixels, or a log's metres, to the plan's pixels: x right, y
    down, pixel centres at whole numbers. Where no place is clearly the best the exit code is 1.
    """
    from replay.registration.aligning import align_files

    notes = Notes()
    if not as_json:
        output = output or Path(f"{source.resolve().name.split('.')[0]}.align.json")
        picture = picture or output.with_suffix(".png")
    elif output is not None:
        picture = picture or output.with_suffix(".png")
    chosen = given(options)
    chosen["mirrored"] = {"auto": None, "yes": True, "no": False}[mirror]
    try:
        found = align_files(source, output=output, picture=picture, notes=notes, **chosen)
    finally:
        say(notes)
    if as_json:
        answer(found.facts)
    else:
        click.echo(report(found.alignment))
        if found.residual is not None:
            click.echo(left_over(found.residual))
        for path in found.written:
            click.echo(f"wrote   {path}")
    if found.alignment.confident:
        if output and not quiet and not as_json:
            click.echo(
                f"next: replay run LOG --prior {options['prior']} --align {output}", err=True
            )
        return ending(notes)
    look = f"look at {picture}, and " if picture else ""
    click.echo(
        f"replay: {source}: no place on the plan is clearly the best; {look}give --pin twice, "
        "--scale, or --mirror no",
        err=True,
    )
    return 1


def report(alignment: Any) -> str:
    """Lines that a person reads."""
    lines = []
    for word, place in zip(["place"] + ["next"] * 9, alignment.places, strict=False):
        x, y = place.matrix[:, 2]
        mirrored = ", mirrored" if place.mirrored else ""
        lines.append(
            f"{word:<8}scale {place.scale:.4g}, turned {place.turn_deg:.1f} deg{mirrored}, "
            f"at {x:.1f} {y:.1f}   score {place.score:.2f}"
        )
    lines[0] += f"   confidence {alignment.confidence:.2f}"
    return "\n".join(lines)


def left_over(residual: Any) -> str:
    """The line on the residual field: metres where they are known, else pixels of the plan."""
    k, unit = (residual.metres, "m") if residual.metres is not None else (1.0, "px of the plan")
    facts = residual.facts()
    size = f"{k * facts['median']:.3g} {unit} (median), {k * facts['largest']:.3g} at most"
    return (
        f"left    the plan lies off the map by {size}; rms of walls "
        f"{k * residual.before:.3g}, with the field {k * residual.after:.3g}"
    )
