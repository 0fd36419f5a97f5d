"""run(): logs and a plan in; a result file, a recording and scores out."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from math import inf
from os import PathLike
from os.path import realpath
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from formats.errors import Notes, UsageError
from formats.frame import Pose
from formats.output import check_output
from formats.plans.edits import read_plan_edits
from formats.plans.file import open_plan
from formats.plans.prior_values import read_prior_values
from formats.result import Result
from formats.results.file import ResultWriter
from formats.stream import open_log, survey
from replay import facts
from replay.mapper import Mapper
from replay.options import GATES, READING, WORLD, Options, among, effective, plan_values
from replay.pipeline import Clock, steps
from replay.posing import decide, pose, wish
from replay.scoring import measuring
from replay.scoring.predictive import Predictor
from replay.sensors.observer import MODELS
from replay.surveying.deviations import deviations
from replay.world import build_world

Source = str | PathLike[str]


def run(
    logs: Source | Sequence[Source],
    prior: Source | None = None,
    *,
    truth: Source | None = None,
    output: Source | None = None,
    force: bool = False,
    rrd: Source | None = None,
    view: bool = False,
    connect: str | None = None,
    viewer_budget: float = 150.0,
    align: Source | None = None,
    truth_poses: Source | None = None,
    prior_values: Source | None = None,
    archive: Mapping[str, Any] | None = None,
    metrics: Sequence[str] = (),
    intervals: bool = False,
    notes: Notes | None = None,
    progress: Callable[[int, int], None] | None = None,
    say: Callable[[str], object] = print,
    **options: Unpack[Options],
) -> Result:
    """Map logs over the prior of a plan, score the map, and write the result.

    Args:
        logs: one log, or several of one run, merged by time.
        prior: the plan; None: map without one.
        truth: what really stands there; None: the plan is taken for it.
        output: the result file; None: STEM.replay.mcap in the current folder.
        force: replace outputs that exist.
        rrd: a recording for Rerun.
        view, connect: stream to a viewer, a new one or the one at an address.
        viewer_budget: MB that are drawn of the run, about.
        align: a placement that `replay align` wrote; without one, and without a place of its own,
            the plan is laid under the log here.
        truth_poses: where the robot really was: a topic, a TUM file, or a .relations file.
        prior_values: values of the prior that `replay tune` wrote; options go before them.
        archive: what a batch notes of this run in its result.
        metrics: more scores of the last maps, by their names in docs/metrics.md.
        intervals: how sure the scores are, and whether a prior's gain may be chance.
        notes: gets what was odd, skipped or lost.
        progress: is told (done, expected) scans.
        say: is told when the viewer is gone.
        options: see Options.

    Returns:
        the scores over time, the last maps, and in `facts` what `--json` prints.

    Raises:
        FormatError: an input cannot be used, or an output cannot be written.
        UsageError: several topics fit, or an option is not possible.
    """
    notes, clock = Notes() if notes is None else notes, Clock()
    values = read_prior_values(prior_values).options() if prior_values else {}
    chosen = effective({**values, **options})
    more = measuring.checked(metrics)
    sources = [Path(logs)] if isinstance(logs, str | PathLike) else [Path(log) for log in logs]
    if chosen["sensor"] not in MODELS:
        hint = f"there are {', '.join(MODELS)}"
        raise UsageError(chosen["sensor"], "no such sensor model", hint=hint)
    by_hand = chosen["plan_edits"]
    read = (prior, truth, align, prior_values, by_hand)
    inputs = [*sources, *(Path(path) for path in read if path)]
    out = Path(output) if output else Path(f"{stem(sources[0])}.replay.mcap")
    written = [out, *([Path(rrd)] if rrd else [])]
    for path in written:
        check_output(path, force=force, inputs=inputs)
    if rrd and realpath(rrd) == realpath(out):
        raise UsageError(rrd, "the recording and the result are one file", hint="name another")
    edits = read_plan_edits(by_hand) if by_hand else None
    if edits and not prior:
        raise UsageError(edits.path, "there is no plan to edit", hint="give --prior PLAN")
    plan = open_plan(prior, notes, **plan_values(chosen)) if prior else None
    real = open_plan(truth, notes) if truth else None
    inputs += [Path(path) for read in (plan, real) if read for path in read.inputs]
    for path in written:  # a yaml beside the plan is an input, too
        check_output(path, force=force, inputs=inputs)
    main = chosen["update"] if prior else "none"
    viewer = None
    with ExitStack() as stack:
        if rrd or view or connect:  # before the log, since it starts beside it
            from replay.viewing.aside import Viewer

            viewer = Viewer(
                path=rrd,
                view=view,
                connect=connect,
                budget=viewer_budget,
                force=force,
                inputs=inputs,
                notes=notes,
                say=say,
            )
            stack.enter_context(viewer)
        log = open_log(sources, notes)
        stack.callback(log.close)
        before = states(sources)
        reading = among(chosen, READING)
        whole = {name: value for name, value in reading.items() if name not in GATES}
        drive = survey(log, notes, poses=wish(chosen["poses"]), **whole)
        decision = decide(chosen["poses"], drive, plan, asked=bool(chosen["pose"]))
        laid = align is not None or chosen["plan_pose"] is not None
        if plan and not (plan.placed or laid) and wish(chosen["poses"]) == "odometry":
            plan = replace(plan, placed=True)  # its lower left corner is the map's origin
        elif plan and (align or not (plan.placed or laid)):
            from replay.placing import located

            plan, laid = located(plan, sources[0], align, notes, **reading), True
        clock.lap("reading")
        posed = pose(decision, drive, plan, notes, chosen, laid=laid, edits=edits)
        judged = None
        if truth_poses:
            from replay.trajectories.truth import judge

            judged = judge(
                truth_poses,
                posed.drive,
                notes,
                since=posed.found.settled if posed.found else 0,
                aligned=not (posed.drive.choice.in_map or (plan and posed.found)),
                delay=chosen["truth_delay"],
            )
        drive = posed.drive.gated(**among(chosen, GATES))
        clock.lap("localising")
        reach = min(drive.limit if drive.limit > 0.0 else inf, chosen["max_range"])
        world = build_world(
            plan, real, drive.bounds, reach, notes, plan_edits=edits, **among(chosen, WORLD)
        )
        facts.warn(world, chosen, notes)
        to_map = chosen["plan_pose"] or Pose(0.0, 0.0, 0.0)
        model = MODELS[chosen["sensor"]]
        mapper = Mapper(
            world.geometry,
            model,
            max_range=reach,
            no_return=chosen["no_return"],
            truth=world.true_levels(model.levels) if model.of_truth else None,
        )
        said = facts.said(world, drive, notes)
        if posed.said:
            said = {**said, "poses": [posed.said]}
        if judged:
            said = {**said, "truth": [judged.line]}
        origin = {"said": said, **facts.origin(world, drive, log), **posed.facts}
        if judged:
            origin["pose_errors"] = judged.facts
        if archive:
            origin["archive"] = dict(archive)
        writer = ResultWriter(
            out,
            geometry=world.geometry,
            curves=world.curves,
            main=main,
            layers=world.kept(),
            settings={
                "logs": sources,
                "prior": prior,
                "truth": truth,
                "prior_values": prior_values,
                **chosen,
            },
            map_to_plan=world.map_to_plan,
            covariances=posed.covariances(world.map_to_plan.yaw - to_map.yaw),
            attachments={path.name: path.read_bytes() for path in world.files},
            facts=origin,
            force=force,
            inputs=inputs,
        )
        sinks: list[Any] = [stack.enter_context(writer)]
        title = f"{sources[0].name} over {plan.path.name if plan else 'no plan'}"
        if viewer is not None:
            from replay.viewing.making import scene_of_world

            text = facts.markdown(title, said)
            viewer.show(scene_of_world(world, title, text, main, len(drive), drive.bounds))
            sinks.append(viewer)
        predictor = None
        if measuring.PREDICTIVE in more:
            predictor = Predictor(world.curves, mapper.observe)
        times, counts = array("q"), array("q")
        clock.lap("reading")
        frames = drive.frames()
        told: dict[str, Any] = {"clock": clock, "progress": progress, "predictor": predictor}
        for step in steps(frames, len(drive), world, mapper, **told):
            for sink in sinks:
                sink.write(step)
            times.append(step.frame.time_ns)
            for split in step.counts.values():
                counts.extend((*split.observed, *split.unobserved))
        for path in sources:
            if states([path]).items() - before.items():
                notes.warn(path, "changed while it was read: give it again when it is whole")
        found = {
            **origin,
            **facts.scores(world, counts[-8 * len(world.curves) :], region=chosen["region"]),
            "scans": len(times),
            "skipped": notes.total("skipped"),
            "lost": notes.total("lost"),
            "log_seconds": (times[-1] - times[0]) / 1e9 if times else 0.0,
            "notes": [f"{note.kind}: {note}" for note in notes if note.kind != "info"],
        }
        if world.plan is not None:
            levels = world.curves["none"].p_levels
            found["walls"] = deviations(mapper.evidence, world.kept(), levels).facts()
        grids = {name: curve.of(mapper.evidence) for name, curve in world.curves.items()}
        scored = world.scored
        if chosen["region"] == "observed":
            scored = scored & (mapper.evidence.visits() > 0)
        if more:
            foretold = predictor.scores() if predictor else {}
            found["metrics"] = measuring.measured(more, grids, world.wall, scored, foretold)
        if intervals:
            found |= measuring.sureness((*facts.SHOWN, *more), grids, world.wall, scored)
        clock.lap("scoring")
        writer.finish(found)
        if viewer is not None:
            viewer.report(facts.markdown(title, said, found))
    clock.lap("writing")
    table = np.array(counts, dtype=np.int64).reshape(len(times), len(world.curves), 2, 4)
    return Result(
        settings=dict(chosen),
        times_ns=np.array(times, dtype=np.int64),
        counts={name: table[:, i] for i, name in enumerate(world.curves)},
        grids=grids,
        facts={
            **found,
            "result": str(out),
            "written": [str(out), *([str(rrd)] if rrd and viewer and viewer.written else [])],
            "lost": notes.total("lost"),  # a recording, too
            "seconds": {"whole": sum(clock.seconds.values()), **clock.seconds},
        },
    )


def states(paths: Sequence[Path]) -> dict[Path, tuple[int, int]]:
    """Size and time of change (ns) of files, and of those right in folders."""
    files = [file for path in paths for file in (path.iterdir() if path.is_dir() else [path])]
    stats = {file: file.stat() for file in files if file.is_file()}
    return {file: (stat.st_size, stat.st_mtime_ns) for file, stat in stats.items()}


def stem(log: Path) -> str:
    """The name that a log's results go by: without `.mcap`, `.bag.gz` and the like."""
    name = "stdin" if log == Path("-") else Path(realpath(log)).name
    return name.split(".")[0] or name
