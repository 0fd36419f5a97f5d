"""Why these topics and poses were chosen, and which scans have no pose for want of what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes, Path, printable
from formats.streaming.choice import Choice, described
from formats.streaming.clock import SECOND, Times
from formats.streaming.gathering import Gathered, ScanTimes
from formats.streaming.poses import Kind
from formats.streaming.sifting import APART_S, apart_s, seconds
from formats.streaming.track import Samples, Why
from formats.streaming.way import Way

WHY: dict[Kind, str] = {
    "tf": "tf knows the map frame",
    "pose topic": "tf knows no map frame",
    "amcl_pose": "tf knows no map frame, no other topic the pose",
    "tf odometry": "nothing in this log knows the map frame",
    "odometry topic": "nothing in this log knows the map frame",
    "nothing": "the scans alone say how it moved",
}
BY_MAP = "poses in the map, of which the way from one to the next is taken"


def tell_choice(
    gathered: Gathered,
    scans: ScanTimes,
    way: Way,
    keep: npt.NDArray[np.bool_],
    reason: str,
    asked: bool,
    odometry: bool = False,
) -> Choice:
    """The choice with its reasons, noted as well.

    Args:
        gathered: of the log.
        scans, reason: the topic taken, and why.
        way: to the poses.
        keep: scans that are wanted.
        asked: the user named the poses.
        odometry: the poses are to be found, and these only say how the robot moved.
    """
    notes, path, source = gathered.notes, gathered.log.path, way.source
    used = int((keep & way.valid).sum())
    kind, choice = scans.topic.type.rsplit("/", 1)[-1], described(way)
    chain = str(source)
    mounted = choice.sensor_frame != source.base_frame and not way.registered
    if source.kind != "nothing" and mounted:
        chain += f" > {choice.sensor_frame or '(unnamed)'}"
    chain += f", carried by {source.carrier}" if source.carrier else ""
    what = f"{source.topic.type.rsplit('/', 1)[-1]}, " if source.topic else ""
    noun, because = "odometry" if odometry else "poses", WHY[source.kind]
    if odometry and source.kind != "nothing":
        because = BY_MAP if source.in_map else "how the robot moved"
    head = "no odometry" if source.kind == "nothing" else f"{noun} from {chain}"
    why = f"{head} ({what}{used} of {len(scans)} scans)"
    why += f": {'as asked for' if asked else because}"
    reasons = [f"scans from {scans.topic.name} ({kind}: {reason})", why]
    for line in reasons:
        notes.info(path, line)
    tree = gathered.tree
    if source.topic is not None:
        track = gathered.poses[source.topic].track(tree.clock, tree.max_gap_ns)
        track.tell(notes, path, source.topic.name, "pose", tree.zero_ns)
    return replace(choice, reasons=reasons)


def tell_frame(scans: ScanTimes, way: Way, notes: Notes, path: Path) -> None:
    """What follows from scans in a frame that does not move with the robot, or has a prefix."""
    for name in scans.names:
        if way.sensor_pose is None and (known := way.known(name)) != name:
            what = f"no transform knows the frame {printable(name)}: taken as {printable(known)}"
            notes.warn(path, what, topic=scans.topic.name)
    fixed = [printable(name) for name in scans.names if way.stays(name)]
    if not fixed:
        return
    where = f"their frame {', '.join(fixed)} does not move with the robot"
    if way.registered:
        notes.info(path, f"{where}: seen from {printable(way.source.base_frame)}")
    else:
        notes.warn(path, f"{where}: taken as seen from its origin", topic=scans.topic.name)


def tell_odometry(choice: Choice, notes: Notes, path: Path) -> None:
    """A warning where the poses are odometry alone."""
    source = choice.source
    if not source.in_map:
        problem = (
            f"poses come from odometry alone ({source.map_frame}): they drift and are not in the "
            "plan's frame"
        )
        notes.warn(path, problem, topic=source.topic.name if source.topic else "/tf")


def tell_missing(
    gathered: Gathered,
    scans: ScanTimes,
    way: Way,
    keep: npt.NDArray[np.bool_],
    times: Times,
    zero: int,
) -> None:
    """Count the scans without a pose by what is missing; an error where no scan has one."""
    notes, path, name = gathered.notes, gathered.log.path, scans.topic.name
    apart = apart_s(scans, _moving(gathered, way), way.delay_ns)
    clocks = (
        f"the clocks of scans and poses seem {abs(apart):.2f} s apart: "
        f"try --pose-delay {apart + way.delay_ns / SECOND:.2f}"
    )
    lost = keep & ~way.valid
    none = not (keep & way.valid).any()
    for gap in sorted(way.missing, key=lambda gap: -len(gap.rows)):
        rows = gap.rows[lost[gap.rows]]
        lost[rows] = False
        if not rows.size:
            continue
        problem = f"no {printable(gap.what)}"
        if gap.why is Why.GAP:
            problem += " within its gaps"
        elif gap.why is Why.JUMP:
            problem += " across its jumps"
        elif gap.bound_ns:
            side = "before" if gap.why is Why.BEFORE else "after"
            problem += f" {side} {seconds(gap.bound_ns, zero)}"
        at = seconds(times[rows[0]], zero)
        if none:
            hint = "the poses do not cover the scans: compare their times with `replay info`"
            if "<-" in gap.what:
                hint = "give --sensor-pose X,Y,YAW or record /tf_static"
            elif abs(apart) > APART_S:
                hint = clocks
            share = f"({rows.size} of {len(scans)} scans)"
            raise FormatError(path, problem, topic=name, at=f"{at} {share}", hint=hint)
        notes.skip(path, problem, topic=name, at=at, count=int(rows.size))
    if abs(apart) > APART_S:
        notes.warn(path, clocks, topic=name)


def _moving(gathered: Gathered, way: Way) -> Samples | None:
    """The samples of what moves in a chain of poses."""
    if way.source.topic is not None:
        return gathered.poses[way.source.topic].samples
    ends = gathered.tree.path_between(way.source.map_frame, way.source.base_frame)
    edges = [edge for end in ends or () for edge in end]
    found = [samples for edge in edges if (samples := gathered.tree.samples(edge)) is not None]
    return max(found, key=len, default=None)
