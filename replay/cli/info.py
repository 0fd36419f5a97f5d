"""`replay info`: what a log holds, and whether `run` can use it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import FormatError, Notes
from replay.cli.flags import json_flag
from replay.cli.values import PoseType, answer, ending, say


@click.command("info")
@click.argument("logs", nargs=-1, required=True, metavar="LOG...", type=click.Path(path_type=Path))
@click.option(
    "--check", is_flag=True, help="Exit 1 where run could not use a log, 2 where it has to be told."
)
@json_flag
@click.option("--scan", metavar="TOPIC", help="Look at these scans, as `run` would.")
@click.option("--pose", metavar="TOPIC", help='Look at these poses: a topic, or "tf".')
@click.option("--map-frame", metavar="FRAME", help="The frame of the poses; map by default.")
@click.option("--base-frame", metavar="FRAME", help="The robot's frame; base_link by default.")
@click.option("--sensor-pose", type=PoseType(), help="Of the sensor in the base frame; else tf.")
@click.option("--pose-delay", metavar="S", type=float, help="Added to the stamps of the poses.")
@click.option("--quiet", is_flag=True, help="No hints.")
def command(logs: tuple[Path, ...], check: bool, as_json: bool, quiet: bool, **options: Any) -> int:
    """Topics, rates, frames and damage of each LOG, and what `replay run` would take of it.

    \b
    Examples:
      replay info turtlebot.mcap
      replay info drive.bag --scan /front/scan
      replay info --check --json logs/*.bag > logs.json

    Exit 0 done, 3 where data are damaged and lost; with --check also 1 where `run` could not use a
    log, and 2 where it would ask for a choice of topics.
    """
    from replay.cli.info_text import info_report, next_step
    from replay.inspecting.contents import inspect

    codes, found, failed = [], [], 0
    for log in logs:
        notes = Notes()
        try:
            inspection = inspect(log, notes, **options)
        except FormatError as error:
            if len(logs) == 1:
                say(notes)
                raise
            click.echo(f"replay: {error}", err=True)
            found.append({"path": str(log), "usable": False, "problem": str(error)})
            failed += 1
            codes.append(error.exit_code if check else 3)
            continue
        found.append(inspection.facts())
        if not as_json:
            click.echo("\n" * (len(found) > 1) + info_report(inspection))
        say(notes)
        codes.append(ending(notes))
        if inspection.problem is not None and check:
            codes.append(inspection.problem.exit_code)
        if not (quiet or as_json):
            click.echo(next_step(inspection), err=True)
    if as_json:
        answer({"logs": found})
    if failed == len(logs):
        return 1
    return next((code for code in (1, 2, 3) if code in codes), 0)
