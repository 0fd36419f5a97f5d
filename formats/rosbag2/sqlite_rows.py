"""The rows of a rosbag2 file through SQLite, sorted by time, without trusting its schema."""

from __future__ import annotations

import re
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

BATCH = 1 << 14
LONGEST_TEXT = 16 << 20  # bytes of a message definition
NEEDED = {
    "topics": {"id", "name", "type", "serialization_format"},
    "messages": {"id", "topic_id", "timestamp", "data"},
    "message_definitions": {"topic_type", "encoding", "encoded_message_definition"},
}


class DamagedError(Exception):
    """SQLite cannot follow the file's trees: its pages have to be read one by one."""


class SqlRows:
    """The tables of a rosbag2 file.

    Attributes:
        topics: rows of id, name, type, serialization_format[, offered_qos_profiles].
        definitions: rows of id, topic_type, encoding, encoded_message_definition.
        counts: messages by topic_id.
        odd: messages whose time or topic is no number.
        gaps: numbers from 1 that no message has.
        span: first and last timestamp.

    Raises:
        ValueError: its tables are not those of rosbag2.
        DamagedError: it cannot be read to the end.
    """

    def __init__(self, path: Path, immutable: bool, longest: int) -> None:
        self._path = path
        mode = "mode=ro&immutable=1" if immutable else "mode=rw"
        try:
            self._db = sqlite3.connect(f"{path.absolute().as_uri()}?{mode}", uri=True)
        except sqlite3.Error as error:
            raise DamagedError(str(error)) from error
        try:
            self._open(longest)
        except sqlite3.Error as error:
            self.close()
            raise DamagedError(str(error)) from error
        except BaseException:
            self.close()
            raise

    def _open(self, longest: int) -> None:
        db = self._db
        # A header of at most 100 bytes and three numbers stand before the payload.
        db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(longest, LONGEST_TEXT) + 200)
        db.text_factory = lambda raw: raw.decode("utf-8", "backslashreplace")
        db.execute("PRAGMA trusted_schema = OFF")
        db.execute("PRAGMA cell_size_check = ON")
        columns = {name: self._columns(name) for name in NEEDED}
        for name in ("topics", "messages"):
            if not NEEDED[name] <= columns[name]:
                raise ValueError(f"is an SQLite file without rosbag2's table of {name}")
        qos = ", offered_qos_profiles" if "offered_qos_profiles" in columns["topics"] else ""
        self.topics = self._all(f"id, name, type, serialization_format{qos}", "topics")
        self.definitions: list[tuple[Any, ...]] = []
        if NEEDED["message_definitions"] <= columns["message_definitions"]:
            names = "rowid, topic_type, encoding, encoded_message_definition"
            self.definitions = self._all(names, "message_definitions")
        self._measure()

    def _columns(self, table: str) -> set[str]:
        """The columns of a real table; none for what is not there.

        A view, a virtual table or a computed column could run for ever.
        """
        kinds = self._db.execute(
            "SELECT type, rootpage FROM sqlite_master WHERE name = ? COLLATE NOCASE", (table,)
        ).fetchall()
        if not kinds:
            return set()
        if [kind for kind, root in kinds if kind != "table" or not root]:
            raise ValueError(f"its {table} are not a plain table")
        columns = self._db.execute(f"PRAGMA table_xinfo({table})").fetchall()
        if any(column[6] for column in columns):
            raise ValueError(f"its table of {table} has computed columns")
        return {str(column[1]).lower() for column in columns}

    def _all(self, columns: str, table: str) -> list[tuple[Any, ...]]:
        """A small table; its rows' numbers must grow, or its tree goes in circles."""
        rows, last = [], None
        for row in self._db.execute(f"SELECT rowid, {columns} FROM {table} ORDER BY rowid"):
            if last is not None and row[0] <= last:
                raise DamagedError("a table goes in circles")
            last = row[0]
            rows.append(row[1:])
        return rows

    def _measure(self) -> None:
        """Count the messages in one pass over the table, which also shows whether it is sorted."""
        self.counts: Counter[int] = Counter()
        self.odd = 0
        self.gaps = 0
        first, last, latest, number = None, None, None, None
        self._sorted = True
        for batch in self._batches(
            "SELECT rowid, timestamp, topic_id FROM messages ORDER BY rowid"
        ):
            sound = [row for row in batch if type(row[1]) is int and type(row[2]) is int]
            self.odd += len(batch) - len(sound)
            numbers = np.array([row[0] for row in batch], dtype=np.int64)
            if (np.diff(numbers) <= 0).any() or (number is not None and numbers[0] <= number):
                raise DamagedError("the table of messages goes in circles")
            self.gaps += int(numbers[-1]) - (number or 0) - len(batch)
            number = int(numbers[-1])
            if not sound:
                continue
            times = np.array([row[1] for row in sound], dtype=np.int64)
            self.counts.update(row[2] for row in sound)
            low, high = int(times.min()), int(times.max())
            if (np.diff(times) < 0).any() or (latest is not None and int(times[0]) < latest):
                self._sorted = False
            latest = int(times[-1])
            first = low if first is None else min(first, low)
            last = high if last is None else max(last, high)
        self.span = (first or 0, last or 0)

    def _batches(self, query: str) -> Iterator[list[tuple[Any, ...]]]:
        with closing(self._db.cursor()) as cursor:
            cursor.execute(query)
            while batch := cursor.fetchmany(BATCH):
                yield batch

    def rows(
        self, topics: Collection[int], longest: int, after: tuple[int, int] | None = None
    ) -> Iterator[tuple[int, int, int, bytes | None]]:
        """Id, topic_id, timestamp and data (None: no bytes, or too long) of messages, by time.

        Args:
            topics: their numbers.
            longest: bytes, the most that a message may have.
            after: not used here: a pass begins at the beginning.

        Raises:
            DamagedError: the rest cannot be read.
        """
        payload = f"CASE WHEN typeof(data) = 'blob' AND length(data) <= {longest} THEN data END"
        # The plus keeps SQLite from using an index on topic_id, and sorting everything itself.
        where = f"WHERE +topic_id IN ({','.join(str(int(topic)) for topic in topics)})"
        query = f"SELECT rowid, topic_id, timestamp, {payload} FROM messages {where} ORDER BY "
        try:
            if self._sorted:
                yield from self._db.execute(query + "rowid")
            elif self._has_index(query + "timestamp, rowid"):
                yield from self._db.execute(query + "timestamp, rowid")
            else:
                yield from self._by_number(topics, payload)
        except sqlite3.Error as error:
            raise DamagedError(str(error)) from error

    def _has_index(self, query: str) -> bool:
        """Whether an index gives the order, and holds every message."""
        plan = " ".join(str(row[3]) for row in self._db.execute("EXPLAIN QUERY PLAN " + query))
        name = re.search(r"USING (?:COVERING )?INDEX (\w+)", plan)
        if name is None or "TEMP B-TREE" in plan:
            return False
        held = self._db.execute(f"SELECT count(*) FROM messages INDEXED BY {name[1]}").fetchone()[0]
        return bool(held == sum(self.counts.values()) + self.odd)

    def _by_number(
        self, topics: Collection[int], payload: str
    ) -> Iterator[tuple[int, int, int, bytes | None]]:
        """By an array of (timestamp, rowid), 16 bytes a message."""
        parts: list[npt.NDArray[np.int64]] = []
        for batch in self._batches("SELECT timestamp, rowid, topic_id FROM messages"):
            wanted = [row[:2] for row in batch if type(row[0]) is int and row[2] in topics]
            parts.append(np.array(wanted, dtype=np.int64).reshape(-1, 2))
        table = np.concatenate(parts) if parts else np.zeros((0, 2), np.int64)
        table = table[np.lexsort((table[:, 1], table[:, 0]))]
        query = f"SELECT rowid, topic_id, timestamp, {payload} FROM messages WHERE rowid = ?"
        for at in range(0, len(table), BATCH):
            for number in table[at : at + BATCH, 1].tolist():
                yield from self._db.execute(query, (number,))

    def uncommitted(self) -> int:
        """Pages of this file's write-ahead log that belong to no sound, finished transaction."""
        place = Path(f"{self._path}-wal")
        page = self._db.execute("PRAGMA page_size").fetchone()[0]
        with place.open("rb") if place.is_file() else BytesIO() as file:
            head = file.read(32)
            written = 0
            while len(frame := file.read(24)) == 24 and frame[8:16] == head[16:24]:
                written += 1
                file.seek(page, 1)
        sound = self._db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()[1]
        return max(0, written - max(0, int(sound)))

    def close(self) -> None:
        """Give the file back."""
        self._db.close()
