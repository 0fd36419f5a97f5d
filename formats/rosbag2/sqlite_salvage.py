"""The messages of a damaged rosbag2 file, from its pages."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Container, Iterator

import numpy as np
import numpy.typing as npt

from formats.rosbag2.sqlite_pages import BLOB, INTEGERS, Cell, Pages, Value, integer, length, values


def find_messages(pages: Pages, elsewhere: Container[int]) -> array[int]:
    """The messages on every leaf page of the file: rows of id, topic_id, timestamp, data.

    Args:
        pages: the file.
        elsewhere: the leaf pages of other tables.

    Returns:
        Timestamp, id, topic_id, and size and place of the record of each message, one after the
        other in the order of the pages.
    """
    found = array("q")
    for page in range(1, pages.count + 1):
        if page in elsewhere or not pages.is_leaf(page):
            continue
        for cell in pages.cells(page):
            columns = pages.columns(cell, 4)
            if columns is None:
                continue
            (_, topic, time, data), place = columns
            if topic not in INTEGERS or time not in INTEGERS or data < BLOB or data % 2:
                continue
            # The id is the row's own number, and NULL in the record; older files may hold it.
            place += length(columns[0][0])
            middle = place + length(topic)
            raw = bytes(pages.buffer[place : middle + length(time)])
            topic_id = integer(topic, raw[: middle - place])
            stamp = integer(time, raw[middle - place :])
            found.extend((stamp, cell.rowid, topic_id, cell.size, cell.pos))
    return found


class PageRows:
    """The messages of a rosbag2 file from its pages, sorted by time.

    Attributes:
        topics: rows of the table of topics.
        definitions: rows of the table of message definitions.
        counts: messages by topic_id.
        span: first and last timestamp.
        missing: messages whose numbers are not there, of those that were once in the file.

    Raises:
        ValueError: no table of messages can be found.
    """

    def __init__(self, buffer: memoryview) -> None:
        self._pages = Pages(buffer)
        tables = self._pages.tables()
        if not {"topics", "messages"} <= tables.keys():
            raise ValueError("the tables of rosbag2 cannot be found")
        self.topics = [(row[0], *row[2:]) for row in self._pages.rows(tables["topics"])]
        self.definitions: list[tuple[Value, ...]] = []
        if "message_definitions" in tables:
            rows = self._pages.rows(tables["message_definitions"])
            self.definitions = [(row[0], *row[2:]) for row in rows]
        others = {
            page
            for name, root in [*tables.items(), ("schema", 1)]
            if name != "messages"
            for page in self._pages.leaves(root)
        }
        found = np.array(find_messages(self._pages, others), dtype=np.int64).reshape(-1, 5)
        _, first = np.unique(found[:, 1], return_index=True)
        found = found[np.sort(first)]
        self._rows = found[np.lexsort((found[:, 1], found[:, 0]))]
        self.counts = Counter(found[:, 2].tolist())
        self.span = (int(self._rows[0, 0]), int(self._rows[-1, 0])) if len(found) else (0, 0)
        ids = found[:, 1]
        gone = int(ids.max()) - min(1, int(ids.min())) + 1 - len(ids) if len(ids) else 0
        self.missing = gone if gone < len(buffer) else 0

    def rows(
        self, topics: Collection[int], longest: int, after: tuple[int, int] | None = None
    ) -> Iterator[tuple[int, int, int, bytes | None]]:
        """Id, topic_id, timestamp and data (None: lost) of these topics' messages, by time.

        Args:
            topics: their numbers.
            longest: bytes, the most that a message may have.
            after: only those after this (timestamp, id).
        """
        for time, rowid, topic, size, pos in _in_steps(self._rows):
            if topic in topics and (after is None or (time, rowid) > after):
                record = self._pages.record(Cell(rowid, size, pos), longest)
                data = values(record)[-1] if record else None
                yield rowid, topic, time, data if isinstance(data, bytes) else None


def _in_steps(rows: npt.NDArray[np.int64], step: int = 4096) -> Iterator[list[int]]:
    for at in range(0, len(rows), step):
        yield from rows[at : at + step].tolist()
