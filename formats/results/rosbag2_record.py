"""The record "rosbag2" of a result: what `ros2 bag info` and `play` look for in an MCAP.

rosbag2's own storage plugin writes it so: a metadata record of that name, whose value
"serialized_metadata" is what metadata.yaml has below its root, here in version 5 (Humble).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import yaml

from formats.mcap.writing import McapWriter
from formats.results.messages import Channels, qos

NAME = "rosbag2"
VERSION = 5
FILE = "result.replay.mcap"  # whatever its name is: the same run gives the same bytes


class Offered(NamedTuple):
    """A topic of the file.

    Attributes:
        topic, kind: name, and ROS 2 type.
        qos: as the channel's metadata has it.
        messages: how many.
    """

    topic: str
    kind: str
    qos: str
    messages: int


def bag_metadata(name: str, topics: list[Offered], start_ns: int, end_ns: int) -> Mapping[str, str]:
    """The record's values for a file of this name."""
    count = sum(topic.messages for topic in topics)
    start = {"nanoseconds_since_epoch": start_ns}
    duration = {"nanoseconds": end_ns - start_ns}
    told = [
        {
            "topic_metadata": {
                "name": topic.topic,
                "type": topic.kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": topic.qos,
            },
            "message_count": topic.messages,
        }
        for topic in topics
    ]
    file = {"path": name, "starting_time": start, "duration": duration, "message_count": count}
    whole = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [name],
        "duration": duration,
        "starting_time": start,
        "message_count": count,
        "topics_with_message_count": told,
        "compression_format": "",
        "compression_mode": "",
        "files": [file],
    }
    return {"serialized_metadata": yaml.safe_dump(whole, sort_keys=False)}


def finish_bag(writer: McapWriter, channels: Channels) -> None:
    """The record, behind the last message, and the end of the file."""
    writer.close_chunk()
    pairs = zip(channels.kinds.items(), writer.counts, strict=True)
    topics = [Offered(topic, kind, qos(topic), count) for (topic, kind), count in pairs]
    writer.metadata(NAME, bag_metadata(FILE, topics, *writer.span))
    writer.finish()
