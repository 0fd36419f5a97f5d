"""Rows 66 to 70, and the bombs of row 9 that are not MCAP: bags, rosbag2 folders, databases."""

from __future__ import annotations

import shutil
import sqlite3
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tests.bag_files import pack, record, u32
from tests.faults_case import Table
from tests.faults_world import drive
from tests.ros_logs import store

table = Table()


def bag(d: Path, compression: str = "none", chunk: int = 3000, name: str = "drive.bag") -> Path:
    """The drive as a ROS 1 bag in several chunks, by rosbags."""
    from rosbags.rosbag1 import Writer

    types, out, known = store(1), d / name, {}
    made = Writer(out)
    made.chunk_threshold = chunk
    if compression != "none":
        made.set_compression(Writer.CompressionFormat[compression.upper()])
    with made as writer:
        for time, topic, kind, latched, data in drive().encoded(1):
            if (topic, kind) not in known:
                known[topic, kind] = writer.add_connection(
                    topic, kind, typestore=types, latching=int(latched)
                )
            writer.write(known[topic, kind], time, data)
    return out


def changed(path: Path, change: Callable[[bytes], bytes]) -> Path:
    path.write_bytes(change(path.read_bytes()))
    return path


def index_at(data: bytes) -> int:
    at = data.index(b"index_pos=") + 10
    return int(struct.unpack_from("<Q", data, at)[0])


def unindexed(data: bytes) -> bytes:
    """What a recorder leaves that was killed: index_pos 0, and nothing behind the chunks."""
    at, end = data.index(b"index_pos=") + 10, index_at(data)
    return data[:at] + bytes(8) + data[at + 8 : end]


def middle_chunk(data: bytes) -> int:
    """The first byte of a record of a chunk in the middle."""
    end, found, at = index_at(data), [], 13
    while at < end:
        (head,) = struct.unpack_from("<I", data, at)
        (body,) = struct.unpack_from("<I", data, at + 4 + head)
        if b"op=\5" in data[at + 4 : at + 4 + head]:
            found.append(at)
        at += 8 + head + body
    assert len(found) > 3
    return found[len(found) // 2]


def with_long(data: bytes, *, header: bool) -> bytes:
    """The length of a chunk's header, or of its data, is 4 GiB."""
    at = middle_chunk(data)
    if not header:
        at += 4 + struct.unpack_from("<I", data, at)[0]
    return data[:at] + b"\xff\xff\xff\xff" + data[at + 4 :]


def definition_damaged(data: bytes) -> bytes:
    """The text of LaserScan's definition in every record of it is garbage, of the same length."""
    word = b"float32 angle_increment"
    assert word in data
    return data.replace(word, b"\xff\xfefloat!! {{{ angle_inc\0"[: len(word)])


for kind in ("none", "lz4", "bz2"):
    table(66, f"sound bag, {kind}", quiet=True)(partial(bag, compression=kind))
table(66, "unindexed", "no index")(lambda d: changed(bag(d), unindexed))
table(66, "named .bag.active", "no index")(
    lambda d: changed(bag(d, name="drive.bag.active"), unindexed)
)
table(66, "truncated", "byte", code=3, map="part")(
    lambda d: changed(bag(d), lambda data: data[: middle_chunk(data) + 900])
)
table(66, "truncated in its index")(
    lambda d: changed(bag(d), lambda data: data[: index_at(data) + 50])
)
table(66, "V1.2", "1.2", code=1)(
    lambda d: changed(bag(d), lambda data: data.replace(b"#ROSBAG V2.0", b"#ROSBAG V1.2"))
)
table(66, "md5 damaged")(
    lambda d: changed(bag(d), lambda data: data.replace(b"md5sum=90c7ef2d", b"md5sum=xxxxxxxx"))
)
table(66, "definition damaged", "definition", code=1)(lambda d: changed(bag(d), definition_damaged))


@table(66, "encrypted", "encrypted", code=1)
def _(d: Path) -> Path:
    fields = [
        ("chunk_count", u32(1)),
        ("conn_count", u32(1)),
        ("encryptor", b"rosbag/AesCbcEncryptor"),
        ("index_pos", struct.pack("<Q", 4117)),
        ("op", b"\3"),
    ]
    head = record(fields, b" " * 4000)
    out = d / "drive.bag"
    out.write_bytes(b"#ROSBAG V2.0\n" + head + bytes(range(256)) * 40)
    return out


table(67, "header of 4 GiB", "byte", code=3, map="part")(
    lambda d: changed(bag(d), partial(with_long, header=True))
)
table(67, "data of 4 GiB", "byte", code=3, map="part")(
    lambda d: changed(bag(d), partial(with_long, header=False))
)
table(67, "data of 4 GiB, no index", "byte", code=3, map="part")(
    lambda d: changed(bag(d), lambda data: unindexed(with_long(data, header=False)))
)


def bomb(data: bytes, kind: str, claimed: int | None) -> bytes:
    """A chunk of 300 MB of zeros in front of the index."""
    end, zeros = index_at(data), bytes(300 << 20)
    size = len(zeros) if claimed is None else claimed
    fields = [("compression", kind.encode()), ("op", b"\5"), ("size", u32(size))]
    return unindexed(data)[:end] + record(fields, pack(kind, zeros))


def bombed(d: Path, kind: str, claimed: int | None = None) -> Path:
    return changed(bag(d), lambda data: bomb(data, kind, claimed))


for kind in ("bz2", "lz4"):
    table(9, f"{kind} bomb in a bag", code=3)(partial(bombed, kind=kind))
table(9, "bz2 bomb in a bag that lies", code=3)(partial(bombed, kind="bz2", claimed=100))

# ---------------------------------------------------------------------------- rosbag2


def folder(d: Path, kind: str = "sqlite3", name: str = "drive") -> Path:
    return drive().write(d / name, f"rosbag2-{kind}")


def database(d: Path) -> Path:
    """The drive's .db3 alone."""
    made = folder(d, name="made")
    (part,) = made.glob("*.db3")
    part.replace(d / "drive.db3")
    shutil.rmtree(made)
    return d / "drive.db3"


def metadata(d: Path, change: Callable[[str], str], kind: str = "sqlite3") -> Path:
    made = folder(d, kind)
    text = made / "metadata.yaml"
    text.write_text(change(text.read_text(encoding="utf-8")), encoding="utf-8")
    return made


def metadata_is(d: Path, text: str) -> Path:
    return metadata(d, lambda _: text)


def with_part(text: str, part: str) -> str:
    """One more part in the list of them."""
    return text.replace("relative_file_paths:", f"relative_file_paths:\n  - {part}")


def split(d: Path) -> Path:
    """Two parts of one recording."""
    made = folder(d)
    (part,) = made.glob("*.db3")
    second = part.with_name("drive_1.db3")
    shutil.copy(part, second)
    for path, sign in ((part, ">="), (second, "<")):
        with sqlite3.connect(path) as db:
            middle = "(SELECT (MIN(timestamp) + MAX(timestamp)) / 2 FROM messages)"
            db.execute(f"DELETE FROM messages WHERE timestamp {sign} {middle}")
        db.close()
    text = made / "metadata.yaml"
    text.write_text(with_part(text.read_text(encoding="utf-8"), second.name), encoding="utf-8")
    return made


def gone(d: Path, kind: str) -> Path:
    made = folder(d, kind)
    (made / "metadata.yaml").unlink()
    return made


for kind in ("sqlite3", "mcap"):
    table(68, f"sound folder, {kind}", quiet=True)(partial(folder, kind=kind))
    table(68, f"no metadata, {kind}", "metadata")(partial(gone, kind=kind))
table(68, "split")(split)
table(68, "wrong storage id", "storage")(
    lambda d: metadata(d, lambda text: text.replace("sqlite3", "mcap"))
)
table(68, "version 99", "version 99")(
    lambda d: metadata(d, lambda text: text.replace("version: 8", "version: 99"))
)
table(68, "counts wrong")(
    lambda d: metadata(d, lambda text: text.replace("message_count: 12", "message_count: 10"))
)
table(68, "a part is missing", "drive_7.db3", code=3)(
    lambda d: metadata(
        d,
        lambda text: text.replace("relative_file_paths:", "relative_file_paths:\n  - drive_7.db3"),
    )
)
table(68, "an empty folder", "is empty", code=1)(lambda d: (d / "drive").mkdir() or d / "drive")  # type: ignore[func-returns-value]

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)
)
for name, text, words in (
    ("YAML bomb", BOMB, "alias"),
    ("python tag", "x: !!python/object/apply:os.system ['touch owned']\n", "tag"),
    ("not YAML", "{[\n", ""),
    ("40 MB", "x: " + "y" * 40_000_000, "larger"),
    ("nested", "x: " + "[" * 5000, "levels"),
):
    table(69, name, words)(partial(metadata_is, text=text))
for part in ("../../etc/passwd", "/etc/passwd"):
    table(69, f"path {part}", "outside of its folder")(
        partial(metadata, change=partial(with_part, part=part))
    )

# ---------------------------------------------------------------------------- databases


@table(70, "WAL left", quiet=True)
def _(d: Path) -> Path:
    """Half of the messages are still in the write-ahead log."""
    path, live = database(d), d / "live.db3"
    shutil.copy(path, live)
    db = sqlite3.connect(live)
    rows = db.execute("SELECT * FROM messages WHERE id > 20").fetchall()
    db.execute("DELETE FROM messages WHERE id > 20")
    db.commit()
    db.execute("VACUUM")
    db.execute("PRAGMA journal_mode=WAL")
    db.execute("PRAGMA wal_autocheckpoint=0")
    db.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
    db.commit()
    shutil.copy(live, path)
    shutil.copy(d / "live.db3-wal", d / "drive.db3-wal")
    db.close()
    for name in ("live.db3", "live.db3-wal", "live.db3-shm"):
        (d / name).unlink(missing_ok=True)
    return path


table(70, "truncated", "cut", code=3, map="part", least=0.1)(
    lambda d: changed(database(d), lambda data: data[: len(data) - 4096 + 100])
)


def with_sql(d: Path, text: str) -> Path:
    path = database(d)
    db = sqlite3.connect(path)
    db.executescript("PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;" + text)
    db.close()
    return path


ENDLESS = "WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) SELECT n, n, n, n FROM r"
table(70, "hostile view", code=1)(
    lambda d: with_sql(
        d, f"ALTER TABLE messages RENAME TO hidden; CREATE VIEW messages AS {ENDLESS};"
    )
)
table(70, "hostile view of topics", code=1)(
    lambda d: with_sql(d, f"ALTER TABLE topics RENAME TO hidden; CREATE VIEW topics AS {ENDLESS};")
)
table(70, "a blob of 300 MB", code=3)(
    lambda d: with_sql(
        d,
        "INSERT INTO messages SELECT 9999, topic_id, timestamp, zeroblob(300000000)"
        " FROM messages WHERE topic_id = 3 LIMIT 1;",
    )
)
table(70, "no definitions", quiet=True)(
    lambda d: with_sql(d, "DROP TABLE IF EXISTS message_definitions;")
)
table(70, "a database that is no log", "without rosbag2", code=1)(
    lambda d: with_sql(d, "DROP TABLE messages; DROP TABLE topics;")
)
table(70, "the .db3 alone", quiet=True)(database)
