"""Messages whose recorded definition is not the standard one: rewritten as the standard says.

A definition comes from the file and may be anything: it is only ever looked up, field by field,
while a payload lasts; no code is made of it.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from formats.errors import printable
from formats.log import Topic
from formats.payload import MOST_ITEMS, Payload, Undecodable
from formats.ros.idl import idl_fields
from formats.ros.standard import NEEDLESS, STANDARD, Fields
from formats.ros.wire import Body, Wire

LONGEST = 1 << 18  # bytes of a definition
DEEPEST = 16  # types within types
CODES = {
    **{"bool": "B", "byte": "B", "octet": "B", "char": "B", "int8": "b", "uint8": "B"},
    **{"int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q"},
    **{"float32": "f", "float64": "d"},
}
TYPE = re.compile(r"([\w/]+)(?:<=\d{1,10})?(\[(?:<=\d{1,10}|(\d{1,10}))?\])?")
RULE = re.compile(r"^=+[ \t\r]*$", re.MULTILINE)
ROS1 = {**STANDARD, "std_msgs/Header": [("uint32", "seq"), *STANDARD["std_msgs/Header"]]}


def short(name: str) -> str:
    """A type's name as definitions write it: "sensor_msgs/msg/Image" -> "sensor_msgs/Image"."""
    return name.replace("/msg/", "/", 1)


def msg_fields(text: str, name: str) -> Fields:
    """The fields in a .msg definition with those of its parts behind it; constants left out."""
    found: Fields = {}
    for block in RULE.split(text):
        fields: list[tuple[str, str]] = []
        for line in block.splitlines():
            words = line.partition("#")[0].split()
            if words[:1] == ["MSG:"]:
                name = short("".join(words[1:]))
            elif len(words) >= 2 and "=" not in line.partition("#")[0].replace("<=", ""):
                fields.append((words[0], words[1]))
        found.setdefault(name, fields)
    return found


def definition_of(topic: Topic) -> Fields:
    """The recorded definition's fields.

    Raises:
        Undecodable: it is implausibly long.
    """
    if len(topic.definition) > LONGEST:
        raise Undecodable("implausible message definition", f"{len(topic.definition)} bytes")
    text = topic.definition.decode("utf-8", "replace")
    if topic.definition_format == "ros2idl":
        return idl_fields(text)
    return msg_fields(text, short(topic.type))


def is_standard(found: Fields, standard: Fields) -> bool:
    """The recorded fields are those that the decoders expect."""

    def plain(fields: list[tuple[str, str]]) -> list[tuple[str, str]]:
        return [(kind.rpartition("/")[2].lower(), name.lower()) for kind, name in fields]

    for name, fields in found.items():
        expected = standard.get(name)
        if name == "sensor_msgs/Range" and fields[-1:] == [("float32", "variance")]:
            fields = fields[:-1]  # of newer distributions; its decoder knows it
        if expected is not None and plain(fields) != plain(expected):
            return False
    return True


@lru_cache(256)
def parsed(kind: str, owner: str) -> tuple[str, bool, int | None]:
    """A field's type in full, whether it is an array, and of what fixed length."""
    match = TYPE.fullmatch(kind)
    if match is None:
        raise Undecodable("message definition not understood", printable(kind, 40))
    name, array, length = match.groups()
    if name in ("Header", "time", "duration", "Time", "Duration"):
        name = "std_msgs/Header" if name == "Header" else "builtin_interfaces/Time"
    elif name not in CODES and name != "string":
        name = short(name) if "/" in name else f"{owner.rpartition('/')[0]}/{name}"
    return name, array is not None, int(length) if length else None


class Recorded:
    """Reads one payload by recorded fields, which may lie: values and depth are bounded."""

    def __init__(self, types: Fields, wire: Wire, data: Payload) -> None:
        self.types, self.body, self.left = types, Body(wire, data), MOST_ITEMS

    def fields(self, name: str, depth: int = 0) -> dict[str, Any]:
        """The values of a type's fields by their names, in lower case."""
        fields = self.types.get(name)
        if fields is None:
            raise Undecodable("message definition lacks a type", printable(name, 40))
        if depth > DEEPEST:
            raise Undecodable("message definition is nested too deep", printable(name, 40))
        return {field.lower(): self.value(*parsed(kind, name), depth) for kind, field in fields}

    def value(self, name: str, array: bool, length: int | None, depth: int) -> Any:
        """One field: number, text, array, or what a structure holds."""
        if array and name in CODES:
            kind = np.dtype(CODES[name])
            return self.body.array(f"{kind.kind}{kind.itemsize}", "items", length)
        count = (self.body.count("items") if length is None else length) if array else 1
        self.left -= count
        if self.left < 0:
            raise Undecodable("message definition asks for too many items")
        values = [self.one(name, depth) for _ in range(count)]
        return values if array else values[0]

    def one(self, name: str, depth: int) -> Any:
        """A single number, text or structure."""
        if name in CODES:
            return self.body.read(CODES[name])[0]
        if name == "string":
            return self.body.text()
        if name == "builtin_interfaces/Time" and self.body.wire.ros1:
            return dict(zip(("sec", "nanosec"), self.body.read("2I"), strict=True))
        return self.fields(name, depth + 1)


def standard_form(name: str, values: dict[str, Any]) -> bytes:
    """Values as a ROS 1 body of a standard type; fields that it lacks are dropped.

    Raises:
        Undecodable: a field that is needed is missing, or of another kind.
    """
    parts = [bytes(4)] if name == "std_msgs/Header" else []  # seq
    for kind, field in STANDARD[name]:
        inner, array, length = parsed(kind, name)
        value = values.get(field)
        if value is None and (name, field) not in NEEDLESS:
            raise Undecodable("message definition lacks a field", f"{field} of {name}")
        try:
            parts.append(written(inner, array, length, value))
        except (struct.error, TypeError, ValueError, OverflowError, AttributeError):
            raise Undecodable("field of another kind", f"{field} of {name}") from None
    return b"".join(parts)


def written(name: str, array: bool, length: int | None, value: Any) -> bytes:
    """One field as ROS 1 writes it; where the value is None, zeros."""
    if array:
        code = CODES.get(name)
        values = [0] * (length or 0) if value is None else value
        if code is not None:
            found = np.asarray(values)
            if len(found):
                found = found.astype("<" + code, casting="same_kind")
            content = found.tobytes()
        else:
            content = b"".join(written(name, False, None, item) for item in values)
        if length is not None and len(values) != length:
            raise ValueError
        return content if length is not None else struct.pack("<I", len(values)) + content
    if name == "string":
        raw = b"" if value is None else value.encode()
        return struct.pack("<I", len(raw)) + raw
    if name == "builtin_interfaces/Time":
        return struct.pack("<2I", *((value["sec"], value["nanosec"]) if value else (0, 0)))
    if name in CODES:
        return struct.pack("<" + CODES[name], 0 if value is None else value)
    if value is None:
        return b"".join(written(*parsed(kind, name), None) for kind, _ in STANDARD[name])
    return standard_form(name, value)


def translator(topic: Topic) -> Callable[[Wire, Payload], bytes] | None:
    """What turns a topic's payloads into ROS 1 bodies of its standard type; None: no need.

    Raises:
        Undecodable: the recorded definition cannot be used.
    """
    found = definition_of(topic) if topic.definition.strip() else {}
    standard = ROS1 if topic.encoding == "ros1" else STANDARD
    if is_standard(found, standard):
        return None
    name, types = short(topic.type), {**standard, **found}

    def translate(wire: Wire, data: Payload) -> bytes:
        recorded = Recorded(types, wire, data)
        values = recorded.fields(name)
        recorded.body.end()
        return standard_form(name, values)

    return translate
