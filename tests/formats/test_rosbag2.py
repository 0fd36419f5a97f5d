"""rosbag2 folders and .db3 files: whole ones as rosbags reads them."""

from __future__ import annotations

import random
import sqlite3
import sys
import tracemalloc
from pathlib import Path

import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from formats.errors import Notes
from formats.rosbag2 import log as rosbag2
from tests.bag_files import Raw, drive, raws, told
from tests.rosbag2_files import (
    clean_temporary,  # noqa: F401 (a fixture)
    read_rosbag2,
    write_db3,
)

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

FOLDERS = [
    "evo/tf_example",
    "olin_mac_floor1/macfirst_floor_take_2",
    "plotjuggler/rosbag2_test",
    "rosbag2_tests/rosbag2_tests/mcap/cdr_test",
    "rosbag2_tests/rosbag2_tests/sqlite3/cdr_test",
]


pytestmark = pytest.mark.usefixtures("clean_temporary")


@pytest.mark.parametrize("name", FOLDERS)
def test_real_folders_as_rosbags_reads_them(shared_data: Path, name: str) -> None:
    folder = shared_data / "bags" / name
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    with Reader(folder) as reader:
        theirs = [(c.topic, c.msgtype, time, bytes(data)) for c, time, data in reader.messages()]
    notes = Notes()
    log = rosbag2.open_file(folder, notes)
    ours = [(m.topic.name, m.topic.type, m.time_ns, bytes(m.data)) for m in log.messages()]
    assert [time for _, _, time, _ in ours] == [time for _, _, time, _ in theirs]
    assert sorted(ours) == sorted(theirs)
    assert sum(topic.count or 0 for topic in log.topics()) == len(theirs)
    assert list(notes) == []
    assert log.container.whole
    log.close()


def test_real_message_compression_without_metadata(shared_data: Path) -> None:
    """Three parts whose payloads are zstd frames, and no metadata.yaml."""
    folder = shared_data / "bags/rosbag2_tests/message_compression"
    expected = []
    for part in sorted(folder.iterdir()):
        db = sqlite3.connect(f"file:{part}?mode=ro&immutable=1", uri=True)
        query = "SELECT name, timestamp, data FROM messages, topics WHERE topic_id = topics.id"
        expected += [Raw(n, t, zstd.decompress(d)) for n, t, d in db.execute(query)]
        db.close()
    found, notes = read_rosbag2(folder)
    assert sorted(found) == sorted(expected)
    assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
    assert told(notes) == ["has no metadata.yaml; its parts are read without"]


def test_real_other_serialization(shared_data: Path) -> None:
    folder = shared_data / "bags/rosbag2_tests/rosbag2_tests/sqlite3/wrong_rmw_test"
    log = rosbag2.open_file(folder, Notes())
    db = sqlite3.connect(f"file:{folder}/wrong_rmw_test_0.db3?mode=ro&immutable=1", uri=True)
    recorded = sorted(db.execute("SELECT name, type, serialization_format FROM topics"))
    db.close()
    assert [(t.name, t.type, t.encoding) for t in log.topics()] == recorded
    assert len(raws(log)) == 7
    log.close()


@pytest.mark.parametrize(
    ("storage", "mode"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.NONE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
    ],
)
def test_folders_of_rosbags_writer(
    tmp_path: Path, storage: StoragePlugin, mode: CompressionMode
) -> None:
    folder, store = tmp_path / "x", get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(folder, version=9, storage_plugin=storage)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    messages = [Raw(topic, time, b"\0\1\0\0" + data) for topic, time, data in drive(500, 6_000)]
    with writer:
        names = {
            name: writer.add_connection(name, "std_msgs/msg/String", typestore=store)
            for name in ("/scan", "/odom", "/tf")
        }
        for topic, time, data in messages:
            writer.write(names[topic], time, data)
    notes = Notes()
    log = rosbag2.open_file(folder, notes)
    assert raws(log) == messages
    assert list(notes) == []
    assert [(t.name, t.type, t.encoding) for t in log.topics()] == [
        (name, "std_msgs/msg/String", "cdr") for name in ("/odom", "/scan", "/tf")
    ]
    assert all(b"string data" in topic.definition for topic in log.topics())
    assert log.container.whole
    assert (log.container.start_ns, log.container.end_ns) == (messages[0][1], messages[-1][1])
    assert log.container.kind == f"rosbag2 {storage.name.lower()}"
    log.close()


@pytest.mark.parametrize("schema", [1, 2, 3, 4])
def test_bare_db3_of_every_schema(tmp_path: Path, schema: int) -> None:
    messages = drive(100)
    path = tmp_path / "x.db3"
    write_db3(path, messages, schema, latched=["/tf"])
    before = sorted(tmp_path.iterdir())
    notes = Notes()
    log = rosbag2.open_file(path, notes)
    assert rosbag2.fits(path, path.read_bytes()[:4096])
    assert raws(log) == messages
    assert raws(log, ["/odom"]) == [m for m in messages if m[0] == "/odom"]
    latched = {t.name for t in log.topics() if t.latched}
    assert latched == ({"/tf"} if schema > 1 else set())
    assert {(t.definition, t.definition_format) for t in log.topics()} == (
        {(b"string data\n", "ros2msg")} if schema == 4 else {(b"", "")}
    )
    assert [t.count for t in log.topics()] == [33, 34, 33]
    assert list(notes) == []
    log.close()
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("index", [True, False])
def test_rows_out_of_order_are_sorted(tmp_path: Path, index: bool) -> None:
    messages = drive(3_000, 40)
    shuffled = messages.copy()
    random.Random(3).shuffle(shuffled)
    path = tmp_path / "x.db3"
    write_db3(path, shuffled, index=index)
    found, notes = read_rosbag2(path)
    assert found == messages
    assert list(notes) == []
    log = rosbag2.open_file(path, Notes())
    assert raws(log, ["/tf"]) == [m for m in messages if m[0] == "/tf"]
    log.close()


@pytest.mark.parametrize("shuffled", [False, True])
def test_memory_does_not_grow_with_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shuffled: bool
) -> None:
    """Four times the rows: without an index and out of order, an array of 16 bytes each."""
    monkeypatch.setattr("formats.rosbag2.sqlite_rows.BATCH", 1_000)
    peaks = []
    for count in (5_000, 20_000):
        messages = drive(count, 100)
        if shuffled:
            random.Random(3).shuffle(messages)
        path = tmp_path / f"{count}.db3"
        write_db3(path, messages, index=False)
        tracemalloc.start()
        log = rosbag2.open_file(path, Notes())
        assert sum(1 for _ in log.messages()) == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        log.close()
    sorting = 56 * 15_000  # the array, its parts, its order and its sorted copy
    # Holding the rows would take 4 MB more; a collection that comes late, some 100 kB.
    assert peaks[1] < peaks[0] + 500_000 + shuffled * sorting


def test_an_index_that_lacks_rows_is_not_used(tmp_path: Path) -> None:
    messages = drive(100)
    path = tmp_path / "x.db3"
    write_db3(path, messages[::-1])
    db = sqlite3.connect(path)
    db.execute("DROP INDEX timestamp_idx")
    db.execute("CREATE INDEX timestamp_idx ON messages (timestamp) WHERE topic_id = 1")
    db.commit()
    db.close()
    assert read_rosbag2(path)[0] == messages


def test_unknown_encoding_is_kept(tmp_path: Path) -> None:
    write_db3(tmp_path / "x.db3", drive(9), encoding="wrong_format")
    log = rosbag2.open_file(tmp_path / "x.db3", Notes())
    assert {topic.encoding for topic in log.topics()} == {"wrong_format"}
    log.close()
