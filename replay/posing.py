"""Where the poses of a run come from: its log, or a localiser; `auto` decides, and says why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import degrees, sqrt
from typing import Any

import numpy as np

from formats.errors import Notes, UsageError
from formats.frame import Floats, Particles, Pose
from formats.plans.edits import PlanEdits
from formats.plans.plan import Plan
from formats.stream import PoseWish
from formats.streaming.drive import Drive
from formats.streaming.explaining import tell_odometry
from replay.drawn import PlanMethod, taken_apart
from replay.localise.localising import LOCALISERS, localise
from replay.localise.options import DEFAULTS as LOCALISING
from replay.localise.poses import Poses, Times, compose, placed

HERE = Pose(0.0, 0.0, 0.0)


def methods() -> list[str]:
    """What --poses may be."""
    return ["auto", "log", *LOCALISERS]


@dataclass(frozen=True, eq=False)
class Decision:
    """How the poses are found.

    Attributes:
        method: "log", or a name in LOCALISERS.
        why: for people.
    """

    method: str
    why: str


@dataclass(frozen=True, eq=False)
class Posed:
    """A drive whose poses are known.

    Attributes:
        drive: its poses are those to map with.
        said: a line about them, "" where the log's own are taken.
        facts: for `--json`.
        found: what the localiser found, in the frame of the plan's yaml; None: the log's own.
        samples: of its particles now and then, of the sensor in the frame of the drive's poses.
    """

    drive: Drive
    said: str
    facts: dict[str, Any]
    found: Poses | None = None
    samples: tuple[Particles, ...] = ()

    def covariances(self, turn: float) -> tuple[Times, Floats] | None:
        """Times (m,) int64 and covariances (m, 3, 3) in a frame turned so far, rad."""
        if self.found is None:
            return None
        c, s = np.cos(turn), np.sin(turn)
        spin = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return self.found.times_ns, spin @ self.found.covariances @ spin.T


def wish(method: str) -> PoseWish:
    """What `survey` is to look for.

    Raises:
        UsageError: there is no such way to poses.
    """
    if method not in methods():
        raise UsageError(method, "no such way to poses", hint=f"there are {', '.join(methods())}")
    known: dict[str, PoseWish] = {"auto": "auto", "log": "log"}
    return known.get(method, "odometry")


def decide(method: str, drive: Drive, plan: Plan | None, *, asked: bool) -> Decision:
    """The method itself, or for `auto` what suits the log and the plan.

    Args:
        method: of `methods`.
        drive: as surveyed.
        plan: that the log is mapped over.
        asked: the user named the log's poses.

    Raises:
        UsageError: the method needs a plan, and there is none.
    """
    if plan is None and method in LOCALISERS and LOCALISERS[method].needs_plan:
        hint = "give --prior PLAN, or take --poses match"
        raise UsageError(drive.log.path, f"--poses {method} needs a plan to be on", hint=hint)
    if method != "auto":
        return Decision(method, "as asked for")
    if drive.choice.in_map:
        return Decision("log", "the log has poses in the map")
    if asked:
        return Decision("log", "its poses are asked for")
    if plan is None:
        return Decision("log", "the log has odometry only, and there is no plan")
    return Decision("amcl", "the log has odometry only")


def pose(
    decision: Decision,
    drive: Drive,
    plan: Plan | None,
    notes: Notes,
    options: Mapping[str, Any],
    *,
    laid: bool = False,
    edits: PlanEdits | None = None,
) -> Posed:
    """Find the poses of a drive.

    Args:
        decision: how.
        drive: all of its scans; its poses are the log's.
        plan: with a resolution, and for `laid` a place.
        notes: told what was found.
        options: of the run.
        laid: the plan was laid under the log's poses, so that they say about where it starts.
        edits: by hand, of the plan.

    Raises:
        UsageError: a start is given, and the log's own poses are taken.
    """
    start, seed = options["initial_pose"], options["seed"]
    if decision.method == "log":
        if start is not None or options["initial_cov"] is not None:
            problem = f"a start is given, but the poses are the log's ({decision.why})"
            raise UsageError(drive.log.path, problem, hint="give --poses amcl")
        if options["poses"] == "auto":
            tell_odometry(drive.choice, notes, drive.log.path)
        return Posed(drive, "", {"poses_depend_on": "log"})
    to_map = options["plan_pose"] or HERE
    depends = ["log", *(["plan"] if plan is not None else []), f"seed {seed}"]
    if start is not None:
        depends.append("start")
    elif laid and drive.choice.source.kind != "nothing":
        first = Pose(*drive.poses[0].tolist()) @ drive.choice.sensor_pose.inverse()
        start = to_map.inverse() @ first
    spread = options["initial_cov"]
    walls = None
    if plan is not None:
        walls, _ = taken_apart(plan, _method(options), Notes(), edits)
    found = localise(
        drive,
        walls,
        method=decision.method,
        start=start,
        covariance=None if spread is None else np.diag(spread),
        seed=seed,
        notes=notes,
        **{name: options[name] for name in LOCALISING},
    )
    if laid and options["poses"] == "auto" and settled_after(found) is None:
        return _fallen_back(decision, drive, notes)
    moved = compose(np.repeat([to_map], len(drive), axis=0), found.poses)
    where = "on the plan" if plan is not None else "without a plan"
    line = f"{decision.method} {where} ({decision.why}), {ending(found)}"
    source = replace(drive.choice.source, map_frame="map")
    choice = replace(
        drive.choice, source=source, reasons=[*drive.choice.reasons[:-1], _odometry(drive)]
    )
    facts = {
        "poses": line,
        "poses_depend_on": ", ".join(depends),
        "map_frame": "map",
        "settled_s": settled_after(found),
    }
    samples = placed(found.samples, to_map)
    return Posed(drive.placed(moved, choice), line, facts, found, samples)


def _fallen_back(decision: Decision, drive: Drive, notes: Notes) -> Posed:
    """The log's own poses, under which the plan was laid: they drift, but are no guess."""
    problem = f"{decision.method} never was certain: the log's odometry is taken, as the plan lies"
    notes.warn(drive.log.path, problem)
    line = f"the log's odometry under the plan ({decision.method} never was certain)"
    facts = {"poses": line, "poses_depend_on": "log", "settled_s": None}
    return Posed(drive, line, facts)


def ending(found: Poses) -> str:
    """How surely the last pose is known, and from when on they all were."""
    metres, angle = deviations(found.covariances[-1])
    after = settled_after(found)
    since = "never certain" if after is None else f"certain after {after:.1f} s"
    return f"{metres:.2f} m / {angle:.1f} deg at the end, {since}"


def settled_after(found: Poses) -> float | None:
    """Seconds to the first pose that was certain."""
    if found.settled >= len(found.times_ns):
        return None
    return (int(found.times_ns[found.settled]) - int(found.times_ns[0])) / 1e9


def deviations(covariance: Floats) -> tuple[float, float]:
    """Standard deviations of a (3, 3) covariance: m along the longest axis, and degrees."""
    place = float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return sqrt(max(place, 0.0)), degrees(sqrt(max(float(covariance[2, 2]), 0.0)))


def _odometry(drive: Drive) -> str:
    return drive.choice.reasons[-1].replace("poses from", "odometry from", 1)


def _method(options: Mapping[str, Any]) -> PlanMethod:
    method: PlanMethod = options["plan_method"]
    return method
