"""A Kinect in the flat, and a laser in its place: the logs of both, and how far their maps agree.

    python -m scripts.kinect [--seconds 20]

Depth images of 640 x 480 pixels at 30 Hz in whole mm with camera_info and tf, walls 2.5 m high,
floor and ceiling in view; and scans of 640 beams over the same view.
"""

from __future__ import annotations

import argparse
import tempfile
from math import atan, cos, pi, sin
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from formats.jit import njit
from formats.results.file import read_result
from replay import run
from scripts.flat import cast, drive, real_boxes

Floats = npt.NDArray[np.float64]
Depth = npt.NDArray[np.uint16]
Cells = set[tuple[int, int]]
COLUMNS, ROWS, FOCAL, RATE = 640, 480, 525.0, 30.0
ROOM = 2.5  # m, from the floor to the ceiling
FAR = 10.0  # m
AHEAD, HEIGHT, PITCH = 0.1, 0.6, 8 * pi / 180  # of the camera on its base; it looks down a little
SHIFT = 0.02  # m: no wall of the flat lies on the border of a cell
CELL = 0.05  # m
HALF = atan((COLUMNS - 1) / 2 / FOCAL)  # rad from the middle to the outermost column
FRAME = "camera_depth_optical_frame"
IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
SCAN, TF = "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
KINDS = {"none": CompressionType.NONE, "zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}


@njit
def render(boxes: Floats, x: float, y: float, yaw: float, found: Depth) -> None:
    """What the camera sees, in mm along its optical axis, 0 beyond 65.535 m.

    Args:
        boxes: (n, 4) m, from the floor to the ceiling.
        x, y, yaw: of the camera, which stands at HEIGHT and looks down by PITCH.
        found: (ROWS, COLUMNS) filled in.
    """
    c, s, down_c, down_s = cos(yaw), sin(yaw), cos(PITCH), sin(PITCH)
    rows, columns = found.shape
    for v in range(rows):
        down = (v - (rows - 1) / 2) / FOCAL
        ahead, up = down_c - down * down_s, -down_s - down * down_c
        floor = -HEIGHT / up if up < 0 else (ROOM - HEIGHT) / up
        for u in range(columns):
            left = ((columns - 1) / 2 - u) / FOCAL
            over_x, over_y = 1 / (c * ahead - s * left), 1 / (s * ahead + c * left)
            nearest = floor
            for i in range(len(boxes)):
                x0, x1 = (boxes[i, 0] - x) * over_x, (boxes[i, 2] - x) * over_x
                y0, y1 = (boxes[i, 1] - y) * over_y, (boxes[i, 3] - y) * over_y
                enter = max(min(x0, x1), min(y0, y1))
                if 0 < enter < nearest and enter <= min(max(x0, x1), max(y0, y1)):
                    nearest = enter
            mm = round(nearest * 1000)
            found[v, u] = mm if mm <= 65535 else 0


def boxes() -> Floats:
    """What stands there."""
    return real_boxes() + SHIFT


def poses(seconds: float) -> tuple[Floats, Floats]:
    """Times (n,) and poses (n, 3) of the base."""
    way = drive(rate=RATE)
    count = min(round(seconds * RATE), len(way.times))
    return way.times[:count], way.poses[:count] + np.array([SHIFT, SHIFT, 0.0])


def sensor_xy(pose: Floats) -> tuple[float, float]:
    """The sensors stand ahead of the base."""
    x, y, yaw = pose.tolist()
    return x + AHEAD * cos(yaw), y + AHEAD * sin(yaw)


def seen(pose: Floats) -> Depth:
    """(ROWS, COLUMNS) mm."""
    found = np.empty((ROWS, COLUMNS), dtype=np.uint16)
    render(boxes(), *sensor_xy(pose), float(pose[2]), found)
    return found


def write_log(path: Path, kind: str, seconds: float, compression: str = "zstd") -> int:
    """Write the "depth" or "laser" log of a drive as MCAP; how many readings it holds."""
    times, places = poses(seconds)
    store, channels = get_typestore(Stores.ROS2_HUMBLE), dict[str, int]()
    made = store.types
    angles = np.linspace(-HALF, HALF, COLUMNS)
    with path.open("wb") as file:
        writer = Writer(file, compression=KINDS[compression])
        writer.start(profile="ros2")

        def say(topic: str, at: int, message: Any) -> None:
            name = message.__msgtype__
            if topic not in channels:
                text = store.generate_msgdef(name, ros_version=2)[0].encode()
                schema = writer.register_schema(name, "ros2msg", text)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], at, bytes(store.serialize_cdr(message, name)), at)

        def header(at: int, frame: str) -> Any:
            stamp = made["builtin_interfaces/msg/Time"](*divmod(at, 10**9))
            return made["std_msgs/msg/Header"](stamp, frame)

        def transform(at: int, parent: str, child: str, numbers: list[float]) -> Any:
            place = made["geometry_msgs/msg/Vector3"](*numbers[:3])
            turn = made["geometry_msgs/msg/Quaternion"](*numbers[3:])
            link = made["geometry_msgs/msg/Transform"](place, turn)
            stamped = made["geometry_msgs/msg/TransformStamped"](header(at, parent), child, link)
            return made[TF]([stamped])

        start = 1_700_000_000 * 10**9
        for frame, turn in ((FRAME, optical()), ("laser", [0.0, 0.0, 0.0, 1.0])):
            mount = transform(start, "base_footprint", frame, [AHEAD, 0.0, HEIGHT, *turn])
            say("/tf_static", start, mount)
        for t, pose in zip(times.tolist(), places, strict=True):
            at = start + round(t * 1e9)
            x, y, yaw = pose.tolist()
            turn = [0.0, 0.0, sin(yaw / 2), cos(yaw / 2)]
            say("/tf", at, transform(at, "map", "base_footprint", [x, y, 0.0, *turn]))
            if kind == "laser":
                ranges = cast(boxes(), *sensor_xy(pose), yaw + angles, FAR).astype(np.float32)
                step = float(angles[1] - angles[0])
                limits = (-HALF, HALF, step, 0.0, 1 / RATE, 0.1, FAR)
                none = np.zeros(0, np.float32)
                say("/scan", at, made[SCAN](header(at, "laser"), *limits, ranges, none))
                continue
            pixels = seen(pose).view(np.uint8).ravel()
            size = (ROWS, COLUMNS)
            picture = made[IMAGE](header(at, FRAME), *size, "16UC1", 0, 2 * COLUMNS, pixels)
            say("/camera/depth/image_raw", at, picture)
            say("/camera/depth/camera_info", at, _camera_info(made, header(at, FRAME)))
        writer.finish()
    return len(times)


def optical() -> list[float]:
    """The quaternion x y z w of an optical frame (x right, y down, z ahead) that looks down."""
    ahead = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return [float(number) for number in (Rotation.from_euler("y", PITCH) * ahead).as_quat()]


def _camera_info(made: Any, header: Any) -> Any:
    k = np.array([FOCAL, 0, (COLUMNS - 1) / 2, 0, FOCAL, (ROWS - 1) / 2, 0, 0, 1])
    p = np.insert(k, (3, 6, 9), 0.0)
    roi = made["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    level = np.eye(3).ravel()
    return made[INFO](header, ROWS, COLUMNS, "plumb_bob", np.zeros(5), k, level, p, 0, 0, roi)


def mapped(log: Path, result: Path) -> tuple[Cells, Cells]:
    """Cells that are occupied, and cells that were seen, by their numbers on the plane."""
    run(log, output=result, say=lambda _: None)
    found = read_result(result)
    g, evidence = found.geometry, found.evidence()
    visited = evidence.counts.any(axis=0)
    occupied = visited & found.curves["none"].of(evidence).occupied()
    row, col = round(g.y / CELL), round(g.x / CELL)
    where = (np.argwhere(mask).tolist() for mask in (occupied, visited))
    walls, known = ({(r + row, c + col) for r, c in cells} for cells in where)
    return walls, known


def grown(cells: Cells, by: int) -> Cells:
    """These cells and those around them."""
    around = range(-by, by + 1)
    return {(r + i, c + j) for r, c in cells for i in around for j in around}


def f2(truth: tuple[Cells, Cells], other: tuple[Cells, Cells], by: int) -> float:
    """F2 of one map's walls where the other's are the truth, in cells that both have seen.

    Walls within `by` cells of each other are the same.
    """
    both = truth[1] & other[1]
    wanted, found = truth[0] & both, other[0] & both
    precision = len(found & grown(wanted, by)) / len(found)
    recall = len(wanted & grown(found, by)) / len(wanted)
    return 5 * precision * recall / (4 * precision + recall)


def agreement(folder: Path, seconds: float) -> tuple[float, float, int]:
    """F2 between the maps cell by cell, within a cell, and how many cells are wall."""
    maps = []
    for kind in ("laser", "depth"):
        begin = perf_counter()
        count = write_log(folder / f"{kind}.mcap", kind, seconds)
        made = perf_counter()
        maps.append(mapped(folder / f"{kind}.mcap", folder / f"{kind}.replay.mcap"))
        took = f"made in {made - begin:.1f} s, mapped in {perf_counter() - made:.1f} s"
        print(f"{kind}: {count} readings, {took}", flush=True)
    return f2(maps[0], maps[1], 0), f2(maps[0], maps[1], 1), len(maps[0][0])


def main() -> None:
    """Print how far the maps agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        exact, near, walls = agreement(Path(folder), options.seconds)
    print(f"F2 between the maps {exact:.3f}, within a cell {near:.3f}; {walls} cells of wall")


if __name__ == "__main__":
    main()
