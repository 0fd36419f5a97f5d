"""rosbag2 folders and .db3 files: whole ones as rosbags reads them, damaged ones with a count."""

from __future__ import annotations

import random
import shutil
import sqlite3
import sys
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from formats import rosbag2
from formats.errors import FormatError, Notes
from tests.bag_files import MESSAGES, SCHEMAS, Raw, drive, raws, write_db3, write_metadata

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


def read(path: Path, max_chunk: int = rosbag2.MAX_CHUNK) -> tuple[list[Raw], Notes]:
    notes = Notes()
    log = rosbag2.open_file(path, notes, max_chunk)
    found = raws(log)
    log.close()
    return found, notes


def told(notes: Notes) -> list[str]:
    return [note.problem for note in notes]


@pytest.fixture(autouse=True)
def _nothing_is_left(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """Temporary copies are gone after every test."""
    folder = tmp_path_factory.mktemp("temporary")
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    yield
    assert list(folder.iterdir()) == []


# ---------------------------------------------------------------------------- whole ones


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
    found, notes = read(folder)
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
    found, notes = read(path)
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
    monkeypatch.setattr("formats.sqlite_rows.BATCH", 1_000)
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
    assert peaks[1] < peaks[0] + 100_000 + shuffled * sorting


def test_an_index_that_lacks_rows_is_not_used(tmp_path: Path) -> None:
    messages = drive(100)
    path = tmp_path / "x.db3"
    write_db3(path, messages[::-1])
    db = sqlite3.connect(path)
    db.execute("DROP INDEX timestamp_idx")
    db.execute("CREATE INDEX timestamp_idx ON messages (timestamp) WHERE topic_id = 1")
    db.commit()
    db.close()
    assert read(path)[0] == messages


def test_unknown_encoding_is_kept(tmp_path: Path) -> None:
    write_db3(tmp_path / "x.db3", drive(9), encoding="wrong_format")
    log = rosbag2.open_file(tmp_path / "x.db3", Notes())
    assert {topic.encoding for topic in log.topics()} == {"wrong_format"}
    log.close()


# ---------------------------------------------------------------------------- folders


def split(folder: Path, messages: list[Raw], parts: int, overlap: bool = False) -> list[str]:
    """Write messages into parts x_0.db3, ...; their names."""
    folder.mkdir()
    size = -(-len(messages) // parts)
    names = []
    for n in range(parts):
        some = messages[n::parts] if overlap else messages[n * size : (n + 1) * size]
        names.append(f"x_{n}.db3")
        write_db3(folder / names[-1], some)
    return names


@pytest.mark.parametrize("overlap", [False, True])
@pytest.mark.parametrize("metadata", [False, True])
def test_split_folders(tmp_path: Path, overlap: bool, metadata: bool) -> None:
    messages = drive(300)
    folder = tmp_path / "x"
    names = split(folder, messages, 3, overlap)
    if metadata:
        write_metadata(folder, names[::-1], 300)
    assert rosbag2.fits(folder, b"")
    log = rosbag2.open_file(folder, Notes())
    assert raws(log) == messages
    assert raws(log, ["/tf"]) == [m for m in messages if m[0] == "/tf"]
    assert [topic.count for topic in log.topics()] == [100, 100, 100]
    log.close()


def test_a_folder_of_several_recordings_is_none(tmp_path: Path) -> None:
    write_db3(tmp_path / "monday.db3", drive(3))
    assert rosbag2.fits(tmp_path, b"")
    write_db3(tmp_path / "tuesday.db3", drive(3))
    assert not rosbag2.fits(tmp_path, b"")
    (tmp_path / "empty").mkdir()
    assert not rosbag2.fits(tmp_path / "empty", b"")


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"storage_identifier": "mcap"}, "says storage 'mcap'; its parts are rosbag2 sqlite3"),
        ({"version": 99}, "is of version 99"),
        ({"version": "new"}, "is of version new"),
        ({"message_count": 301}, "says 301 messages; 300 are there"),
        ({"relative_file_paths": "[x_0.db3]"}, ""),
        ({"relative_file_paths": "[old/x_0.db3, old/x_1.db3, old/x_2.db3]"}, ""),
        ({"relative_file_paths": "[../../etc/x_9.db3, /etc/passwd, x_0.db3]"}, "outside of its"),
        ({"relative_file_paths": "17"}, ""),
        ({"relative_file_paths": "[{a: 1}, x_0.db3]"}, "names a part that is no text"),
        ({"topics_with_message_count": "[1, {topic_metadata: 3}]"}, ""),
        ({"files": "[1, {path: [1], message_count: 1}]"}, ""),
    ],
)
def test_odd_metadata_is_told_and_the_parts_are_read(
    tmp_path: Path, fields: dict[str, object], said: str
) -> None:
    messages = drive(300)
    folder = tmp_path / "x"
    write_metadata(folder, split(folder, messages, 3), 300, fields=fields)
    found, notes = read(folder)
    assert found == messages
    assert not notes.of("lost")
    assert any(said in problem for problem in told(notes)) if said else True
    assert all("\n" not in str(note) for note in notes)


BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{b}: &{b} [*{a},*{a},*{a},*{a},*{a},*{a},*{a},*{a},*{a}]\n"
    for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
MERGES = "a: &a {k: 1}\n" + "".join(
    f"{b}: &{b} {{<<: [*{a},*{a},*{a},*{a},*{a},*{a},*{a},*{a}]}}\n"
    for a, b in zip("abcdefghijk", "bcdefghijkl", strict=True)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "not used: a YAML alias at line 2"),
        (MERGES, "not used: a YAML alias at line 2"),
        ("x: !!python/object/apply:os.system ['touch pwned']", "not used: a YAML tag at line 1"),
        ("x: " + "[" * 5_000, "not used: more than 32 levels at line 1"),
        ("x: [1, 2", "not used: did not find expected ',' or ']'"),
        ("\x00\x01", "not used: "),
        ("", "not used: holds no rosbag2_bagfile_information"),
        ("- 1", "not used: holds no rosbag2_bagfile_information"),
    ],
)
def test_hostile_metadata_is_not_used(tmp_path: Path, text: str, said: str) -> None:
    messages = drive(30)
    write_db3(tmp_path / "x_0.db3", messages)
    (tmp_path / "metadata.yaml").write_text(text)
    found, notes = read(tmp_path)
    assert found == messages
    assert len(told(notes)) == 1
    assert told(notes)[0].startswith(said)
    assert "\n" not in str(next(iter(notes)))


def test_missing_and_empty_parts_are_counted(tmp_path: Path) -> None:
    messages = drive(300)
    folder = tmp_path / "x"
    names = split(folder, messages, 3)
    files = "".join(f"    - path: {name}\n      message_count: 100\n" for name in names)
    write_metadata(folder, names, 300, more="  files:\n" + files)
    (folder / names[0]).unlink()
    (folder / names[2]).write_bytes(b"")
    found, notes = read(folder)
    assert found == messages[100:200]
    assert sorted((note.problem, note.count) for note in notes.of("lost")) == [
        ("is empty", 100),
        ("is missing", 100),
    ]
    (folder / names[1]).write_bytes(b"#!/bin/sh\n")
    with pytest.raises(FormatError, match=r"x_0\.db3: is missing"):
        read(folder)


def test_file_compression(tmp_path: Path) -> None:
    messages = drive(200)
    names = split(tmp_path / "x", messages, 2)
    for name in names:
        part = tmp_path / "x" / name
        part.with_name(f"{name}.zstd").write_bytes(zstd.compress(part.read_bytes()))
        part.unlink()
    found, _ = read(tmp_path / "x")
    assert found == messages
    packed = [f"{name}.zstd" for name in names]
    write_metadata(tmp_path / "x", packed, 200, fields={"compression_mode": "FILE"})
    found, notes = read(tmp_path / "x")
    assert found == messages
    assert list(notes) == []
    whole = (tmp_path / "x" / "x_1.db3.zstd").read_bytes()
    (tmp_path / "x" / "x_1.db3.zstd").write_bytes(whole[: len(whole) // 2])
    found, notes = read(tmp_path / "x")
    assert found[:100] == messages[:100]
    assert notes.of("lost")


def test_message_compression_and_its_damage(tmp_path: Path) -> None:
    messages = [Raw(topic, time, b"\0\1\0\0" + data) for topic, time, data in drive(100)]
    packed = [(topic, time, zstd.compress(data)) for topic, time, data in messages]
    packed[7] = (packed[7][0], packed[7][1], packed[7][2][:-9])
    packed[8] = (packed[8][0], packed[8][1], b"\x28\xb5\x2f\xfd" + b"\xff" * 40)
    packed[9] = (packed[9][0], packed[9][1], zstd.compress(bytes(70_000_000)))
    path = tmp_path / "x.db3"
    write_db3(path, packed)
    notes = Notes()
    log = rosbag2.open_file(path, notes, 1 << 20)
    for _ in range(2):
        assert raws(log) == messages[:7] + messages[10:]
    assert {note.topic: note.count for note in notes.of("lost")} == {
        "/odom": 1,
        "/tf": 1,
        "/scan": 1,
    }
    log.close()


# ---------------------------------------------------------------------------- damaged files


def test_a_write_ahead_log_is_read_and_nothing_is_written_beside(tmp_path: Path) -> None:
    messages = drive(300)
    write_db3(tmp_path / "made.db3", messages[:100])
    db = sqlite3.connect(tmp_path / "made.db3")
    db.execute("PRAGMA journal_mode = WAL")
    db.execute("PRAGMA wal_autocheckpoint = 0")
    for topic, time, data in messages[100:]:
        query = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)"
        db.execute(query, (["/scan", "/odom", "/tf"].index(topic) + 1, time, data))
        db.commit()
    folder = tmp_path / "copy"
    folder.mkdir()
    for end in ("", "-wal"):  # as after a loss of power
        shutil.copy(tmp_path / f"made.db3{end}", folder / f"x.db3{end}")
    db.close()
    before = {place.name: place.read_bytes() for place in folder.iterdir()}
    for place in (folder / "x.db3", folder):
        found, notes = read(place)
        assert found == messages
        assert not notes.of("lost")
    wal = bytearray(before["x.db3-wal"])
    wal[len(wal) // 2] ^= 0xFF
    assert {place.name: place.read_bytes() for place in folder.iterdir()} == before
    (folder / "x.db3-wal").write_bytes(wal)
    found, notes = read(folder / "x.db3")
    assert found == messages[: len(found)]
    assert 100 < len(found) < 300
    assert "of its write-ahead log are damaged" in notes.of("lost")[0].problem


def test_a_rollback_journal_is_applied(tmp_path: Path) -> None:
    """A transaction that never ended is undone, in a copy."""
    messages = drive(300, 4_000)
    write_db3(tmp_path / "made.db3", messages)
    db = sqlite3.connect(tmp_path / "made.db3", isolation_level=None)
    db.execute("PRAGMA cache_size = 10")
    db.execute("BEGIN")
    db.execute("UPDATE messages SET timestamp = 7, data = zeroblob(3000)")
    folder = tmp_path / "copy"
    folder.mkdir()
    for end in ("", "-journal"):
        shutil.copy(tmp_path / f"made.db3{end}", folder / f"x.db3{end}")
    db.close()
    assert (folder / "x.db3").read_bytes() != (tmp_path / "made.db3").read_bytes()
    before = {place.name: place.read_bytes() for place in folder.iterdir()}
    assert read(folder / "x.db3")[0] == messages
    assert {place.name: place.read_bytes() for place in folder.iterdir()} == before


def there(raw: bytes, messages: list[Raw]) -> list[int]:
    """How much of the file each message's payload needs, by looking for its pieces."""
    ends = []
    for _, _, data in messages:
        half = len(data) // 2  # the other half are zeros
        pieces = [data[at : at + 24] for at in range(0, half - 24, 400)] + [data[half - 24 : half]]
        ends.append(max(raw.find(piece) + 24 for piece in pieces))
    return ends


@pytest.mark.parametrize(("count", "size"), [(3_000, 300), (400, 9_000)])
def test_cut_anywhere(tmp_path: Path, count: int, size: int) -> None:
    """54 even cuts: at least 98 % of the messages whose bytes are still in the file."""
    messages = drive(count, size)
    path = tmp_path / "x.db3"
    write_db3(path, messages)
    raw = path.read_bytes()
    ends = there(raw, messages)
    physically = got = 0
    for step in range(1, 55):
        cut = len(raw) * step // 55
        path.write_bytes(raw[:cut])
        found, notes = read(path)
        assert set(found) <= set(messages)
        assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
        assert notes.of("lost")
        physically += sum(end <= cut for end in ends)
        got += len(found)
    assert physically > 20 * count
    assert got >= 0.98 * physically


def test_a_zeroed_page_costs_its_own_rows(tmp_path: Path) -> None:
    messages = drive(3_000, 300)
    path = tmp_path / "x.db3"
    write_db3(path, messages)
    raw = path.read_bytes()
    for page in range(8, len(raw) // 4096, 13):
        path.write_bytes(raw[: page * 4096] + bytes(4096) + raw[(page + 1) * 4096 :])
        found, notes = read(path)
        assert set(found) <= set(messages)
        assert len(found) >= len(messages) - 30
        assert len(found) == len(messages) or notes.of("lost")


@pytest.mark.parametrize(
    ("script", "said"),
    [
        (
            "CREATE VIEW messages AS WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1"
            " FROM r) SELECT n AS id, 1 AS topic_id, n AS timestamp, x'00' AS data FROM r;",
            "its messages are not a plain table",
        ),
        (
            "CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data);",
            "its messages are not a plain table",
        ),
        (
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
            " data BLOB GENERATED ALWAYS AS (zeroblob(1000000000)) VIRTUAL);",
            "its table of messages has computed columns",
        ),
        ("CREATE TABLE messages(a, b);", "without rosbag2's table of messages"),
        ("", "without rosbag2's table of messages"),
    ],
)
def test_hostile_schemas_are_refused(tmp_path: Path, script: str, said: str) -> None:
    path = tmp_path / "x.db3"
    db = sqlite3.connect(path)
    db.executescript(SCHEMAS[2] + script)
    db.commit()
    db.close()
    with pytest.raises(FormatError, match=said):
        read(path)


def test_triggers_do_nothing(tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    write_db3(path, drive(30))
    db = sqlite3.connect(path)
    db.executescript("CREATE TRIGGER t AFTER INSERT ON messages BEGIN DELETE FROM messages; END;")
    db.close()
    assert read(path)[0] == drive(30)


def test_odd_rows_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    db = sqlite3.connect(path)
    db.executescript(SCHEMAS[2] + MESSAGES.replace(" NOT NULL", ""))
    db.execute(
        "INSERT INTO topics VALUES (1, CAST(x'2fff' AS TEXT), 'std_msgs/msg/String', 'cdr', '')"
    )
    rows: list[tuple[object, ...]] = [
        (1, 10, b"a"),
        (1, None, b"b"),
        (1, "soon", b"c"),
        (9, 11, b"d"),
        (1, 12, None),
        (1, 13, "text"),
        (1, 14, bytes(3_000_000)),
        (1, -5, b"e"),
    ]
    db.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    db.commit()
    db.close()
    found, notes = read(path, 1 << 21)
    assert found == [("/\\xff", -5, b"e"), ("/\\xff", 10, b"a")]
    assert sorted((note.problem, note.count) for note in notes.of("lost")) == [
        ("message is incomplete or too long", 3),
        ("messages of topic 9, which is not described", 1),
        ("messages without a time or topic", 2),
    ]


@pytest.mark.parametrize("raw", [b"SQLite format 3\0", b"SQLite format 3\0" + bytes(84), b"x"])
def test_what_is_no_database_is_refused(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / "x.db3"
    path.write_bytes(raw)
    with pytest.raises(FormatError):
        read(path)


# ---------------------------------------------------------------------------- random damage


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("sound") / "x.db3"
    write_db3(path, drive(200, 900))
    return path.read_bytes()


def check_damage(path: Path, raw: bytes, flips: list[tuple[int, int]]) -> None:
    """The same number of messages, an error of ours, or something said; always sorted.

    SQLite has no checksums: changed payloads, times and names cannot be told from others.
    """
    spoilt = bytearray(raw)
    for place, value in flips:
        spoilt[place % len(raw)] ^= value
    path.write_bytes(bytes(spoilt))
    try:
        found, notes = read(path)
    except FormatError:
        return
    times = [time for _, time, _ in found]
    assert times == sorted(times)
    assert len(found) == 200 or notes.of("lost") or notes.of("warning")
    assert len(found) <= 400


flips = st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 255)), min_size=1, max_size=4)


@given(flips)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_random_damage(
    tmp_path_factory: pytest.TempPathFactory, sound: bytes, flips: list[tuple[int, int]]
) -> None:
    check_damage(tmp_path_factory.getbasetemp() / "damaged.db3", sound, flips)


@pytest.mark.slow
@given(flips)
@settings(max_examples=2_000, deadline=None)
def test_random_damage_at_length(
    tmp_path_factory: pytest.TempPathFactory, sound: bytes, flips: list[tuple[int, int]]
) -> None:
    check_damage(tmp_path_factory.getbasetemp() / "damaged.db3", sound, flips)
