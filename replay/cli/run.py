"""`replay run`: the main job."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.drawing_values import scaled
from replay.cli.flags import (
    base_frame_flag,
    file_flag,
    force_flag,
    json_flag,
    map_frame_flag,
    plan_method_flag,
    quiet_flag,
    sensor_pose_flag,
)
from replay.cli.localising_flags import localising_flags
from replay.cli.values import (
    NOT_NEGATIVE,
    POSITIVE,
    PROBABILITY,
    CovarianceType,
    PoseType,
    SpanType,
    TableOption,
    answer,
    ending,
    say,
)


@click.command("run")
@click.argument("logs", nargs=-1, required=True, metavar="LOG...", type=click.Path(path_type=Path))
@click.option(
    "--prior",
    metavar="PLAN",
    type=click.Path(path_type=Path),
    help="The plan: a picture, a map_server yaml, or LOG:/map; without it, no prior.",
)
@click.option(
    "--truth",
    metavar="IMAGE",
    type=click.Path(path_type=Path),
    help="What really stands there; without it the plan is taken for the truth.",
)
@file_flag("FILE", "The result; STEM.replay.mcap in this folder by default.")
@force_flag
@json_flag
@click.option("--view", is_flag=True, help="Open the Rerun viewer and stream to it.")
@click.option("--rrd", metavar="FILE", type=click.Path(path_type=Path), help="Save for Rerun.")
@click.option("--viewer-budget", metavar="MB", type=POSITIVE, help="Drawn of a run at most; 150.")
@click.option("--connect", metavar="URL", help="Stream to a Rerun viewer that is already there.")
@click.option(
    "--align",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Where `replay align` found that the plan lies; found anew where nothing says it.",
)
@click.option("--scan", metavar="TOPIC", help="The scans; chosen when only one topic fits.")
@click.option("--pose", metavar="TOPIC", help='Where poses come from: a topic, "tf", "none".')
@click.option(
    "--poses",
    metavar="NAME",
    cls=TableOption,
    table="replay.posing:methods",
    help="The log's, or found on the plan; auto (default) decides and says why:",
)
@click.option("--initial-pose", type=PoseType(), help="Where amcl starts; else anywhere.")
@click.option("--initial-cov", type=CovarianceType(), help="Its variances; 0.25,0.25,0.0685.")
@click.option("--seed", type=click.IntRange(0), help="Of what is drawn by chance; 0.")
@click.option(
    "--truth-poses",
    metavar="TOPIC|FILE",
    help="Where it really was: a topic, TUM poses, or relations; prints the errors.",
)
@click.option("--truth-delay", metavar="S", type=float, help="Added to the stamps of that truth.")
@localising_flags
@map_frame_flag
@base_frame_flag
@sensor_pose_flag
@click.option("--camera-info", metavar="TOPIC", help="Of depth images; beside them by default.")
@click.option(
    "--scan-height",
    type=SpanType(),
    help="What of depth images and clouds counts: m above the floor; 0.1,1.",
)
@click.option(
    "--echo",
    type=click.Choice(["first", "last", "strongest"]),
    help="Of a laser scanner with several echoes a beam; first by default.",
)
@click.option(
    "--plan-pose", type=PoseType(), help="Of the plan's own frame in the frame of the poses."
)
@click.option("--pose-delay", metavar="S", type=float, help="Added to the stamps of the poses.")
@scaled
@click.option(
    "--plan-origin", type=PoseType(), help="Of the plan's lower left corner in its own frame."
)
@click.option(
    "--prior-values",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Values that `replay tune` chose; each option below goes before its value.",
)
@click.option("--p-wall", type=PROBABILITY, help="P(EMPTY) of a drawn wall, as in the paper; 0.2.")
@click.option("--p-space", type=PROBABILITY, help="P(EMPTY) of drawn free space; 0.9.")
@click.option("--p-outside", type=PROBABILITY, help="P(EMPTY) outside the plan; 0.5.")
@click.option("--p-door", type=PROBABILITY, help="P(EMPTY) of doors a drawing shows; p_space.")
@click.option("--p-window", type=PROBABILITY, help="P(EMPTY) of its windows; p_wall.")
@plan_method_flag
@click.option(
    "--plan-edits",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Edits of the plan by hand, as `replay plan --edits` takes them.",
)
@click.option(
    "--plan-confidence/--no-plan-confidence",
    default=None,
    help="Scale the prior towards 0.5 where the extraction is unsure; off by default.",
)
@click.option("--prior-scale", type=PROBABILITY, help="Multiplies p_wall and p_space; 0.9.")
@click.option(
    "--cell-rule",
    type=click.Choice(["any", "majority", "fraction"]),
    help="Which cells are wall: any wall pixel (default), most, or in proportion.",
)
@click.option(
    "--sensor",
    metavar="NAME",
    cls=TableOption,
    table="replay.sensors.models:MODELS",
    help="Sensor model; beam by default:",
)
@click.option("--p-hit", type=PROBABILITY, help="P(OCCUPIED) of a hit; 0.7 for beam.")
@click.option("--p-miss", type=PROBABILITY, help="P(OCCUPIED) of a miss; 0.4 for beam.")
@click.option(
    "--update",
    type=click.Choice(["bayes", "paper"]),
    help="The rule behind the map: bayes (default), or Equation 5 as the paper prints it.",
)
@click.option("--resolution", metavar="M", type=POSITIVE, help="A cell's side; 0.05.")
@click.option("--max-range", metavar="M", type=POSITIVE, help="Readings beyond are no returns.")
@click.option(
    "--no-return",
    type=click.Choice(["near", "clear", "ignore"]),
    help="What +inf clears: 5 m at most (near, default), all its range, or nothing.",
)
@click.option(
    "--region",
    type=click.Choice(["footprint", "image", "observed"]),
    help="Where cells are scored: inside the building (default), everywhere, where seen.",
)
@click.option(
    "--metric",
    "metrics",
    metavar="NAME",
    multiple=True,
    cls=TableOption,
    table="replay.scoring.measuring:names",
    help="More scores of the last maps; may be given again:",
)
@click.option(
    "--intervals", is_flag=True, help="How sure the scores are: bootstrap, and a test of the gain."
)
@click.option("--every", metavar="N", type=click.IntRange(1), help="Use every Nth scan.")
@click.option(
    "--readings-per-pose",
    metavar="N",
    type=click.IntRange(1),
    help="At most N scans where it stands.",
)
@click.option("--min-travel", metavar="M", type=NOT_NEGATIVE, help="Between scans that are used.")
@click.option("--min-turn", metavar="RAD", type=NOT_NEGATIVE, help="Or so much of a turn.")
@click.option("--start-offset", metavar="S", type=NOT_NEGATIVE, help="Leave out the log's start.")
@click.option("--duration", metavar="S", type=POSITIVE, help="Stop so long after the start.")
@quiet_flag
def command(logs: tuple[Path, ...], as_json: bool, quiet: bool, **options: Any) -> int:
    """Map LOGs over the prior of a plan, and score the map.

    \b
    Examples:
      replay run turtlebot.mcap --prior plan.png
      replay run drive.bag --prior plan.yaml --truth truth.png --view
      replay run drive.bag --prior plan.png --plan-resolution 0.02 --plan-origin -1.5,-2

    Probabilities of the prior (--p-wall, --p-space, --p-outside) are of EMPTY, as the paper has
    them; those of the sensor (--p-hit, --p-miss) are of OCCUPIED, as ROS has them.

    Localisation takes the options of nav2_amcl by their names, too (--max-particles, --alpha1,
    --laser-model-type and so on); docs/poses.md lists them.
    """
    from replay import run
    from replay.cli.progress import bar

    notes, aside = Notes(), partial(click.echo, err=True)
    chosen = {name: value for name, value in options.items() if value not in (None, ())}
    try:
        with bar(quiet=quiet or as_json) as progress:
            result = run(list(logs), notes=notes, progress=progress, say=aside, **chosen)
    finally:
        say(notes)
    if as_json:
        answer(result.facts)
    else:
        from replay.cli.table import run_report

        click.echo(run_report(result))
        if not quiet:
            click.echo(f"next: replay view {result.facts['result']}", err=True)
    return ending(notes)
