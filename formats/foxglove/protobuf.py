"""Protocol Buffers' wire format, read by known field numbers and within bounds.

Source: protobuf.dev, "Encoding"; proto3, so that what is absent has its default.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from formats.payload import MOST_ITEMS, Payload, Undecodable, cut, plain_text

# Field number -> (name, kind). Kinds: "double", "doubles", "text", "bytes", "int", "fixed32",
# a schema, or a list of one schema where the field repeats.
Schema = dict[int, tuple[str, Any]]
VARINT, EIGHT, BYTES, FOUR = 0, 1, 2, 5
WIRES = {"double": EIGHT, "fixed32": FOUR, "int": VARINT}
DEFAULTS = {"double": 0.0, "fixed32": 0, "int": 0, "text": "", "bytes": b""}


def varint(data: Payload, at: int, end: int) -> tuple[int, int]:
    """A number of seven bits a byte, and the offset behind it."""
    value = 0
    for k in range(10):
        if at + k >= end:
            raise cut(end, end + 1, "bytes")
        byte = data[at + k]
        value |= (byte & 0x7F) << 7 * k
        if byte < 0x80:
            return value & 0xFFFF_FFFF_FFFF_FFFF, at + k + 1
    raise Undecodable("not protobuf", f"number at byte {at}")


def signed(value: int) -> int:
    """A 64-bit number in two's complement."""
    return value - (1 << 64) if value >> 63 else value


def fields(data: Payload, at: int, end: int) -> Iterator[tuple[int, int, int, int]]:
    """Field number, wire type, and where the value starts and ends."""
    while at < end:
        key, at = varint(data, at, end)
        number, wire = key >> 3, key & 7
        if wire == VARINT:
            start, (_, at) = at, varint(data, at, end)
        elif wire in (EIGHT, FOUR):
            start, at = at, at + (8 if wire == EIGHT else 4)
        elif wire == BYTES:
            size, start = varint(data, at, end)
            at = start + size
        else:
            raise Undecodable("not protobuf", f"wire type {wire} at byte {at}")
        if at > end:
            raise cut(end, at, "bytes")
        yield number, wire, start, at


def read(schema: Schema, data: Payload, at: int = 0, end: int | None = None) -> dict[str, Any]:
    """A message's values by name; what is absent has its default, an absent message is None.

    Arrays and bytes are views on the payload.

    Raises:
        Undecodable: the bytes end too early, or are not of this schema.
    """
    found: dict[str, Any] = {}
    for name, kind in schema.values():
        found[name] = [] if isinstance(kind, list) or kind == "doubles" else _default(kind)
    for number, wire, start, stop in fields(data, at, len(data) if end is None else end):
        if number not in schema:
            continue
        name, kind = schema[number]
        if kind == "doubles" and wire in (EIGHT, BYTES):
            if (stop - start) % 8:
                raise Undecodable("not of its schema", f"{stop - start} bytes of {name}")
            found[name].append(np.frombuffer(data, "<f8", (stop - start) // 8, start))
        elif isinstance(kind, str):
            if wire != WIRES.get(kind, BYTES):
                raise Undecodable("not of its schema", f"wire type {wire} of {name}")
            found[name] = _single(kind, data, start, stop)
        elif wire != BYTES:
            raise Undecodable("not of its schema", f"wire type {wire} of {name}")
        elif isinstance(kind, list):
            if len(found[name]) == MOST_ITEMS:
                raise Undecodable(f"impossible number of {name}")
            found[name].append(read(kind[0], data, start, stop))
        else:
            found[name] = read(kind, data, start, stop)
    for name, kind in schema.values():
        if kind == "doubles":
            parts = found[name]
            found[name] = parts[0] if len(parts) == 1 else np.concatenate([np.empty(0), *parts])
    return found


def _default(kind: Any) -> Any:
    return DEFAULTS[kind] if isinstance(kind, str) else None


def _single(kind: str, data: Payload, start: int, stop: int) -> Any:
    """One value between two offsets."""
    if kind == "double":
        return struct.unpack_from("<d", data, start)[0]
    if kind == "fixed32":
        return struct.unpack_from("<I", data, start)[0]
    if kind == "int":
        return signed(varint(data, start, stop)[0])
    if kind == "text":
        return plain_text(bytes(data[start:stop]))
    return data[start:stop]
