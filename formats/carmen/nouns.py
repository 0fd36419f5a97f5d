"""Lines of CARMEN logs become the nouns of messages.py, under topics that say how."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from math import cos, sin
from typing import Any

import numpy as np

from formats.carmen.lines import LIMIT, Line, Malformed, Place, parse
from formats.frame import Pose
from formats.log import Topic
from formats.messages import LaserScan, Numbers, PoseMessage, Transform, Transforms
from formats.payload import Undecodable

SCAN = "sensor_msgs/msg/LaserScan"
TF = "tf2_msgs/msg/TFMessage"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
BASE = "base_link"
Payload = bytes | memoryview


def topic_of(name: str, kind: str, count: int, *, latched: bool = False, **says: Any) -> Topic:
    """A topic of a CARMEN log; its definition holds what its lines do not say themselves."""
    definition = json.dumps(says).encode()
    return Topic(name, kind, "carmen", definition, "carmen", count, latched)


def to_ns(seconds: float) -> int:
    """Whole microseconds: CARMEN writes six places, and a double of today has no more."""
    return round(seconds * 1e6) * 1000


def seven(pose: Pose | Place) -> Numbers:
    """As x y z qx qy qz qw; what is not finite stays so, to be dropped and counted later."""
    if not abs(pose.yaw) < 1e6:  # also nan
        return pose.x, pose.y, 0.0, 0.0, 0.0, float("nan"), float("nan")
    return pose.x, pose.y, 0.0, 0.0, 0.0, sin(pose.yaw / 2), cos(pose.yaw / 2)


def decoder(topic: Topic) -> Callable[[Payload], Any]:
    """The function that reads a topic's lines; it raises Undecodable."""
    says = json.loads(topic.definition)
    return partial(DECODERS[topic.type], says)


def _line(data: Payload) -> Line:
    try:
        return parse(bytes(data))
    except Malformed as error:  # only where the file changes while it is read
        raise Undecodable(str(error)) from None


def _scan(says: dict[str, Any], data: Payload) -> LaserScan:
    line = _line(data)
    with np.errstate(over="ignore"):
        ranges = np.array(line.ranges, dtype=np.float64).astype(np.float32)
    limit = line.limit if line.limit is not None else says.get("limit", LIMIT)
    stamp = to_ns(line.stamp)
    return LaserScan(stamp, says["frame"], line.start, line.step, 0.0, 0.0, limit, ranges)


def _transforms(says: dict[str, Any], data: Payload) -> Transforms:
    if "mounts" in says:
        mounts = says["mounts"].items()
        return Transforms([Transform(0, BASE, name, seven(Pose(*pose))) for name, pose in mounts])
    line = _line(data)
    assert line.laser is not None
    laser = line.laser
    numbers = seven(laser)
    if np.isfinite(numbers).all():
        numbers = seven(Pose(*laser) @ Pose(*says["mount"]).inverse())
    return Transforms([Transform(to_ns(line.stamp), says["frame"], BASE, numbers)])


def _pose(says: dict[str, Any], data: Payload) -> PoseMessage:
    line = _line(data)
    assert line.robot is not None
    return PoseMessage(to_ns(line.stamp), says["frame"], BASE, seven(line.robot))


DECODERS: dict[str, Callable[[dict[str, Any], Payload], Any]] = {
    SCAN: _scan,
    TF: _transforms,
    ODOMETRY: _pose,
    POSE: _pose,
}
