"""`replay compare`: archives, priors or curves side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes, printable
from replay.cli.flags import file_flag, force_flag, json_flag
from replay.cli.values import answer, say


class PriorType(click.ParamType[dict[str, Any]]):
    """NAME=VALUE,NAME=VALUE."""

    name = "NAME=VALUE,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> dict[str, Any]:
        """The values, or a usage error that shows the form."""
        if isinstance(value, dict):
            return value
        out: dict[str, Any] = {}
        for part in str(value).split(","):
            name, _, text = part.partition("=")
            name = name.strip().replace("-", "_")
            try:
                out[name] = text if name == "update" else float(text)
            except ValueError:
                self.fail(f"{value!r} is not NAME=VALUE,NAME=VALUE", param, ctx)
        return out


@click.command("compare")
@click.argument("archives", nargs=-1, required=True, metavar="ARCHIVE...")
@click.option(
    "--p",
    "priors",
    multiple=True,
    type=PriorType(),
    help="A prior to hold against the results as they were: p_wall=0.3,p_space=0.8.",
)
@click.option("--prior-values", multiple=True, metavar="FILE", help="The same from `replay tune`.")
@click.option(
    "--curves", metavar="NAME,...", help="none,bayes,paper of one archive; or one of them."
)
@click.option("--label", "labels", multiple=True, metavar="NAME", help="Of each archive, in turn.")
@click.option("--metric", default="f2", metavar="NAME", help="f2 by default.")
@file_flag("FILE.html", "A page.", "html")
@click.option(
    "--csv",
    "table",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Every log, as .csv or .parquet.",
)
@force_flag
@json_flag
def command(
    archives: tuple[str, ...],
    priors: tuple[dict[str, Any], ...],
    curves: str | None,
    table: Path | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> int:
    """Hold ARCHIVEs, priors or curves against the first, log by log.

    \b
    Examples:
      replay compare runs-without runs-with -o comparison.html
      replay compare runs --p p_wall=0.3,p_space=0.8 --p p_wall=0.1,p_space=0.9
      replay compare runs --curves none,bayes,paper
    """
    from formats.output import check_output
    from replay import compare
    from replay.archive.tables import check_table, write_table

    if table:
        check_table(table)
        check_output(table, force=force)
    named = {", ".join(f"{k} {v}" for k, v in each.items()): each for each in priors}
    chosen = [name.strip() for name in curves.split(",")] if curves else []
    notes = Notes()
    try:
        found = compare(archives, priors=named, curves=chosen, force=force, notes=notes, **options)
        if table:
            write_table(table, found.rows(), force=force)
    finally:
        say(notes)
    written = [str(path) for path in (options["html"], table) if path]
    if as_json:
        versus = [
            {"label": each.label, **each.paired._asdict(), "median": each.median}
            | {"better": each.wins, "worse": each.losses, "same": each.ties, "least": each.worst}
            for each in found.versus
        ]
        answer(
            {"metric": found.metric, "logs": len(found.names), "versus": versus}
            | {"rows": found.rows(), "alone": found.alone, "failed": found.failed}
            | {"written": written}
        )
    else:
        click.echo(report(found, written))
    return 3 if found.failed else 0


def report(found: Any, written: list[str]) -> str:
    """Lines that a person reads, without the last line break."""
    from statistics import median

    from replay.archive.summary import titled

    labels = [printable(side.label) for side in found.sides]
    wide = max(16, *(len(label) for label in labels)) + 2
    count = f"{len(found.names)} log{'s' * (len(found.names) != 1)}"
    head = f"{count:<{wide}}{'median ' + titled(found.metric):>16}"
    lines = [head + f"{'difference':>12}{'95 % interval':>22}{'p':>8}{'better':>8}{'worse':>7}"]
    lines.append(f"{labels[0]:<{wide}}{median(found.values[0].tolist()):>16.3f}")
    for label, values, each in zip(labels[1:], found.values[1:], found.versus, strict=True):
        few = len(found.names) < 2  # draws of one log say nothing
        span = "-" if few else f"{each.paired.low:+.4f} to {each.paired.high:+.4f}"
        lines.append(
            f"{label:<{wide}}{median(values.tolist()):>16.3f}{each.paired.difference:>+12.4f}"
            f"{span:>22}{each.paired.p:>8.4f}{each.wins:>8}{each.losses:>7}"
        )
    for label, each in zip(labels[1:], found.versus, strict=True):
        for name, less in each.worst:
            lines.append(f"worst   {label}: {printable(name)} {less:+.4f}")
    for label, names in found.alone.items():
        lines.append(f"alone   {len(names)} logs of {printable(label)} are not in all")
    for label, failed in found.failed.items():
        for name, error in failed.items():
            lines.append(f"failed  {printable(label)}: {printable(name)}: {error}")
    return "\n".join([*lines, *(f"wrote   {printable(path)}" for path in written)])
