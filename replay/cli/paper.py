"""`replay paper`: the paper, made anew."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.flags import file_flag, force_flag, json_flag, quiet_flag
from replay.cli.values import answer


@click.command("paper")
@file_flag("DIR", "Where report.html and the figures go; paper by default.", default=Path("paper"))
@click.option("--only", "rows", multiple=True, metavar="ROW", help="G2 .. G8, T1, T2, X1 .. X8.")
@click.option(
    "--logs",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="The folder of recorded logs; $REPLAY_SHARED_DATA or ../shared/data by default.",
)
@force_flag
@json_flag
@quiet_flag
def command(
    output: Path, rows: tuple[str, ...], logs: Path | None, force: bool, as_json: bool, quiet: bool
) -> int:
    """Reproduce every table and figure of Georgiou et al. (2017), and check its claims.

    \b
    Examples:
      replay paper
      replay paper -o out --only T1 --only T2

    Takes a few minutes: five drawings at three cell sizes are explored by the paper's simulated
    robot; recorded logs are used where they are there.
    """
    from replay import paper
    from replay.cli.progress import bar
    from replay.reproduction.reproducing import report

    with bar(quiet=quiet or as_json, what="paper", unit="rows") as progress:
        facts = paper(output, rows=rows or None, logs=logs, force=force, progress=progress)
    if as_json:
        answer(facts)
    else:
        click.echo(report(facts))
    return 0
