"""`replay deviation`: the plan against the building."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from replay.cli.flags import answered, force_flag, given, json_flag, output_flag
from replay.cli.values import POSITIVE


@click.command("deviation")
@click.argument("result", type=click.Path(path_type=Path))
@output_flag("the result's name here")
@click.option(
    "--tolerance",
    metavar="M",
    type=POSITIVE,
    help="How far a wall may lie off and is still confirmed; 0.1.",
)
@click.option(
    "--frame",
    type=click.Choice(["plan", "map"]),
    default="plan",
    show_default=True,
    help="Of the coordinates: the plan's, or the frame of the log's poses.",
)
@force_flag
@json_flag
def command(result: Path, output: Path | None, as_json: bool, **options: Any) -> int:
    """Say which walls of the plan a RESULT confirms, and which moved, are gone or were unseen.

    \b
    Examples:
      replay deviation turtlebot.replay.mcap
      replay deviation turtlebot.replay.mcap -o survey/ --frame map --json

    A wall that moved has a sign: positive to the left of the direction from its first end to its
    second. Walls that the plan lacks are listed as found. Writes a picture and GeoJSON in metres.
    """
    from replay.surveying.deviating import deviation, report

    return answered(
        lambda notes: deviation(result, output, notes=notes, **given(options)),
        report,
        as_json=as_json,
    )
