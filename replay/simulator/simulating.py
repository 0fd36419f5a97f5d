"""simulate(): a plan and what became of it in; a robot's log with its truth inside out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any, Unpack

import numpy as np

from formats.errors import FormatError, Notes, UsageError, printable
from formats.log_writing import Recorded, check_suffix, write_log
from formats.output import check_output
from formats.plans.file import Plan, open_plan
from replay.drawn import taken_apart
from replay.simulator.building import build
from replay.simulator.options import Options, effective
from replay.simulator.recording import recorded

Source = str | PathLike[str]
READINGS = ("/scan", "/range", "/camera/depth/image_raw")


def simulate(
    plan: Source,
    output: Source,
    *,
    truth: Source | None = None,
    count: int | None = None,
    force: bool = False,
    notes: Notes | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[Options],
) -> dict[str, Any]:
    """Drive a simulated robot through a plan, and write the log that it would have recorded.

    Args:
        plan: as drawn: a picture, drawing, map yaml, or LOG:/map.
        output: .mcap, .bag, or without a suffix a rosbag2 folder.
        truth: a picture of what stands there instead, of the plan's size.
        count: so many logs OUTPUT-000, ..., with seeds from `seed` on, each from a place of its
            own where none is given.
        force: replace outputs that exist.
        notes: gets what was odd.
        progress: is told (done, expected) readings.
        options: see `simulator.options.Options`.

    Returns:
        facts of the drive; of all of them where `count` is given, by "logs".

    Raises:
        FormatError: the plan cannot be used, or the log cannot be written.
        UsageError: an option is not possible.
    """
    notes, chosen, out = Notes() if notes is None else notes, effective(options), Path(output)
    check_suffix(out)
    if count is not None and not 1 <= count <= 100_000:
        raise UsageError("", f"--count {count} is not from 1 to 100,000")
    given = [Path(path) for path in (plan, truth) if path]
    outputs = [out] if count is None else [numbered(out, i, count) for i in range(count)]
    for path in outputs:
        if path.suffix:
            check_output(path, force=force, inputs=given)
        elif path.exists() and not force:
            raise FormatError(path, "exists already", hint="give another name, or --force")
    scale, corner = chosen["plan_resolution"], chosen["plan_origin"]
    drawing = open_plan(plan, notes, resolution=scale, origin=corner)
    drawn, _ = taken_apart(drawing, chosen["plan_method"], notes)
    real = beside(open_plan(truth, notes), drawn) if truth else None
    inputs = [Path(name) for read in (drawn, real) if read is not None for name in read.inputs]
    logs = []
    for i, path in enumerate(outputs):
        own: Options = {**chosen, "seed": chosen["seed"] + i}
        if count is not None and not (chosen["start"] or chosen["waypoint"]):
            own["random_start"] = True
        logs.append(_one(drawn, real, path, own, notes, force, inputs, progress))
    return logs[0] if count is None else {"logs": logs}


def numbered(path: Path, i: int, count: int) -> Path:
    """NAME-007.mcap of NAME.mcap."""
    digits = max(3, len(str(count - 1)))
    return path.with_name(f"{path.stem}-{i:0{digits}}{path.suffix}")


def beside(truth: Plan, plan: Plan) -> Plan:
    """The truth, when it has the plan's pixels.

    Raises:
        UsageError: it has others.
    """
    if truth.occupancy.shape != plan.occupancy.shape:
        rows, cols = plan.occupancy.shape
        have = f"{truth.occupancy.shape[1]} x {truth.occupancy.shape[0]}"
        problem = f"{have} pixels are not the plan's {cols} x {rows}"
        raise UsageError(truth.path, problem, hint="draw both at one scale")
    return replace(truth, resolution=plan.resolution, origin=plan.origin)


def _one(
    plan: Plan,
    real: Plan | None,
    path: Path,
    options: Options,
    notes: Notes,
    force: bool,
    inputs: list[Path],
    progress: Callable[[int, int], None] | None,
) -> dict[str, Any]:
    """One log."""
    start = perf_counter()
    drive, reach = build(plan, real, options, notes)
    expected = sum(int(drive.way.seconds * s.rate + 1e-9) + 1 for s in drive.sensors.values())

    def counted() -> Iterator[Recorded]:
        done = 0
        for message in recorded(drive):
            if message.topic in READINGS:
                done += 1
                if progress and done % 16 == 0:
                    progress(done, expected)
            yield message

    about = {"simulation": drive.about}
    topics = write_log(path, counted(), metadata=about, force=force, inputs=inputs)
    solid, drawn = drive.site.solid, plan.wall[::-1]
    area = plan.scale**2
    return {
        "log": str(path),
        "plan": str(plan.path),
        "seconds": drive.way.seconds,
        "metres": drive.way.metres,
        "reachable": reach,
        "added": float(np.count_nonzero(solid & ~drawn)) * area,
        "gone": float(np.count_nonzero(drawn & ~solid)) * area,
        "topics": topics,
        "readings": sum(topics.get(name, 0) for name in READINGS),
        "plan_offset": list(drive.plan_pose),
        "seed": options["seed"],
        "took": perf_counter() - start,
    }


def report(facts: dict[str, Any]) -> str:
    """Lines that a person reads, without the last line break."""
    if "logs" in facts:
        logs = facts["logs"]
        took, readings = sum(log["took"] for log in logs), sum(log["readings"] for log in logs)
        driven = sum(log["seconds"] for log in logs)
        head = f"drive   {len(logs)} drives of {driven:.1f} s, {readings} readings in {took:.1f} s"
        return "\n".join([head, f"wrote   {logs[0]['log']} to {Path(logs[-1]['log']).name}"])
    topics = ", ".join(f"{name} {n}" for name, n in facts["topics"].items())
    took = facts["took"]
    changes = f"{facts['added']:.1f} m² stand that are not drawn, {facts['gone']:.1f} m² are gone"
    return "\n".join(
        [
            f"world   {printable(Path(facts['plan']).name)}: {changes}",
            f"drive   {facts['metres']:.1f} m of way over {facts['reachable']:.0f} m² of ground",
            f"log     {facts['readings']} readings, {facts['seconds']:.1f} s in {took:.1f} s",
            f"topics  {topics}",
            f"wrote   {printable(facts['log'])}",
        ]
    )
