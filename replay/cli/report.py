"""`replay report`: a result as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import answered, file_flag, force_flag, json_flag, wrote


@click.command("report")
@click.argument(
    "sources", nargs=-1, required=True, metavar="RESULT...", type=click.Path(path_type=Path)
)
@file_flag("HTML", "The file; the first result's name here by default.")
@force_flag
@json_flag
def command(sources: tuple[Path, ...], output: Path | None, force: bool, as_json: bool) -> int:
    """Write one HTML file of RESULTs (or folders of them) that needs no network and prints well.

    \b
    Examples:
      replay report turtlebot.replay.mcap
      replay report runs/ -o runs.html
    """
    from replay import report

    def written(notes: Notes) -> dict[str, Any]:
        return {"written": [str(report(list(sources), output, force=force, notes=notes))]}

    return answered(written, wrote, as_json=as_json)
