"""The connections and chunks of a ROS 1 bag whose index is not sound: record by record."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

from formats.bag.chunks import Chunk
from formats.bag.index import (
    MAGIC,
    Survey,
    by_index_section,
    chunk_info,
    chunk_of,
    index_entry,
)
from formats.bag.records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MESSAGE,
    OUTSIDE_CHUNKS,
    Record,
    find_record,
    read_record,
    release,
)
from formats.errors import FormatError, Notes

# How lz4 frames and bz2 streams begin: they show a chunk whose own header is damaged.
COMPRESSED = re.compile(rb"(BZh[1-9]1AY&SY)|\x04\x22\x4d\x18")
LARGEST = 1 << 32  # bytes, for a chunk that does not say
LONGEST_INDEX = 4096  # bytes of damage behind which index records may still belong to the chunk


def survey(path: Path, buffer: memoryview, notes: Notes) -> Survey:
    """Find every chunk of a bag, or of several bags glued together.

    Raises:
        FormatError: encrypted.
    """
    found = Survey()
    base, part = 0, 0
    while True:
        head = read_record(buffer, base + len(MAGIC), len(buffer))
        if head is not None and head.op == BAG_HEADER:
            encryptor = head.fields.get(b"encryptor", b"").decode("utf-8", "replace")
            if encryptor not in ("", "rosbag/NoEncryptor"):
                hint = "decrypt it with ROS's rosbag first"
                raise FormatError(path, f"is encrypted ({encryptor})", hint=hint)
        else:
            head = None
        end = by_index_section(buffer, base, head, part, found)
        if end is None:
            end = Walk(path, buffer, notes, base, head, part, found).end
        if not _glued(buffer, end):
            break
        notes.warn(path, "another bag is glued to its end; read as one", at=f"byte {end}")
        base, part = end, part + 1
    if end < len(buffer):
        notes.warn(path, f"{len(buffer) - end} bytes of junk after the end", at=f"byte {end}")
    return found


def _glued(buffer: memoryview, pos: int) -> bool:
    return bytes(buffer[pos : pos + len(MAGIC)]) == MAGIC


class Walk:
    """One part of a file record by record, going on behind damage; `end` is where it ends."""

    def __init__(
        self,
        path: Path,
        buffer: memoryview,
        notes: Notes,
        base: int,
        head: Record | None,
        part: int,
        found: Survey,
    ) -> None:
        self.path, self.buffer, self.notes, self.part, self.found = path, buffer, notes, part, found
        self.chunks: list[Chunk] = []
        self.current: Chunk | None = None
        self.infos: dict[int, Counter[int]] = {}
        self.orphans: Counter[int] = Counter()
        self.doubtful: set[int] = set()  # chunks whose index records may be incomplete
        self.gaps: list[tuple[int, int]] = []
        self.base = base
        pos = head.end if head else base + len(MAGIC)
        while pos < len(buffer) and not _glued(buffer, pos):
            last, pos = pos, self.step(pos)
            release(buffer, last, pos)
        self.end = pos
        self.finish(head)

    def step(self, pos: int) -> int:
        """Take in what stands at `pos`; where the next record begins."""
        size = len(self.buffer)
        record = read_record(self.buffer, pos, size)
        if record is None or (record.end > size and record.op not in (CHUNK, MESSAGE)):
            return self.damage(pos)
        if record.op == CHUNK:
            return self.chunk(record)
        if record.op == MESSAGE:
            return self.loose(record)
        if record.op == INDEX:
            self.index(record)
        elif record.op == CHUNK_INFO:
            self.infos[self.base + record.number(b"chunk_pos")] = chunk_info(self.buffer, record)
        elif record.op == CONNECTION:
            self.found.keep(self.part, record, self.buffer)
        elif record.op != BAG_HEADER:
            problem = f"record of unknown kind {record.op} skipped"
            self.notes.warn(self.path, problem, at=f"byte {pos}")
        return record.end

    def chunk(self, record: Record) -> int:
        """A chunk whose length is believed where a record follows it."""
        chunk = chunk_of(record)
        size = len(self.buffer)
        same = chunk.compression == "none" and chunk.size == chunk.end - chunk.data
        if chunk.end > size or not (same or self.follows(chunk.end)):
            again = find_record(self.buffer, chunk.data, size, OUTSIDE_CHUNKS)
            chunk.end = again.pos if again else size
            chunk.complaint = "damaged chunk" if again else "cut chunk"
        self.add(chunk)
        return chunk.end

    def follows(self, pos: int) -> bool:
        """Whether something that may follow a chunk stands at `pos`."""
        record = read_record(self.buffer, pos, len(self.buffer))
        after = record is not None and record.op != MESSAGE
        return after or pos == len(self.buffer) or _glued(self.buffer, pos)

    def loose(self, record: Record) -> int:
        """Messages outside of any chunk: those of a chunk whose own header is damaged."""
        again = find_record(self.buffer, record.data, len(self.buffer), OUTSIDE_CHUNKS)
        end = again.pos if again else len(self.buffer)
        self.add(Chunk(record.pos, record.pos, end, "none", end - record.pos))
        return end

    def damage(self, pos: int) -> int:
        """A stretch without records; perhaps a compressed chunk without its header."""
        size = len(self.buffer)
        if self.current:
            self.doubtful.add(self.current.pos)
        again = find_record(self.buffer, pos + 1, size)
        end = again.pos if again else size
        begin = COMPRESSED.search(self.buffer, pos, min(end, pos + LONGEST_INDEX))
        if begin:
            # lz4 leaves much as it is: what looks like a message here may be half of one.
            again = find_record(self.buffer, begin.end(), size, OUTSIDE_CHUNKS)
            end = again.pos if again else size
            kind = "bz2" if begin[1] else "lz4"
            self.add(Chunk(pos, begin.start(), end, kind, LARGEST, complaint="damaged chunk"))
        elif end - pos > LONGEST_INDEX:
            self.current = None
        self.gaps.append((pos, end))
        return end

    def add(self, chunk: Chunk) -> None:
        """One more chunk, to which the next index records belong."""
        chunk.part = self.part
        self.current = chunk
        self.chunks.append(chunk)

    def index(self, record: Record) -> None:
        """An index record; behind a chunk that is gone it counts what was lost."""
        entry = index_entry(record)
        if entry is None:
            return
        if self.current is None:
            self.orphans[entry[0]] += entry[1]
        else:
            self.current.index.append(entry)

    def finish(self, head: Record | None) -> None:
        """Compare with what the index says, as far as it is there, and count what is gone."""
        index_pos = head.number(b"index_pos") if head else 0
        data_end = self.base + index_pos if index_pos else len(self.buffer)
        listed = head is not None and 0 < head.number(b"chunk_count") == len(self.infos)
        if self.chunks:  # a cut may have taken some of the last one's index
            self.doubtful.add(self.chunks[-1].pos)
        for chunk in self.chunks:
            by_index: Counter[int] = Counter()
            for conn, count, _ in chunk.index:
                by_index[conn] += count
            sure = chunk.pos not in self.doubtful
            chunk.expected = self.infos.get(chunk.pos, by_index if sure else Counter())
            chunk.indexed = bool(chunk.index) and chunk.expected == by_index
        self.found.chunks += self.chunks
        places = {chunk.pos for chunk in self.chunks}
        gone = [self.orphans] if not listed else []
        gone += [counts for pos, counts in self.infos.items() if pos not in places]
        for counts in gone:
            self.found.lost.update({self.part << 32 | conn: n for conn, n in counts.items()})
        self.say(data_end, known=listed)
        if head and not index_pos:
            self.notes.warn(self.path, "has no index: its recording was not ended; read in full")
            self.found.say("no index")
        if self.found.state == "complete":
            self.notes.warn(self.path, "has a damaged index; read in full")
            self.found.say("damaged index")

    def say(self, data_end: int, known: bool) -> None:
        """Count damage between records: a loss, unless it is `known` what should be there."""
        size = len(self.buffer)
        for pos, end in self.gaps:
            tell = self.notes.warn if known or pos >= data_end else self.notes.lose
            if end < size or pos >= data_end:
                tell(self.path, "damaged bytes between records", at=f"byte {pos} to {end}")
                self.found.say(f"damaged at byte {pos}")
        if data_end > size or (self.gaps and self.gaps[-1][1] == size and data_end == size):
            counted = bool(self.chunks) and self.chunks[-1].complaint
            tell = self.notes.warn if counted else self.notes.lose
            tell(self.path, "cut: the file ends before its index", at=f"byte {size}")
            self.found.say(f"cut at byte {size}")
