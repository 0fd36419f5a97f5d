"""Messages of many blocks in the order of log time, with few blocks in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from formats.log import Message, Topic
from formats.mcap.blocks import Block, Entries, Loaded, load, loaded, release
from formats.mcap.records import Buffer

KEPT_BYTES = 128 << 20  # of decompressed chunks whose messages wait for their turn
PIECE_BYTES = 32 << 20  # of messages that are made ready at a time
PIECE = 4096
RELEASED = 64 << 20  # bytes of the file between two releases of its pages
NEVER = 1 << 64
new = tuple.__new__  # a Message in half the time


def merged(
    data: memoryview,
    blocks: Sequence[Block],
    index: Callable[[Block, Loaded], Entries],
    topics: Sequence[dict[int, Topic]],
    max_chunk: int,
) -> Iterator[Message]:
    """Messages sorted by log time, in the order of the file where equal.

    Blocks that follow each other in time pass straight through. Where they overlap, the index of
    their messages waits (26 bytes each) until no later block can come before; their data wait too,
    up to 128 MiB, beyond which chunks are opened again.

    Args:
        data: the whole file.
        blocks: sorted by (first_ns, at).
        index: the wanted messages of a loaded block.
        topics: of each channel, for each part.
        max_chunk: the most bytes that a chunk may decompress to.
    """
    waiting = _Waiting(data, blocks, topics, max_chunk)
    seen = 0
    following = [*(block.first_ns for block in blocks[1:]), NEVER]
    chunks = loaded(data, blocks, max_chunk)
    for number, (block, horizon) in enumerate(zip(blocks, following, strict=False)):
        chunk = next(chunks)
        found = index(block, chunk)
        times = found["time"]
        if not waiting and _sorted(times) and _before(times, horizon, block, blocks, number):
            yield from _messages(found, memoryview(chunk.data), topics[block.part])
        else:
            waiting.add(number, found, chunk.data)
            yield from waiting.until(horizon)
        del chunk, found, times  # before the next one is loaded, which may be large
        seen += block.stop - block.start
        if seen > RELEASED:
            release(data)
            seen = 0


Times = npt.NDArray[np.uint64]


def _sorted(times: Times) -> bool:
    return bool(np.all(times[:-1] <= times[1:]))


def _before(times: Times, horizon: int, block: Block, blocks: Sequence[Block], number: int) -> bool:
    """Whether no later block can come before the last of these times, or tie with it wrongly."""
    if not len(times) or times[-1] < horizon:
        return True
    return bool(times[-1] == horizon) and blocks[number + 1].at > block.at


def _messages(found: Entries, data: memoryview, topics: dict[int, Topic]) -> Iterator[Message]:
    for begin in range(0, len(found), PIECE):
        piece = found[begin : begin + PIECE]
        starts = piece["start"]
        named = map(topics.__getitem__, piece["channel"].tolist())
        fields = (field.tolist() for field in (piece["time"], starts, starts + piece["size"]))
        for topic, time, start, stop in zip(named, *fields, strict=True):
            yield new(Message, (topic, time, data[start:stop]))


class _Waiting:
    """Messages of overlapping blocks that wait until no later block can come before them."""

    def __init__(
        self,
        data: memoryview,
        blocks: Sequence[Block],
        topics: Sequence[dict[int, Topic]],
        max_chunk: int,
    ) -> None:
        self.file, self.blocks, self.topics, self.max_chunk = data, blocks, topics, max_chunk
        self.parts: list[Entries] = []
        self.earliest = NEVER
        self.kept: OrderedDict[int, Buffer] = OrderedDict()
        self.kept_bytes = 0

    def __bool__(self) -> bool:
        return bool(self.parts)

    def add(self, number: int, found: Entries, data: Buffer) -> None:
        """Let the messages of this block wait."""
        if len(found):
            found["block"] = number
            self.parts.append(found)
            self.earliest = min(self.earliest, int(found["time"].min()))
            self._keep(number, data)

    def until(self, horizon: int) -> Iterator[Message]:
        """The messages before this time, sorted."""
        if not self.parts or (self.earliest >= horizon and horizon != NEVER):
            return
        index = np.concatenate(self.parts) if len(self.parts) > 1 else self.parts[0]
        places = np.array([block.at for block in self.blocks], dtype=np.uint64)[index["block"]]
        index = index[np.lexsort((index["start"], places, index["time"]))]
        ready = len(index)
        if horizon != NEVER:
            ready = int(np.searchsorted(index["time"], np.uint64(horizon)))
        rest = index[ready:].copy()
        self.parts = [rest] if len(rest) else []
        self.earliest = int(rest["time"][0]) if len(rest) else NEVER
        yield from self._messages(index[:ready])
        self._forget()

    def _messages(self, index: Entries) -> Iterator[Message]:
        """These messages in their order, a piece at a time; each piece opens a chunk once."""
        begin = 0
        while begin < len(index):
            sizes = np.cumsum(index["size"][begin : begin + PIECE], dtype=np.uint64)
            count = max(1, int(np.searchsorted(sizes, np.uint64(PIECE_BYTES))))
            piece = index[begin : begin + count]
            begin += count
            bodies: list[Buffer] = [b""] * len(piece)
            numbers = np.unique(piece["block"]).tolist()
            # Views would keep more chunks in memory than may be kept.
            copy = sum(self._size(number) for number in numbers) > KEPT_BYTES
            for number in numbers:
                data = memoryview(self._data(number))
                for place in np.flatnonzero(piece["block"] == number).tolist():
                    start = int(piece["start"][place])
                    body = data[start : start + int(piece["size"][place])]
                    bodies[place] = body.tobytes() if copy else body
            fields = (piece["block"].tolist(), piece["channel"].tolist(), piece["time"].tolist())
            for number, channel, time, whole in zip(*fields, bodies, strict=True):
                topic = self.topics[self.blocks[number].part][channel]
                yield Message(topic, time, whole)

    def _size(self, number: int) -> int:
        block = self.blocks[number]
        return 0 if block.compression in ("", "none") else min(block.size, self.max_chunk)

    def _data(self, number: int) -> Buffer:
        if number not in self.kept:
            self._keep(number, load(self.file, self.blocks[number], self.max_chunk).data)
        self.kept.move_to_end(number)
        return self.kept[number]

    def _keep(self, number: int, data: Buffer) -> None:
        self.kept[number] = data
        self.kept_bytes += self._size(number)
        while self.kept_bytes > KEPT_BYTES and len(self.kept) > 1:
            oldest, _ = self.kept.popitem(last=False)
            self.kept_bytes -= self._size(oldest)

    def _forget(self) -> None:
        """Drop the data of blocks that have nothing left."""
        left = set(self.parts[0]["block"].tolist()) if self.parts else set()
        for number in [number for number in self.kept if number not in left]:
            del self.kept[number]
            self.kept_bytes -= self._size(number)
