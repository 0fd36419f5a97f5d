"""Where the scans of a topic were taken, by one source of poses: tf or a pose topic."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.clock import Times
from formats.frame import Pose
from formats.frame_names import BASES, MAPS, by_name, is_base, is_map, is_odom, last_part
from formats.gathering import Gathered, PoseTimes, ScanTimes
from formats.log import Topic
from formats.tf import Missing, Tree, missing_of
from formats.track import Floats, Track, Why, matrices

Kind = Literal["tf", "pose topic", "amcl_pose", "tf odometry", "odometry topic"]
DRIVEN = 0.1  # m; what moves by less does not drive
KINDS: tuple[Kind, ...] = ("tf", "pose topic", "amcl_pose", "tf odometry", "odometry topic")


@dataclass(frozen=True)
class Source:
    """One way to the robot's poses.

    Attributes:
        kind: what it is, in the order of preference of KINDS.
        topic: None for tf.
        map_frame: the frame that the poses are in.
        base_frame: what is posed, "" where nothing says so.
    """

    kind: Kind
    topic: Topic | None
    map_frame: str
    base_frame: str

    @property
    def in_map(self) -> bool:
        """Whether the poses may be in the plan's frame: not odometry alone."""
        return "odometry" not in self.kind

    def __str__(self) -> str:
        chain = f"{self.map_frame or '(unnamed)'} > {self.base_frame or '(unnamed)'}"
        return f"{self.topic.name if self.topic else 'tf'} {chain}"


@dataclass(frozen=True, eq=False)
class Placed:
    """Poses of a topic's sensor: matrices (n, 4, 4) in the map frame where `valid` (n,)."""

    matrices: Floats
    valid: npt.NDArray[np.bool_]
    missing: list[Missing]

    @property
    def share(self) -> float:
        """How many of the scans have a pose, 0 to 1."""
        return float(self.valid.mean()) if self.valid.size else 0.0


def matrix(pose: Pose) -> Floats:
    """(4, 4) of a pose in the plane."""
    m = np.eye(4)
    m[:2, :2] = [[np.cos(pose.yaw), -np.sin(pose.yaw)], [np.sin(pose.yaw), np.cos(pose.yaw)]]
    m[:2, 3] = pose.x, pose.y
    return m


def flat(m: Floats) -> Floats:
    """(n, 3) x y yaw of (n, 4, 4): the heading is that of the x axis seen from above."""
    return np.stack([m[:, 0, 3], m[:, 1, 3], np.arctan2(m[:, 1, 0], m[:, 0, 0])], axis=1)


def bodies(source: Source, gathered: Gathered, times_ns: Times, *, tell: bool = False) -> Placed:
    """The robot's body in the map frame, at any times."""
    if source.topic is None:
        found = gathered.tree.lookup(source.map_frame, source.base_frame, times_ns)
        return Placed(*found)
    tree = gathered.tree
    samples = gathered.poses[source.topic].samples
    track = Track.of(samples, tree.clock, max_gap_ns=tree.max_gap_ns)
    if tell:
        track.tell(gathered.notes, gathered.log.path, source.topic.name, "pose", tree.zero_ns)
    numbers, why = track.at(times_ns)
    known = np.ones(len(times_ns), dtype=bool)
    missing = missing_of(f"pose on {source.topic.name}", track.times_ns, why, known)
    return Placed(matrices(numbers), why == Why.OK, missing)


def mounts(
    source: Source, tree: Tree, scans: ScanTimes, times_ns: Times, sensor_pose: Pose | None
) -> Placed:
    """The sensor on the body at each scan, by the frame that the scan names."""
    n = len(times_ns)
    if sensor_pose is not None:
        return Placed(np.broadcast_to(matrix(sensor_pose), (n, 4, 4)), np.ones(n, dtype=bool), [])
    found, valid, missing = np.tile(np.eye(4), (n, 1, 1)), np.zeros(n, dtype=bool), []
    frames = scans.frame
    for index, name in enumerate(scans.names):
        rows = np.flatnonzero(frames == index)
        if name in ("", source.base_frame):  # an unnamed sensor is taken as sitting on the body
            valid[rows] = True
        elif not source.base_frame or tree.path_between(source.base_frame, name) is None:
            what = f"transform {source.base_frame or 'base_link'} <- {name}"
            missing.append(Missing(what, Why.AFTER, 0, rows))
        else:
            part = tree.lookup(source.base_frame, name, times_ns[rows], mounted=True)
            found[rows], valid[rows] = part.matrices, part.valid
            missing += [gap._replace(rows=rows[gap.rows]) for gap in part.missing]
    return Placed(found, valid, missing)


def base_of(tree: Tree, names: list[str], top: str = "", child: str = "") -> str:
    """The frame of the robot's body.

    Args:
        tree: of the log.
        names: frames of the sensor.
        top: the frame that the body must be connected to, "" for any.
        child: what the poses say they are of.

    Returns:
        `child` where the tree leads from it to the sensor; else a frame named as a base on the way
        from `top` to the sensor; else the child of odom, of `top`, or of what moves last; "" where
        nothing tells.
    """
    sensor = next((name for name in names if name), "")
    line = tree.ancestors(sensor) if sensor in tree.frames else []
    if child and (child == sensor or child in line or not line):
        return child
    if not line and is_base(sensor):
        return sensor
    if not line or (top and tree.path_between(top, sensor) is None):
        near = tree.relatives(top) if top else sorted(tree.frames)
        named = by_name(near, BASES) or [f for f in near if is_base(f)]
        return named[0] if named else child or _child_of_odom(tree, near)
    named = by_name(line, BASES) or [frame for frame in line if is_base(frame)]
    if named:
        return named[0]
    for low, above in pairwise(line):
        if is_odom(above) or is_map(above) or above == top:
            return low
    moving = [low for low, above in pairwise(line) if tree.moves((above, low))]
    return moving[0] if moving else child or line[-1]


def _child_of_odom(tree: Tree, frames: list[str]) -> str:
    return next((low for low in frames if is_odom(tree.parents.get(low, ""))), "")


def around(tree: Tree, names: list[str]) -> list[str]:
    """Frames connected to the sensor; all where none is: then its mounting is missing."""
    near = [frame for name in names if name for frame in tree.relatives(name)]
    return list(dict.fromkeys(near)) or sorted(tree.frames)


def fixed_frames(tree: Tree, names: list[str]) -> list[str]:
    """Frames that the plan may lie in: by name, else the root of what drives about.

    Below a root without a name of its own something must move by more than a tilting laser does.
    """
    found = by_name(around(tree, names), MAPS)
    for line in (tree.ancestors(name) for name in names if name in tree.frames):
        steps = [
            np.ptp(tree.track((above, low)).numbers[:, :3], axis=0).max()
            for low, above in pairwise(line)
            if tree.moves((above, low)) and len(tree.track((above, low)))
        ]
        if not is_odom(line[-1]) and not is_base(line[-1]) and max(steps, default=0.0) > DRIVEN:
            found.append(line[-1])
    return list(dict.fromkeys(found))


def odom_frames(tree: Tree, names: list[str]) -> list[str]:
    """Frames of odometry, "odom" first."""
    found = [frame for frame in around(tree, names) if is_odom(frame)]
    return sorted(found, key=lambda frame: last_part(frame) != "odom")


def kind_of(poses: PoseTimes) -> Kind:
    """What sort of source a pose topic is."""
    if is_odom(poses.frame):
        return "odometry topic"
    if poses.topic.type.endswith("/Odometry") and not is_map(poses.frame):
        return "odometry topic"
    if "amcl" in poses.topic.name:
        return "amcl_pose"
    return "pose topic"
