"""How ROS lays out a message's body: ROS 1, CDR and plain CDR 2, read within bounds."""

from __future__ import annotations

from functools import lru_cache
from struct import Struct
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.payload import MOST_ITEMS, SECOND, OddStamp, Payload, Undecodable, cut, plain_text

SIZES = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "f": 4, "q": 8, "Q": 8, "d": 8}


def ended_text(raw: bytes) -> str:
    """CDR text, whose last byte is a NUL."""
    return plain_text(raw[:-1] if raw[-1:] == b"\0" else raw)


class Wire:
    """One encoding: byte order, where the body starts, how far items are aligned.

    Args:
        order: "<" or ">".
        widest: bytes, the largest alignment: 8 in CDR, 4 in CDR 2; 1, no padding, in ROS 1.
    """

    def __init__(self, order: str, widest: int) -> None:
        self.order, self.widest, self.ros1 = order, widest, widest == 1
        self.start = 0 if self.ros1 else 4  # alignment counts from behind the encapsulation
        self.slack = 0 if self.ros1 else 3  # RTPS pads a payload to whole 4 bytes
        self.long_text = plain_text if self.ros1 else ended_text
        self.short_text = lru_cache(1024)(self.long_text)  # frame ids repeat
        self.layouts: dict[str, tuple[Struct, int, int]] = {}
        self.native = np.dtype(order + "f4").isnative

    def layout(self, items: str) -> tuple[Struct, int, int]:
        """The compiled items of one size ("7f"), their bytes together, their alignment's mask."""
        made = Struct(self.order + items)
        found = made, made.size, min(SIZES[items[-1]], self.widest) - 1
        self.layouts[items] = found
        return found

    def text(self, raw: bytes) -> str:
        """The text in a string's bytes."""
        return self.short_text(raw) if len(raw) < 256 else self.long_text(raw)


class Body:
    """A place in a payload that moves on as items are read."""

    __slots__ = ("at", "data", "wire")

    def __init__(self, wire: Wire, data: Payload, at: int | None = None) -> None:
        self.wire, self.data = wire, data
        self.at = wire.start if at is None else at

    def read(self, items: str) -> tuple[Any, ...]:
        """Numbers of one size, as `struct` names them: "7f"."""
        wire = self.wire
        made, size, mask = wire.layouts.get(items) or wire.layout(items)
        at = self.at + ((wire.start - self.at) & mask)
        self.at = at + size
        return made.unpack_from(self.data, at)

    def header(self) -> tuple[int, str]:
        """std_msgs/Header: stamp in ns and frame_id."""
        if self.wire.ros1:
            self.read("I")
        return self.stamp(), self.text()

    def stamp(self) -> int:
        """A time in ns."""
        sec, nanosec = *self.read("I" if self.wire.ros1 else "i"), *self.read("I")
        stamp: int = sec * SECOND + nanosec
        return OddStamp(stamp) if nanosec >= SECOND else stamp

    def text(self) -> str:
        """A string."""
        (length,) = self.read("I")
        at, self.at = self.at, self.at + length
        if self.at > len(self.data):
            raise cut(len(self.data), self.at, "characters")
        return self.wire.text(bytes(self.data[at : self.at]))

    def count(self, what: str, most: int = MOST_ITEMS) -> int:
        """How many structures follow; at least 4 bytes each, and not absurdly many."""
        if self.wire.widest == 4:  # CDR 2 says their size in bytes first
            self.read("I")
        (count,) = self.read("I")
        if self.at + 4 * count > len(self.data):
            raise cut(len(self.data), self.at + 4 * count, what)
        if count > most:
            raise Undecodable(f"impossible number of {what}", f"{count}")
        return int(count)

    def array(self, kind: str, what: str, count: int | None = None) -> npt.NDArray[Any]:
        """An array ("f4"): `count` items, or as many as the number in front of them says."""
        if count is None:
            (count,) = self.read("I")
        dtype = np.dtype(self.wire.order + kind)
        if count:  # CDR aligns items, not the empty place of none
            self.at += (self.wire.start - self.at) & (min(dtype.itemsize, self.wire.widest) - 1)
        at, self.at = self.at, self.at + count * dtype.itemsize
        if self.at > len(self.data):
            raise cut(len(self.data), self.at, what)
        found = np.frombuffer(self.data, dtype, count, at)
        return found if dtype.isnative else found.astype(dtype.newbyteorder("="))

    def end(self) -> None:
        """Nothing but padding may follow: more means that the fields were not these."""
        if len(self.data) > self.at + self.wire.slack:
            sizes = f"{len(self.data)} bytes instead of {self.at}"
            raise Undecodable("longer than its type", sizes)
