"""What a prior was worth on recorded logs: F2 over time, as the figure of docs/prior.md.

    python -m scripts.prior_worth DATA [FIGURE]     DATA: the folder of recorded logs

Every log that has a plan or a map to score against is run with every scan, with every tenth, and
with a scan a 0.1 m; the curves are those of the runs: no prior, bayes, and paper (0.9 / 0.1).
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.result import Result
from formats.results.records import ratios
from replay import figures, run
from replay.figures import Chart, Line

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "pictures" / "prior.png"
MEASURED: dict[str, Any] = {
    "pose": "/pose_ground_truth",
    "plan_pose": Pose(-14.5115, -3.7328, 0.02681),
    "pose_delay": 0.135,
}


class Log(NamedTuple):
    """A recorded log with what it is scored against.

    Attributes:
        name: in the figure.
        log, plan: below the folder of data.
        options: of `run`.
    """

    name: str
    log: str
    plan: str
    options: dict[str, Any]


JARVIS = "bags/crob_lab/jarvis_circular_path_fast.bag", "maps/crob_lab/i-108_10mm.yaml"
MAC = "bags/olin_mac_floor1/macfirst_floor_take_2"
LOGS = (
    Log(
        "jarvis, upper laser, measured poses",
        *JARVIS,
        {**MEASURED, "scan": "/driver_laser_navigation/laser_scan"},
    ),
    Log(
        "jarvis, lower laser, measured poses",
        *JARVIS,
        {**MEASURED, "scan": "/driver_laser_security/laser_scan"},
    ),
    Log(
        "jarvis, upper laser, AMCL",
        *JARVIS,
        {"poses": "amcl", "scan": "/driver_laser_navigation/laser_scan"},
    ),
    Log(
        "TurtleBot 4, AMCL on its map",
        MAC,
        "bags/olin_mac_floor1/maps/mac_1st_floor_final.yaml",
        {"poses": "amcl"},
    ),
    Log(
        "Wean Hall 1, AMCL on its map",
        "carmen/cmu_wean/robotdata1.log.gz",
        "carmen/cmu_wean/wean.dat.gz",
        {"poses": "amcl", "resolution": 0.1},
    ),
    Log(
        "Guardian, its own tf, drawn lab",
        "bags/crob_lab/guardian_3.bag",
        "maps/crob_lab/lab_without_windows.yaml",
        {"scan": "/scan"},
    ),
    Log(
        "Intel lab, corrected poses, drawing",
        "carmen/ple_corrected/intel-corrected.log.gz",
        "maps/ipa_roomseg/lab_intel.png",
        {"plan_resolution": 0.0423},
    ),
)
WAYS: dict[str, dict[str, Any]] = {
    "every scan": {},
    "every tenth": {"every": 10},
    "a scan a 0.1 m": {"min_travel": 0.1},
}
CURVES = {"none": ("no prior", figures.GREY, "--"), "bayes": ("bayes", figures.BLUE, "-")}
CURVES["paper"] = ("paper", figures.RED, "-")


def chart(name: str, result: Result) -> Chart:
    """F2 over time of a run."""
    seconds = (result.times_ns - result.times_ns[0]) / 1e9
    lines = []
    for curve, (title, colour, style) in CURVES.items():
        f2 = ratios(result.counts[curve].sum(axis=1))[:, 2]
        lines.append(Line(title, seconds, f2, style, colour))
    return Chart(name, "s", "F2", lines, None, (0.0, 1.02))


def main() -> None:
    data = Path(sys.argv[1])
    figure = Path(sys.argv[2]) if len(sys.argv) > 2 else PICTURE
    panels = []
    print(
        f"{'log':<38}{'scans taken':<16}{'scans':>6}{'none':>7}{'bayes':>7}{'paper':>7}  observed"
    )
    with TemporaryDirectory() as folder:
        for one in LOGS:
            for way, fewer in WAYS.items():
                try:
                    result = run(
                        data / one.log,
                        data / one.plan,
                        output=Path(folder) / "run.replay.mcap",
                        force=True,
                        notes=Notes(),
                        **one.options,
                        **fewer,
                    )
                except (FormatError, UsageError) as error:
                    print(f"{one.name:<38}{way:<16}{error}")
                    continue
                whole, seen = result.facts["scores"], result.facts["observed"]
                f2 = "".join(f"{whole[curve]['f2']:>7.2f}" for curve in CURVES)
                inside = " ".join(f"{seen[curve]['f2']:.2f}" for curve in CURVES)
                print(
                    f"{one.name:<38}{way:<16}{result.facts['scans']:>6}{f2}  {inside}", flush=True
                )
                panels.append(chart(f"{one.name}\n{way}", result))
    figure.write_bytes(figures.charts(panels, len(WAYS), 3.6, 2.7))


if __name__ == "__main__":
    main()
