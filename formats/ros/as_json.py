"""ROS messages as JSON, as rosbridge and Foxglove's bridges write them.

An object with the fields of the message: stamps are {sec, nanosec} or ROS 1's {secs, nsecs}, bytes
are a list or base64, a number that is not finite may be null or a word. It is rewritten as ROS 1
lays it out, for the decoders of ros.py.
"""

from __future__ import annotations

import struct
from base64 import b64decode
from collections.abc import Callable
from typing import Any

import numpy as np

from formats.log import Topic
from formats.payload import Payload, Undecodable, from_json
from formats.ros.decoders import DECODERS, ROS1, Noun
from formats.ros.recorded import CODES, short
from formats.ros.standard import NEEDLESS, STANDARD

NAMES = {name.rpartition("/")[2]: name for name in STANDARD}
U32 = struct.Struct("<I")
SECONDS, NANOSECONDS = ("sec", "secs"), ("nanosec", "nsecs", "nsec")


def decoder(topic: Topic) -> Callable[[Payload], Noun]:
    """What reads a topic's payloads; it raises Undecodable.

    Args:
        topic: of a type in DECODERS, encoded as "json".
    """
    name, read = short(topic.type), DECODERS[topic.type]

    def read_json(data: Payload) -> Noun:
        values = from_json(data)
        out = bytearray()
        try:
            _put_fields(name, values, out)
        except (TypeError, ValueError, AttributeError, OverflowError, struct.error) as error:
            raise Undecodable("not of its schema", str(error)[:80]) from None
        return read(ROS1, bytes(out))

    return read_json


def _put_fields(name: str, values: dict[str, Any], out: bytearray) -> None:
    """A message's fields one after the other; those that no noun needs may be missing."""
    if name == "builtin_interfaces/Time":
        for words in (SECONDS, NANOSECONDS):
            out += U32.pack(next((values[word] for word in words if word in values), None))
        return
    if name == "std_msgs/Header":
        out += U32.pack(0)  # seq
    for kind, field in STANDARD[name]:
        value = values.get(field, values.get(field.upper()))  # CameraInfo's K was upper case once
        if value is None and field not in values and (name, field) not in NEEDLESS:
            raise ValueError(f"no {field}")
        _put(kind, value, out)


def _put(kind: str, value: Any, out: bytearray) -> None:
    base, bracket, size = kind.partition("[")
    if bracket:
        _put_array(base, int(size[:-1] or -1), [] if value is None else value, out)
    elif base == "string":
        text = b"" if value is None else str(value).encode("utf-8", "replace")
        out += U32.pack(len(text)) + text
    elif base in CODES:
        out += _numbers(base, [value]).tobytes()
    else:
        _put_fields(NAMES[base.rpartition("/")[2]], {} if value is None else value, out)


def _put_array(base: str, size: int, value: Any, out: bytearray) -> None:
    if base in CODES:
        found = b64decode(value) if isinstance(value, str) else _numbers(base, value).tobytes()
        count = len(found) // struct.calcsize(CODES[base])
        if size >= 0 and count == 0:
            found, count = bytes(size * struct.calcsize(CODES[base])), size
        if size >= 0 and count != size:
            raise ValueError(f"{count} numbers for {size}")
        out += (U32.pack(count) if size < 0 else b"") + found
        return
    out += U32.pack(len(value))
    for item in value:
        _put(base, item, out)


def _numbers(base: str, values: list[Any]) -> np.ndarray[Any, np.dtype[Any]]:
    """Little-endian numbers; null and words of a float are nan and what they name."""
    code = CODES[base]
    if code in "fd":
        values = [float("nan") if value is None else float(value) for value in values]
    else:
        values = [int(value or 0) for value in values]
    return np.array(values, dtype="<" + {"B": "u1", "b": "i1"}.get(code, code))
