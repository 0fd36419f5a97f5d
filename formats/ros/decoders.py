"""ROS message bodies, ROS 1 and CDR of either byte order, become the nouns of messages.py."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial

from formats.errors import printable
from formats.log import Topic
from formats.messages import (
    CameraInfo,
    Cloud,
    CompressedImage,
    Image,
    LaserScan,
    MultiEchoLaserScan,
    OccupancyGrid,
    PoseMessage,
    RangeReading,
    Transform,
    Transforms,
)
from formats.payload import Payload, Undecodable
from formats.ros.clouds import point_cloud, point_cloud2
from formats.ros.pictures import camera_info, compressed_image, image
from formats.ros.recorded import translator
from formats.ros.repeats import LEARNERS, repeating
from formats.ros.wire import Body, Wire

Noun = (
    LaserScan
    | MultiEchoLaserScan
    | RangeReading
    | Transforms
    | PoseMessage
    | Image
    | CompressedImage
    | CameraInfo
    | Cloud
    | OccupancyGrid
)


def laser_scan(wire: Wire, data: Payload) -> LaserScan:
    """sensor_msgs/LaserScan; the ranges are copied, since scans outlive their payloads."""
    body = Body(wire, data)
    stamp, frame = body.header()
    start, _, step, time_step, _, near, far = body.read("7f")
    ranges = body.array("f4", "ranges").copy()
    body.array("f4", "intensities")
    body.end()
    return LaserScan(stamp, frame, start, step, time_step, near, far, ranges)


def multi_echo_laser_scan(wire: Wire, data: Payload) -> MultiEchoLaserScan:
    """sensor_msgs/MultiEchoLaserScan."""
    body = Body(wire, data)
    stamp, frame = body.header()
    start, _, step, time_step, _, near, far = body.read("7f")
    echoes = [body.array("f4", "echoes") for _ in range(body.count("beams"))]
    bright = [body.array("f4", "intensities") for _ in range(body.count("beams"))]
    body.end()
    return MultiEchoLaserScan(stamp, frame, start, step, time_step, near, far, echoes, bright)


def range_reading(wire: Wire, data: Payload) -> RangeReading:
    """sensor_msgs/Range; the `variance` of newer distributions is passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    body.read("B")
    view, near, far, distance = body.read("4f")
    if len(data) - body.at >= 4:
        body.read("f")
    body.end()
    return RangeReading(stamp, frame, view, near, far, distance)


def transform(body: Body) -> Transform:
    """geometry_msgs/TransformStamped within another message."""
    stamp, parent = body.header()
    child = body.text()
    x, y, z, qx, qy, qz, qw = body.read("7d")
    return Transform(stamp, parent, child, (x, y, z, qx, qy, qz, qw))


def transforms(wire: Wire, data: Payload) -> Transforms:
    """tf2_msgs/TFMessage, tf/tfMessage."""
    body = Body(wire, data)
    found = [transform(body) for _ in range(body.count("transforms"))]
    body.end()
    return Transforms(found)


def transform_stamped(wire: Wire, data: Payload) -> Transforms:
    """geometry_msgs/TransformStamped."""
    body = Body(wire, data)
    found = transform(body)
    body.end()
    return Transforms([found])


def odometry(wire: Wire, data: Payload) -> PoseMessage:
    """nav_msgs/Odometry; the twist is passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    child = body.text()
    x, y, z, qx, qy, qz, qw = body.read("7d")
    covariance = body.array("f8", "covariances", 36).reshape(6, 6)
    body.read("42d")
    body.end()
    return PoseMessage(stamp, frame, child, (x, y, z, qx, qy, qz, qw), covariance)


def pose_with_covariance(wire: Wire, data: Payload) -> PoseMessage:
    """geometry_msgs/PoseWithCovarianceStamped."""
    body = Body(wire, data)
    stamp, frame = body.header()
    x, y, z, qx, qy, qz, qw = body.read("7d")
    covariance = body.array("f8", "covariances", 36).reshape(6, 6)
    body.end()
    return PoseMessage(stamp, frame, "", (x, y, z, qx, qy, qz, qw), covariance)


def pose(wire: Wire, data: Payload) -> PoseMessage:
    """geometry_msgs/PoseStamped."""
    body = Body(wire, data)
    stamp, frame = body.header()
    x, y, z, qx, qy, qz, qw = body.read("7d")
    body.end()
    return PoseMessage(stamp, frame, "", (x, y, z, qx, qy, qz, qw))


def occupancy_grid(wire: Wire, data: Payload) -> OccupancyGrid:
    """nav_msgs/OccupancyGrid."""
    body = Body(wire, data)
    stamp, frame = body.header()
    body.stamp()
    (resolution,) = body.read("f")
    width, height = body.read("2I")
    x, y, z, qx, qy, qz, qw = body.read("7d")
    cells = body.array("i1", "cells")
    body.end()
    if len(cells) != width * height:
        raise Undecodable("map of a wrong size", f"{len(cells)} cells for {width} x {height}")
    origin = (x, y, z, qx, qy, qz, qw)
    return OccupancyGrid(stamp, frame, resolution, origin, cells.reshape(height, width))


Decoder = Callable[[Wire, Payload], Noun]
POSES: dict[str, Decoder] = {
    "geometry_msgs/msg/PoseStamped": pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": pose_with_covariance,
    "nav_msgs/msg/Odometry": odometry,
}
TRANSFORMS: dict[str, Decoder] = {
    "geometry_msgs/msg/TransformStamped": transform_stamped,
    "tf/msg/tfMessage": transforms,
    "tf2_msgs/msg/TFMessage": transforms,
}
DECODERS: dict[str, Decoder] = {
    **POSES,
    **TRANSFORMS,
    "nav_msgs/msg/OccupancyGrid": occupancy_grid,
    "sensor_msgs/msg/CameraInfo": camera_info,
    "sensor_msgs/msg/CompressedImage": compressed_image,
    "sensor_msgs/msg/Image": image,
    "sensor_msgs/msg/LaserScan": laser_scan,
    "sensor_msgs/msg/MultiEchoLaserScan": multi_echo_laser_scan,
    "sensor_msgs/msg/PointCloud": point_cloud,
    "sensor_msgs/msg/PointCloud2": point_cloud2,
    "sensor_msgs/msg/Range": range_reading,
}
"""Type -> function; those of poses and transforms apart, since they say where the robot was."""
ROS1 = Wire("<", 1)
CDR = {0: Wire(">", 8), 1: Wire("<", 8), 6: Wire(">", 4), 7: Wire("<", 4)}  # by encapsulation
OTHERS = {2: "PL_CDR", 3: "PL_CDR", 8: "XCDR2", 9: "XCDR2", 10: "PL_CDR2", 11: "PL_CDR2"}


def unknown_encapsulation(data: Payload) -> Undecodable:
    """Why a CDR payload's first two bytes name no wire."""
    number = data[0] << 8 | data[1]
    name = f" ({OTHERS[number]})" if number in OTHERS else ""
    return Undecodable(f"unknown encapsulation 0x{number:04x}{name}")


def decoder(topic: Topic) -> Callable[[Payload], Noun]:
    """The function that reads a topic's payloads; it raises what `decode` raises.

    Where the recorded definition is not the standard one, it rules.
    """
    standard = read = DECODERS[topic.type]
    try:
        translate = translator(topic)
    except Undecodable as error:
        return refuse(error)
    if translate is not None:

        def read(wire: Wire, data: Payload) -> Noun:
            return standard(ROS1, translate(wire, data))

    def read_ros1(data: Payload) -> Noun:
        try:
            return read(ROS1, data)
        except (struct.error, IndexError):
            raise cut_short(data) from None

    def read_cdr(data: Payload) -> Noun:
        try:
            wire = CDR.get(data[1])
            if wire is None or data[0]:
                raise unknown_encapsulation(data)
            return read(wire, data)
        except (struct.error, IndexError):
            raise cut_short(data) from None

    if topic.encoding not in ("ros1", "cdr"):
        return refuse(Undecodable(f"unknown encoding {printable(topic.encoding)}"))
    decode_any = read_ros1 if topic.encoding == "ros1" else read_cdr
    learn = LEARNERS.get(topic.type)
    if learn is None or translate is not None:
        return decode_any
    return repeating(learn, decode_any, partial(wire_of, topic))


def wire_of(topic: Topic, data: Payload) -> Wire:
    """The encoding of a payload that can be read."""
    return ROS1 if topic.encoding == "ros1" else CDR[data[1]]


def is_usual(topic: Topic) -> bool:
    """Whether a topic's payloads are what their type says, and not what a definition of its own."""
    try:
        return topic.encoding in ("ros1", "cdr") and translator(topic) is None
    except Undecodable:
        return False


def cut_short(data: Payload) -> Undecodable:
    """Why reading ran over the end."""
    size = len(data)
    return Undecodable("cut short", f"after {size} bytes") if size else Undecodable("empty payload")


def refuse(error: Undecodable) -> Callable[[Payload], Noun]:
    """The decoder of a topic that cannot be read at all."""

    def read(data: Payload) -> Noun:
        raise error

    return read


def decode(topic: Topic, data: Payload) -> Noun:
    """The noun in a payload; its arrays may be read-only, unaligned views on the payload.

    Args:
        topic: of a type in DECODERS, encoded as "ros1" or "cdr".
        data: the payload.

    Raises:
        Undecodable: this payload (or this topic's definition) cannot be read.
    """
    known = _known.get(id(topic))
    if known is None or known[0] is not topic:
        if len(_known) >= 1024:
            _known.clear()
        known = _known[id(topic)] = topic, decoder(topic)
    return known[1](data)


_known: dict[int, tuple[Topic, Callable[[Payload], Noun]]] = {}  # by identity: hashing is slow
