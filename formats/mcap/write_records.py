"""Records of an MCAP file as bytes (mcap.dev/spec): mcap_parse the other way round."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.mcap import records as r
from formats.mcap.parse import HEAD, LAYOUT, F
from formats.mcap.records import Buffer, Record

MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log, publish time
# The same as one message of a block; its payload follows.
HEAD_FIELDS: list[tuple[str, Any]] = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
u8, u16, u32, u64 = (struct.Struct("<" + code).pack for code in "BHIQ")


def blob(data: Buffer) -> bytes:
    """Bytes behind their length."""
    return u32(len(data)) + data


def text(value: str) -> bytes:
    """UTF-8 behind its length."""
    return blob(value.encode())


def texts(value: Mapping[str, str]) -> bytes:
    """Keys and values, in their order, behind their length."""
    return blob(b"".join(text(key) + text(item) for key, item in value.items()))


def counts(value: Mapping[int, int]) -> bytes:
    """16-bit keys and 64-bit values, in their order, behind their length."""
    return blob(b"".join(u16(key) + u64(item) for key, item in value.items()))


# How each kind of field that mcap_parse reads is written; but for a message index's pairs.
FIELDS: dict[Callable[[F], Any], Callable[[Any], bytes]] = {
    F.op: u8,
    F.u16: u16,
    F.u32: u32,
    F.u64: u64,
    F.text: text,
    F.blob: blob,
    F.texts: texts,
    F.counts: counts,
    F.long_blob: lambda data: u64(len(data)) + data,
    F.rest: bytes,
}
OPCODES = {kind: opcode for opcode, (kind, _) in LAYOUT.items()}


def encode(record: Record) -> bytes:
    """A record behind its opcode and length, of any kind but a message index."""
    opcode = OPCODES[type(record)]
    _, fields = LAYOUT[opcode]
    content = b"".join(FIELDS[field](item) for field, item in zip(fields, record, strict=True))
    return HEAD.pack(opcode, len(content)) + content


def encode_message(channel: int, sequence: int, log: int, publish: int, data: Buffer) -> bytes:
    """A message; times in ns."""
    size = MESSAGE_HEAD.size - HEAD.size + len(data)
    return MESSAGE_HEAD.pack(r.MESSAGE, size, channel, sequence, log, publish) + data


def encode_index(channel: int, pairs: Buffer) -> bytes:
    """A message index of pairs "<QQ": log time in ns, offset in the chunk."""
    content = u16(channel) + blob(pairs)
    return HEAD.pack(r.MESSAGE_INDEX, len(content)) + content


def block(
    times_ns: npt.NDArray[np.int64],
    sequence: int,
    streams: Sequence[tuple[int, npt.NDArray[Any]]],
) -> npt.NDArray[np.void]:
    """Messages of fixed sizes, one a frame on each channel, as they follow each other in a file.

    Args:
        times_ns: (n,) log and publish time of each frame.
        sequence: of the first frame; the others count on.
        streams: channel and payloads, (n,) of any type whose bytes are the message, in the order
            in which a frame's messages follow each other.

    Returns:
        (n,) with a field for each channel, named by its number: `HEAD_FIELDS` and "data".
    """
    kinds = [[*HEAD_FIELDS, ("data", np.void, data.itemsize)] for _, data in streams]
    names = [str(channel) for channel, _ in streams]
    out = np.empty(len(times_ns), dtype=list(zip(names, kinds, strict=True)))
    for name, (channel, data) in zip(names, streams, strict=True):
        part = out[name]
        part["opcode"] = r.MESSAGE
        part["length"] = MESSAGE_HEAD.size - HEAD.size + data.itemsize
        part["channel"] = channel
        part["sequence"] = sequence + np.arange(len(times_ns))
        part["log_time"] = part["publish_time"] = times_ns
        part["data"] = np.ascontiguousarray(data).view((np.void, data.itemsize))
    return out
