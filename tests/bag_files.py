"""ROS 1 bags written by hand for tests, by the format's description alone."""

from __future__ import annotations

import bz2
import random
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import lz4.frame

from formats.bag import log as bag
from formats.errors import Notes
from formats.log import Log


class Raw(tuple[str, int, bytes]):
    """A message as tests compare it: topic, time in ns, payload."""

    __slots__ = ()

    def __new__(cls, topic: str, time: int, data: bytes) -> Raw:
        return super().__new__(cls, (topic, time, data))


def raws(log: Log, names: Iterable[str] | None = None) -> list[Raw]:
    """Everything in a log, or its topics of these names, as plain values."""
    topics = None if names is None else [t for t in log.topics() if t.name in set(names)]
    return [Raw(m.topic.name, m.time_ns, bytes(m.data)) for m in log.messages(topics)]


def read_bag(path: Path, raw: bytes, max_chunk: int = bag.MAX_CHUNK) -> tuple[list[Raw], Notes]:
    """Write these bytes, read them as a bag."""
    path.write_bytes(raw)
    notes = Notes()
    log = bag.open_file(path, notes, max_chunk)
    found = raws(log)
    log.close()
    return found, notes


def told(notes: Notes) -> list[str]:
    """What was said, whatever its kind."""
    return [note.problem for note in notes]


def spoil(raw: bytes, pos: int, new: bytes) -> bytes:
    """The same bytes with others from `pos` on."""
    return raw[:pos] + new + raw[pos + len(new) :]


def drive(count: int = 300, size: int = 400, seed: int = 1) -> list[Raw]:
    """Messages of three topics, 10 ms apart, with payloads that compress to about a half."""
    rng = random.Random(seed)
    topics = ("/scan", "/odom", "/tf")
    return [
        Raw(topics[k % 3], 1_700_000_000_000_000_000 + k * 10_000_000, _payload(rng, size))
        for k in range(count)
    ]


def _payload(rng: random.Random, size: int) -> bytes:
    size = rng.randrange(size // 2, size)
    return rng.randbytes(size // 2) + bytes(size - size // 2)


def record(fields: Sequence[tuple[str, bytes]], data: bytes) -> bytes:
    """One record of a bag: header length, fields, data length, data."""
    head = b"".join(
        struct.pack("<I", len(n) + 1 + len(v)) + n.encode() + b"=" + v for n, v in fields
    )
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def u32(value: int) -> bytes:
    return struct.pack("<I", value)


def stamp(time: int) -> bytes:
    return struct.pack("<II", *divmod(time, 10**9))


def message_record(
    conn: int, time: int, data: bytes, order: Sequence[str] = ("conn", "op", "time")
) -> bytes:
    values = {"op": b"\x02", "conn": u32(conn), "time": stamp(time)}
    return record([(name, values[name]) for name in order], data)


def connection_record(
    conn: int, topic: str, kind: str = "std_msgs/String", more: Sequence[tuple[str, bytes]] = ()
) -> bytes:
    inside = [
        ("topic", topic.encode("utf-8", "surrogateescape")),
        ("type", kind.encode()),
        ("md5sum", b"992ce8a1687cec8c8bd883ec73ca41d1"),
        ("message_definition", b"string data\n"),
        *more,
    ]
    body = record(inside, b"")[4:-4]
    head = [("conn", u32(conn)), ("op", b"\x07"), ("topic", inside[0][1])]
    return record(head, body)


def bag_header(
    index_pos: int, conns: int, chunks: int, more: Sequence[tuple[str, bytes]] = ()
) -> bytes:
    fields = [
        ("chunk_count", u32(chunks)),
        ("conn_count", u32(conns)),
        ("index_pos", struct.pack("<Q", index_pos)),
        ("op", b"\x03"),
        *more,
    ]
    bare = record(fields, b"")
    return bare[:-4] + u32(4096 - len(bare)) + b" " * (4096 - len(bare))


def pack(kind: str, data: bytes) -> bytes:
    """Compress as ROS does: lz4 frames of independent 64 kB blocks with a checksum, or bz2."""
    if kind == "lz4":
        packed: bytes = lz4.frame.compress(
            data, block_linked=False, content_checksum=True, store_size=False, block_size=4
        )
        return packed
    return bz2.compress(data) if kind == "bz2" else data


@dataclass
class Place:
    """Where one chunk went: its record, its compressed data, its messages.

    Attributes:
        pos, data, end: bytes in the file.
        offsets: (first, last + 1 byte) of each message's record in the chunk's data.
        messages: in the order written.
    """

    pos: int
    data: int
    end: int
    offsets: list[tuple[int, int]] = field(default_factory=list)
    messages: list[Raw] = field(default_factory=list)


@dataclass
class Bag:
    """The bytes of a bag under construction, and where everything is."""

    raw: bytes
    chunks: list[Place]
    index_pos: int


def make_bag(
    messages: Sequence[Raw],
    kind: str = "none",
    chunk: int = 16_000,
    order: Sequence[str] = ("conn", "op", "time"),
    index: bool = True,
    kinds: dict[str, str] | None = None,
) -> Bag:
    """A bag of these messages, in chunks of about `chunk` bytes.

    Args:
        messages: in the order of the file.
        kind: compression.
        chunk: bytes, decompressed.
        order: of the fields in a message's header.
        index: False for what a recorder leaves that was killed (.bag.active).
        kinds: type by topic; std_msgs/String for others.
    """
    names = list(dict.fromkeys(topic for topic, _, _ in messages))
    records = {
        name: connection_record(n, name, (kinds or {}).get(name, "std_msgs/String"))
        for n, name in enumerate(names)
    }
    out = bytearray(b"#ROSBAG V2.0\n" + bytes(4096))
    places: list[Place] = []
    infos = b""
    known: set[str] = set()
    position = 0
    while position < len(messages):
        data = bytearray()
        place = Place(len(out), 0, 0)
        entries: dict[int, list[bytes]] = {}
        while position < len(messages) and len(data) < chunk:
            topic, time, payload = messages[position]
            conn = names.index(topic)
            if topic not in known:
                data += records[topic]
                known.add(topic)
            entries.setdefault(conn, []).append(stamp(time) + u32(len(data)))
            start = len(data)
            data += message_record(conn, time, payload, order)
            place.offsets.append((start, len(data)))
            place.messages.append(messages[position])
            position += 1
        packed = pack(kind, bytes(data))
        fields = [("compression", kind.encode()), ("op", b"\x05"), ("size", u32(len(data)))]
        out += record(fields, packed)
        place.data, place.end = len(out) - len(packed), len(out)
        for conn, rows in entries.items():
            head = [
                ("conn", u32(conn)),
                ("count", u32(len(rows))),
                ("op", b"\x04"),
                ("ver", u32(1)),
            ]
            out += record(head, b"".join(rows))
        times = [time for _, time, _ in place.messages]
        head = [
            ("chunk_pos", struct.pack("<Q", place.pos)),
            ("count", u32(len(entries))),
            ("end_time", stamp(max(times))),
            ("op", b"\x06"),
            ("start_time", stamp(min(times))),
            ("ver", u32(1)),
        ]
        infos += record(head, b"".join(u32(c) + u32(len(r)) for c, r in entries.items()))
        places.append(place)
    end = len(out)
    out[13 : 13 + 4096] = bag_header(end if index else 0, len(names) * index, len(places) * index)
    if index:
        out += b"".join(records.values()) + infos
    return Bag(bytes(out), places, end)
