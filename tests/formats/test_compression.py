from __future__ import annotations

import bz2
import errno
import gzip
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import pytest

from formats import compression
from formats.compression import inflate, open_stream, wrapper
from formats.errors import FormatError, Notes

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

PACK: dict[str, Callable[[bytes], bytes]] = {
    "zstd": lambda data: zstd.compress(data, options={zstd.CompressionParameter.checksum_flag: 1}),
    "lz4": lambda data: bytes(lz4.frame.compress(data, block_linked=False)),
    "bz2": bz2.compress,
    "gzip": gzip.compress,
}
CHUNK_KINDS = ["zstd", "lz4", "bz2"]
MIB = 1 << 20


def numbers(count: int) -> bytes:
    """Data that shrink by about half."""
    return np.random.default_rng(1).integers(0, 16, count, dtype=np.uint8).tobytes()


@pytest.mark.parametrize("kind", CHUNK_KINDS)
@pytest.mark.parametrize("size", [0, 1, 300_000])
def test_sound_data_come_back_whole(kind: str, size: int) -> None:
    data = numbers(size)
    packed = PACK[kind](data)
    assert inflate(kind, packed, size, MIB) == (data, True)
    assert inflate(kind, memoryview(packed), size, MIB) == (data, True)


@pytest.mark.parametrize("kind", ["", "none"])
def test_data_that_are_not_compressed(kind: str) -> None:
    assert inflate(kind, b"abc", 3, 10) == (b"abc", True)
    assert inflate(kind, b"abc", 4, 10) == (b"abc", False)
    assert inflate(kind, b"abc", 2, 10) == (b"ab", False)
    assert inflate(kind, b"abc", 3, 2) == (b"ab", False)


@pytest.mark.parametrize("kind", CHUNK_KINDS)
def test_a_size_that_lies_is_not_sound(kind: str) -> None:
    data = numbers(1000)
    packed = PACK[kind](data)
    assert inflate(kind, packed, 999, MIB) == (data[:999], False)
    assert inflate(kind, packed, 1001, MIB) == (data, False)
    assert inflate(kind, packed, 1000, 10) == (data[:10], False)


@pytest.mark.parametrize("kind", CHUNK_KINDS)
def test_cut_data_give_the_part_that_is_there(kind: str) -> None:
    data = numbers(3_000_000)
    packed = PACK[kind](data)
    found, sound = inflate(kind, packed[: len(packed) // 2], len(data), 10 * MIB)
    assert not sound
    assert data.startswith(found)
    # bz2 works in blocks of 900 kB, and one of them may be lost.
    assert len(found) > len(data) / 2 - 1_000_000


@pytest.mark.parametrize("kind", CHUNK_KINDS)
def test_damaged_data_give_what_comes_before_the_damage(kind: str) -> None:
    data = numbers(3_000_000)
    packed = bytearray(PACK[kind](data))
    middle = len(packed) // 2
    packed[middle : middle + 4096] = b"\xff" * 4096
    found, sound = inflate(kind, bytes(packed), len(data), 10 * MIB)
    assert not sound
    assert found[:500_000] == data[:500_000]


@pytest.mark.parametrize("kind", CHUNK_KINDS)
def test_nonsense_gives_nothing(kind: str) -> None:
    for junk in (b"", b"\0", b"nonsense" * 100):
        assert inflate(kind, junk, 100, MIB) == (b"", False)


@pytest.mark.parametrize("kind", CHUNK_KINDS)
def test_several_frames_in_a_row(kind: str) -> None:
    first, second = numbers(200_000), numbers(100_001)[1:]
    packed = PACK[kind](first) + PACK[kind](second)
    assert inflate(kind, packed, 300_000, MIB)[0] == first + second


@pytest.mark.parametrize("kind", CHUNK_KINDS)
@pytest.mark.parametrize("claim", [100, 2 * MIB, 1 << 40])
def test_a_bomb_stops_at_the_limit(kind: str, claim: int) -> None:
    bomb = PACK[kind](bytes(50 * MIB))
    tracemalloc.start()
    found, sound = inflate(kind, bomb, claim, MIB)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found) == min(claim, MIB)
    assert not sound
    assert peak < 6 * MIB


def test_unknown_compression_is_an_error() -> None:
    with pytest.raises(ValueError, match="brotli"):
        inflate("brotli", b"", 0, 0)


@pytest.mark.parametrize("kind", list(PACK))
def test_wrapped_file_is_unpacked_and_gone_on_close(kind: str, tmp_path: Path) -> None:
    data = numbers(2_500_000)
    path = tmp_path / "odd name"
    path.write_bytes(PACK[kind](data))
    assert wrapper(path.read_bytes()[:4]) == kind
    notes = Notes()
    with open_stream(path, notes) as stream:
        copy = Path(stream.name)
        assert stream.read() == data
        assert copy.read_bytes() == data
    assert not copy.exists()
    assert not list(notes)


@pytest.mark.parametrize("kind", list(PACK))
def test_cut_wrapped_file_gives_its_beginning_and_a_loss(kind: str, tmp_path: Path) -> None:
    data = numbers(3_000_000)
    packed = PACK[kind](data)
    path = tmp_path / "cut"
    path.write_bytes(packed[: len(packed) * 3 // 4])
    notes = Notes()
    with open_stream(path, notes) as stream:
        found = stream.read()
    assert data.startswith(found)
    assert len(found) > len(data) * 3 / 4 - 1_000_000
    assert notes.total("lost") == 1


@pytest.mark.parametrize("kind", list(PACK))
def test_damaged_wrapped_file_is_a_loss_wherever_the_damage_is(kind: str, tmp_path: Path) -> None:
    data = b"".join(b"%d\n" % (k * k) for k in range(2000))
    packed = PACK[kind](data)
    if kind == "lz4":  # without its checksum nothing can tell
        packed = bytes(lz4.frame.compress(data, content_checksum=True))
    path = tmp_path / "damaged"
    for at in range(4, len(packed), 7):
        path.write_bytes(packed[:at] + bytes([packed[at] ^ 0x5A]) + packed[at + 1 :])
        notes = Notes()
        with open_stream(path, notes) as file:
            found = file.read()
        assert notes.total("lost") or found == data


@pytest.mark.parametrize("kind", list(PACK))
def test_wrapped_bomb_stops_at_the_limit(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb"
    path.write_bytes(PACK[kind](bytes(50 * MIB)))
    notes = Notes()
    with open_stream(path, notes, limit=5 * MIB) as stream:
        assert len(stream.read()) <= 5 * MIB
    assert notes.total("lost") == 1


def test_full_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "log.mcap.gz"
    path.write_bytes(gzip.compress(b"abc"))
    monkeypatch.setattr(compression, "_unpack", full)
    with pytest.raises(FormatError, match=r"cannot be unpacked: No space left.*TMPDIR"):
        open_stream(path, Notes())


def test_other_files_are_not_wrapped(tmp_path: Path) -> None:
    path = tmp_path / "plain"
    path.write_bytes(b"\x89MCAP0\r\n")
    assert wrapper(b"\x89MCAP0\r\n") == ""
    with pytest.raises(FormatError, match="is not a zstd"):
        open_stream(path, Notes())
