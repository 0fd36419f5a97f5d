"""The messages of a topic are alike: a layout found once reads the next payload in one unpacking.

Where all that shapes a payload (lengths, counts, names, padding) is byte for byte as it was in an
earlier one, its numbers lie where they lay there. Everything else is for the decoders of ros.py.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from struct import Struct, calcsize
from typing import Any, cast

import numpy as np

from formats.messages import Image, LaserScan, PoseMessage, Transform, Transforms
from formats.payload import SECOND, Payload
from formats.ros.wire import Body, Wire

Read = Callable[[Payload], Any]
MOST = 256  # layouts of a topic
MANY = 64  # transforms in a message, beyond which its layout is not kept
POSE = "7d"
EVERY = 11  # items of a transform: bytes, sec, nanosec, bytes, seven numbers
new = tuple.__new__  # a noun in half the time


def repeating(learn: Learn, read: Read, wire_of: Callable[[Payload], Wire]) -> Read:
    """What reads a topic's payloads as `read` does, those of a known layout in less time.

    Args:
        learn: one of LEARNERS.
        read: the decoder of any payload.
        wire_of: the encoding of a payload that can be read.
    """
    readers: dict[int, Read] = {}  # by the payload's size: the first layout of each

    def begin(data: Payload) -> Any:
        noun, wire = read(data), wire_of(data)
        if wire.native and len(readers) < MOST:
            readers[len(data)] = learn(wire, data, noun, read)
        return noun

    def read_repeated(data: Payload) -> Any:
        return readers.get(len(data), begin)(data)

    return read_repeated


class Layout:
    """Where the numbers of a payload lie.

    Attributes:
        body: stands behind the last of them.
        items: up to there, as `struct` names them: before each group of numbers comes one of
            bytes, what lies between.
        at: where `items` end.
    """

    def __init__(self, wire: Wire, data: Payload) -> None:
        self.body, self.items, self.at = Body(wire, data), wire.order, 0

    def add(self, begin: int, items: str) -> None:
        """The bytes up to `begin`, then these items."""
        self.items += f"{begin - self.at}s{items}"
        self.at = begin + calcsize("<" + items)

    def header(self, *, timed: bool = True) -> None:
        """The stamp of a header; passed over where not `timed`."""
        # ROS 1 has a number before it that nobody needs.
        ros1 = self.body.wire.ros1
        stamp = ("2I" if ros1 else "iI") if timed else "8x"
        self.add(self.body.at, "4x" + stamp if ros1 else stamp)
        self.body.header()

    def pose(self) -> None:
        """Seven numbers."""
        self.body.read(POSE)
        self.add(self.body.at - calcsize("<" + POSE), POSE)

    @property
    def unpack(self) -> Callable[[Payload], tuple[Any, ...]]:
        """What takes payloads of this layout apart; the rest of them is passed over."""
        return Struct(f"{self.items}{len(self.body.data) - self.at}x").unpack


def scan_layout(
    wire: Wire, data: Payload, size: int, *, timed: bool = True
) -> Callable[[Payload], tuple[Any, ...]]:
    """What unpacks LaserScans: bytes, sec, nanosec, bytes, time_increment, bytes, ranges, bytes.

    The times vary, since some drivers measure them; the bytes shape a scan. Where not `timed` the
    three times are left out: bytes, bytes, bytes, ranges, bytes.

    Args:
        wire: the encoding.
        data: a payload that can be read.
        size: bytes of its ranges.
    """
    found = Layout(wire, data)
    found.header(timed=timed)
    found.body.read("3f")
    found.add(found.body.at, "f4x" if timed else "8x")
    found.body.read("5f")
    at = found.body.at
    found.add(at, f"{size}s")
    found.add(at + size + 4, "")  # up to the number of intensities
    return found.unpack


def laser_scans(wire: Wire, data: Payload, noun: LaserScan, other: Read) -> Read:
    """sensor_msgs/LaserScan."""
    unpack = scan_layout(wire, data, noun.ranges.nbytes)
    f4 = np.dtype(wire.order + "f4")
    start, _, _, shape, _, limits, _, bright = unpack(data)
    _, frame, angle, step, _, near, far, _ = noun

    def read(data: Payload) -> LaserScan:
        one, sec, nanosec, two, time_step, three, raw, four = unpack(data)
        same = two == shape and three == limits and four == bright and one == start
        if not same or nanosec >= SECOND:
            return cast("LaserScan", other(data))
        stamp, ranges = sec * SECOND + nanosec, np.frombuffer(raw, f4)
        return new(LaserScan, (stamp, frame, angle, step, time_step, near, far, ranges))

    return read


def poses(
    wire: Wire, data: Payload, noun: PoseMessage, other: Read, *, named: bool = False
) -> Read:
    """PoseStamped, PoseWithCovarianceStamped; and Odometry, where the child is `named`."""
    found = Layout(wire, data)
    found.header()
    if named:
        found.body.text()
    found.pose()
    unpack, f8, at = found.unpack, np.dtype(wire.order + "f8"), found.at
    start, _, _, shape, *_ = unpack(data)
    _, frame, child, _, covariance = noun
    bare = covariance is None

    def read(data: Payload) -> PoseMessage:
        one, sec, nanosec, two, *numbers = unpack(data)
        if two != shape or one != start or nanosec >= SECOND:
            return cast("PoseMessage", other(data))
        square = None if bare else np.frombuffer(data, f8, 36, at).reshape(6, 6)
        return new(PoseMessage, (sec * SECOND + nanosec, frame, child, tuple(numbers), square))

    return read


def transforms(
    wire: Wire, data: Payload, noun: Transforms, other: Read, *, one: bool = False
) -> Read:
    """TFMessage, tfMessage; and TransformStamped, which holds `one`."""
    found = Layout(wire, data)
    if not one:
        found.body.count("transforms")
    for _ in noun.transforms:
        found.header()
        found.body.text()
        found.pose()
    unpack = found.unpack
    known = unpack(data)
    if not 0 < len(noun.transforms) <= MANY:
        return other
    starts, shapes = known[::EVERY], known[3::EVERY]
    edges = [(transform.parent, transform.child) for transform in noun.transforms]

    def read(data: Payload) -> Transforms:
        found = unpack(data)
        same = found[3::EVERY] == shapes and found[::EVERY] == starts
        if not same or max(found[2::EVERY]) >= SECOND:
            return cast("Transforms", other(data))
        made, at = [], 1
        for parent, child in edges:
            stamp = found[at] * SECOND + found[at + 1]
            made.append(new(Transform, (stamp, parent, child, found[at + 3 : at + 10])))
            at += EVERY
        return new(Transforms, (made,))

    return read


def images(wire: Wire, data: Payload, noun: Image, other: Read) -> Read:
    """sensor_msgs/Image."""
    found = Layout(wire, data)
    found.header()
    found.body.read("2I")
    found.body.text()
    found.body.read("B")
    found.body.read("2I")  # step, bytes of pixels
    found.add(found.body.at, "")
    unpack, at = found.unpack, found.at
    start, _, _, shape = unpack(data)
    _, *fields, pixels = noun
    size = len(pixels)

    def read(data: Payload) -> Image:
        one, sec, nanosec, two = unpack(data)
        if two != shape or one != start or nanosec >= SECOND:
            return cast("Image", other(data))
        seen = np.frombuffer(data, np.uint8, size, at)
        return new(Image, (sec * SECOND + nanosec, *fields, seen))

    return read


Learn = Callable[[Wire, Payload, Any, Read], Read]
LEARNERS: dict[str, Learn] = {
    "geometry_msgs/msg/PoseStamped": poses,
    "geometry_msgs/msg/PoseWithCovarianceStamped": poses,
    "geometry_msgs/msg/TransformStamped": partial(transforms, one=True),
    "nav_msgs/msg/Odometry": partial(poses, named=True),
    "sensor_msgs/msg/Image": images,
    "sensor_msgs/msg/LaserScan": laser_scans,
    "tf/msg/tfMessage": transforms,
    "tf2_msgs/msg/TFMessage": transforms,
}
