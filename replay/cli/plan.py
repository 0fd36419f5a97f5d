"""`replay plan`: what a drawing says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.drawing_values import scaled
from replay.cli.values import answer, ending, say


@click.command("plan")
@click.argument("path", metavar="PLAN", type=click.Path(path_type=Path))
@click.option(
    "--method",
    type=click.Choice(["structural", "georgiou"]),
    default="structural",
    show_default=True,
    help="structural, or Algorithm 1 of the paper.",
)
@click.option(
    "--truth",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Score it: CVC-FP's SVG, mlstructfp's JSON, or a picture of the walls.",
)
@scaled
@click.option(
    "--edits",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Edits by hand, replayed on what was found; docs/plan.md has their form.",
)
@click.option(
    "-o",
    "--output",
    metavar="DIR-or-STEM",
    type=click.Path(path_type=Path),
    help="A folder, or the stem of the files' names; the drawing's name here by default.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(path: Path, as_json: bool, **options: Any) -> int:
    """Walls, doors and outline of a drawing: overlay, map_server map, GeoJSON.

    \b
    Examples:
      replay plan plan.png
      replay plan office.pdf --drawing-scale 1:200
      replay plan drawing.png --truth drawing_gt.svg --json
      replay plan drawing.png --edits drawing.edits
    """
    from replay import plan

    notes = Notes()
    try:
        chosen = {name: value for name, value in options.items() if value is not None}
        facts = plan(path, notes=notes, **chosen)
    finally:
        say(notes)
    if as_json:
        answer(facts)
    else:
        from replay.planning.extracting import report

        click.echo(report(facts))
    return ending(notes)
