"""`replay view`: results and recordings in Rerun."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import answered, force_flag, given, json_flag, wrote
from replay.cli.values import NOT_NEGATIVE, POSITIVE


@click.command("view")
@click.argument(
    "sources", nargs=-1, required=True, metavar="RESULT...", type=click.Path(path_type=Path)
)
@click.option("--rrd", metavar="FILE", type=click.Path(path_type=Path), help="Save for Rerun.")
@click.option(
    "--screenshot",
    metavar="PNG",
    type=click.Path(path_type=Path),
    help="A picture of what the viewer shows; needs no screen.",
)
@click.option(
    "--at", metavar="S", type=NOT_NEGATIVE, help="Of the picture: s since the start; the end."
)
@click.option("--web", is_flag=True, help="Serve the viewer for browsers of this machine.")
@click.option("--connect", metavar="URL", help="Send to a Rerun viewer that is already there.")
@click.option("--viewer-budget", metavar="MB", type=POSITIVE, help="Drawn of a run at most; 150.")
@force_flag
@json_flag
def command(sources: tuple[Path, ...], as_json: bool, **options: Any) -> int:
    """Look at RESULTs, without their logs; several lie side by side on one timeline.

    \b
    Examples:
      replay view turtlebot.replay.mcap
      replay view a.replay.mcap b.replay.mcap --web
      replay view turtlebot.replay.mcap --screenshot map.png --at 60
      replay view turtlebot.rrd

    A RESULT is what `replay run` wrote, a folder of such files, or a recording (.rrd).
    """
    from replay import view

    def written(notes: Notes) -> dict[str, Any]:
        show = partial(click.echo, err=True)
        files = view(list(sources), notes=notes, say=show, **given(options))
        return {"written": list(map(str, files))}

    return answered(written, wrote, as_json=as_json)
