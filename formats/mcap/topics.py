"""MCAP channels as topics: types, encodings and latching as ROS 1, ROS 2 and others write them."""

from __future__ import annotations

import re
from collections import Counter

from formats.errors import Notes, Path
from formats.log import Topic
from formats.mcap.contents import Part
from formats.mcap.records import Channel, Schema
from formats.ros.standard import STANDARD

ENCODINGS = {"ros1": "ros1", "ros2": "cdr"}  # of a profile, where a channel names none
ROS_DEFINITIONS = ("ros1msg", "ros2msg", "ros2idl")
# rosbag2 writes the number of rmw's enumeration, or from Jazzy on its name.
TRANSIENT_LOCAL = re.compile(r"durability:\s*(?:1\b|transient_local)")
Key = tuple[str, str, str]


def topics_of(path: Path, notes: Notes, parts: list[Part]) -> list[dict[int, Topic]]:
    """The topic of each channel of each part; channels of one name, type and encoding share one.

    Args:
        path: the name to give in notes.
        notes: where channels without a schema that they name are counted.
        parts: with their counts of messages.
    """
    first: dict[Key, tuple[Channel, Schema | None]] = {}
    counts: Counter[Key] = Counter()
    latched: set[Key] = set()
    keys: list[dict[int, Key]] = []
    for part in parts:
        keys.append({})
        for channel in part.channels.values():
            schema = part.schemas.get(channel.schema_id)
            if schema is None and channel.schema_id:
                problem = f"schema {channel.schema_id} is not defined; its type is unknown"
                notes.warn(path, problem, topic=channel.topic)
            key = (channel.topic, _type(schema), _encoding(channel, part))
            first.setdefault(key, (channel, schema))
            counts[key] += part.counts[channel.id]
            keys[-1][channel.id] = key
            if _latched(channel):
                latched.add(key)
    topics = {
        key: Topic(
            *key,
            definition=schema.data if schema else b"",
            definition_format=schema.encoding if schema else "",
            count=counts[key],
            latched=key in latched,
        )
        for key, (_, schema) in first.items()
    }
    return [{channel: topics[key] for channel, key in table.items()} for table in keys]


def _type(schema: Schema | None) -> str:
    if schema is None:
        return ""
    ros = schema.encoding in ROS_DEFINITIONS and schema.name.count("/") == 1
    if ros or schema.name in STANDARD:  # as JSON it is called so too
        return schema.name.replace("/", "/msg/")
    return schema.name


def _encoding(channel: Channel, part: Part) -> str:
    return channel.message_encoding or ENCODINGS.get(part.profile, "")


def _latched(channel: Channel) -> bool:
    profiles = channel.metadata.get("offered_qos_profiles", "")
    if TRANSIENT_LOCAL.search(profiles):
        return True
    return channel.metadata.get("latching", "").lower() in ("1", "true")
