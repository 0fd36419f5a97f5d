"""Payload -> Scan: what the second pass over a log does with each message of its scan topic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from formats.frame import Scan
from formats.gathering import decoder_of
from formats.log import Topic
from formats.ros import is_usual, wire_of
from formats.ros_repeats import MOST, scan_layout
from formats.ros_wire import Payload
from formats.sensing import FLOAT32, LEVEL, SENSORS, Floats, Motion

Scanner = Callable[[Payload, Floats, Motion | None], Scan]
LEVELLED = np.eye(4)


def scanner(topic: Topic) -> Scanner:
    """What makes Scans: payload, pose of the sensor (4, 4) in the map frame, motion during it.

    It raises Undecodable. The scans of one sensor that is level differ in their ranges alone: where
    a payload is as an earlier one in all else, only these are read.
    """
    read, scan = decoder_of(topic), SENSORS[topic.type].scan
    if read is None:
        raise ValueError(f"no decoder for {topic.type}")

    def any_scan(data: Payload, matrix: Floats, motion: Motion | None) -> Scan:
        return scan(read(data), matrix, motion)

    if topic.type != "sensor_msgs/msg/LaserScan" or not is_usual(topic):
        return any_scan
    layouts: dict[int, tuple[Any, ...]] = {}  # by the payload's size: the first of each

    def begin(data: Payload, matrix: Floats, motion: Motion | None) -> Scan:
        reading, wire = read(data), wire_of(topic, data)
        if wire.native and reading.angle_increment > 0 and len(layouts) < MOST:
            unpack = scan_layout(wire, data, reading.ranges.nbytes)
            start, _, _, shape, _, limits, _, bright = unpack(data)
            like = scan(reading, LEVELLED, None)
            told = like.bearings, like.widths, like.min_range, like.max_range
            layouts[len(data)] = unpack, start, shape, limits, bright, *told
        return scan(reading, matrix, motion)

    def level_scan(data: Payload, matrix: Floats, motion: Motion | None) -> Scan:
        layout = layouts.get(len(data))
        if layout is None:
            return begin(data, matrix, motion)
        if motion is None and matrix[2, 2] >= LEVEL:
            unpack, start, shape, limits, bright, bearings, widths, near, far = layout
            one, _, _, two, _, three, ranges, four = unpack(data)
            if two == shape and three == limits and four == bright and one == start:
                return Scan(bearings, widths, np.frombuffer(ranges, FLOAT32), near, far)
        return any_scan(data, matrix, motion)

    return level_scan
