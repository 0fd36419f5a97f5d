"""Errors of the poses that are found on recorded logs, a line a log and way of finding them.

    python -m scripts.trajectories DATA [--only NAME]

Truth is measured poses (jarvis), or hand-made relations between poses (intel, aces). Errors are
what `replay run --truth-poses` prints; seconds are of the whole run, mapping and scoring included.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from formats.frame import Pose
from replay import run


class Drive(NamedTuple):
    """A recorded log whose poses are known.

    Attributes:
        name: in the table.
        log, truth: below the folder of data; a truth that begins with "/" is a topic of the log.
        plan: below it; "" for none.
        options: of `run`.
    """

    name: str
    log: str
    truth: str
    plan: str
    options: dict[str, Any]


JARVIS: dict[str, Any] = {
    "scan": "/driver_laser_navigation/laser_scan",
    "truth_delay": 0.135,
    "plan_origin": Pose(-14.5115, -3.7328, 0.02681),
}
RADISH = "carmen/mola_radish"
DRIVES = (
    *(
        Drive(
            f"jarvis, amcl from anywhere, seed {seed}",
            "bags/crob_lab/jarvis_circular_path_fast.bag",
            "/pose_ground_truth",
            "maps/crob_lab/i-108_10mm.yaml",
            {**JARVIS, "poses": "amcl", "seed": seed},
        )
        for seed in range(3)
    ),
    *(
        Drive(
            f"{name}, {poses}",
            f"{RADISH}/{name}.clf.bz2",
            f"{RADISH}/{name}.relations",
            "",
            {"poses": poses},
        )
        for name in ("intel", "aces")
        for poses in ("match", "fastslam")
    ),
)


def main(argv: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", default="", help="drives whose names hold this")
    args = parser.parse_args(argv)
    with TemporaryDirectory() as folder:
        for drive in DRIVES:
            if args.only not in drive.name:
                continue
            truth = drive.truth if drive.truth[0] == "/" else str(args.data / drive.truth)
            begin = time.perf_counter()
            result = run(
                args.data / drive.log,
                args.data / drive.plan if drive.plan else None,
                truth_poses=truth,
                output=Path(folder) / "result.mcap",
                force=True,
                **drive.options,
            )
            took = time.perf_counter() - begin
            said = result.facts["said"]["truth"][0]
            print(f"{drive.name:36}{took:6.0f} s  {said}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
