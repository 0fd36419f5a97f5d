"""Rows 60 to 64: what a depth camera's pictures and its camera_info can be."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Collection
from math import atan2, hypot, nan
from pathlib import Path
from typing import Any

import numpy as np

from tests.depth_worlds import as_image
from tests.faults_case import Given, Table
from tests.faults_world import MOUNT, STEPS, path, ray
from tests.ros_logs import RosLog

table = Table()
TOPIC, INFO_TOPIC = "/camera/depth/image_raw", "/camera/depth/camera_info"
FRAME = "camera_depth_optical_frame"
COLUMNS, ROWS, FOCAL, HEIGHT = 60, 8, 45.0, 0.5
LEVEL = (-0.5, 0.5, -0.5, 0.5)  # x right, y down, z ahead, as a quaternion
FEW = (3, 7)
ALL = range(STEPS)
Fields = dict[str, Any]


def metres_at(t: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(ROWS, COLUMNS) of depth from the camera's place: the room's walls, taller than the view."""
    x, y, yaw = path(t)
    x, y = x + MOUNT[0] * np.cos(yaw), y + MOUNT[0] * np.sin(yaw)
    aside = [((COLUMNS - 1) / 2 - u) / FOCAL for u in range(COLUMNS)]
    row = [ray(x, y, yaw + atan2(left, 1.0)) / hypot(left, 1.0) for left in aside]
    return np.tile(np.round(row, 3), (ROWS, 1))


def k_of(focal: float, width: int, height: int) -> list[float]:
    return [focal, 0, (width - 1) / 2, 0, focal, (height - 1) / 2, 0, 0, 1]


def drive(
    change: Callable[[int], Fields] = lambda _: {}, info: Fields | None = None, wanted: bool = True
) -> RosLog:
    """The drive with a depth camera instead of a laser.

    Args:
        change: fields of the k-th picture instead.
        info: fields of every camera_info instead.
        wanted: whether there is a camera_info.
    """
    log = RosLog()
    log.static("base_link", FRAME, (MOUNT[0], 0.0, HEIGHT, *LEVEL))
    for k in range(STEPS + 1):
        t = k / 10
        log.tf(t, "map", "odom", (0.0, 0.0, 0.0))
        log.tf(t, "odom", "base_link", path(t))
        if k == STEPS:
            break
        header = log.header(t, FRAME, None)
        if wanted:
            size = {"height": ROWS, "width": COLUMNS, "distortion_model": "plumb_bob"}
            made = {"header": header, **size, "k": k_of(FOCAL, COLUMNS, ROWS), **(info or {})}
            log.say(t, INFO_TOPIC, "sensor_msgs/msg/CameraInfo", **made)
        size = {"height": ROWS, "width": COLUMNS, "encoding": "16UC1", "step": 2 * COLUMNS}
        pixels = np.round(metres_at(t) * 1000).astype("<u2").view(np.uint8).ravel()
        made = {"header": header, **size, "data": pixels, **change(k)}
        log.say(t, TOPIC, "sensor_msgs/msg/Image", **made)
    return log


def some(fields: Fields, which: Collection[int] = FEW) -> Callable[[int], Fields]:
    """These fields in some of the pictures."""
    return lambda k: fields if k in which else {}


def like(d: Path, log: RosLog, options: tuple[str, ...] = ()) -> Given:
    """A log that must give what a sound camera's gives, or a part of that."""
    sound = drive().write(d / "like.mcap")
    return Given(log.write(d / "drive.mcap"), options=options, like=sound)


def recoded(encoding: str, big: bool, padding: int) -> Callable[[int], Fields]:
    """The same pictures in another encoding."""

    def change(k: int) -> Fields:
        image = as_image(metres_at(k / 10), encoding, big, padding)
        fields: Fields = {"encoding": encoding, "is_bigendian": int(big), "step": image.step}
        return {**fields, "data": image.data}

    return change


table(60, "mono16 is depth in mm", f"{TOPIC}: mono16 taken as depth in mm")(
    lambda d: like(d, drive(lambda _: {"encoding": "mono16"}))
)
table(60, "rgb8 is no depth", "rgb8 is no depth", code=1)(
    lambda d: drive(lambda _: {"encoding": "rgb8"}).write(d / "a.mcap")
)
table(60, "rgb8 asked for", "encoding 'rgb8' is no depth", code=1)(
    lambda d: Given(
        drive(lambda _: {"encoding": "rgb8"}).write(d / "a.mcap"), options=("--scan", TOPIC)
    )
)


@table(60, "colour and infrared beside depth are no choice", quiet=True)
def _(d: Path) -> Given:
    log = drive()
    for name, encoding in (("/camera/rgb/image_raw", "rgb8"), ("/camera/ir/image_raw", "mono16")):
        fields: Fields = {"height": 1, "width": 1, "encoding": encoding, "step": 3}
        for k in ALL:
            header = log.header(k / 10, FRAME, None)
            kind = "sensor_msgs/msg/Image"
            log.say(k / 10, name, kind, header=header, **fields, data=[0, 0, 0])
    return like(d, log)


HUGE = {"height": 1 << 31, "width": 1 << 31, "step": 0, "data": []}
BAD: list[tuple[str, Fields, str, int]] = [
    ("data short", {"data": [0] * 9}, "message not readable: too few pixels", 3),
    ("step short", {"step": 2}, f"step of 2 bytes is short of {COLUMNS} pixels", 0),
    ("2^31 x 2^31", HUGE, "implausible image of 2147483648 x 2147483648 pixels", 0),
    ("0 x 0", {"height": 0, "width": 0}, "image without pixels", 0),
]
for name, fields, words, code in BAD:
    table(61, f"{name}, some", f"2 x {words}", code=code, map="part", least=0.7)(
        lambda d, fields=fields: like(d, drive(some(fields)))
    )
    table(61, f"{name}, all", words, code=1)(
        lambda d, fields=fields: drive(some(fields, ALL)).write(d / "drive.mcap")
    )
table(61, "some all 0", quiet=True, map="part", least=0.7)(
    lambda d: like(d, drive(some({"data": np.zeros(2 * ROWS * COLUMNS, np.uint8)})))
)

for encoding, big, padding in (("16UC1", False, 6), ("16UC1", True, 0), ("32FC1", True, 3)):
    order = "big" if big else "little"
    table(62, f"{encoding} {order}-endian, rows padded by {padding}", quiet=True)(
        lambda d, given=(encoding, big, padding): like(d, drive(recoded(*given)))
    )


@table(62, "32FC1 with NaN and inf where nothing is seen", quiet=True, map="part", least=0.5)
def _(d: Path) -> Given:
    def change(k: int) -> Fields:
        metres = metres_at(k / 10).astype("<f4")
        metres[:, ::3], metres[:, 1::9] = nan, np.inf
        pixels = metres.view(np.uint8).ravel()
        return {"encoding": "32FC1", "step": 4 * COLUMNS, "data": pixels}

    return like(d, drive(change))


table(63, "no camera_info", f"looked for {INFO_TOPIC}; found none", code=1)(
    lambda d: drive(wanted=False).write(d / "drive.mcap")
)
for name, value, words in (("0", 0.0, "no focal length"), ("NaN", nan, "is not finite")):
    table(63, f"K {name}", words, code=1)(
        lambda d, value=value: drive(info={"k": [value] * 9}).write(d / "drive.mcap")
    )
TWICE = {"height": 2 * ROWS, "width": 2 * COLUMNS, "k": k_of(2 * FOCAL, 2 * COLUMNS, 2 * ROWS)}
table(63, "camera_info of twice the size", "camera_info of 120 x 16 scaled to 60 x 8 pixels")(
    lambda d: like(d, drive(info=TWICE))
)
table(63, "camera_info in another frame", "its camera_info in 'elsewhere'")(
    lambda d: like(d, drive(info={"header": RosLog().header(0.0, "elsewhere", None)}))
)


def packed(change: Callable[[bytes], bytes] = lambda png: png) -> RosLog:
    """The pictures as image_transport compresses them; two of them changed."""
    import cv2

    log, count = drive(), 0
    for i, (t, topic, _, latched, fields) in enumerate(log.happened):
        if topic != TOPIC:
            continue
        pixels = np.asarray(fields["data"]).view("<u2").reshape(ROWS, COLUMNS)
        png = bytes(cv2.imencode(".png", pixels)[1])
        body = bytes(12) + (change(png) if count in FEW else png)
        made = {"header": fields["header"], "format": "16UC1; compressedDepth png"}
        made["data"] = np.frombuffer(body, np.uint8)
        name, kind = f"{TOPIC}/compressedDepth", "sensor_msgs/msg/CompressedImage"
        log.happened[i] = t, name, kind, latched, made
        count += 1
    return log


def bomb(png: bytes) -> bytes:
    """The same PNG with a header of 30000 x 30000 pixels: 1.8 GB."""
    head = b"IHDR" + (30000).to_bytes(4, "big") * 2 + png[24:29]
    return png[:12] + head + zlib.crc32(head).to_bytes(4, "big") + png[33:]


def spoilt(png: bytes) -> bytes:
    """Pixels damaged under checksums that hold."""
    at = png.index(b"IDAT")
    size = int.from_bytes(png[at - 4 : at], "big")
    body = b"IDAT" + b"\xff" * size
    return png[:at] + body + zlib.crc32(body).to_bytes(4, "big") + png[at + 8 + size :]


table(64, "compressedDepth", quiet=True)(lambda d: like(d, packed()))
PACKED: list[tuple[str, str, Callable[[bytes], bytes]]] = [
    ("cut", "damaged PNG", lambda png: png[:-20]),
    ("flipped", "damaged PNG", lambda png: png[:60] + bytes([png[60] ^ 1]) + png[61:]),
    ("damaged under its checksums", "damaged PNG", spoilt),
    ("bomb", "PNG of too many pixels", bomb),
    ("empty", "", lambda _: b""),
]
for name, words, changed in PACKED:
    table(64, f"PNG {name}", f"2 x message not readable: {words}", code=3, map="part", least=0.7)(
        lambda d, changed=changed: like(d, packed(changed))
    )
