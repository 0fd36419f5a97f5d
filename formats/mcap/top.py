"""The outer records of an MCAP file, whole, cut or damaged: where chunks and all else lie."""

from __future__ import annotations

import re
from typing import NamedTuple

from formats.errors import Kind, Notes, Path
from formats.mcap import records as r
from formats.mcap.blocks import (
    CHUNK_HEAD,
    RUN_BYTES,
    TOP,
    Block,
    Walked,
    channel_counts,
    entries,
    release,
    walk_block,
)
from formats.mcap.contents import Contents, Part, define
from formats.mcap.parse import HEAD, LAYOUT, MalformedError, parse

KNOWN_COMPRESSIONS = ("", "none", "zstd", "lz4", "bz2")
LONGEST_NAME = 64  # of a compression
# Where a record may begin: a known opcode and a length below 2^40, or the start of a file.
CANDIDATE = re.compile(rb"[\x03-\x0f](?=[\s\S]{5}\x00{3})|\x89MCAP0\r\n")
MOST_CANDIDATES = 300_000
# Records without which no data are missing.
HARMLESS = (
    r.MESSAGE_INDEX,
    r.CHUNK_INDEX,
    r.ATTACHMENT_INDEX,
    r.STATISTICS,
    r.METADATA_INDEX,
    r.SUMMARY_OFFSET,
    r.DATA_END,
    r.FOOTER,
)
CUT = {
    r.CHUNK: "a chunk",
    r.MESSAGE: "a message",
    r.ATTACHMENT: "an attachment",
    r.METADATA: "metadata",
}
WRONG_LENGTH = "record with a wrong length"
CHAIN = 3  # records in a row that show that a place is not junk
NEVER_IN_CHUNKS = (r.CHUNK, r.MESSAGE_INDEX, r.DATA_END)


class Outer(NamedTuple):
    """A record that is no message nor its definition, and where it ends."""

    stop: int
    found: r.Record | Block | bytes | None = None


class Top:
    """Walks a file's outer records; odd and damaged places go to `notes`, and are stepped over."""

    def __init__(self, path: Path, data: memoryview, notes: Notes) -> None:
        self.path, self.data, self.notes, self.end = path, data, notes, len(data)
        self.contents = Contents([Part()])
        self.channels: set[int] = set()  # defined outside chunks in this part

    @property
    def part(self) -> Part:
        """The one that is being walked."""
        return self.contents.parts[self.number]

    @property
    def number(self) -> int:
        """Of the part that is being walked."""
        return len(self.contents.parts) - 1

    def walk(self) -> Contents:
        """Everything that can be found."""
        at, released = len(r.MAGIC), 0
        while at < self.end:
            begin, walked = at, walk_block(self.data, at, self.end, TOP, RUN_BYTES)
            outer = self._outer(walked.end)
            if outer is None:
                walked, at = self._step_over(begin, walked)
                self._keep(begin, walked)
            else:
                self._keep(begin, walked)
                at = self._take(walked.end, outer)
            if at - released > 64 << 20:
                release(self.data)
                released = at
        if not self.contents.ended and self.contents.cut is None:
            self.contents.cut = ("warning", "no end: the recording was not closed", self.end)
        return self.contents

    def _outer(self, at: int) -> Outer | None:
        """The chunk, footer, ... at this byte; None if there is no sound one."""
        if at == self.end:
            return Outer(at)
        if self.data[at : at + 8] == r.MAGIC:
            return Outer(at + 8, r.MAGIC)
        if self.end - at < HEAD.size:
            return None
        opcode, size = HEAD.unpack_from(self.data, at)
        if opcode == r.CHUNK:
            return self._chunk(at)
        stop = at + HEAD.size + size
        if opcode == 0 or stop > self.end:
            return None
        if opcode not in TOP:
            return Outer(at)  # the run before it was long enough
        try:
            return Outer(stop, parse(opcode, self.data[at + HEAD.size : stop]))
        except MalformedError:
            return None

    def _chunk(self, at: int) -> Outer | None:
        """The chunk at this byte, also where the file ends inside it or a length is wrong."""
        body = at + HEAD.size
        stop = body + HEAD.unpack_from(self.data, at)[1]
        if self.end - body < CHUNK_HEAD.size:
            return None
        first, last, size, crc, letters = CHUNK_HEAD.unpack_from(self.data, body)
        start = body + CHUNK_HEAD.size + letters + 8
        if letters > LONGEST_NAME or start > self.end:
            return None
        name = str(self.data[start - 8 - letters : start - 8], "utf-8", "backslashreplace")
        inner = start + int.from_bytes(self.data[start - 8 : start], "little")
        block = Block(at, start, inner, self.number, first, last)
        block.compression, block.size, block.crc = name, size, crc
        if inner <= stop <= self.end:
            return Outer(stop, block)
        if inner <= self.end and self._chain(inner):
            stop = inner
        elif stop <= self.end and self._chain(stop):
            block.stop = stop
        elif abs(stop - inner) <= LONGEST_NAME and name in KNOWN_COMPRESSIONS:
            block.cut, block.stop = True, self._resync(start, NEVER_IN_CHUNKS)
            return Outer(block.stop, block)
        else:
            return None
        self.notes.warn(self.path, WRONG_LENGTH, at=f"byte {at}")
        return Outer(stop, block)

    def _take(self, at: int, outer: Outer) -> int:
        """Keep what an outer record says; where the walk goes on."""
        found = outer.found
        if isinstance(found, Block):
            self.contents.blocks.append(found)
            if found.cut and found.stop == self.end:
                self.contents.cut = ("lost", "cut in a chunk", at)
        elif isinstance(found, r.Header):
            self.part.profile = found.profile
        elif isinstance(found, r.DataEnd):
            self.part.data_end = (at, found.data_section_crc)
        elif isinstance(found, r.Footer):
            return self._footer(outer.stop)
        elif found == r.MAGIC:
            self.notes.warn(self.path, "another file begins inside", at=f"byte {at}")
            self._begin_part(at)
        return outer.stop

    def _footer(self, at: int) -> int:
        """What follows a footer: the end magic, and nothing else in a sound file."""
        behind = self.data[at : at + 8]
        if behind == r.MAGIC:
            self.contents.ended = True
            at += 8
        else:
            self.contents.cut = ("warning", "no end magic behind the footer", at)
        if at == self.end or (not self.contents.ended and r.MAGIC.startswith(behind)):
            return self.end
        found = re.compile(re.escape(r.MAGIC)).search(self.data, at)
        begin = found.start() if found else self.end
        if begin > at:
            self.notes.warn(self.path, "bytes behind its end", at=f"byte {at}")
        if begin == self.end:
            return begin
        self.notes.warn(self.path, "another file is glued to its end", at=f"byte {begin}")
        self._begin_part(begin)
        return begin + len(r.MAGIC)

    def _begin_part(self, at: int) -> None:
        self.contents.parts.append(Part(at))
        self.channels = set()
        self.contents.ended, self.contents.cut = False, None

    def _keep(self, begin: int, walked: Walked) -> None:
        """Keep a run of messages, and note definitions, attachments and metadata around them."""
        if len(walked.messages):
            index = entries(self.data, walked.messages)
            found = channel_counts(index)
            self.part.counts += found
            first, last = int(index["time"].min()), int(index["time"].max())
            ids = frozenset(found)
            block = Block(begin, begin, walked.end, self.number, first, last, ids, run=True)
            self.contents.blocks.append(block)
        for opcode, start, stop in walked.others:
            if opcode in (r.SCHEMA, r.CHANNEL):
                self.contents.definitions.append((opcode, start, stop, self.number))
                if opcode == r.CHANNEL:
                    self.channels.add(int.from_bytes(self.data[start : start + 2], "little"))
            elif opcode == r.ATTACHMENT:
                self.contents.attachments.append((start, stop))
            elif opcode == r.METADATA:
                self.contents.metadata.append((start, stop))
            else:
                define(self.path, self.notes, self.part, opcode, self.data[start:stop], start)

    def _step_over(self, begin: int, walked: Walked) -> tuple[Walked, int]:
        """Find the next sound record; a last record with a wrong length is taken back."""
        at = walked.end
        starts = [*walked.messages[-1:], *(other[1] - HEAD.size for other in walked.others[-1:])]
        before = max(starts, default=at)
        resume = self._resync(before + 1)
        if resume == self.end:
            self.contents.cut = (*self._ending(at), at)
            return walked, resume
        problem = "bytes that are no records"
        if resume < at:
            at, problem = before, WRONG_LENGTH
            walked = walk_block(self.data, begin, at, TOP)
        kind: Kind = "warning" if self.part.data_end[0] else "lost"
        self.notes.add(kind, self.path, problem, at=f"byte {at}")
        if self.contents.damaged is None:
            self.contents.damaged = at
        return walked, resume

    def _ending(self, at: int) -> tuple[Kind, str]:
        """What the file ends in, where nothing readable follows."""
        opcode = self.data[at]
        if self.part.data_end[0] or opcode in HARMLESS:
            return "warning", "cut or damaged behind its messages"
        if opcode in CUT:
            return "lost", f"cut in {CUT[opcode]}"
        if opcode in LAYOUT or self.end - at < HEAD.size:
            return "warning", "cut between messages"
        return "lost", "ends in bytes that are no records"

    def _resync(self, at: int, opcodes: tuple[int, ...] = ()) -> int:
        """The next byte where sound records begin (of these opcodes, if given), or the end."""
        for tries, found in enumerate(CANDIDATE.finditer(self.data, at)):
            place = found.start()
            if tries == MOST_CANDIDATES:
                break
            if found[0] == r.MAGIC:
                return place
            if (not opcodes or self.data[place] in opcodes) and self._chain(place):
                return place
        return self.end

    def _chain(self, at: int) -> bool:
        """Whether some whole records follow each other here, or the file ends whole here."""
        for records in range(CHAIN):
            if at == self.end or self.data[at : at + 8] == r.MAGIC:
                return True
            if self.end - at < HEAD.size:
                return False
            opcode, size = HEAD.unpack_from(self.data, at)
            if opcode not in LAYOUT:
                return False
            if size > self.end - at - HEAD.size:
                return records > 0 and size < 1 << 40  # cut behind a sound record
            try:
                record = parse(opcode, self.data[at + HEAD.size : at + HEAD.size + size])
            except MalformedError:
                return False
            known = self.channels
            if isinstance(record, r.RawMessage) and known and record.channel_id not in known:
                return False
            at += HEAD.size + size
        return True
