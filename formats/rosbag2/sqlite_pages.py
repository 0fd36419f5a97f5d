"""Rows of a SQLite file taken from its pages, for files that SQLite itself cannot read to the end.

Every whole page of a table's leaves is used, whether or not the tree above it is still there.
Source: https://www.sqlite.org/fileformat2.html, sections 1.3 to 2.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from struct import Struct
from typing import NamedTuple

MAGIC = b"SQLite format 3\0"
LEAF, INTERIOR = 0x0D, 0x05
SIZES = (0, 1, 2, 3, 4, 6, 8, 8, 0, 0)  # bytes by serial type, section 2.1
INTEGERS = (1, 2, 3, 4, 5, 6, 8, 9)
NULL, BLOB = 0, 12
u16, u32 = Struct(">H").unpack_from, Struct(">I").unpack_from
Value = int | float | bytes | str | None


class Cell(NamedTuple):
    """A row on a leaf page: its number, the size of its record, and where the record begins."""

    rowid: int
    size: int
    pos: int


def _varint(buffer: bytes | memoryview, pos: int) -> tuple[int, int]:
    """A variable-length integer (section 1.6) and the place behind it."""
    value = 0
    for step in range(8):
        byte = buffer[pos + step]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, pos + step + 1
    value = value << 8 | buffer[pos + 8]
    return value - (1 << 64 if value >> 63 else 0), pos + 9


class Pages:
    """The pages of a SQLite file, whole or cut.

    Args:
        buffer: the file, beginning with its header.

    Raises:
        ValueError: the header is cut or damaged.
    """

    def __init__(self, buffer: memoryview) -> None:
        if len(buffer) < 100:
            raise ValueError("its header is cut")
        self.buffer = buffer
        size: int = u16(buffer, 16)[0]
        self.size = 65536 if size == 1 else size
        if self.size < 512 or self.size & (self.size - 1) or buffer[20] > 32:
            raise ValueError(f"page size {size}")
        self.usable = self.size - buffer[20]
        self.count = -(-len(buffer) // self.size)  # the last may be cut

    def tables(self) -> dict[str, int]:
        """Root page by table name, from the schema on page 1."""
        found = {}
        for row in self.rows(1):
            if len(row) == 6 and row[1] == "table" and isinstance(row[4], int):
                found[str(row[2]).lower()] = row[4]
        return found

    def rows(self, root: int, longest: int = 1 << 24) -> Iterator[tuple[Value, ...]]:
        """A table's rows, each behind its number, as far as its tree can be followed.

        The column of an INTEGER PRIMARY KEY is None: the number stands for it.
        """
        for page in self.leaves(root):
            for cell in self.cells(page):
                record = self.record(cell, longest) if cell.size <= longest else None
                if record is not None:
                    yield (cell.rowid, *values(record))

    def leaves(self, root: int) -> Iterator[int]:
        """The leaf pages below a root, each once."""
        seen: set[int] = set()
        waiting = [root]
        while waiting:
            page = waiting.pop()
            if page in seen or not 1 <= page <= self.count:
                continue
            seen.add(page)
            here, head = self._page(page)
            if here[head] == LEAF:
                yield page
            elif here[head] == INTERIOR:
                waiting.append(u32(here, head + 8)[0])
                for number in reversed(range(self._cells(here, head))):
                    cell = u16(here, head + 12 + 2 * number)[0]
                    if cell + 4 <= self.size:
                        waiting.append(u32(here, cell)[0])

    def _page(self, page: int) -> tuple[bytes, int]:
        """A page's bytes and where its header begins; what a cut took reads as zeros."""
        base = (page - 1) * self.size
        here = bytes(self.buffer[base : base + self.size])
        return here.ljust(self.size, b"\0"), 100 if page == 1 else 0

    def _cells(self, here: bytes, head: int) -> int:
        return min(int(u16(here, head + 3)[0]), (self.size - 112) // 2)

    def is_leaf(self, page: int) -> bool:
        """Whether a page is a leaf of a table."""
        place = 100 if page == 1 else (page - 1) * self.size
        return self.buffer[place] == LEAF

    def cells(self, page: int) -> Iterator[Cell]:
        """The rows of a leaf page whose records begin on it."""
        here, head = self._page(page)
        base = (page - 1) * self.size
        for number in range(self._cells(here, head)):
            try:
                size, pos = _varint(here, u16(here, head + 8 + 2 * number)[0])
                rowid, pos = _varint(here, pos)
            except IndexError:
                continue
            if size > 0 and pos + self.local(size) <= self.usable:
                yield Cell(rowid, size, base + pos)

    def local(self, size: int) -> int:
        """Bytes of a record that stand on its leaf page (section 1.6)."""
        if size <= self.usable - 35:
            return size
        least = (self.usable - 12) * 32 // 255 - 23
        some = least + (size - least) % (self.usable - 4)
        return some if some <= self.usable - 35 else least

    def record(self, cell: Cell, longest: int) -> bytes | None:
        """A whole record; None where some of it is not in the file or it is too long."""
        local = self.local(cell.size)
        if cell.size > min(longest, len(self.buffer)) or cell.pos + local > len(self.buffer):
            return None
        parts = [bytes(self.buffer[cell.pos : cell.pos + local])]
        missing = cell.size - local
        place = cell.pos + local
        while missing > 0:
            if place + 4 > len(self.buffer):
                return None
            page = u32(self.buffer, place)[0]
            place = (page - 1) * self.size
            step = min(missing, self.usable - 4)
            if page < 2 or place + 4 + step > len(self.buffer):
                return None
            parts.append(bytes(self.buffer[place + 4 : place + 4 + step]))
            missing -= step
        return b"".join(parts)

    def columns(self, cell: Cell, count: int) -> tuple[list[int], int] | None:
        """The serial types of a record of `count` columns and where its values begin, or None."""
        here = bytes(self.buffer[cell.pos : cell.pos + min(self.local(cell.size), 100)])
        try:
            stop, pos = _varint(here, 0)
            kinds: list[int] = []
            while pos < stop and len(kinds) <= count:
                kind, pos = _varint(here, pos)
                kinds.append(kind)
        except IndexError:
            return None
        if len(kinds) != count or pos != stop or min(kinds) < 0:
            return None
        if stop + sum(map(length, kinds)) != cell.size:
            return None
        return kinds, cell.pos + stop


def length(kind: int) -> int:
    """Bytes of a value, by its serial type."""
    return (kind - BLOB) // 2 if kind >= BLOB else SIZES[max(0, min(kind, 9))]


def integer(kind: int, raw: bytes) -> int:
    """A value of an integer serial type."""
    return kind - 8 if kind >= 8 else int.from_bytes(raw, "big", signed=True)


def _value(kind: int, raw: bytes) -> Value:
    if kind in INTEGERS:
        return integer(kind, raw)
    if kind >= BLOB:
        return raw.decode("utf-8", "backslashreplace") if kind % 2 else raw
    return None if kind == NULL else 0.0


def values(record: bytes) -> list[Value]:
    """The columns of a record (section 2.1); fewer where its header is damaged."""
    found: list[Value] = []
    try:
        stop, pos = _varint(record, 0)
        place = stop
        while pos < stop:
            kind, pos = _varint(record, pos)
            found.append(_value(kind, record[place : place + length(kind)]))
            place += length(kind)
    except IndexError:
        pass
    return found
