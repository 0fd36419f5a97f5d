"""Sources of poses in a log: which frames the plan may lie in, what the robot's body is called."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from formats.log import Topic
from formats.streaming.frame_names import BASES, MAPS, by_name, is_base, is_map, is_odom, last_part
from formats.streaming.gathering import PoseTimes
from formats.streaming.tf import Tree

Kind = Literal["tf", "pose topic", "amcl_pose", "tf odometry", "odometry topic", "nothing"]
DRIVEN = 0.1  # m; what moves by less does not drive
KINDS: tuple[Kind, ...] = (
    "tf",
    "pose topic",
    "amcl_pose",
    "tf odometry",
    "odometry topic",
    "nothing",
)


@dataclass(frozen=True)
class Source:
    """One way to the robot's poses.

    Attributes:
        kind: what it is, in the order of preference of KINDS; "nothing" where the robot is taken
            as standing still, for those who find its poses by its scans.
        topic: None for tf and nothing.
        map_frame: the frame that the poses are in.
        base_frame: what is posed, "" where nothing says so.
        carrier: odometry that carries the body between the seldom poses of amcl.
    """

    kind: Kind
    topic: Topic | None
    map_frame: str
    base_frame: str
    carrier: Source | None = None

    @property
    def in_map(self) -> bool:
        """Whether the poses may be in the plan's frame: not odometry alone."""
        return self.kind in ("tf", "pose topic", "amcl_pose")

    def __str__(self) -> str:
        if self.kind == "nothing":
            return "nothing"
        chain = f"{self.map_frame or '(unnamed)'} > {self.base_frame or '(unnamed)'}"
        return f"{self.topic.name if self.topic else 'tf'} {chain}"


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
    if line and (sensor == top or is_map(sensor) or is_odom(sensor)):  # of what a mapper says
        below = [f for f in tree.relatives(sensor) if sensor in tree.ancestors(f)[1:]]
        named = by_name(below, BASES) or [f for f in below if is_base(f)]
        moving = [f for f in below if tree.moves((tree.parents[f], f))]
        return next(iter([*named, *moving]), child or sensor)
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
