"""The outer records of an MCAP file, whole, cut or damaged: where chunks and all else lie."""

from __future__ import annotations

import re

from formats import mcap_records as r
from formats.errors import Kind, Notes, Path
from formats.mcap_blocks import (
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
from formats.mcap_contents import NAMES, Contents, Part, define
from formats.mcap_parse import HEAD, LAYOUT, MalformedError, parse

KNOWN_COMPRESSIONS = ("", "none", "zstd", "lz4", "bz2")
LONGEST_NAME = 64  # of a compression
# Where a record may begin: a known opcode and a length below 2^40, or the start of a file.
CANDIDATE = re.compile(rb"[\x03-\x0f](?=[\s\S]{5}\x00{3})|\x89MCAP0\r\n")
MOST_CANDIDATES = 300_000
CHAIN = 3  # records in a row that show that a place is not junk
NEVER_IN_CHUNKS = (r.CHUNK, r.MESSAGE_INDEX, r.DATA_END)


class Top:
    """Walks a file's outer records; odd and damaged places go to `notes`, and are stepped over."""

    def __init__(self, path: Path, data: memoryview, notes: Notes) -> None:
        self.path, self.data, self.notes, self.end = path, data, notes, len(data)
        self.contents = Contents([Part()])

    @property
    def part(self) -> Part:
        """The one that is being walked."""
        return self.contents.parts[-1]

    def walk(self) -> Contents:
        """Everything that can be found."""
        at, released = len(r.MAGIC), 0
        while at < self.end:
            walked = walk_block(self.data, at, self.end, TOP, RUN_BYTES)
            begin, at = at, walked.end
            after = self._outer(at) if at < self.end else at
            if after is None:
                walked, after = self._step_over(begin, walked)
            self._keep(begin, walked)
            at = after
            if at - released > 64 << 20:
                release(self.data)
                released = at
        if not self.contents.ended and self.contents.cut is None:
            self.contents.cut = ("warning", "no end: the recording was not closed", self.end)
        return self.contents

    def _outer(self, at: int) -> int | None:
        """Keep the chunk, footer, ... at this byte; where it ends, or None if it is damaged."""
        if self.data[at : at + 8] == r.MAGIC:
            self.notes.warn(self.path, "another file begins inside", at=f"byte {at}")
            return self._begin_part(at)
        if self.end - at < HEAD.size:
            return None
        opcode, size = HEAD.unpack_from(self.data, at)
        if opcode == r.CHUNK:
            return self._chunk(at)
        stop = at + HEAD.size + size
        if opcode not in TOP:
            # A run may have ended because it was long enough.
            return at if opcode > 0 and stop <= self.end else None
        if stop > self.end:
            return None
        try:
            record = parse(opcode, self.data[at + HEAD.size : stop])
        except MalformedError:
            return None
        if isinstance(record, r.Header):
            self.part.profile = record.profile
        elif isinstance(record, r.DataEnd):
            self.part.data_end = (at, record.data_section_crc)
        else:
            return self._footer(stop)
        return stop

    def _footer(self, at: int) -> int:
        """What follows a footer: the end magic, and nothing else in a sound file."""
        self.contents.ended = self.data[at : at + 8] == r.MAGIC
        if not self.contents.ended:
            missing = "no end magic behind the footer"
            self.contents.cut = ("warning", missing, at)
            return self._next_part(at)
        return at + 8 if at + 8 == self.end else self._next_part(at + 8)

    def _next_part(self, at: int) -> int:
        """Pass over junk behind a file's end to the next file that is glued to it, if any."""
        found = re.compile(re.escape(r.MAGIC)).search(self.data, at)
        begin = found.start() if found else self.end
        if begin > at:
            self.notes.warn(self.path, f"{begin - at} bytes behind its end", at=f"byte {at}")
        if begin == self.end:
            return begin
        self.notes.warn(self.path, "another file is glued to its end", at=f"byte {begin}")
        return self._begin_part(begin)

    def _begin_part(self, at: int) -> int:
        self.contents.parts.append(Part(at))
        self.contents.ended, self.contents.cut = False, None
        return at + len(r.MAGIC)

    def _chunk(self, at: int) -> int | None:
        """Keep the chunk at this byte, also where the file ends inside it or a length is wrong."""
        body = at + HEAD.size
        stop = body + HEAD.unpack_from(self.data, at)[1]
        if self.end - body < CHUNK_HEAD.size:
            return self._cut("lost", "cut in a chunk", at)
        first, last, size, crc, letters = CHUNK_HEAD.unpack_from(self.data, body)
        if letters > LONGEST_NAME:
            return None
        start = body + CHUNK_HEAD.size + letters + 8
        if start > self.end:
            return self._cut("lost", "cut in a chunk", at)
        name = bytes(self.data[start - 8 - letters : start - 8])
        inner = start + int.from_bytes(self.data[start - 8 : start], "little")
        cut = False
        if inner > stop or stop > self.end:
            if inner <= self.end and self._chain(inner):
                stop = inner
            elif stop <= self.end and self._chain(stop):
                inner = stop
            elif abs(stop - inner) <= LONGEST_NAME and name.decode("latin-1") in KNOWN_COMPRESSIONS:
                cut, inner = True, self._resync(start, NEVER_IN_CHUNKS)
                stop = inner
                if stop == self.end:
                    self._cut("lost", "cut in a chunk", at)
            else:
                return None
        compression = str(name, "utf-8", "backslashreplace")
        block = Block(at, start, inner, len(self.contents.parts) - 1, first, last, None)
        block.compression, block.size, block.crc, block.cut = compression, size, crc, cut
        self.contents.blocks.append(block)
        return stop

    def _cut(self, kind: Kind, problem: str, at: int) -> int:
        self.contents.cut = (kind, problem, at)
        return self.end

    def _keep(self, begin: int, walked: Walked) -> None:
        """Keep a run of messages, and note definitions, attachments and metadata around them."""
        if len(walked.messages):
            index = entries(self.data, walked.messages)
            found = channel_counts(index)
            self.part.counts += found
            first, last = int(index["time"].min()), int(index["time"].max())
            number = len(self.contents.parts) - 1
            block = Block(begin, begin, walked.end, number, first, last, frozenset(found), run=True)
            self.contents.blocks.append(block)
        for opcode, start, stop in walked.others:
            if opcode == r.ATTACHMENT:
                self.contents.attachments.append((start, stop))
            elif opcode == r.METADATA:
                self.contents.metadata.append((start, stop))
            else:
                define(self.path, self.notes, self.part, opcode, self.data[start:stop], start)

    def _step_over(self, begin: int, walked: Walked) -> tuple[Walked, int]:
        """Find the next sound record; a last record with a wrong length is taken back."""
        kind: Kind = "warning" if self.part.data_end[0] else "lost"
        at = walked.end
        starts = [*walked.messages[-1:], *(other[1] - HEAD.size for other in walked.others[-1:])]
        resume = self._resync(max(starts, default=at) + 1)
        if self.contents.damaged is None and resume < self.end:
            self.contents.damaged = at
        if resume < at:
            walked = walk_block(self.data, begin, max(starts), TOP)
            at = max(starts)
            self.notes.add(kind, self.path, "record with a wrong length", at=f"byte {at}")
        elif resume < self.end:
            problem = f"{resume - at} bytes that are no records"
            self.notes.add(kind, self.path, problem, at=f"byte {at}")
        else:
            self._end_at(at)
        return walked, resume

    def _end_at(self, at: int) -> None:
        """Say what the file ends in, where nothing readable follows."""
        opcode = self.data[at]
        if self.part.data_end[0] or opcode in (r.CHUNK_INDEX, r.STATISTICS, r.SUMMARY_OFFSET):
            self._cut("warning", "cut or damaged in its summary; no messages are missing", at)
        elif opcode in (r.MESSAGE, r.ATTACHMENT, r.METADATA):
            self._cut("lost", f"cut in {NAMES[opcode]}", at)
        elif opcode in LAYOUT or self.end - at < HEAD.size:
            self._cut("warning", "cut between messages", at)
        else:
            self._cut("lost", f"{self.end - at} bytes at its end that are no records", at)

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
            known = self.part.channels
            if isinstance(record, r.RawMessage) and known and record.channel_id not in known:
                return False
            at += HEAD.size + size
        return True
