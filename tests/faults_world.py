"""A room of 2 x 2 m with a pillar, a robot that drives through it, and its log: for fault tests."""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, inf, pi, sin
from pathlib import Path
from typing import Any

import numpy as np

from formats.mcap import records as r
from tests.mcap_files import McapBytes
from tests.pictures import png
from tests.ros_logs import RosLog, store

SCAN = "sensor_msgs/msg/LaserScan"
BEAMS = 90
STEPS = 12
MOUNT = (0.1, 0.0, 0.0)
# Boxes x0, y0, x1, y1 in m: the room's inside, and a pillar that leaves it no symmetry; both 2 cm
# within what is drawn, so that no reading ends where two cells meet.
ROOM = (-1.02, -1.02, 1.02, 1.02)
PILLAR = (0.42, 0.32, 0.68, 0.48)
DRAWN = (0.4, 0.3, 0.7, 0.5)
PIXEL = 0.05


def path(t: float) -> tuple[float, float, float]:
    """The robot's pose in the map at t s; no number is round, or the last bit would tell cells."""
    return -0.613 + 0.5 * t, -0.407 + 0.1 * t, 0.017 + 0.3 * t


def ray(x: float, y: float, angle: float) -> float:
    """Metres from a place inside the room to the first wall."""
    dx, dy = cos(angle), sin(angle)
    walls = [(ROOM[0 if dx < 0 else 2] - x) / dx if dx else inf]
    walls.append((ROOM[1 if dy < 0 else 3] - y) / dy if dy else inf)
    near, far = -inf, inf
    for at, d, low, high in ((x, dx, PILLAR[0], PILLAR[2]), (y, dy, PILLAR[1], PILLAR[3])):
        a, b = ((low - at) / d, (high - at) / d) if d else (-inf, inf)
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return min([*walls, near] if 0 < near < far else walls)


def ranges_at(t: float, turn: float = 0.0, beams: int = BEAMS, first: float = -pi) -> list[float]:
    """A full turn of beams from the laser's place, counter-clockwise from `first`."""
    x, y, yaw = path(t)
    lx, ly = x + MOUNT[0] * cos(yaw), y + MOUNT[0] * sin(yaw)
    step = 2 * pi / beams
    return [ray(lx, ly, yaw + turn + first + step * i) for i in range(beams)]


def drive(
    steps: int = STEPS,
    *,
    mount: tuple[float, ...] | None = MOUNT,
    poses: str = "tf",
    start_ns: int | None = None,
    **scan: Any,
) -> RosLog:
    """A drive at 10 Hz; its poses go one step farther than its scans.

    Args:
        steps: scans.
        mount: of the laser on base_link, None where nothing tells.
        poses: "tf" (map > odom > base_link), "odom" (odom > base_link), "none".
        start_ns: of the clock.
        scan: fields of every scan instead.
    """
    log = RosLog() if start_ns is None else RosLog(start_ns)
    if mount is not None:
        log.static("base_link", "laser", mount)
    for k in range(steps + 1):
        t = k / 10
        if poses == "tf":
            log.tf(t, "map", "odom", (0.0, 0.0, 0.0))
        if poses in ("tf", "odom"):
            log.tf(t, "odom", "base_link", path(t))
        if k < steps:
            given = {"angle_min": -pi, "increment": 2 * pi / BEAMS, "range_max": 4.0, **scan}
            log.scan(t, ranges_at(t), **given)
    return log


def scans(log: RosLog, topic: str = "/scan") -> list[dict[str, Any]]:
    """The fields of its scans: change them before it is written."""
    return [fields for _, name, _, _, fields in log.happened if name == topic]


def transforms(log: RosLog, topic: str = "/tf") -> list[dict[str, Any]]:
    """The fields of its transforms, one by one."""
    rows = [fields for _, name, _, _, fields in log.happened if name == topic]
    return [transform for fields in rows for transform in fields["transforms"]]


def plan_pixels() -> np.ndarray[Any, np.dtype[np.uint8]]:
    """The room as it is drawn: walls 0.1 m thick and the pillar, black on white, row 0 on top."""
    size = round(2.2 / PIXEL)
    pixels = np.full((size, size), 255, dtype=np.uint8)
    pixels[:2], pixels[-2:], pixels[:, :2], pixels[:, -2:] = 0, 0, 0, 0
    low, high = (round((DRAWN[i] + 1.1) / PIXEL) for i in (1, 3))
    left, right = (round((DRAWN[i] + 1.1) / PIXEL) for i in (0, 2))
    pixels[size - high : size - low, left:right] = 0
    return pixels


YAML = """image: {image}
mode: trinary
resolution: {resolution}
origin: [-1.1, -1.1, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def write_plan(folder: Path, name: str = "plan") -> Path:
    """The plan and its yaml."""
    picture = folder / f"{name}.png"
    picture.write_bytes(png(plan_pixels()))
    text = YAML.format(image=picture.name, resolution=PIXEL)
    picture.with_suffix(".yaml").write_text(text, encoding="utf-8")
    return picture


def definitions(log: RosLog) -> tuple[list[Any], dict[tuple[str, str], int]]:
    """MCAP schemas and channels of a log, and the channel of each (topic, type)."""
    types = store(2)
    records: list[Any] = []
    channels: dict[tuple[str, str], int] = {}
    for _, topic, name, _, _ in log.happened:
        if (topic, name) not in channels:
            number = channels[topic, name] = len(channels) + 1
            text = types.generate_msgdef(name, ros_version=2)[0].encode()
            records += [r.Schema(number, name, "ros2msg", text)]
            records += [r.Channel(number, number, topic, "cdr", {})]
    return records, channels


def messages(log: RosLog) -> list[Any]:
    """MCAP message records of a log."""
    _, channels = definitions(log)
    return [
        r.RawMessage(channels[topic, name], number, time, time, data)
        for number, (time, topic, name, _, data) in enumerate(log.encoded(2))
    ]


def mcap_of(log: RosLog, more: Iterable[Any] = (), **options: Any) -> McapBytes:
    """An MCAP under construction, all messages added; `more` records go in front."""
    made = McapBytes(**{"chunk_messages": 8, **options})
    return made.add(*more, *definitions(log)[0], *messages(log))
