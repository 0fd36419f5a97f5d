"""The SQLite files of rosbag2 (schema versions 1 to 4), whole, cut or damaged.

A file is opened read-only and immutable, so that nothing is written beside it. With a write-ahead
log or a rollback journal beside it, they are copied to a temporary folder and opened there. What
SQLite cannot read to the end is taken from the pages themselves. SQLite has no checksums of its
tables: a changed byte inside a payload cannot be seen.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path
from struct import Struct

from formats.errors import FormatError, Notes
from formats.log import Container, Message, Topic
from formats.rosbag2.metadata import latched
from formats.rosbag2.sqlite_rows import DamagedError, SqlRows
from formats.rosbag2.sqlite_salvage import PageRows

MAX_MESSAGE = 256 << 20
MAGIC = b"SQLite format 3\0"
BESIDE = ("-wal", "-journal")
u16, u32 = Struct(">H").unpack_from, Struct(">I").unpack_from


def left_beside(path: Path) -> list[Path]:
    """The write-ahead log and the journal that a recorder left beside its file."""
    places = [path.with_name(path.name + end) for end in BESIDE]
    return [place for place in places if place.is_file() and place.stat().st_size]


class SqliteLog:
    """One opened .db3 file: a Log.

    Args:
        path: the file, as the user names it.
        notes: where losses and oddities are counted.
        max_chunk: bytes, the most that one message may have.
        unpacked: where its bytes lie, if `path` itself is compressed.

    Raises:
        FormatError: not a file of rosbag2's.
    """

    def __init__(
        self,
        path: Path,
        notes: Notes,
        max_chunk: int = MAX_MESSAGE,
        unpacked: Path | None = None,
    ) -> None:
        self.path, self._notes, self._longest = path, notes, max_chunk
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._map: mmap | None = None
        self._rows: SqlRows | PageRows | None = None
        self._source = unpacked or path
        self._state = "complete"
        self._told: set[tuple[int, int]] = set()
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        try:
            beside = left_beside(self._source)
            if beside:
                self._source = self._copied(beside)
                self._notes.info(self.path, f"read with its {beside[0].name}")
            size = self._source.stat().st_size
            with self._source.open("rb") as file:
                head = file.read(100)
        except OSError as error:
            raise FormatError(self.path, f"cannot be read: {error.strerror}") from error
        if not beside and (gone := _cut(head, size)):
            self._notes.lose(self.path, f"cut: {gone} bytes are gone", at=f"byte {size}")
            self._state = f"cut at byte {size}"
            rows: SqlRows | PageRows = self._salvaged()
        else:
            try:
                rows = SqlRows(self._source, not beside, self._longest)
                self._rows = rows
                if beside and (pages := rows.uncommitted()):
                    problem = f"{pages} pages of its write-ahead log are damaged or unfinished"
                    self._notes.lose(self.path, problem)
            except DamagedError as error:
                rows = self._damaged(error)
            except ValueError as error:
                raise FormatError(self.path, str(error)) from error
        self._rows = rows
        self._topics = self._named(rows)

    def _copied(self, beside: list[Path]) -> Path:
        """The file and what was left beside it, in a temporary folder."""
        self._folder = tempfile.TemporaryDirectory(prefix="replay-")
        for place in [self._source, *beside]:
            shutil.copyfile(place, Path(self._folder.name) / place.name)
        return Path(self._folder.name) / self._source.name

    def _damaged(self, error: Exception) -> PageRows:
        self._notes.lose(self.path, f"damaged: {error}; read page by page")
        self._state = "damaged"
        return self._salvaged()

    def _salvaged(self) -> PageRows:
        try:
            with self._source.open("rb") as file:
                self._map = mmap(file.fileno(), 0, access=ACCESS_READ)
            rows = PageRows(memoryview(self._map))
        except (ValueError, IndexError) as error:
            raise FormatError(self.path, f"is damaged beyond reading: {error}") from error
        if rows.missing:
            self._notes.lose(self.path, "messages are gone", count=rows.missing)
        return rows

    def _named(self, rows: SqlRows | PageRows) -> dict[int, Topic]:
        """Topics by number; rows of one name and type share theirs."""
        definitions = {str(row[1]): row for row in rows.definitions if len(row) >= 4}
        groups: dict[tuple[str, str, str], list[int]] = {}
        kept: set[tuple[str, str, str]] = set()
        for number, name, kind, encoding, *more in (row for row in rows.topics if len(row) >= 4):
            if not isinstance(number, int):
                continue
            key = (str(name), str(kind), str(encoding))
            groups.setdefault(key, []).append(number)
            if more and latched(more[0]):
                kept.add(key)
        found: dict[int, Topic] = {}
        for key, numbers in groups.items():
            _, _, form, text, *_ = definitions.get(key[1], (0, "", "", ""))
            count = sum(rows.counts[number] for number in numbers)
            body = str(text).encode("utf-8", "backslashreplace")
            topic = Topic(*key, body, str(form) if body else "", count, key in kept)
            found |= dict.fromkeys(numbers, topic)
        for number in rows.counts.keys() - found.keys():
            problem = f"messages of topic {number}, which is not described"
            self._notes.lose(self.path, problem, count=rows.counts[number])
        if isinstance(rows, SqlRows) and rows.odd:
            self._notes.lose(self.path, "messages without a time or topic", count=rows.odd)
        if isinstance(rows, SqlRows) and rows.gaps > 0:
            self._notes.warn(self.path, f"{rows.gaps} message numbers are not there")
        return found

    @property
    def container(self) -> Container:
        """Kind, times and state."""
        start, end = self._rows.span if self._rows else (0, 0)
        size = self.path.stat().st_size
        whole = self._state == "complete"
        return Container("rosbag2 sqlite3", "none", size, start, end, whole, self._state)

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name and type."""
        return sorted(set(self._topics.values()), key=lambda topic: (topic.name, topic.type))

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics (None: all), sorted by log time, file order where equal."""
        wanted = set(self.topics() if topics is None else topics)
        table = {number: topic for number, topic in self._topics.items() if topic in wanted}
        last: tuple[int, int] | None = None
        rows = self._rows
        assert rows is not None
        try:
            for rowid, number, time, data in rows.rows(table, self._longest):
                if type(time) is not int:
                    continue
                last = time, rowid
                if data is None:
                    self._lost(table[number].name, rowid, time)
                else:
                    yield Message(table[number], time, data)
        except DamagedError as error:
            if isinstance(self._rows, SqlRows):
                self._rows.close()
            if not isinstance(self._rows, PageRows):
                self._rows = self._damaged(error)
            for rowid, number, time, data in self._rows.rows(table, self._longest, last):
                if data is None:
                    self._lost(table[number].name, rowid, time)
                else:
                    yield Message(table[number], time, data)

    def _lost(self, name: str, rowid: int, time: int) -> None:
        """Count a message once, however many passes meet it."""
        if (rowid, time) in self._told:
            return
        self._told.add((rowid, time))
        at = f"{time / 1e9:.3f} s"
        self._notes.lose(self.path, "message is incomplete or too long", topic=name, at=at)
        if self._state == "complete":
            self._state = f"damaged at {at}"

    def close(self) -> None:
        """Close the file and remove temporary copies."""
        if isinstance(self._rows, SqlRows):
            self._rows.close()
        self._rows = None
        if self._map is not None:
            with suppress(BufferError):
                self._map.close()
        if self._folder is not None:
            self._folder.cleanup()


def _cut(head: bytes, size: int) -> int:
    """Bytes that a file is shorter than its header says, 0 where the header does not say."""
    if len(head) < 100 or u32(head, 24) != u32(head, 92):
        return 0
    page = u16(head, 16)[0]
    said = u32(head, 28)[0] * (65536 if page == 1 else page)
    return max(0, int(said) - size)
