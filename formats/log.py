"""What every container reader gives: topics, and messages as bytes in the order of log time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from formats.errors import printable


@dataclass(frozen=True, slots=True)
class Topic:
    """One kind of message on one topic; two types on one name are two topics.

    Attributes:
        name: as recorded.
        type: ROS 2 style, "sensor_msgs/msg/LaserScan"; for protobuf and JSON the schema's name.
        encoding: of the payloads: "ros1", "cdr", "protobuf", "json" or what the file says.
        definition: the message definition as recorded, b"" where there is none.
        definition_format: "ros1msg", "ros2msg", "ros2idl", "protobuf", "jsonschema" or "".
        count: messages, as far as known without reading them; None where unknown.
        latched: kept for late joiners (latching=1, transient_local).
    """

    name: str
    type: str
    encoding: str
    definition: bytes = b""
    definition_format: str = ""
    count: int | None = None
    latched: bool = False


class Message(NamedTuple):
    """One recorded message: its topic, log time (ns since 1970) and the payload's bytes.

    `data` may be a view on the file's mapped pages: valid while the log is open, never written to.
    """

    topic: Topic
    time_ns: int
    data: bytes | memoryview


@dataclass(frozen=True, slots=True)
class Container:
    """What a log is, in the words of `replay info`.

    Attributes:
        kind: "MCAP ros2", "ROS 1 bag", "rosbag2 sqlite3", ...
        compression: "zstd", "lz4", "bz2", "none" or a comma-separated mix.
        size: bytes on disk.
        start_ns, end_ns: first and last log time; 0 and 0 where there are no messages.
        whole: False where the file is cut or damaged.
        state: "complete (CRC ok)", "no index", "cut at byte 81920", ...
    """

    kind: str
    compression: str
    size: int
    start_ns: int
    end_ns: int
    whole: bool
    state: str


class Log(Protocol):
    """An opened log, whatever its container. Losses and oddities go to the Notes given on opening.

    A reader module offers `fits(path, head) -> bool` (head: the first 4 KiB, b"" for a folder) and
    `open_file(path, notes, max_chunk) -> Log`; both stand in stream.READERS.
    """

    path: Path

    @property
    def container(self) -> Container:
        """What the log is; `whole` and `state` may change while messages are read."""
        ...

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name and type."""
        ...

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics (None: all), sorted by log time, file order where equal.

        May be called again for another pass. Memory does not grow with the log.
        """
        ...

    def close(self) -> None:
        """Give back files, maps and temporary copies."""
        ...


def listing(topics: list[Topic]) -> str:
    """Topics with their types and counts, for an error's line."""
    return ", ".join(
        f"{printable(t.name)} ({t.type.rsplit('/', 1)[-1]}"
        f"{'' if t.count is None else f' x{t.count}'})"
        for t in topics
    )


def named(topics: list[Topic], name: str) -> list[Topic]:
    """The topics of a name, with or without the leading slash."""
    return [t for t in topics if t.name == name] or [
        t for t in topics if t.name.lstrip("/") == name.lstrip("/")
    ]
