"""`replay deviation`: the plan against the building."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.values import POSITIVE, answer, ending, say


@click.command("deviation")
@click.argument("result", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    metavar="DIR-or-STEM",
    type=click.Path(path_type=Path),
    help="A folder, or the stem of the files' names; the result's name here by default.",
)
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
@click.option("--force", is_flag=True, help="Replace files that exist.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(result: Path, output: Path | None, as_json: bool, **options: Any) -> int:
    """Say which walls of the plan a RESULT confirms, and which moved, are gone or were unseen.

    \b
    Examples:
      replay deviation turtlebot.replay.mcap
      replay deviation turtlebot.replay.mcap -o survey/ --frame map --json

    A wall that moved has a sign: positive to the left of the direction from its first end to its
    second. Walls that the plan lacks are listed as found. Writes a picture and GeoJSON in metres.
    """
    from replay import deviation

    notes = Notes()
    chosen = {name: value for name, value in options.items() if value is not None}
    try:
        facts = deviation(result, output, notes=notes, **chosen)
    finally:
        say(notes)
    if as_json:
        answer(facts)
    else:
        from replay.surveying.deviating import report

        click.echo(report(facts))
    return ending(notes)
