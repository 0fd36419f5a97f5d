"""Foxglove's messages in both encodings, with the nouns that they are."""

from __future__ import annotations

import base64
import struct
from math import inf, nan
from typing import Any

import numpy as np

from formats.messages import (
    CameraInfo,
    Cloud,
    CompressedImage,
    Image,
    LaserScan,
    PoseMessage,
    Transform,
    Transforms,
)

# A second, independent way to write protobuf: a field is (number, kind, value).


def number(value: int) -> bytes:
    value &= 2**64 - 1
    groups = [value >> shift & 0x7F for shift in range(0, max(value.bit_length(), 1), 7)]
    return bytes([*(group | 0x80 for group in groups[:-1]), groups[-1]])


def field(at: int, kind: str, value: Any) -> bytes:
    if kind == "double":
        return number(at << 3 | 1) + struct.pack("<d", value)
    if kind == "fixed32":
        return number(at << 3 | 5) + struct.pack("<I", value)
    if kind == "int":
        return number(at << 3) + number(value)
    if kind == "packed":
        value = struct.pack(f"<{len(value)}d", *value)
    elif kind == "text":
        value = value.encode()
    return number(at << 3 | 2) + number(len(value)) + value


def vector(*values: float) -> bytes:
    return b"".join(field(i, "double", value) for i, value in enumerate(values, 1))


TIME = field(1, "int", 12) + field(2, "int", 500_000_000)
JSON_TIME = {"sec": 12, "nsec": 500_000_000}
NS = 12_500_000_000
POSE = field(1, "bytes", vector(1, 2, 3)) + field(2, "bytes", vector(0, 0, 0, 1))
JSON_POSE = {
    "position": {"x": 1, "y": 2, "z": 3},
    "orientation": {"x": 0, "y": 0, "z": 0, "w": 1},
}
XYZ = struct.pack("<6f", 1, 2, 3, 4, 5, 6)


def packed_field(name: str, offset: int, kind: int) -> bytes:
    return field(1, "text", name) + field(2, "fixed32", offset) + field(3, "int", kind)


STAMPED = field(1, "bytes", TIME)
JSON_STAMPED = {"timestamp": JSON_TIME, "frame_id": "laser"}
FRAMED = STAMPED + field(2, "text", "laser")
TRANSFORM = (
    STAMPED
    + field(2, "text", "odom")
    + field(3, "text", "base")
    + field(4, "bytes", vector(1, 2, 3))
    + field(5, "bytes", vector(0, 0, 0.6, 0.8))
)
JSON_TRANSFORM = {
    "timestamp": JSON_TIME,
    "parent_frame_id": "odom",
    "child_frame_id": "base",
    "translation": {"x": 1, "y": 2, "z": 3},
    "rotation": {"x": 0, "y": 0, "z": 0.6, "w": 0.8},
}
MOVED = Transform(NS, "odom", "base", (1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8))
K = [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0]
DEPTH = bytes(range(12))

CASES: dict[str, tuple[bytes, dict[str, Any], tuple[Any, ...]]] = {
    "foxglove.LaserScan": (
        FRAMED
        + field(3, "bytes", field(2, "bytes", vector(0, 0, 0, 1)))
        + field(4, "double", -1.0)
        + field(5, "double", 1.0)
        + field(6, "packed", [1.0, 2.5, inf, nan, 3.0])
        + field(7, "packed", [7.0]),
        JSON_STAMPED
        | {"start_angle": -1.0, "end_angle": 1, "ranges": [1, 2.5, "Infinity", None, 3]},
        LaserScan(NS, "laser", -1.0, 0.5, 0.0, 0.0, inf, np.array([1.0, 2.5, inf, nan, 3.0])),
    ),
    "foxglove.PoseInFrame": (
        FRAMED + field(3, "bytes", POSE),
        JSON_STAMPED | {"pose": JSON_POSE},
        PoseMessage(NS, "laser", "", (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)),
    ),
    "foxglove.FrameTransform": (TRANSFORM, JSON_TRANSFORM, Transforms([MOVED])),
    "foxglove.FrameTransforms": (
        field(1, "bytes", TRANSFORM) * 2,
        {"transforms": [JSON_TRANSFORM] * 2},
        Transforms([MOVED, MOVED]),
    ),
    "foxglove.PointCloud": (
        FRAMED
        + field(3, "bytes", POSE)
        + field(4, "fixed32", 12)
        + b"".join(field(5, "bytes", packed_field(n, 4 * i, 7)) for i, n in enumerate("xyz"))
        + field(6, "bytes", XYZ),
        JSON_STAMPED
        | {
            "pose": JSON_POSE,
            "point_stride": 12,
            "fields": [{"name": n, "offset": 4 * i, "type": 7} for i, n in enumerate("xyz")],
            "data": base64.b64encode(XYZ).decode(),
        },
        Cloud(NS, "laser", np.array([[2.0, 4.0, 6.0], [5.0, 7.0, 9.0]])),
    ),
    "foxglove.RawImage": (
        STAMPED
        + field(7, "text", "laser")
        + field(2, "fixed32", 3)
        + field(3, "fixed32", 2)
        + field(4, "text", "16UC1")
        + field(5, "fixed32", 6)
        + field(6, "bytes", DEPTH),
        JSON_STAMPED
        | {"width": 3, "height": 2, "encoding": "16UC1", "step": 6}
        | {"data": base64.b64encode(DEPTH).decode()},
        Image(NS, "laser", 2, 3, "16UC1", False, 6, np.arange(12, dtype=np.uint8)),
    ),
    "foxglove.CompressedImage": (
        STAMPED + field(4, "text", "laser") + field(2, "bytes", DEPTH) + field(3, "text", "png"),
        JSON_STAMPED | {"format": "png", "data": base64.b64encode(DEPTH).decode()},
        CompressedImage(NS, "laser", "png", np.arange(12, dtype=np.uint8)),
    ),
    "foxglove.CameraCalibration": (
        STAMPED
        + field(9, "text", "laser")
        + field(2, "fixed32", 640)
        + field(3, "fixed32", 480)
        + field(4, "text", "plumb_bob")
        + field(5, "packed", [0.1, 0.2])
        + field(6, "packed", K),
        JSON_STAMPED
        | {"width": 640, "height": 480, "distortion_model": "plumb_bob", "D": [0.1, 0.2], "K": K},
        CameraInfo(NS, "laser", 480, 640, "plumb_bob", np.array([0.1, 0.2]), np.reshape(K, (3, 3))),
    ),
}
