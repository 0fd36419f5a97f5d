"""Memory that is filled again and again, since fresh pages cost as much as what fills them."""

from __future__ import annotations

from threading import Lock

KEPT = 8  # buffers; more than are filled ahead, and few enough to look through


class Buffers:
    """Buffers, each of which is given out again once no view on it is left.

    Several threads may ask at once.
    """

    def __init__(self) -> None:
        self._kept: list[bytearray] = []
        self._lock = Lock()

    def take(self, size: int) -> memoryview:
        """Writable memory of `size` bytes that hold anything, its owner's until all views go."""
        with self._lock:
            for place, buffer in enumerate(self._kept):
                if not _seen(buffer):
                    if len(buffer) < size:
                        buffer = self._kept[place] = _roomy(size)
                    return memoryview(buffer)[:size]
            buffer = _roomy(size)
            if len(self._kept) < KEPT:
                self._kept.append(buffer)
            return memoryview(buffer)[:size]


def _roomy(size: int) -> bytearray:
    """Chunks are of nearly one size: the next one may be a little larger."""
    return bytearray(size + size // 8)


def _seen(buffer: bytearray) -> bool:
    """Whether a view on it is left: such a bytearray cannot change its size."""
    try:
        buffer.append(0)
    except BufferError:
        return True
    buffer.pop()
    return False
