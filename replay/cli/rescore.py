"""`replay rescore`: results under other priors, without their logs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import force_flag, json_flag, quiet_flag
from replay.cli.values import PROBABILITY, answer, ending, say


class GridType(click.ParamType[tuple[str, tuple[float, ...]]]):
    """NAME=V,V,... or NAME=FROM:TO:N."""

    name = "NAME=VALUES"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, tuple[float, ...]]:
        """The name and its values, or a usage error that shows the form."""
        if isinstance(value, tuple):
            return value
        name, _, text = str(value).partition("=")
        try:
            if ":" in text:
                low, high, number = text.split(":")
                a, b, n = float(low), float(high), int(number)
                if not 2 <= n <= 10_000:
                    raise ValueError
                values = tuple(round(a + (b - a) * i / (n - 1), 12) for i in range(n))
            else:
                values = tuple(float(part) for part in text.split(","))
        except ValueError:
            self.fail(f"{value!r} is not NAME=V,V,... or NAME=FROM:TO:N", param, ctx)
        return name.replace("-", "_"), values


@click.command("rescore")
@click.argument("archives", nargs=-1, required=True, metavar="ARCHIVE...")
@click.option("--p-wall", type=PROBABILITY, help="P(EMPTY) of a drawn wall, as in the paper.")
@click.option("--p-space", type=PROBABILITY, help="P(EMPTY) of drawn free space.")
@click.option("--p-outside", type=PROBABILITY, help="P(EMPTY) outside the plan.")
@click.option("--p-door", type=PROBABILITY, help="P(EMPTY) of doors.")
@click.option("--p-window", type=PROBABILITY, help="P(EMPTY) of windows.")
@click.option("--prior-scale", type=PROBABILITY, help="Multiplies p_wall and p_space.")
@click.option("--p-hit", type=PROBABILITY, help="P(OCCUPIED) of a hit.")
@click.option("--p-miss", type=PROBABILITY, help="P(OCCUPIED) of a miss.")
@click.option("--update", type=click.Choice(["bayes", "paper"]), help="The rule behind the map.")
@click.option(
    "--prior-values",
    multiple=True,
    metavar="FILE",
    help="Values that `replay tune` chose; may be given again.",
)
@click.option(
    "--grid",
    multiple=True,
    type=GridType(),
    help="p_wall=0.05:0.5:10 or p_wall=0.1,0.2; several make all combinations.",
)
@click.option("--truth", metavar="IMAGE", help="Another truth, for all of the results.")
@click.option("--metric", default="f2", metavar="NAME", help="Of the table; f2 by default.")
@click.option("--region", type=click.Choice(["observed"]), help="Score the observed cells alone.")
@click.option("--over-time", is_flag=True, help="At every keyframe, not at the end alone.")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="All rows as .parquet or .csv; may be given again.",
)
@force_flag
@json_flag
@quiet_flag
def command(
    archives: tuple[str, ...],
    grid: tuple[tuple[str, tuple[float, ...]], ...],
    outputs: tuple[Path, ...],
    force: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> int:
    """Score the results in ARCHIVEs under another prior, from the evidence that they keep.

    \b
    Examples:
      replay rescore runs/ --p-wall 0.3 --p-space 0.8
      replay rescore runs/ --grid p_wall=0.05:0.5:10 --grid p_space=0.5:0.95:10 -o scores.parquet
      replay rescore turtlebot.replay.mcap --truth measured.png --over-time -o curve.csv

    What is not said stays as it was in each run. An ARCHIVE is a folder, a result file, a pattern,
    or an address such as s3://bucket/runs.
    """
    from formats.output import check_output
    from replay import rescore
    from replay.archive.tables import check_table, write_table
    from replay.cli.progress import bar

    for path in outputs:
        check_table(path)
        check_output(path, force=force)
    notes = Notes()
    try:
        with bar(quiet=quiet or as_json, what="score", unit="results") as progress:
            scored = rescore(
                archives, grid=dict(grid) or None, notes=notes, progress=progress, **options
            )
        for path in outputs:
            write_table(path, scored.rows, force=force)
    finally:
        say(notes)
    if as_json:
        answer(
            {
                "results": scored.results,
                "lossy": scored.lossy,
                "failed": scored.failed,
                "poses_depend_on": scored.depending,
                "priors": scored.priors,
                "rows": scored.rows,
                "written": list(map(str, outputs)),
            }
        )
    else:
        from replay.archive.summary import report

        click.echo(report(scored, list(map(str, outputs))))
    return 3 if scored.failed or scored.lossy else ending(notes)
