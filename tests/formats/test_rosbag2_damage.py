""".db3 files: logs left beside them, cuts, damage, hostile schemas."""

from __future__ import annotations

import shutil
import sqlite3
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.errors import FormatError
from tests.bag_files import Raw, drive
from tests.rosbag2_files import (
    MESSAGES,
    SCHEMAS,
    clean_temporary,  # noqa: F401 (a fixture)
    read_rosbag2,
    write_db3,
)

if sys.version_info >= (3, 14):
    pass
else:
    pass


pytestmark = pytest.mark.usefixtures("clean_temporary")


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
        found, notes = read_rosbag2(place)
        assert found == messages
        assert not notes.of("lost")
    wal = bytearray(before["x.db3-wal"])
    wal[len(wal) // 2] ^= 0xFF
    assert {place.name: place.read_bytes() for place in folder.iterdir()} == before
    (folder / "x.db3-wal").write_bytes(wal)
    found, notes = read_rosbag2(folder / "x.db3")
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
    assert read_rosbag2(folder / "x.db3")[0] == messages
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
        found, notes = read_rosbag2(path)
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
        found, notes = read_rosbag2(path)
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
        read_rosbag2(path)


def test_triggers_do_nothing(tmp_path: Path) -> None:
    path = tmp_path / "x.db3"
    write_db3(path, drive(30))
    db = sqlite3.connect(path)
    db.executescript("CREATE TRIGGER t AFTER INSERT ON messages BEGIN DELETE FROM messages; END;")
    db.close()
    assert read_rosbag2(path)[0] == drive(30)


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
    found, notes = read_rosbag2(path, 1 << 21)
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
        read_rosbag2(path)


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
        found, notes = read_rosbag2(path)
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
