"""`replay report`: a result as one HTML file."""

from __future__ import annotations

from pathlib import Path

import click

from formats.errors import Notes
from replay.cli.values import answer, ending, say


@click.command("report")
@click.argument(
    "sources", nargs=-1, required=True, metavar="RESULT...", type=click.Path(path_type=Path)
)
@click.option(
    "-o",
    "--output",
    metavar="HTML",
    type=click.Path(path_type=Path),
    help="The file; the first result's name here by default.",
)
@click.option("--force", is_flag=True, help="Replace a file that exists.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(sources: tuple[Path, ...], output: Path | None, force: bool, as_json: bool) -> int:
    """Write one HTML file of RESULTs (or folders of them) that needs no network and prints well.

    \b
    Examples:
      replay report turtlebot.replay.mcap
      replay report runs/ -o runs.html
    """
    from replay import report

    notes = Notes()
    try:
        written = report(list(sources), output, force=force, notes=notes)
    finally:
        say(notes)
    if as_json:
        answer({"written": [str(written)]})
    else:
        click.echo(f"wrote   {written}")
    return ending(notes)
