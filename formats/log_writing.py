"""Logs are written as .mcap, as a ROS 1 .bag, or as a rosbag2 folder (sqlite3), by their suffix."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from formats.errors import Path as AnyPath
from formats.errors import UsageError
from formats.mcap.writing import McapWriter
from formats.output import atomic, atomic_folder
from formats.results.messages import LATCHED, Channels, store

LIBRARY = "plan-replay"


class Recorded(NamedTuple):
    """A message to write.

    Attributes:
        time_ns: of recording.
        topic, type: "/scan", "sensor_msgs/msg/LaserScan".
        data: its CDR.
    """

    time_ns: int
    topic: str
    type: str
    data: bytes


Add = Callable[[Recorded], None]


@contextmanager
def _mcap(path: Path, metadata: Mapping[str, str]) -> Iterator[Add]:
    with path.open("wb") as file:
        writer = McapWriter(file, "ros2", LIBRARY)
        channels = Channels(writer)

        def add(message: Recorded) -> None:
            channels.add(message.topic, message.type, message.time_ns, message.data)

        yield add
        if metadata:
            writer.metadata(LIBRARY, metadata)
        writer.finish()


@contextmanager
def _bag(path: Path, _metadata: Mapping[str, str]) -> Iterator[Add]:
    from rosbags.rosbag1 import Writer

    types, found = store(), dict[str, Any]()
    noetic = _noetic()
    path.unlink(missing_ok=True)  # rosbags makes the file itself
    writer = Writer(path)
    writer.set_compression(writer.CompressionFormat.LZ4)
    with writer:

        def add(message: Recorded) -> None:
            if message.topic not in found:
                found[message.topic] = writer.add_connection(
                    message.topic,
                    message.type,
                    typestore=noetic,
                    latching=int(message.topic in LATCHED) or None,
                )
            data = bytes(types.cdr_to_ros1(message.data, message.type))
            writer.write(found[message.topic], message.time_ns, data)

        yield add


def _noetic() -> Any:
    """ROS 1's types, tf2_msgs among them."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC)
    text = "geometry_msgs/TransformStamped[] transforms"
    types.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    return types


@contextmanager
def _folder(path: Path, metadata: Mapping[str, str]) -> Iterator[Add]:
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )
    from rosbags.rosbag2 import StoragePlugin, Writer

    never, found = QosTime(9223372036, 854775807), dict[str, Any]()
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for key, value in metadata.items():
            writer.set_custom_data(key, value)

        def add(message: Recorded) -> None:
            if message.topic not in found:
                latched = message.topic in LATCHED
                keeps = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
                qos = Qos(
                    QosHistory.KEEP_LAST,
                    1 if latched else 100,
                    QosReliability.RELIABLE,
                    keeps,
                    never,
                    never,
                    QosLiveliness.AUTOMATIC,
                    never,
                    avoid_ros_namespace_conventions=False,
                )
                found[message.topic] = writer.add_connection(
                    message.topic, message.type, typestore=store(), offered_qos_profiles=[qos]
                )
            writer.write(found[message.topic], message.time_ns, message.data)

        yield add


FILES = {".mcap": _mcap, ".bag": _bag}


def check_suffix(path: AnyPath) -> None:
    """Whether a log can be written under that name.

    Raises:
        UsageError: its suffix is of no log that is written.
    """
    suffix = Path(path).suffix
    if suffix and suffix not in FILES:
        hint = "give .mcap, .bag, or a name without a suffix for a rosbag2 folder"
        raise UsageError(path, f"no log is written as {suffix}", hint=hint)


def write_log(
    path: AnyPath,
    messages: Iterable[Recorded],
    *,
    metadata: Mapping[str, str] | None = None,
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> dict[str, int]:
    """Write a log whole or not at all; the same messages give the same bytes.

    Args:
        path: .mcap (profile ros2, zstd), .bag (ROS 1, lz4), or without a suffix a rosbag2 folder.
        messages: in the order of their times.
        metadata: of the whole log, where the container has a place for it (not a bag).
        force: replace what is there; inputs: what is read and must not be replaced.

    Returns:
        topic -> messages.

    Raises:
        UsageError: another suffix. FormatError: it cannot be written.
    """
    check_suffix(path)
    kind, counts = FILES.get(Path(path).suffix), dict[str, int]()
    place = (
        atomic(path, force=force, inputs=inputs)
        if kind
        else atomic_folder(path, mark="metadata.yaml", force=force, inputs=inputs)
    )
    with place as part, (kind or _folder)(part, metadata or {}) as add:
        for message in messages:
            add(message)
            counts[message.topic] = counts.get(message.topic, 0) + 1
    return counts
