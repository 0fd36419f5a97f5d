"""Payload -> Scan: what the second pass over a log does with each message of its scan topic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from formats.decoding import decoder_of
from formats.depth.packed import depth_image
from formats.depth.scans import camera_remarks, moved
from formats.frame import Scan
from formats.log import Topic
from formats.messages import CompressedImage
from formats.payload import Payload
from formats.ros.decoders import is_usual, wire_of
from formats.ros.repeats import MOST, scan_layout
from formats.sensing.scans import FLOAT32, LEVEL, SENSORS
from formats.sensing.sensor import LOOK, Floats, Look, Motion, View

Scanner = Callable[[Payload, Floats, Motion | View | None], Scan]
LEVELLED = np.eye(4)


def scanner(
    topic: Topic, look: Look = LOOK, remark: Callable[[str], object] = lambda _: None
) -> Scanner:
    """What makes Scans: payload, pose of the sensor (4, 4) in the map frame, motion during it.

    It raises Undecodable. The scans of one sensor that is level differ in their ranges alone: where
    a payload is as an earlier one in all else, only these are read.

    Args:
        topic: of a type in SENSORS.
        look: with the camera where the topic is of pictures.
        remark: is told once what is odd about a picture and its camera.
    """
    read, scan = decoder_of(topic), SENSORS[topic.type].scan
    if read is None:
        raise ValueError(f"no decoder for {topic.type}")

    def any_scan(data: Payload, matrix: Floats, motion: Motion | View | None) -> Scan:
        if isinstance(motion, View):
            return scan(moved(read(data), motion.matrix), matrix, None, look)
        return scan(read(data), matrix, motion, look)

    if look.camera is not None:
        camera, told = look.camera, set[tuple[Any, ...]]()

        def picture_scan(data: Payload, matrix: Floats, motion: Motion | View | None) -> Scan:
            image = read(data)
            if isinstance(image, CompressedImage):
                image = depth_image(image)
            if image[1:5] not in told:
                told.add(image[1:5])
                for odd in camera_remarks(image, camera):
                    remark(odd)
            return scan(image, matrix, None, look)

        return picture_scan
    if topic.type != "sensor_msgs/msg/LaserScan" or not is_usual(topic):
        return any_scan
    layouts: dict[int, tuple[Any, ...]] = {}  # by the payload's size: the first of each

    def begin(data: Payload, matrix: Floats, motion: Motion | View | None) -> Scan:
        reading, wire = read(data), wire_of(topic, data)
        if wire.native and reading.angle_increment > 0 and len(layouts) < MOST:
            unpack = scan_layout(wire, data, reading.ranges.nbytes, timed=False)
            start, shape, limits, _, bright = unpack(data)
            like = scan(reading, LEVELLED, None)
            told = like.bearings, like.widths, like.min_range, like.max_range
            layouts[len(data)] = unpack, start, shape, limits, bright, *told
        return any_scan(data, matrix, motion)

    def level_scan(data: Payload, matrix: Floats, motion: Motion | View | None) -> Scan:
        layout = layouts.get(len(data))
        if layout is None:
            return begin(data, matrix, motion)
        if motion is None and matrix[2, 2] >= LEVEL:
            unpack, start, shape, limits, bright, bearings, widths, near, far = layout
            one, two, three, ranges, four = unpack(data)
            if two == shape and three == limits and four == bright and one == start:
                return Scan(bearings, widths, np.frombuffer(ranges, FLOAT32), near, far)
        return any_scan(data, matrix, motion)

    return level_scan
