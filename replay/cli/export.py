"""`replay export`: a result in the formats of others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.values import answer, ending, say


@click.command("export")
@click.argument("result", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    metavar="DIR-or-STEM",
    type=click.Path(path_type=Path),
    help="A folder, or the stem of the files' names; the result's name here by default.",
)
@click.option(
    "--only",
    "what",
    multiple=True,
    metavar="PART",
    help="Only this part; may be given again. An unknown one lists them all.",
)
@click.option(
    "--fill-prior", is_flag=True, help="Cells never observed show the prior, not unknown."
)
@click.option(
    "--frame",
    type=click.Choice(["plan", "map"]),
    default="plan",
    show_default=True,
    help="Of maps and poses: the plan's, or the frame of the log's poses.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(
    result: Path, output: Path | None, what: tuple[str, ...], as_json: bool, **options: Any
) -> int:
    """Write maps (map_server yaml + pgm), poses (TUM), scores (CSV) and a picture of a RESULT.

    \b
    Examples:
      replay export turtlebot.replay.mcap
      replay export turtlebot.replay.mcap -o maps/ --only map --fill-prior
    """
    from replay import export

    notes = Notes()
    try:
        written = export(result, output, what or None, notes=notes, **options)
    finally:
        say(notes)
    if as_json:
        answer({"written": [str(path) for path in written]})
    else:
        for path in written:
            click.echo(f"wrote   {path}")
    return ending(notes)
