"""Writes sample_logs/: a flat's plan and truth, and a simulated TurtleBot's drive through it.

    python -m scripts.make_sample_logs [FOLDER]

The same bytes every time: the noise is seeded, and nothing depends on the clock.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scripts.flat import (
    LEFT,
    LOW,
    Drive,
    Floats,
    cast,
    drawing,
    drive,
    picture,
    plan_boxes,
    real_boxes,
)

RESOLUTION = 0.02  # m a pixel
BORDER = 0.4
BEAMS, FAR, NOISE = 360, 12.0, 0.01
STEP = 2 * np.pi / BEAMS
SCAN_HZ, TF_HZ = 7.7, 20.0
MOUNT = (-0.04, 0.0, 0.19, np.pi / 2)  # of the lidar in base_link: x, y, z, yaw
START_NS = 1_663_967_375_000_000_000
TF_DEF = "geometry_msgs/TransformStamped[] transforms"
YAML = """\
image: {image}
mode: trinary
resolution: {resolution}
origin: [{x:.2f}, {y:.2f}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def quaternion(yaw: float) -> tuple[float, float, float, float]:
    """x, y, z, w of a turn about z."""
    return 0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2))


class Messages:
    """Builds messages of one typestore, ROS 1 or ROS 2."""

    def __init__(self, store: Any, ros1: bool) -> None:
        self.types, self.ros1 = store.types, ros1

    def header(self, t_ns: int, frame: str) -> Any:
        """std_msgs/Header, with ROS 1's sequence number where it has one."""
        stamp = self.types["builtin_interfaces/msg/Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        seq = {"seq": 0} if self.ros1 else {}
        return self.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **seq)

    def transform(
        self, t_ns: int, parent: str, child: str, xyz: tuple[float, float, float], yaw: float
    ) -> Any:
        """geometry_msgs/TransformStamped."""
        x, y, z, w = quaternion(yaw)
        return self.types["geometry_msgs/msg/TransformStamped"](
            header=self.header(t_ns, parent),
            child_frame_id=child,
            transform=self.types["geometry_msgs/msg/Transform"](
                translation=self.types["geometry_msgs/msg/Vector3"](*map(float, xyz)),
                rotation=self.types["geometry_msgs/msg/Quaternion"](x, y, z, w),
            ),
        )

    def tf(self, *transforms: Any) -> Any:
        """tf2_msgs/TFMessage."""
        return self.types["tf2_msgs/msg/TFMessage"](transforms=list(transforms))

    def laser(
        self, t_ns: int, frame: str, start: float, step: float, far: float, ranges: Floats
    ) -> Any:
        """sensor_msgs/LaserScan."""
        return self.types["sensor_msgs/msg/LaserScan"](
            header=self.header(t_ns, frame),
            angle_min=start,
            angle_max=start + (len(ranges) - 1) * step,
            angle_increment=step,
            time_increment=0.0,
            scan_time=0.0,
            range_min=0.15,
            range_max=far,
            ranges=ranges.astype(np.float32),
            intensities=np.zeros(0, np.float32),
        )


def odometry(path: Drive, rng: np.random.Generator) -> Floats:
    """The wheels' own belief (n, 3): true steps with 2 % of noise and a slight pull to the left."""
    out = np.zeros_like(path.poses)
    out[0] = path.poses[0]
    for i in range(1, len(out)):
        before, after, belief = path.poses[i - 1], path.poses[i], out[i - 1]
        dx, dy = after[:2] - before[:2]
        ahead = np.hypot(dx, dy) * (1 + rng.normal(0, 0.02))
        turn = (after[2] - before[2]) * (1 + rng.normal(0, 0.02)) + 0.004 * ahead
        yaw = belief[2] + turn
        out[i] = belief[0] + ahead * np.cos(yaw), belief[1] + ahead * np.sin(yaw), yaw
    return out


def between(frame: Floats, pose: Floats) -> tuple[float, float, float]:
    """The transform that takes `frame` (x, y, yaw in odom) to `pose` (in map)."""
    yaw = pose[2] - frame[2]
    c, s = np.cos(yaw), np.sin(yaw)
    x = pose[0] - (c * frame[0] - s * frame[1])
    y = pose[1] - (s * frame[0] + c * frame[1])
    return float(x), float(y), float(yaw)


def at(path: Drive, t: float, table: Floats | None = None) -> Floats:
    """The true pose (or a row of another table of the same times) at a moment."""
    rows = path.poses if table is None else table
    return np.array([np.interp(t, path.times, rows[:, i]) for i in range(3)])


def events(make: Messages) -> list[tuple[int, str, str, Any]]:
    """(log time, topic, type, message) in order of time."""
    rng = np.random.default_rng(2017)
    path, boxes = drive(), real_boxes()
    belief = odometry(path, rng)
    out = []
    tf, scan = "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/LaserScan"
    x, y, z, yaw = MOUNT
    fixed = make.transform(START_NS, "base_link", "rplidar_link", (x, y, z), yaw)
    out.append((START_NS, "/tf_static", tf, make.tf(fixed)))

    for t in np.arange(0, path.times[-1], 1 / TF_HZ):
        t_ns = START_NS + round(t * 1e9)
        wheels = at(path, t, belief)
        shift = between(wheels, at(path, t))
        pair = (
            make.transform(t_ns, "map", "odom", (shift[0], shift[1], 0.0), shift[2]),
            make.transform(t_ns, "odom", "base_link", (wheels[0], wheels[1], 0.0), wheels[2]),
        )
        out.append((t_ns, "/tf", tf, make.tf(*pair)))
    angles = np.arange(BEAMS) * STEP - np.pi
    for t in np.arange(0.11, path.times[-1] - 0.1, 1 / SCAN_HZ):
        t_ns = START_NS + round(t * 1e9)
        px, py, heading = at(path, t)
        sx, sy = px + x * np.cos(heading), py + x * np.sin(heading)
        ranges = cast(boxes, sx, sy, angles + heading + yaw, FAR)
        ranges = ranges + rng.normal(0, NOISE, BEAMS)
        ranges[rng.random(BEAMS) < 0.001] = np.inf  # a beam now and then comes back from nowhere
        out.append(
            (
                t_ns + 8_000_000,
                "/scan",
                scan,
                make.laser(t_ns, "rplidar_link", -np.pi, STEP, FAR, ranges),
            )
        )
    return sorted(out, key=lambda event: event[0])


def write_mcap(path: Path) -> None:
    """ROS 2 flavour: profile ros2, cdr, zstd chunks."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with path.open("wb") as f:
        writer = McapWriter(
            f, chunk_size=256 * 1024, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        writer.start(profile="ros2", library="plan-replay samples")
        channels: dict[str, int] = {}
        for t_ns, topic, kind, message in events(Messages(store, ros1=False)):
            if topic not in channels:
                text = store.generate_msgdef(kind, ros_version=2)[0].encode()
                schema = writer.register_schema(kind, "ros2msg", text)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], t_ns, data, t_ns)
        writer.finish()


def write_bag(path: Path) -> None:
    """ROS 1 flavour of the same drive, bz2 chunks."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(TF_DEF, "tf2_msgs/msg/TFMessage"))
    path.unlink(missing_ok=True)
    writer = BagWriter(path)
    writer.set_compression(writer.CompressionFormat.BZ2)
    with writer:
        connections: dict[str, Any] = {}
        for t_ns, topic, kind, message in events(Messages(store, ros1=True)):
            if topic not in connections:
                latched = 1 if topic == "/tf_static" else None
                connections[topic] = writer.add_connection(
                    topic, kind, typestore=store, latching=latched
                )
            data = bytes(store.serialize_ros1(message, kind))
            writer.write(connections[topic], t_ns, data)


def main(folder: Path) -> None:
    """Writes all of it into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {
        "plan": (picture(plan_boxes(), RESOLUTION, BORDER), RESOLUTION),
        "truth": (picture(real_boxes(), RESOLUTION, BORDER), RESOLUTION),
        "drawing": (drawing(RESOLUTION / 2, BORDER), RESOLUTION / 2),
    }
    for name, (pixels, resolution) in pictures.items():
        cv2.imwrite(str(folder / f"{name}.png"), pixels)
        text = YAML.format(
            image=f"{name}.png", resolution=resolution, x=LEFT - BORDER, y=LOW - BORDER
        )
        (folder / f"{name}.yaml").write_text(text)
    write_mcap(folder / "turtlebot.mcap")
    write_bag(folder / "turtlebot.bag")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "sample_logs"))
