"""Small logs for tests: say what happens, then write it as any container, by rosbags' own means.

    log = RosLog()
    log.static("base_link", "laser", (0.2, 0.0, 0.3))
    for i in range(10):
        log.tf(i * 0.1, "odom", "base_link", (0.05 * i, 0.0, 0.0))
        log.scan(i * 0.1, [1.0, 2.0, inf])
    path = log.write(tmp_path / "drive.mcap")          # or "mcap", "sqlite3" folders, ".bag"

Times are seconds from `start`. A pose is (x, y, yaw), (x, y, z, qx, qy, qz, qw), or (x, y, z, roll,
pitch, yaw). Any message type goes by `say(t, topic, type, **fields)`; fields left out are zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.log import Message, Topic
from tests.memory_log import MemoryLog

SECOND = 1_000_000_000
START_NS = 1_600_000_000 * SECOND
TF = "tf2_msgs/msg/TFMessage"
Numbers = Sequence[float]


def store(ros: int = 2) -> Any:
    """rosbags' typestore of ROS 1 Noetic (with tf2_msgs) or ROS 2 Humble."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    found = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    if TF not in found.types:
        found.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    return found


def stamp(time_ns: int) -> dict[str, int]:
    """A builtin_interfaces/Time."""
    return {"sec": time_ns // SECOND, "nanosec": time_ns % SECOND}


def euler(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """The quaternion x y z w of fixed-axis roll, pitch, yaw (REP-103)."""
    a, b, c = cos(roll / 2), cos(pitch / 2), cos(yaw / 2)
    u, v, w = sin(roll / 2), sin(pitch / 2), sin(yaw / 2)
    return (
        u * b * c - a * v * w,
        a * v * c + u * b * w,
        a * b * w - u * v * c,
        a * b * c + u * v * w,
    )


def seven(pose: Numbers) -> tuple[float, ...]:
    """x y z qx qy qz qw of a pose in any of the three forms."""
    p = [float(number) for number in pose]
    if len(p) == 3:
        return p[0], p[1], 0.0, *euler(0.0, 0.0, p[2])
    return tuple(p) if len(p) == 7 else (*p[:3], *euler(p[3], p[4], p[5]))


def pose_fields(pose: Numbers, place: str = "position", turn: str = "orientation") -> Any:
    """A geometry_msgs/Pose (or with other names a Transform)."""
    n = seven(pose)
    return {
        place: dict(zip("xyz", n[:3], strict=True)),
        turn: dict(zip("xyzw", n[3:], strict=True)),
    }


def build(types: Any, name: str, fields: dict[str, Any]) -> Any:
    """A message of rosbags' from nested dicts; what is left out is zero or empty."""
    from rosbags.interfaces import Nodetype

    def value(kind: Any, given: Any) -> Any:
        node, detail = kind
        if node == Nodetype.NAME:
            return build(types, detail, given or {})
        if node == Nodetype.BASE:
            empty = {"string": "", "bool": False}.get(detail[0], 0)
            return empty if given is None else given
        (inner, what), size = detail
        items = [None] * size if given is None else given
        if inner == Nodetype.BASE and what[0] != "string":
            dtype = {"bool": "?", "byte": "u1", "char": "u1", "octet": "u1"}.get(what[0], what[0])
            zero = np.zeros(size) if given is None else given
            return np.ascontiguousarray(zero, dtype=dtype)
        return [value((inner, what), item) for item in items]

    made = {key: value(kind, fields.get(key)) for key, kind in types.fielddefs[name][1]}
    return types.types[name](**made)


@dataclass
class RosLog:
    """What happens in a drive; `start` is added to every time, of stamps and of recording.

    Attributes:
        start_ns: the time of 0 s.
        happened: (log time, topic, type, latched, fields).
    """

    start_ns: int = START_NS
    happened: list[tuple[int, str, str, bool, dict[str, Any]]] = field(default_factory=list)

    def ns(self, t: float) -> int:
        """Seconds of the drive as ns of the clock."""
        return self.start_ns + round(t * SECOND)

    def say(self, t: float, topic: str, name: str, *, latched: bool = False, **fields: Any) -> None:
        """Any message; `t` is when it is recorded."""
        self.happened.append((self.ns(t), topic, name, latched, fields))

    def header(self, t: float, frame: str, at: float | None) -> dict[str, Any]:
        """A header stamped `at` (default: t)."""
        return {"stamp": stamp(self.ns(t if at is None else at)), "frame_id": frame}

    def scan(
        self,
        t: float,
        ranges: Sequence[float] | npt.NDArray[Any],
        *,
        topic: str = "/scan",
        frame: str = "laser",
        at: float | None = None,
        angle_min: float = -pi / 2,
        increment: float | None = None,
        range_min: float = 0.1,
        range_max: float = 10.0,
        time_increment: float = 0.0,
        header: dict[str, Any] | None = None,
    ) -> None:
        """A LaserScan over 180 degrees, unless said otherwise; `at` is its stamp."""
        n = len(ranges)
        step = pi / max(n - 1, 1) if increment is None else increment
        self.say(
            t,
            topic,
            "sensor_msgs/msg/LaserScan",
            header=self.header(t, frame, at) if header is None else header,
            angle_min=angle_min,
            angle_max=angle_min + step * (n - 1),
            angle_increment=step,
            time_increment=time_increment,
            range_min=range_min,
            range_max=range_max,
            ranges=ranges,
        )

    def tf(
        self,
        t: float,
        parent: str,
        child: str,
        pose: Numbers,
        *,
        at: float | None = None,
        topic: str = "/tf",
    ) -> None:
        """One transform."""
        made = {
            "header": self.header(t, parent, at),
            "child_frame_id": child,
            "transform": pose_fields(pose, "translation", "rotation"),
        }
        self.say(t, topic, TF, latched=topic.endswith("_static"), transforms=[made])

    def static(self, parent: str, child: str, pose: Numbers, t: float = 0.0) -> None:
        """One static transform, recorded at `t`."""
        self.tf(t, parent, child, pose, topic="/tf_static")

    def pose(
        self, t: float, topic: str, pose: Numbers, *, frame: str = "map", at: float | None = None
    ) -> None:
        """A PoseStamped."""
        header = self.header(t, frame, at)
        self.say(t, topic, "geometry_msgs/msg/PoseStamped", header=header, pose=pose_fields(pose))

    def amcl_pose(
        self, t: float, pose: Numbers, *, topic: str = "/amcl_pose", frame: str = "map"
    ) -> None:
        """A PoseWithCovarianceStamped."""
        name = "geometry_msgs/msg/PoseWithCovarianceStamped"
        header = self.header(t, frame, None)
        self.say(t, topic, name, header=header, pose={"pose": pose_fields(pose)})

    def odometry(
        self,
        t: float,
        pose: Numbers,
        *,
        topic: str = "/odom",
        frame: str = "odom",
        child: str = "base_link",
    ) -> None:
        """An Odometry."""
        self.say(
            t,
            topic,
            "nav_msgs/msg/Odometry",
            header=self.header(t, frame, None),
            child_frame_id=child,
            pose={"pose": pose_fields(pose)},
        )

    def write(self, path: Path, kind: str = "") -> Path:
        """Write all of it.

        Args:
            path: of the file or folder to make.
            kind: "bag", "mcap" (one file), "rosbag2-sqlite3" or "rosbag2-mcap" (folders); by
                default "bag" or "mcap" by the path's suffix.
        """
        writers = {
            "bag": self._bag,
            "mcap": self._mcap,
            "rosbag2-sqlite3": self._folder,
            "rosbag2-mcap": self._folder,
        }
        kind = kind or path.suffix[1:]
        writers[kind](path, kind)
        return path

    def encoded(self, ros: int) -> Iterator[tuple[int, str, str, bool, bytes]]:
        """(log time, topic, type, latched, payload), in the order in which it was said."""
        types = store(ros)
        for time_ns, topic, name, latched, fields in self.happened:
            message = build(types, name, fields)
            serialize = types.serialize_ros1 if ros == 1 else types.serialize_cdr
            yield time_ns, topic, name, latched, bytes(serialize(message, name))

    def _bag(self, path: Path, _kind: str) -> None:
        from rosbags.rosbag1 import Writer

        types = store(1)
        with Writer(path) as bag:
            found: dict[tuple[str, str], Any] = {}
            for time_ns, topic, name, latched, data in self.encoded(1):
                if (topic, name) not in found:
                    found[topic, name] = bag.add_connection(
                        topic, name, typestore=types, latching=int(latched)
                    )
                bag.write(found[topic, name], time_ns, data)

    def _mcap(self, path: Path, _kind: str) -> None:
        from mcap.writer import Writer

        types = store(2)
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="ros2")
            found: dict[tuple[str, str], int] = {}
            for time_ns, topic, name, _, data in self.encoded(2):
                if (topic, name) not in found:
                    text, _ = types.generate_msgdef(name, ros_version=2)
                    schema = writer.register_schema(name, "ros2msg", text.encode())
                    found[topic, name] = writer.register_channel(topic, "cdr", schema)
                writer.add_message(found[topic, name], time_ns, data, time_ns)
            writer.finish()

    def _folder(self, path: Path, kind: str) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer

        types = store(2)
        plugin = StoragePlugin.MCAP if kind.endswith("mcap") else StoragePlugin.SQLITE3
        with Writer(path, version=8, storage_plugin=plugin) as bag:
            found: dict[tuple[str, str], Any] = {}
            for time_ns, topic, name, _, data in self.encoded(2):
                if (topic, name) not in found:
                    found[topic, name] = bag.add_connection(topic, name, typestore=types)
                bag.write(found[topic, name], time_ns, data)

    def opened(self) -> MemoryLog:
        """The same as a Log that was never written, CDR inside."""
        counts: dict[tuple[str, str], int] = {}
        rows = list(self.encoded(2))
        for _, topic, name, _, _ in rows:
            counts[topic, name] = counts.get((topic, name), 0) + 1
        topics = {
            (topic, name): Topic(topic, name, "cdr", count=count, latched="static" in topic)
            for (topic, name), count in counts.items()
        }
        messages = [Message(topics[row[1], row[2]], row[0], row[4]) for row in rows]
        return MemoryLog(sorted(messages, key=lambda message: message.time_ns))
