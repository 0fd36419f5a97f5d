"""Payload -> noun, whatever its encoding: ROS 1, CDR, or Foxglove's protobuf and JSON."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial

from formats import foxglove, ros
from formats.log import Topic
from formats.ros import Noun
from formats.ros_wire import Payload

ENCODINGS: dict[str, Collection[str]] = {
    "ros1": ros.DECODERS,
    "cdr": ros.DECODERS,
    "protobuf": foxglove.DECODERS,
    "json": foxglove.DECODERS,
}


def decodable(topic: Topic) -> bool:
    """Whether we know how to read this topic's type in its encoding."""
    return topic.type in ENCODINGS.get(topic.encoding, ())


def decoder(topic: Topic) -> Callable[[Payload], Noun]:
    """The function that reads a decodable topic's payloads; it raises Undecodable."""
    if topic.encoding in ("ros1", "cdr"):
        return ros.decoder(topic)
    return partial(foxglove.decode, topic)
