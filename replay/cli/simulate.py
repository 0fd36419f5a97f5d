"""`replay simulate`: a log with its truth inside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from formats.errors import Notes
from replay.cli.flags import file_flag, force_flag, json_flag, plan_method_flag, quiet_flag
from replay.cli.values import NOT_NEGATIVE, POSITIVE, Number, PoseType, answer, ending, say


class LineType(click.ParamType[tuple[float, float, float, float]]):
    """X0,Y0,X1,Y1 in metres."""

    name = "X0,Y0,X1,Y1"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float, float]:
        """The four numbers, or a usage error that shows the form."""
        if isinstance(value, tuple):
            return value
        try:
            a, b, c, d = (float(part) for part in str(value).split(","))
        except ValueError:
            a = b = c = d = float("nan")
        if not all(abs(number) < 1e8 for number in (a, b, c, d)):
            self.fail(f"{value!r} is not X0,Y0,X1,Y1 (metres)", param, ctx)
        return a, b, c, d


SHARE = Number(0.0, 1.0)
LINE = LineType()


@click.command("simulate")
@click.argument("plan", metavar="PLAN", type=click.Path(path_type=Path))
@file_flag("LOG", "LOG.mcap, LOG.bag (ROS 1), or without a suffix a rosbag2 folder.", required=True)
@force_flag
@json_flag
@click.option(
    "--count",
    metavar="N",
    type=click.IntRange(1, 100_000),
    help="N logs LOG-000, LOG-001, ..., with seeds from --seed on, from random places.",
)
@click.option("--seed", type=click.IntRange(0), help="Of everything that is drawn; 2017.")
@click.option(
    "--truth",
    metavar="IMAGE",
    type=click.Path(path_type=Path),
    help="What stands there instead of PLAN, a picture of the same size.",
)
@click.option("--plan-resolution", metavar="M", type=POSITIVE, help="Metres a pixel of PLAN.")
@click.option("--plan-origin", type=PoseType(), help="Of PLAN's lower left corner.")
@plan_method_flag
@click.option("--plan-offset", type=PoseType(), help="Of the plan's frame in the map frame.")
@click.option("--clutter", metavar="SHARE", type=SHARE, help="Furniture on a share of the floor.")
@click.option("--remove-wall", multiple=True, type=LINE, help="The wall along a line is gone.")
@click.option("--collapse-wall", multiple=True, type=LINE, help="It lies about as rubble.")
@click.option("--remove-walls", metavar="SHARE", type=SHARE, help="Of the inner walls, at random.")
@click.option("--collapse-walls", metavar="SHARE", type=SHARE, help="Likewise, left as rubble.")
@click.option(
    "--deviation", metavar="M", type=NOT_NEGATIVE, help="Walls stand off from their drawn place."
)
@click.option(
    "--plan-speckle",
    metavar="SHARE",
    type=SHARE,
    help="Pixels turned over in /plan_map, the plan that the log holds.",
)
@click.option("--start", type=PoseType(), help="In PLAN's frame; the widest place by default.")
@click.option("--random-start", is_flag=True, default=None, help="Any free place instead.")
@click.option(
    "--waypoint",
    multiple=True,
    type=PoseType(),
    help="Drive by these, on the shortest way; without any, everywhere.",
)
@click.option("--laps", metavar="N", type=click.IntRange(1), help="Everywhere, so often; 1.")
@click.option("--spacing", metavar="M", type=POSITIVE, help="Of the places visited; 1.")
@click.option("--metres", metavar="M", type=NOT_NEGATIVE, help="Stop after so long a way.")
@click.option("--seconds", metavar="S", type=NOT_NEGATIVE, help="Stop after so long a time.")
@click.option("--speed", metavar="M/S", type=POSITIVE, help="0.35.")
@click.option("--turn-rate", metavar="RAD/S", type=POSITIVE, help="0.9.")
@click.option("--pause", metavar="S", type=NOT_NEGATIVE, help="Stand at each waypoint.")
@click.option("--robot-radius", metavar="M", type=NOT_NEGATIVE, help="Kept from walls; 0.2.")
@click.option(
    "--sensor",
    multiple=True,
    type=click.Choice(["lidar", "sonar", "kinect"]),
    help="lidar by default; may be given again.",
)
@click.option("--sensor-pose", type=PoseType(), help="Of the sensor on the base.")
@click.option("--sensor-height", metavar="M", type=NOT_NEGATIVE, help="Above the floor.")
@click.option("--pitch", metavar="RAD", type=float, help="Of the kinect, positive looks down.")
@click.option("--beams", metavar="N", type=click.IntRange(1), help="Of the lidar; 360.")
@click.option("--fov-deg", metavar="DEG", type=POSITIVE, help="Of the lidar; 360.")
@click.option("--cone-deg", metavar="DEG", type=POSITIVE, help="Of the sonar; 30.")
@click.option("--min-range", metavar="M", type=NOT_NEGATIVE, help="0.15, 0.05 or 0.5 by sensor.")
@click.option("--range", metavar="M", type=POSITIVE, help="12, 4 or 5 by sensor.")
@click.option("--rate", metavar="HZ", type=POSITIVE, help="Readings a second; 10, 10 or 5.")
@click.option("--range-noise", metavar="M", type=NOT_NEGATIVE, help="Standard deviation; 0.01.")
@click.option("--dropout", metavar="SHARE", type=SHARE, help="Readings that are lost.")
@click.option("--mixed", metavar="SHARE", type=SHARE, help="Beams at edges that hit in between.")
@click.option("--drift", metavar="D", type=NOT_NEGATIVE, help="Of the odometry after 1 m; 0.01.")
@click.option("--drift-pull", metavar="RAD/M", type=float, help="To the left; 0.002.")
@click.option(
    "--localised/--odometry-only",
    default=None,
    help="Whether tf leads from the map to the robot (default), or from odom alone.",
)
@quiet_flag
def command(plan: Path, as_json: bool, quiet: bool, **options: Any) -> int:
    """Drive a simulated robot through PLAN, and write its log with the truth inside.

    \b
    Examples:
      replay simulate plan.png -o sim.mcap
      replay simulate plan.png -o sim.bag --clutter 0.05 --remove-walls 0.2 --seconds 120
      replay simulate plan.png -o drives/flat.mcap --count 200 --metres 10

    Topics: /scan, /range or /camera/depth, /tf, /odom, /ground_truth (poses), /truth_map and
    /plan_map (what stands, what is drawn), /simulation (the options).
    """
    from replay import simulate
    from replay.cli.progress import bar
    from replay.simulator.simulating import report

    notes = Notes()
    chosen = {name: value for name, value in options.items() if value not in (None, ())}
    try:
        with bar(quiet=quiet or as_json) as progress:
            facts = simulate(plan, notes=notes, progress=progress, **chosen)
    finally:
        say(notes)
    if as_json:
        answer(facts)
    else:
        click.echo(report(facts))
        if not quiet and "log" in facts:
            log = facts["log"]
            offset = ",".join(f"{number:g}" for number in facts["plan_offset"])
            pose = "" if offset == "0,0,0" else f" --plan-pose={offset}"
            click.echo(
                f"next: replay run {log} --prior {plan} --truth {log}:/truth_map{pose}", err=True
            )
    return ending(notes)
