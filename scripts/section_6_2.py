"""The paper's section 6.2: mapping with AMCL's poses, from an exact x_0 and from an uncertain one.

Both priors are mapped from the same poses, since one run scores all of them; F2 is printed over
time. x_0 is the true pose at the first scan; the uncertain one is off by a draw from its variance.

    python -m scripts.section_6_2 LOG PLAN --truth-poses /pose_ground_truth --scan /scan
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import Notes
from formats.frame import Pose
from formats.result import Result
from formats.stream import open_log, survey
from replay.running import run
from replay.scoring.count_metrics import METRICS

EXACT = (1e-6, 1e-6, 1e-6)  # m², m², rad²
UNSURE = (0.25, 0.25, (pi / 12) ** 2)  # nav2_amcl's
POINTS = 11  # of the table, over the drive


def start_of(log: str, truth: str, delay: float, **reading: Any) -> Pose:
    """Where the body truly is at the first scan that the truth reaches."""
    opened = open_log([log], Notes())
    drive = survey(opened, Notes(), pose=truth, pose_delay=delay, **reading)
    opened.close()
    return Pose(*drive.poses[0].tolist()) @ drive.choice.sensor_pose.inverse()


def experiment(
    log: str,
    plan: str,
    start: Pose,
    *,
    seed: int = 0,
    folder: str | None = None,
    **options: Any,
) -> dict[str, Result]:
    """The run with AMCL from each start, by "exact" and "variance".

    Args:
        log: with odometry.
        plan: placed.
        start: the true first pose of the body, in the frame of the plan's yaml.
        seed: of the filter, and of how far off the uncertain start is.
        folder: where the two results are kept; None: nowhere.
        options: of `run`.
    """
    noise = np.random.default_rng(seed).standard_normal(3) * np.sqrt(UNSURE)
    off = Pose(*(np.array(start) + noise).tolist())
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name, pose, spread in (("exact", start, EXACT), ("variance", off, UNSURE)):
            found[name] = run(
                log,
                plan,
                poses="amcl",
                initial_pose=pose,
                initial_cov=spread,
                seed=seed,
                output=Path(folder or scratch) / f"{name}.replay.mcap",
                force=True,
                **options,
            )
    return found


def f2_over_time(result: Result, curve: str) -> list[tuple[float, float]]:
    """Seconds and F2, evenly over the drive."""
    rows = np.linspace(0, len(result.times_ns) - 1, POINTS).round().astype(int)
    since = (result.times_ns - result.times_ns[0]) / 1e9
    return [(float(since[k]), METRICS["f2"](result.split(curve, k).whole)) for k in rows]


def main(argv: list[str] | None = None) -> int:
    """Print F2 of each prior over time, for both starts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("log")
    parser.add_argument("plan")
    parser.add_argument("--truth-poses", required=True)
    parser.add_argument("--truth-delay", type=float, default=0.0)
    parser.add_argument("--plan-origin", type=lambda text: Pose(*map(float, text.split(","))))
    parser.add_argument("--scan", default="")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", help="a folder for the two results")
    args = parser.parse_args(argv)
    reading = {"scan": args.scan}
    start = start_of(args.log, args.truth_poses, args.truth_delay, **reading)
    found = experiment(
        args.log,
        args.plan,
        start,
        seed=args.seed,
        folder=args.output,
        plan_origin=args.plan_origin,
        truth_poses=args.truth_poses,
        truth_delay=args.truth_delay,
        **reading,
    )
    for name, result in found.items():
        print(f"x_0 {name}: {result.facts['said']['truth'][0]}")
        print("  s      " + "".join(f"{s:7.1f}" for s, _ in f2_over_time(result, "none")))
        for curve in result.counts:
            print(f"  {curve:<7}" + "".join(f"{f2:7.3f}" for _, f2 in f2_over_time(result, curve)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
