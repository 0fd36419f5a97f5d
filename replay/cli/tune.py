"""`replay tune`: which values the prior should have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import force_flag, given, json_flag, output_flag, quiet_flag
from replay.cli.values import POSITIVE, PROBABILITY, answer, ending, say


@click.command("tune")
@click.argument(
    "sources", nargs=-1, required=True, metavar="RESULT...|PLAN", type=click.Path(path_type=Path)
)
@click.option(
    "--truth", metavar="IMAGE", type=click.Path(path_type=Path), help="Of PLAN: what really stands."
)
@output_flag("tune")
@force_flag
@click.option(
    "--update",
    type=click.Choice(["both", "bayes", "paper"]),
    help="The rule; both by default, of which bayes chooses the prior.",
)
@click.option(
    "--pick",
    metavar="NAME",
    help="What is chosen: f2 (default), robust (default of several), early, knee, weights, "
    "shortlist, paper.",
)
@click.option("--p-hit", type=PROBABILITY, help="P(OCCUPIED) of a hit, instead of the run's.")
@click.option("--p-miss", type=PROBABILITY, help="P(OCCUPIED) of a miss, instead of the run's.")
@click.option("--prior-scale", type=PROBABILITY, help="Instead of the run's, 0.9 as a rule.")
@click.option(
    "--objective",
    type=click.Choice(["exact", "interpolated"]),
    help="Of the genetic search: exact (default), or from a 10 x 10 grid.",
)
@click.option(
    "--algorithm",
    type=click.Choice(["gamultiobj", "geometric", "nsga2"]),
    help="Controlled elitism as MATLAB documents it (default), Deb and Goel's, or plain NSGA-II.",
)
@click.option("--seed", metavar="N", type=int, help="Of the search; 1.")
@click.option("--population", metavar="N", type=click.IntRange(4), help="50.")
@click.option("--generations", metavar="N", type=click.IntRange(1), help="At most; 400.")
@click.option("--steps", metavar="N", type=click.IntRange(2), help="A side of the surfaces; 91.")
@click.option("--recall-weight", type=PROBABILITY, help="Of the pick by pseudo-weights; 0.5.")
@click.option("--cell", metavar="PX", type=click.IntRange(1), help="Of PLAN: a cell's side; 5.")
@click.option("--plan-resolution", metavar="M", type=POSITIVE, help="Of PLAN: metres a pixel.")
@click.option(
    "--plan-method",
    type=click.Choice(["auto", "ink", "structural", "georgiou"]),
    help="Of PLAN: how a drawing becomes walls.",
)
@click.option(
    "--resume",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Keep the search's state here, and go on from it.",
)
@click.option("--no-figures", is_flag=True, help="Write values and table alone.")
@click.option("--no-sensors", is_flag=True, help="Do not try other sensor probabilities.")
@json_flag
@quiet_flag
def command(
    sources: tuple[Path, ...],
    no_figures: bool,
    no_sensors: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> int:
    """Find the prior's values that suit RESULTs of `replay run`, or a PLAN, best.

    \b
    Examples:
      replay tune turtlebot.replay.mcap
      replay tune runs/*.replay.mcap --pick early -o tuned
      replay tune plan.png --plan-resolution 0.02 --update paper
      replay run drive.mcap --prior plan.png --prior-values tune_prior.json

    Nothing is replayed: a result keeps what its readings showed, and the exact Pareto front of
    precision and recall over p_wall and p_space follows from that. A PLAN is explored by the
    paper's simulated robot.
    """
    from replay import tune
    from replay.cli.progress import bar
    from replay.tuning.telling import report

    notes = Notes()
    chosen = given(options)
    try:
        with bar(quiet=quiet or as_json, what="search", unit="generations") as progress:
            facts = tune(
                list(sources),
                figures=not no_figures,
                sensors=not no_sensors,
                notes=notes,
                progress=progress,
                **chosen,
            )
    finally:
        say(notes)
    if as_json:
        answer(facts)
    else:
        click.echo(report(facts))
        if not quiet:
            click.echo(
                f"next: replay run LOG --prior PLAN --prior-values {facts['written'][0]}", err=True
            )
    return ending(notes)
