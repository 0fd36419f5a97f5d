"""ROS 1 bags and rosbag2 folders written by hand for tests: by the formats' descriptions alone."""

from __future__ import annotations

import bz2
import random
import sqlite3
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import lz4.frame

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


# ---------------------------------------------------------------------------- rosbag2

SCHEMAS = {
    1: "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
    " serialization_format TEXT NOT NULL);",
    2: "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
    " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);",
    4: "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
    " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,"
    " type_description_hash TEXT NOT NULL);",
}
SCHEMAS[3] = SCHEMAS[2]
MESSAGES = (
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
    " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
)
INDEX = "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
METADATA = (
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,"
    " metadata TEXT NOT NULL);"
)
DEFINITIONS = (
    "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,"
    " encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,"
    " type_description_hash TEXT NOT NULL);"
)
QOS = "- history: 3\n  depth: 0\n  reliability: 1\n  durability: {}\n  deadline:\n    sec: 0\n"


def write_db3(
    path: Path,
    messages: Iterable[tuple[str, int, Any]],
    schema: int = 4,
    index: bool = True,
    latched: Sequence[str] = (),
    encoding: str = "cdr",
) -> None:
    """A .db3 file as recorders of that schema version write it."""
    db = sqlite3.connect(path)
    if schema >= 3:
        db.executescript(METADATA)
        db.execute("INSERT INTO schema VALUES (?, 'jazzy')", (schema,))
    db.executescript(SCHEMAS[schema] + (DEFINITIONS if schema == 4 else "") + MESSAGES)
    if index:
        db.executescript(INDEX)
    numbers: dict[str, int] = {}
    for topic, time, data in messages:
        if topic not in numbers:
            numbers[topic] = len(numbers) + 1
            durability = (1 if schema < 4 else "transient_local") if topic in latched else 2
            row = [numbers[topic], topic, "std_msgs/msg/String", encoding]
            row += [QOS.format(durability)] * (schema > 1) + ["hash"] * (schema > 3)
            db.execute(f"INSERT INTO topics VALUES ({','.join('?' * len(row))})", row)
        values = (numbers[topic], time, data)
        db.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", values)
    if schema == 4:
        row = ["std_msgs/msg/String", "ros2msg", "string data\n", "hash"]
        db.execute("INSERT INTO message_definitions VALUES (1, ?, ?, ?, ?)", row)
    db.commit()
    db.close()


def write_metadata(
    folder: Path,
    parts: Sequence[str],
    total: int,
    more: str = "",
    fields: Mapping[str, object] | None = None,
) -> None:
    """A metadata.yaml; `fields` replace its first-level values."""
    values: dict[str, object] = {
        "version": 5,
        "storage_identifier": "sqlite3",
        "message_count": total,
        "compression_format": '""',
        "compression_mode": '""',
        "relative_file_paths": "[" + ", ".join(parts) + "]",
    } | dict(fields or {})
    text = "rosbag2_bagfile_information:\n"
    text += "".join(f"  {name}: {value}\n" for name, value in values.items())
    (folder / "metadata.yaml").write_text(text + more, encoding="utf-8")
