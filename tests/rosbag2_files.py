"""rosbag2 folders and .db3 files written by hand for tests."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from formats.errors import Notes
from formats.rosbag2 import log as rosbag2
from tests.bag_files import Raw, raws


@pytest.fixture
def clean_temporary(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Temporary copies go to a folder that is empty again after the test."""
    folder = tmp_path_factory.mktemp("temporary")
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    yield
    assert list(folder.iterdir()) == []


def read_rosbag2(path: Path, max_chunk: int = rosbag2.MAX_CHUNK) -> tuple[list[Raw], Notes]:
    """Everything in a folder or .db3 file."""
    notes = Notes()
    log = rosbag2.open_file(path, notes, max_chunk)
    found = raws(log)
    log.close()
    return found, notes


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
