"""`replay batch`: many logs into an archive of results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from replay.cli.flags import given, json_flag
from replay.cli.run import command as of_run
from replay.cli.values import POSITIVE, answer

# What of a single run's options does not shape its result, or is said otherwise of many.
NOT_HERE = (
    *("logs", "output", "force", "as_json", "view", "rrd", "connect", "quiet"),
    *("viewer_budget", "truth_poses", "metrics", "intervals"),
)


def options_of_run(command: click.Command) -> click.Command:
    """The command with the options of `replay run` besides its own."""
    own = {param.name for param in command.params}
    taken = [param for param in of_run.params if param.name not in (*NOT_HERE, *own)]
    command.params += taken
    return command


@options_of_run
@click.command("batch")
@click.argument("logs", nargs=-1, required=True, metavar="LOGS...")
@click.option(
    "-o",
    "--output",
    "archive",
    required=True,
    metavar="ARCHIVE",
    help="The folder of results, made if need be; or an address like s3://bucket/runs.",
)
@click.option("--retry", is_flag=True, help="Try logs again that failed before.")
@click.option("--force", is_flag=True, help="Replace results of other options or versions.")
@click.option(
    "--jobs", type=click.IntRange(1), default=1, help="Logs at a time; 1. More need [cluster]."
)
@click.option("--cluster", metavar="tcp://HOST:8786", help="Work on a running Dask cluster.")
@click.option(
    "--timeout", metavar="S", type=POSITIVE, default=3600.0, help="That a log may take; 3600."
)
@click.option(
    "--max-memory",
    metavar="MB",
    type=POSITIVE,
    help="That a log's process may hold; else its share of 80 % of the machine's.",
)
@json_flag
@click.option("--quiet", is_flag=True, help="No progress.")
def command(logs: tuple[str, ...], archive: str, as_json: bool, quiet: bool, **options: Any) -> int:
    """Run LOGS into an ARCHIVE, a result each; a second call does only what is missing.

    \b
    Examples:
      replay batch logs/ -o runs --prior plan.yaml
      replay batch manifest.csv -o runs --jobs 8 --retry
      replay batch s3://bucket/logs -o s3://bucket/runs --prior plan.yaml

    LOGS are files, folders, patterns, lists (.txt), addresses, or manifests (.csv, .yaml) with a
    plan, a truth and options for each log. All options of `replay run` hold for every log.
    """
    from replay import batch
    from replay.cli.batch_progress import told

    chosen = given(options)
    done = [0, 0]
    try:
        with told(quiet=quiet, count=done) as watch:
            found = batch(logs, archive, watch=watch, **chosen)
    except KeyboardInterrupt:
        left = f"{done[0]} of {done[1]} logs are done" if done[1] else "nothing was begun"
        click.echo(f"replay: interrupted; {left}: the same command goes on from here", err=True)
        return 130
    if as_json:
        answer({"archive": found.archive, "same": found.same, "rows": found.rows()})
    else:
        from replay.cli.batch_progress import batch_report

        click.echo(batch_report(found))
        if not quiet:
            click.echo(
                f"next: replay rescore {Path(archive) if '://' not in archive else archive}",
                err=True,
            )
    return 3 if found.failed or found.lossy else 0
