"""`replay export`: a result in the formats of others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import answered, force_flag, json_flag, output_flag, wrote


@click.command("export")
@click.argument("result", type=click.Path(path_type=Path))
@output_flag("the result's name here")
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
@force_flag
@json_flag
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

    def written(notes: Notes) -> dict[str, Any]:
        files = export(result, output, what or None, notes=notes, **options)
        return {"written": list(map(str, files))}

    return answered(written, wrote, as_json=as_json)
