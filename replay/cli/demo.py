"""`replay demo`: sample files, and what to do with them."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from replay.cli.flags import force_flag, json_flag
from replay.cli.values import answer


@click.command("demo")
@click.argument("folder", default="replay-demo", type=click.Path(path_type=Path))
@force_flag
@json_flag
def command(folder: Path, force: bool, as_json: bool) -> int:
    """Write a sample log, its plan and its truth into a FOLDER, and say what to try.

    \b
    Examples:
      replay demo
      replay demo /tmp/try
    """
    from replay import demo
    from replay.samples import COMMANDS

    written = demo(folder, force=force)
    if as_json:
        answer({"written": [str(path) for path in written], "commands": list(COMMANDS)})
        return 0
    for path in written:
        click.echo(f"wrote   {path}")
    click.echo("try:")
    for line in (f"cd {shlex.quote(str(folder))}", *COMMANDS):
        click.echo(f"  {line}")
    return 0
