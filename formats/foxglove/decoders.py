"""Foxglove's messages, as protobuf or JSON, become the nouns of messages.py.

Schemas: github.com/foxglove/foxglove-sdk, schemas/proto and schemas/jsonschema.
"""

from __future__ import annotations

import binascii
from base64 import b64decode
from collections.abc import Callable
from functools import partial
from math import atan2, inf
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.foxglove import protobuf
from formats.log import Topic
from formats.messages import (
    CameraInfo,
    Cloud,
    CompressedImage,
    Image,
    LaserScan,
    Numbers,
    PoseMessage,
    Transform,
    Transforms,
)
from formats.payload import SECOND, OddStamp, Payload, Undecodable, from_json
from formats.ros.clouds import points

Values = dict[str, Any]
Noun = LaserScan | PoseMessage | Transforms | Cloud | Image | CompressedImage | CameraInfo
STILL: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
# PackedElementField's numeric types, as those of a sensor_msgs/PointField.
POINT_FIELDS = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5, 7: 7, 8: 8}

TIME: protobuf.Schema = {1: ("sec", "int"), 2: ("nsec", "int")}
VECTOR: protobuf.Schema = {k: (name, "double") for k, name in enumerate("xyz", 1)}
TURN: protobuf.Schema = {k: (name, "double") for k, name in enumerate("xyzw", 1)}
POSE: protobuf.Schema = {1: ("position", VECTOR), 2: ("orientation", TURN)}
FIELD: protobuf.Schema = {1: ("name", "text"), 2: ("offset", "fixed32"), 3: ("type", "int")}
FRAMED: protobuf.Schema = {1: ("timestamp", TIME), 2: ("frame_id", "text"), 3: ("pose", POSE)}
TRANSFORM: protobuf.Schema = {
    1: ("timestamp", TIME),
    2: ("parent_frame_id", "text"),
    3: ("child_frame_id", "text"),
    4: ("translation", VECTOR),
    5: ("rotation", TURN),
}
SCHEMAS: dict[str, protobuf.Schema] = {
    "foxglove.LaserScan": FRAMED
    | {4: ("start_angle", "double"), 5: ("end_angle", "double"), 6: ("ranges", "doubles")},
    "foxglove.PoseInFrame": FRAMED,
    "foxglove.FrameTransform": TRANSFORM,
    "foxglove.FrameTransforms": {1: ("transforms", [TRANSFORM])},
    "foxglove.PointCloud": FRAMED
    | {4: ("point_stride", "fixed32"), 5: ("fields", [FIELD]), 6: ("data", "bytes")},
    "foxglove.RawImage": {
        **{1: ("timestamp", TIME), 7: ("frame_id", "text"), 2: ("width", "fixed32")},
        **{3: ("height", "fixed32"), 4: ("encoding", "text"), 5: ("step", "fixed32")},
        6: ("data", "bytes"),
    },
    "foxglove.CompressedImage": {
        **{1: ("timestamp", TIME), 4: ("frame_id", "text"), 2: ("data", "bytes")},
        3: ("format", "text"),
    },
    "foxglove.CameraCalibration": {
        **{1: ("timestamp", TIME), 9: ("frame_id", "text"), 2: ("width", "fixed32")},
        **{3: ("height", "fixed32"), 4: ("distortion_model", "text"), 5: ("D", "doubles")},
        6: ("K", "doubles"),
    },
}


def head(values: Values) -> tuple[int, str]:
    """Time in ns (0 where there is none) and frame."""
    return stamp(values.get("timestamp")), str(values.get("frame_id") or "")


def stamp(time: Values | None) -> int:
    """A time in ns."""
    if not time:
        return 0
    nsec = int(time.get("nsec") or time.get("nanosec") or 0)
    found = int(time.get("sec") or 0) * SECOND + nsec
    if not -(1 << 63) <= found < 1 << 63:
        raise Undecodable("impossible time")
    return found if 0 <= nsec < SECOND else OddStamp(found)


def numbers(position: Values | None, orientation: Values | None) -> Numbers:
    """X y z qx qy qz qw; an absent part moves nothing."""
    x, y, z = (float((position or {}).get(axis) or 0.0) for axis in "xyz")
    turn = orientation or {"w": 1.0}
    qx, qy, qz, qw = (float(turn.get(axis) or 0.0) for axis in "xyzw")
    return x, y, z, qx, qy, qz, qw


def pose_of(values: Values) -> Numbers:
    """The `pose` of a message."""
    pose = values.get("pose") or {}
    return numbers(pose.get("position"), pose.get("orientation"))


def array(values: Any) -> npt.NDArray[np.float64]:
    """Numbers (n,); null, as JSON writes what is not finite, is nan."""
    return np.asarray(values if values is not None else [], dtype=np.float64).ravel()


def content(values: Values) -> npt.NDArray[np.uint8]:
    """The bytes of `data`, which JSON writes in base 64."""
    data = values.get("data") or b""
    return np.frombuffer(b64decode(data) if isinstance(data, str) else data, np.uint8)


def laser_scan(values: Values) -> LaserScan:
    """foxglove.LaserScan: it names no limits; its pose may only turn it within its plane."""
    ranges = array(values.get("ranges"))
    start, end = float(values.get("start_angle") or 0.0), float(values.get("end_angle") or 0.0)
    step = (end - start) / (len(ranges) - 1) if len(ranges) > 1 else end - start
    *moved, qz, qw = pose_of(values)
    if any(moved):
        raise Undecodable("scan whose pose is not that of its frame")
    stamp_ns, frame = head(values)
    start += 2.0 * atan2(qz, qw) if qz else 0.0
    return LaserScan(stamp_ns, frame, start, step, 0.0, 0.0, inf, ranges)


def pose_in_frame(values: Values) -> PoseMessage:
    """foxglove.PoseInFrame."""
    stamp_ns, frame = head(values)
    return PoseMessage(stamp_ns, frame, "", pose_of(values))


def transform(values: Values) -> Transform:
    """foxglove.FrameTransform within another message."""
    parent, child = (str(values.get(f"{end}_frame_id") or "") for end in ("parent", "child"))
    moved = numbers(values.get("translation"), values.get("rotation"))
    return Transform(stamp(values.get("timestamp")), parent, child, moved)


def frame_transform(values: Values) -> Transforms:
    """foxglove.FrameTransform."""
    return Transforms([transform(values)])


def frame_transforms(values: Values) -> Transforms:
    """foxglove.FrameTransforms."""
    return Transforms([transform(item) for item in values.get("transforms") or []])


def point_cloud(values: Values) -> Cloud:
    """foxglove.PointCloud, its points in its frame."""
    data, step = content(values), int(values.get("point_stride") or 0)
    fields = {
        str(field.get("name")): (int(field.get("offset") or 0), POINT_FIELDS[field["type"]])
        for field in values.get("fields") or []
        if field.get("type") in POINT_FIELDS
    }
    if step <= 0 or any(offset < 0 for offset, _ in fields.values()):
        raise Undecodable("cloud whose points overlap", f"{step} bytes a point")
    count = len(data) // step
    found = points(data, (1, count), (count * step, step), fields, "<")
    pose = pose_of(values)
    if pose != STILL:
        with np.errstate(over="ignore", invalid="ignore"):  # garbage in, inf or nan out
            found = found @ rotation(pose).T + np.array(pose[:3])
    return Cloud(*head(values), found)


def rotation(pose: Numbers) -> npt.NDArray[np.float64]:
    """The (3, 3) rotation of a pose whose quaternion may be of any length but 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        x, y, z, w = np.array(pose[3:]) / (np.linalg.norm(pose[3:]) or 1.0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def raw_image(values: Values) -> Image:
    """foxglove.RawImage; its numbers are little-endian."""
    height, width, step = (int(values.get(key) or 0) for key in ("height", "width", "step"))
    data = content(values)
    if height * step > len(data) or min(height, width, step) < 0:
        raise Undecodable("too few pixels", f"{len(data)} bytes for {height} rows of {step}")
    encoding = str(values.get("encoding") or "")
    return Image(*head(values), height, width, encoding, False, step, data[: height * step])


def compressed_image(values: Values) -> CompressedImage:
    """foxglove.CompressedImage."""
    return CompressedImage(*head(values), str(values.get("format") or ""), content(values))


def camera_calibration(values: Values) -> CameraInfo:
    """foxglove.CameraCalibration."""
    height, width = (int(values.get(key) or 0) for key in ("height", "width"))
    k, model = array(values.get("K")), str(values.get("distortion_model") or "")
    if k.size != 9:
        raise Undecodable("camera matrix of a wrong size", f"{k.size} numbers")
    return CameraInfo(*head(values), height, width, model, array(values.get("D")), k.reshape(3, 3))


Decoder = Callable[[Values], Noun]
POSES: dict[str, Decoder] = {"foxglove.PoseInFrame": pose_in_frame}
TRANSFORMS: dict[str, Decoder] = {
    "foxglove.FrameTransform": frame_transform,
    "foxglove.FrameTransforms": frame_transforms,
}
DECODERS: dict[str, Decoder] = {
    **POSES,
    **TRANSFORMS,
    "foxglove.CameraCalibration": camera_calibration,
    "foxglove.CompressedImage": compressed_image,
    "foxglove.LaserScan": laser_scan,
    "foxglove.PointCloud": point_cloud,
    "foxglove.RawImage": raw_image,
}


def decoder(topic: Topic) -> Callable[[Payload], Noun]:
    """What reads a topic's payloads; see `decode`."""
    return partial(decode, topic)


def decode(topic: Topic, data: Payload) -> Noun:
    """The noun in a payload of Foxglove's.

    Args:
        topic: of a type in DECODERS, encoded as "protobuf" or "json".
        data: the payload.

    Raises:
        Undecodable: this payload cannot be read.
    """
    try:
        if topic.encoding == "protobuf":
            return DECODERS[topic.type](protobuf.read(SCHEMAS[topic.type], data))
        return DECODERS[topic.type](from_json(data))
    except (TypeError, ValueError, AttributeError, OverflowError, binascii.Error) as error:
        raise Undecodable("not of its schema", str(error)[:80]) from None
