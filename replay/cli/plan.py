"""`replay plan`: what a drawing says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.drawing_values import DISTANCE, SCALE
from replay.cli.values import POSITIVE, answer, ending, say


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
@click.option("--plan-resolution", metavar="M", type=POSITIVE, help="Metres a pixel.")
@click.option(
    "--plan-page",
    metavar="N",
    type=click.IntRange(1),
    default=1,
    help="Page of a PDF.  [default: 1]",
)
@click.option("--plan-dpi", metavar="D", type=POSITIVE, help="Dots an inch to render or scanned.")
@click.option("--drawing-scale", metavar="1:N", type=SCALE, help="Scale of the drawing on paper.")
@click.option(
    "--plan-distance",
    metavar="X1,Y1,X2,Y2=M",
    type=DISTANCE,
    help="Two points in pixels, y down, and the metres between.",
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
    """
    from replay import plan

    notes = Notes()
    try:
        facts = plan(path, notes=notes, **options)
    finally:
        say(notes)
    if as_json:
        answer(facts)
    else:
        from replay.planning import report

        click.echo(report(facts))
    return ending(notes)
