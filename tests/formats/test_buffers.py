"""Memory is given out again when nobody looks at it, and never before."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from formats.buffers import KEPT, Buffers
from formats.compression import inflate, zstd
from formats.errors import Notes
from formats.mcap import log as mcap_log


def test_memory_is_used_again_once_the_last_view_goes() -> None:
    buffers = Buffers()
    first = buffers.take(1000)
    memory = first.obj
    part, array = first[10:20].toreadonly(), np.frombuffer(first, np.uint8, 4, 100)
    del first
    other = buffers.take(1000)
    assert other.obj is not memory
    del part
    third = buffers.take(1000)
    assert third.obj is not memory
    assert third.obj is not other.obj
    del array
    assert buffers.take(900).obj is memory


def test_more_than_is_kept_and_larger_ones_are_fresh_memory() -> None:
    buffers = Buffers()
    views = [buffers.take(100) for _ in range(3 * KEPT)]
    for number, view in enumerate(views):
        view[:] = bytes([number] * 100)
    large = buffers.take(10_000)
    large[:] = bytes(10_000)
    assert [view[0] for view in views] == list(range(3 * KEPT))
    assert all(bytes(view) == bytes([view[0]] * 100) for view in views)


def test_threads_never_share_memory() -> None:
    buffers = Buffers()

    def work(number: int) -> bool:
        view = buffers.take(5000)
        view[:] = bytes([number % 256]) * 5000
        return bytes(view) == bytes([number % 256]) * 5000

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(2000)))


@pytest.mark.parametrize("stated", [True, False])
def test_a_frame_comes_out_in_the_memory_given(stated: bool) -> None:
    """Whether the frame states its size (one call of ZSTD_compress) or not (a stream)."""
    data = np.random.default_rng(1).integers(0, 16, 300_000, dtype=np.uint8).tobytes()
    machine = zstd.ZstdCompressor()
    packed = zstd.compress(data) if stated else machine.compress(data) + machine.flush()
    assert (zstd.get_frame_info(packed).decompressed_size is not None) == stated
    found, sound = inflate("zstd", packed, len(data), 1 << 20, Buffers())
    assert sound
    assert isinstance(found, memoryview)
    assert found.readonly
    assert found == data


@pytest.mark.parametrize("cut", [1, 1000, 100_000])
def test_damage_is_seen_as_without_the_memory(cut: int) -> None:
    data = np.random.default_rng(1).integers(0, 16, 300_000, dtype=np.uint8).tobytes()
    packed = zstd.compress(data)
    flipped = packed[: len(packed) // 2] + bytes(4) + packed[len(packed) // 2 + 4 :]
    for bad in (packed[:-cut], flipped, b"", packed[4:]):
        assert inflate("zstd", bad, len(data), 1 << 20, Buffers()) == inflate(
            "zstd", bad, len(data), 1 << 20
        )
    for size in (len(data) - 1, len(data) + 1):
        for limit in (1000, 1 << 20):
            assert inflate("zstd", packed, size, limit, Buffers()) == inflate(
                "zstd", packed, size, limit
            )


def test_messages_that_are_kept_stay_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    bodies = [number.to_bytes(4, "little") * 500 for number in range(3000)]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 16, compression=CompressionType.ZSTD)
        writer.start()
        channel = writer.register_channel("/a", "x", 0)
        for number, body in enumerate(bodies):
            writer.add_message(channel, number, body, number)
        writer.finish()
    log = mcap_log.open_file(path, Notes())
    assert [bytes(message.data) for message in list(log.messages())] == bodies
    every_tenth = [message for k, message in enumerate(log.messages()) if k % 10 == 0]
    assert [bytes(message.data) for message in every_tenth] == bodies[::10]
    log.close()
