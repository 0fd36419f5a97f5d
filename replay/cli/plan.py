"""`replay plan`: what a drawing says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from replay.cli.drawing_values import scaled
from replay.cli.flags import answered, force_flag, given, json_flag, output_flag


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
@output_flag("the drawing's name here")
@force_flag
@json_flag
def command(path: Path, as_json: bool, **options: Any) -> int:
    """Walls, doors and outline of a drawing: overlay, map_server map, GeoJSON.

    \b
    Examples:
      replay plan plan.png
      replay plan office.pdf --drawing-scale 1:200
      replay plan drawing.png --truth drawing_gt.svg --json
      replay plan drawing.png --edits drawing.edits
    """
    from replay.planning.extracting import plan, report

    return answered(
        lambda notes: plan(path, notes=notes, **given(options)), report, as_json=as_json
    )
