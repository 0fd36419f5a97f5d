"""X1, X2, G7, G8 on a real robot: jarvis, whose poses were measured, with both of its lasers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.results.file import RunFile, read_result
from replay import figures
from replay.figures import Chart, Line, Surface
from replay.reproduction.claims import Section
from replay.reproduction.course import SENSORS, reoptimised
from replay.reproduction.maps import RULES
from replay.running import run
from replay.sensors.observer import MODELS
from replay.tuning.early import course, keyframes_of
from replay.tuning.picks import PAPER
from replay.tuning.reading import ground_of, values_of
from replay.tuning.surfaces import Tables

LOG = "bags/crob_lab/jarvis_circular_path_fast.bag"
PLAN = "maps/crob_lab/i-108_10mm.yaml"
LASERS = {
    "upper laser": "/driver_laser_navigation/laser_scan",
    "lower laser": "/driver_laser_security/laser_scan",
}
# The plan's place and the clock's offset, measured once: see the plan's edges under the laser.
MEASURED: dict[str, Any] = {
    "pose": "/pose_ground_truth",
    "plan_pose": Pose(-14.5115, -3.7328, 0.02681),
    "pose_delay": 0.135,
}
WAYS: dict[str, dict[str, Any]] = {"every scan": {}, "a scan a 0.1 m": {"min_travel": 0.1}}
ABSENT = "the recorded log is not there: give --logs DIR, see the page of `replay paper`"


def data_folder(logs: Path | None) -> Path | None:
    """Where recorded logs lie: what is asked for, the environment's, or ../shared/data."""
    for folder in (logs, os.environ.get("REPLAY_SHARED_DATA"), "../shared/data"):
        if folder and (Path(folder) / LOG).exists():
            return Path(folder)
    return None


def runs(folder: Path, model: str = "eq15", **options: Any) -> dict[tuple[str, str], RunFile]:
    """Laser, way of taking scans -> the result of its run, with that sensor model."""
    out = {}
    with TemporaryDirectory() as there:
        for laser, topic in LASERS.items():
            for way, fewer in WAYS.items():
                path = Path(there) / "run.replay.mcap"
                given = {**MEASURED, **fewer, **options}
                run(
                    folder / LOG,
                    folder / PLAN,
                    output=path,
                    force=True,
                    notes=Notes(),
                    scan=topic,
                    sensor=model,
                    **given,
                )
                out[laser, way] = read_result(path)
    return out


def add_real(sections: Mapping[str, Section], logs: Path | None) -> None:
    """Put what the real robot says to G7, X1 and X2; or that it could not be asked."""
    folder = data_folder(logs)
    if folder is None:
        for row in ("G7", "X1", "X2", "G8"):
            sections[row].untested("the same on a real robot's log", ABSENT)
        return
    try:
        found = runs(folder)
        _curves(sections["G7"], found)
        for row in SENSORS:
            _optima(row, sections[row], found)
        _amcl(sections["G8"], folder)
    except FormatError as error:
        sections["G7"].untested("the same on a real robot's log", str(error))


def _curves(out: Section, found: Mapping[tuple[str, str], RunFile]) -> None:
    """F2 over time of the real robot, both rules."""
    panels = []
    for (laser, way), kept in found.items():
        ground = ground_of(kept)
        seen = keyframes_of(kept, ground)
        lines: list[Line] = []
        for rule in RULES:
            one = course(seen, values_of(kept, rule, 0.9, 0.1))
            mine, none = one.f2([PAPER[0]], [PAPER[1]])[:, 0], one.without_prior()
            if not lines:
                lines.append(Line("no prior", one.times, none, "--", figures.GREY))
            lines.append(Line(f"(.2, .9), {rule}", one.times, mine))
            above = bool((mine >= none).all())
            out.claim(
                f"real: starts very high, drops, stays above ({laser}, {way}, {rule})",
                bool(mine[0] > 0.8 and mine[-1] < mine[0] and above),
                f"F2 {mine[0]:.3f}, at the end {mine[-1]:.3f}, no prior {none[-1]:.3f}; least "
                f"lead {float((mine - none).min()):.3f}",
                "" if above else "every further reading takes the prior away again (A1)",
            )
        panels.append(Chart(f"jarvis, {laser}, {way}", "s", "F2", lines, None, (0.0, 1.02)))
    out.figure(
        "the same on a real robot: jarvis in a room of known plan, poses measured to 4 mm; prior "
        "and truth are one drawing (A28), cells of 0.05 m",
        figures.charts(panels, 2, 4.6, 2.9),
    )


def _optima(row: str, out: Section, found: Mapping[tuple[str, str], RunFile]) -> None:
    """X1 or X2 on the real robot's evidence."""
    sensor, (p_wall, p_space) = SENSORS[row]
    surfaces: list[Surface] = []
    for (laser, way), kept in found.items():
        case = ground_of(kept).case(kept.evidence())
        levels = MODELS["eq15"].p_levels(*sensor)
        for rule in RULES:
            values = values_of(kept, rule, *sensor)
            assert np.allclose(values.p_levels, levels)
            name = f"real, {laser}, {way}, {rule}"
            reoptimised(row, out, name, Tables(case, values), surfaces)
    out.figure(
        f"jarvis: F2 over (p_wall, p_space); cross: ({p_wall:g}, {p_space:g})",
        figures.surfaces(surfaces, 4, 2.9),
    )


def _amcl(out: Section, folder: Path) -> None:
    """Poses by AMCL on the plan, from the log's odometry; both priors on them."""
    with TemporaryDirectory() as there:
        path = Path(there) / "run.replay.mcap"
        run(
            folder / LOG,
            folder / PLAN,
            output=path,
            notes=Notes(),
            scan=LASERS["upper laser"],
            sensor="eq15",
            poses="amcl",
        )
        kept = read_result(path)
    ground = ground_of(kept)
    seen = keyframes_of(kept, ground)
    lines: list[Line] = []
    for rule in RULES:
        one = course(seen, values_of(kept, rule, 0.9, 0.1))
        mine, none = one.f2([PAPER[0]], [PAPER[1]])[:, 0], one.without_prior()
        if not lines:
            lines.append(Line("no prior", one.times, none, "--", figures.GREY))
        lines.append(Line(f"(.2, .9), {rule}", one.times, mine))
        out.claim(
            f"real: the informative prior stays above (jarvis, AMCL, {rule})",
            bool((mine >= none).all()),
            f"F2 at the end {mine[-1]:.3f} against {none[-1]:.3f}; least lead "
            f"{float((mine - none).min()):.3f}",
            "" if (mine >= none).all() else "every further reading takes the prior away (A1)",
        )
    chart = Chart("jarvis, AMCL on the plan", "s", "F2", lines, None, (0.0, 1.02))
    out.figure("the same on a real robot in one room, started anywhere", figures.charts([chart]))
