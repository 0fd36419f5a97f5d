"""run(): logs and a plan in; a result file, a recording and scores out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from math import inf
from os import PathLike
from typing import TYPE_CHECKING, Any, Unpack

from formats.errors import Notes
from formats.frame import Floats, Pose
from formats.log import Log
from formats.plans.plan import Plan
from formats.result import Result
from formats.results.file import ResultWriter
from formats.stream import Drive, open_log, survey
from replay import facts
from replay.asking import Asked, ask, states, tell_changed
from replay.mapper import Mapper
from replay.options import GATES, READING, WORLD, Options, among
from replay.pipeline import Clock, steps
from replay.posing import Posed, decide, pose, wish
from replay.scoring import measuring
from replay.scoring.history import History
from replay.scoring.predictive import Predictor
from replay.sensors.models import MODELS
from replay.surveying.deviations import Deviations, deviations
from replay.world import World, build_world

if TYPE_CHECKING:
    from replay.localise.poses import Times
    from replay.trajectories.truth import Judged

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
    more = measuring.checked(metrics)
    named: dict[str, Any] = {"truth": truth, "output": output, "rrd": rrd, "force": force}
    asked = ask(logs, prior, options, notes, align=align, prior_values=prior_values, **named)
    viewer, chosen = None, asked.chosen
    with ExitStack() as stack:
        if rrd or view or connect:  # before the log, since it starts beside it
            from replay.viewing.aside import Viewer

            viewer = Viewer(
                path=rrd,
                view=view,
                connect=connect,
                budget=viewer_budget,
                force=force,
                inputs=asked.inputs,
                notes=notes,
                say=say,
            )
            stack.enter_context(viewer)
        log = open_log(asked.logs, notes)
        stack.callback(log.close)
        before = states(asked.logs)
        plan, posed = posed_drive(log, asked, align, notes, clock)
        judged = None
        if truth_poses:
            judged = against_truth(truth_poses, posed, plan, chosen["truth_delay"], notes)
        drive = posed.drive.gated(**among(chosen, GATES))
        clock.lap("localising")
        world, mapper = begun(asked, plan, drive, notes)
        said = facts.said(world, drive, notes, posed.said, judged.line if judged else "")
        origin = {"said": said, **facts.origin(world, drive, log), **posed.facts}
        origin |= {"pose_errors": judged.facts} if judged else {}
        origin |= {"archive": dict(archive)} if archive else {}
        writer = writer_of(asked, world, posed, origin, force=force)
        sinks: list[Any] = [stack.enter_context(writer)]
        title = f"{asked.logs[0].name} over {plan.path.name if plan else 'no plan'}"
        if viewer is not None:
            from replay.viewing.making import scene_of_world, walls_of

            text = facts.markdown(title, said)
            told = {
                "spread": spread_of(asked, world, posed),
                "particles": posed.samples,
                "places": posed.facts.get("places", ()),
            }
            viewer.show(
                scene_of_world(world, title, text, asked.main, len(drive), drive.bounds, **told)
            )
            sinks.append(viewer)
        predictor, history = None, History(world.curves)
        if measuring.PREDICTIVE in more:
            predictor = Predictor(world.curves, mapper.observe)
        clock.lap("reading")
        frames = drive.frames()
        aside: dict[str, Any] = {"clock": clock, "progress": progress, "predictor": predictor}
        for step in steps(frames, len(drive), world, mapper, **aside):
            for sink in sinks:
                sink.write(step)
            history.add(step)
        tell_changed(asked.logs, before, notes)
        result = Result(
            settings=dict(chosen),
            times_ns=history.times_ns(),
            counts=history.counts(),
            grids={name: curve.of(mapper.evidence) for name, curve in world.curves.items()},
            facts={**origin, **facts.ended(history, chosen["region"], notes)},
        )
        against_plan = compared(world, mapper, notes)
        if against_plan is not None:
            result.facts["walls"] = against_plan.facts()
        foretold = predictor.scores() if predictor else {}
        result.facts |= measured(result, world, mapper, more, foretold, intervals=intervals)
        clock.lap("scoring")
        writer.finish(result.facts)
        if viewer is not None:
            if against_plan is not None:
                viewer.compare(walls_of(against_plan))
            viewer.report(facts.markdown(title, said, result.facts))
    clock.lap("writing")
    drawn = [str(rrd)] if rrd and viewer and viewer.written else []
    result.facts |= {
        "result": str(asked.out),
        "written": [str(asked.out), *drawn],
        "lost": notes.total("lost"),  # a recording, too
        "seconds": {"whole": sum(clock.seconds.values()), **clock.seconds},
    }
    return result


def posed_drive(
    log: Log, asked: Asked, align: Source | None, notes: Notes, clock: Clock
) -> tuple[Plan | None, Posed]:
    """The log's scans with the poses to map with, and the plan where it lies under them."""
    plan, chosen = asked.plan, asked.chosen
    reading = among(chosen, READING)
    whole = {name: value for name, value in reading.items() if name not in GATES}
    drive = survey(log, notes, poses=wish(chosen["poses"]), **whole)
    decision = decide(chosen["poses"], drive, plan, asked=bool(chosen["pose"]))
    laid = align is not None or chosen["plan_pose"] is not None
    places: list[dict[str, Any]] = []
    if plan and not (plan.placed or laid) and wish(chosen["poses"]) == "odometry":
        plan = replace(plan, placed=True)  # its lower left corner is the map's origin
    elif plan and (align or not (plan.placed or laid)):
        from replay.placing import located

        plan, places = located(plan, asked.logs[0], align, notes, **reading)
        laid = True
    clock.lap("reading")
    posed = pose(decision, drive, plan, notes, chosen, laid=laid, edits=asked.edits)
    if places:
        posed = replace(posed, facts={**posed.facts, "places": places})
    return plan, posed


def writer_of(
    asked: Asked, world: World, posed: Posed, origin: dict[str, Any], *, force: bool
) -> ResultWriter:
    """What writes the result."""
    return ResultWriter(
        asked.out,
        geometry=world.geometry,
        curves=world.curves,
        main=asked.main,
        layers=world.kept(),
        settings=asked.settings,
        map_to_plan=world.map_to_plan,
        covariances=spread_of(asked, world, posed),
        particles=posed.samples,
        attachments={path.name: path.read_bytes() for path in world.files},
        facts=origin,
        force=force,
        inputs=asked.inputs,
    )


def spread_of(asked: Asked, world: World, posed: Posed) -> tuple[Times, Floats] | None:
    """Covariances of the poses in the plan's frame, where a localiser found them."""
    to_map = asked.chosen["plan_pose"] or Pose(0.0, 0.0, 0.0)
    return posed.covariances(world.map_to_plan.yaw - to_map.yaw)


def against_truth(
    truth_poses: Source, posed: Posed, plan: Plan | None, delay: float, notes: Notes
) -> Judged:
    """The errors of the poses, from when on they were certain."""
    from replay.trajectories.truth import judge

    return judge(
        truth_poses,
        posed.drive,
        notes,
        since=posed.found.settled if posed.found else 0,
        aligned=not (posed.drive.choice.in_map or (plan and posed.found)),
        delay=delay,
    )


def begun(asked: Asked, plan: Plan | None, drive: Drive, notes: Notes) -> tuple[World, Mapper]:
    """What stands before the first frame, and the mapper with nothing seen."""
    chosen = asked.chosen
    reach = min(drive.limit if drive.limit > 0.0 else inf, chosen["max_range"])
    options = among(chosen, WORLD)
    world = build_world(
        plan, asked.truth, drive.bounds, reach, notes, plan_edits=asked.edits, **options
    )
    facts.warn(world, chosen, notes)
    model = MODELS[chosen["sensor"]]
    mapper = Mapper(
        world.geometry,
        model,
        max_range=reach,
        no_return=chosen["no_return"],
        truth=world.true_levels(model.levels) if model.of_truth else None,
    )
    return world, mapper


def compared(world: World, mapper: Mapper, notes: Notes) -> Deviations | None:
    """The walls of the plan, where there is one, against all that was seen."""
    if world.plan is None:
        return None
    found = deviations(mapper.evidence, world.kept(), world.curves["none"].p_levels)
    facts.warn_elsewhere(found, world.plan.path, notes)
    return found


def measured(
    result: Result,
    world: World,
    mapper: Mapper,
    metrics: Iterable[str],
    foretold: Mapping[str, float],
    *,
    intervals: bool,
) -> dict[str, Any]:
    """What else was asked for of the last maps."""
    found: dict[str, Any] = {}
    scored = world.scored
    if result.settings["region"] == "observed":
        scored = scored & (mapper.evidence.visits() > 0)
    if metrics:
        found["metrics"] = measuring.measured(metrics, result.grids, world.wall, scored, foretold)
    if intervals:
        names = (*facts.SHOWN, *metrics)
        found |= measuring.sureness(names, result.grids, world.wall, scored)
    return found
