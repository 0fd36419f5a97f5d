"""ROS message bodies, ROS 1 and CDR of either byte order, become the nouns of messages.py."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

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
from formats.ros_wire import Body, Payload, Undecodable, Wire, odd_stamp

__all__ = ["DECODERS", "Undecodable", "decode", "odd_stamp"]

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
FIELD_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def laser_scan(wire: Wire, data: Payload) -> LaserScan:
    """sensor_msgs/LaserScan. The one message that comes by the ten thousand: no cursor."""
    stamp, frame, at = wire.header(data)
    at += -at & wire.mask4
    start, _, step, time_step, _, nearest, farthest, count = wire.seven(data, at)
    at += 32
    end = at + 4 * count
    if len(data) != end + 4:  # intensities, or padding
        body = Body(wire, data, at - 4)
        body.array("f4", "ranges")
        body.array("f4", "intensities")
        body.end()
    ranges = np.frombuffer(data, wire.f4, count, at)
    if not wire.f4.isnative:
        ranges = ranges.astype(np.float32)
    return LaserScan(stamp, frame, start, step, time_step, nearest, farthest, ranges)


def multi_echo_laser_scan(wire: Wire, data: Payload) -> MultiEchoLaserScan:
    """sensor_msgs/MultiEchoLaserScan."""
    body = Body(wire, data)
    stamp, frame = body.header()
    start, _, step, time_step, _, nearest, farthest = body.read("7f")
    echoes = [body.array("f4", "echoes") for _ in range(body.count("beams"))]
    bright = [body.array("f4", "intensities") for _ in range(body.count("beams"))]
    body.end()
    return MultiEchoLaserScan(
        stamp, frame, start, step, time_step, nearest, farthest, echoes, bright
    )


def range_reading(wire: Wire, data: Payload) -> RangeReading:
    """sensor_msgs/Range; the `variance` of newer distributions is passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    body.read("B")
    view, nearest, farthest, distance = body.read("4f")
    if len(data) - body.at >= 4:
        body.read("f")
    body.end()
    return RangeReading(stamp, frame, view, nearest, farthest, distance)


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


def image(wire: Wire, data: Payload) -> Image:
    """sensor_msgs/Image."""
    body = Body(wire, data)
    stamp, frame = body.header()
    height, width = body.read("2I")
    encoding = body.text()
    (big,) = body.read("B")
    (step,) = body.read("I")
    pixels = body.array("u1", "bytes of pixels")
    body.end()
    if height * step > len(pixels):
        raise Undecodable("too few pixels", f"{len(pixels)} bytes for {height} rows of {step}")
    return Image(stamp, frame, height, width, encoding, bool(big), step, pixels[: height * step])


def compressed_image(wire: Wire, data: Payload) -> CompressedImage:
    """sensor_msgs/CompressedImage."""
    body = Body(wire, data)
    stamp, frame = body.header()
    form = body.text()
    content = body.array("u1", "bytes of picture")
    body.end()
    return CompressedImage(stamp, frame, form, content)


def camera_info(wire: Wire, data: Payload) -> CameraInfo:
    """sensor_msgs/CameraInfo; R and P are passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    height, width = body.read("2I")
    model = body.text()
    d = body.array("f8", "distortion numbers")
    k = body.array("f8", "camera matrix numbers", 9).reshape(3, 3)
    body.read("21d")
    across, down, x, y, rows, cols = body.read("6I")
    body.read("B")
    body.end()
    part = (x, y, cols, rows)
    return CameraInfo(stamp, frame, height, width, model, d, k, (across, down), part)


def point_cloud2(wire: Wire, data: Payload) -> Cloud:
    """sensor_msgs/PointCloud2: the fields x, y, z, as a view where they are floats in a row."""
    body = Body(wire, data)
    stamp, frame = body.header()
    height, width = body.read("2I")
    fields: dict[str, tuple[int, int]] = {}
    for _ in range(body.count("fields")):
        name, (offset,), (kind,), _ = body.text(), body.read("I"), body.read("B"), body.read("I")
        fields[name] = offset, kind
    (big,) = body.read("B")
    step, row_step = body.read("2I")
    content = body.array("u1", "bytes of points")
    body.read("B")
    body.end()
    order = ">" if big else "<"
    return Cloud(stamp, frame, points(content, (height, width), (row_step, step), fields, order))


def points(
    content: npt.NDArray[np.uint8],
    shape: tuple[int, int],
    strides: tuple[int, int],
    fields: dict[str, tuple[int, int]],
    order: str,
) -> npt.NDArray[np.floating]:
    """The (n, 3) points in a PointCloud2's bytes, float32 unless a field is float64.

    Args:
        content: the bytes.
        shape: rows, points a row.
        strides: bytes a row, bytes a point.
        fields: name -> offset in a point, PointField datatype.
        order: "<" or ">".
    """
    if shape[0] * shape[1] == 0:
        return np.empty((0, 3), dtype=np.float32)
    if any(axis not in fields or fields[axis][1] not in FIELD_KINDS for axis in "xyz"):
        raise Undecodable("cloud without x, y and z", ", ".join(fields))
    axes = [(fields[axis][0], np.dtype(order + FIELD_KINDS[fields[axis][1]])) for axis in "xyz"]
    row_step, step = strides
    inside = all(offset + kind.itemsize <= step for offset, kind in axes)
    if not inside or (shape[0] > 1 and shape[1] * step > row_step):
        raise Undecodable("cloud whose points overlap", f"{step} bytes a point")
    needed = (shape[0] - 1) * row_step + shape[1] * step
    if needed > len(content):
        raise Undecodable("too few points", f"{len(content)} of {needed} bytes")
    double = any(kind == np.float64 for _, kind in axes)
    found = np.empty((*shape, 3), dtype=np.float64 if double else np.float32)
    for axis, (offset, kind) in enumerate(axes):
        found[..., axis] = np.ndarray(shape, kind, content, offset, strides)
    return found.reshape(-1, 3)


def point_cloud(wire: Wire, data: Payload) -> Cloud:
    """sensor_msgs/PointCloud; channels are passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    count = body.count("points", most=1 << 32)
    found = body.array("f4", "points", 3 * count).reshape(-1, 3)
    for _ in range(body.count("channels")):
        body.text()
        body.array("f4", "channel values")
    body.end()
    return Cloud(stamp, frame, found)


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


DECODERS: dict[str, Callable[[Wire, Payload], Noun]] = {
    "geometry_msgs/msg/PoseStamped": pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": pose_with_covariance,
    "geometry_msgs/msg/TransformStamped": transform_stamped,
    "nav_msgs/msg/OccupancyGrid": occupancy_grid,
    "nav_msgs/msg/Odometry": odometry,
    "sensor_msgs/msg/CameraInfo": camera_info,
    "sensor_msgs/msg/CompressedImage": compressed_image,
    "sensor_msgs/msg/Image": image,
    "sensor_msgs/msg/LaserScan": laser_scan,
    "sensor_msgs/msg/MultiEchoLaserScan": multi_echo_laser_scan,
    "sensor_msgs/msg/PointCloud": point_cloud,
    "sensor_msgs/msg/PointCloud2": point_cloud2,
    "sensor_msgs/msg/Range": range_reading,
    "tf/msg/tfMessage": transforms,
    "tf2_msgs/msg/TFMessage": transforms,
}
ROS1 = Wire("<", 1)
CDR = {0: Wire(">", 8), 1: Wire("<", 8), 6: Wire(">", 4), 7: Wire("<", 4)}  # by encapsulation
OTHERS = {2: "PL_CDR", 3: "PL_CDR", 8: "XCDR2", 9: "XCDR2", 10: "PL_CDR2", 11: "PL_CDR2"}


def wire_of(topic: Topic, data: Payload) -> Wire:
    """How a payload is laid out: in CDR its first bytes say it."""
    if topic.encoding == "ros1":
        return ROS1
    if topic.encoding != "cdr":
        raise Undecodable(f"unknown encoding {printable(topic.encoding)}")
    wire = CDR.get(data[1])
    if wire is None or data[0]:
        number = data[0] << 8 | data[1]
        name = f" ({OTHERS[number]})" if number in OTHERS else ""
        raise Undecodable(f"unknown encapsulation 0x{number:04x}{name}")
    return wire


def decode(topic: Topic, data: Payload) -> Noun:
    """The noun in a payload; its arrays may be read-only, unaligned views on the payload.

    Args:
        topic: of a type in DECODERS, encoded as "ros1" or "cdr".
        data: the payload.

    Raises:
        Undecodable: this payload (or this topic's definition) cannot be read.
    """
    try:
        return DECODERS[topic.type](wire_of(topic, data), data)
    except (struct.error, IndexError):
        if not len(data):
            raise Undecodable("empty payload") from None
        raise Undecodable("cut short", f"after {len(data)} bytes") from None
