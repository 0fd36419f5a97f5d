"""Bounded decompression: never more than asked for, whatever the compressed data claim."""

from __future__ import annotations

import bz2
import gzip
import sys
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, cast

import lz4.frame
import zstandard

from formats.buffers import Buffers
from formats.errors import FormatError, Notes

try:
    # Ten times as fast as zlib's, which would cost as much as all else in reading a plain chunk.
    from isal.isal_zlib import crc32  # type: ignore[import-not-found,unused-ignore]
except ImportError:
    from zlib import crc32

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

__all__ = ["DAMAGE", "DECOMPRESSORS", "crc32", "inflate", "open_stream", "wrapper", "zstd"]

STEP = 16_384
PIECE = 1 << 20
# A file of a few kB that unpacks to more than this is a bomb; real logs shrink 2 to 50 times.
LEAST_LIMIT = 1 << 30
LARGEST_RATIO = 200

# Each object has decompress(data, max_length), eof, needs_input and unused_data.
DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    "zstd": zstd.ZstdDecompressor,
    "lz4": lz4.frame.LZ4FrameDecompressor,
    "bz2": bz2.BZ2Decompressor,
}
# What the libraries raise on damaged data, as seen under random damage.
DAMAGE = (zstd.ZstdError, zlib.error, RuntimeError, OSError, EOFError, ValueError, MemoryError)

WRAPPERS: dict[bytes, tuple[str, Callable[..., Any]]] = {
    b"\x28\xb5\x2f\xfd": ("zstd", zstd.open),
    b"\x04\x22\x4d\x18": ("lz4", lz4.frame.open),
    b"BZh": ("bz2", bz2.open),
    b"\x1f\x8b": ("gzip", gzip.open),
}


def inflate(
    kind: str,
    data: bytes | memoryview,
    size: int,
    limit: int,
    buffers: Buffers | None = None,
) -> tuple[bytes | memoryview, bool]:
    """Decompress one chunk: what could be had of it, and whether it was all sound.

    Args:
        kind: "zstd", "lz4" (frames), "bz2", or "" / "none".
        data: the compressed bytes, perhaps cut or damaged.
        size: how many bytes they claim to hold; nothing is allocated by this number alone.
        limit: the most bytes to make.
        buffers: memory for what comes out, where that is sound and of one zstd frame.

    Returns:
        At most min(size, limit) bytes, and True where these are exactly `size` bytes without error.

    Raises:
        ValueError: the compression is not known.
    """
    want = min(size, limit)
    if kind in ("", "none"):
        return bytes(data[:want]), len(data) == size <= limit
    if kind not in DECOMPRESSORS:
        raise ValueError(f"unknown compression {kind!r}")
    if kind == "zstd" and buffers is not None and size <= limit:
        into = buffers.take(size + 1)
        if _whole(data, into) == size:
            return into[:size].toreadonly(), True
        del into
    machine = DECOMPRESSORS[kind]()
    try:
        # One byte more than wanted shows data that hold more than they claim.
        found = machine.decompress(data, want + 1)
    except DAMAGE:
        return _in_steps(kind, data, want)[:want], False
    if machine.eof and len(found) < want and machine.unused_data:
        found = _in_steps(kind, data, want + 1)  # several frames in a row
    if len(found) > want:
        return found[:want], False
    return found, bool(machine.eof) and len(found) == size


def _whole(data: bytes | memoryview, into: memoryview) -> int:
    """Bytes of one zstd frame put into memory in one call, -1 where it is damaged.

    All other ways take the interpreter's lock for each 32 kB or more, and wait for it as long as
    another thread computes.
    """
    try:
        return int(zstandard.ZstdDecompressor().stream_reader(data).readinto(into))
    except (zstandard.ZstdError, MemoryError):
        return -1


def _in_steps(kind: str, data: bytes | memoryview, want: int) -> bytes:
    """What comes out before the damage, over any number of frames, at most `want` bytes."""
    found = bytearray()
    machine = DECOMPRESSORS[kind]()
    try:
        for start in range(0, len(data), STEP):
            block = bytes(data[start : start + STEP])
            while block and len(found) < want:
                found += machine.decompress(block, want - len(found))
                block = b""
                if machine.eof:
                    block = machine.unused_data or b""
                    machine = DECOMPRESSORS[kind]()
    except DAMAGE:
        pass
    return bytes(found)


def wrapper(head: bytes) -> str:
    """The compression that the first bytes of a file speak of: "zstd", "lz4", "bz2", "gzip", ""."""
    return next((name for magic, (name, _) in WRAPPERS.items() if head.startswith(magic)), "")


def open_stream(path: Path, notes: Notes, limit: int | None = None) -> IO[bytes]:
    """A wrapped file (.mcap.zst, .gz, .bz2, .lz4) unpacked to a temporary file, gone on close.

    The temporary file has a `name` and lies in the system's temporary folder. A cut or damaged
    file gives what comes before the damage, and `notes` a loss.

    Args:
        path: a file whose `wrapper` is not "".
        notes: where losses are counted.
        limit: the most bytes to unpack; default 1 GiB or 200 times the file, whichever is more.

    Raises:
        FormatError: not a wrapped file, or the temporary folder is too small.
    """
    with path.open("rb") as file:
        head = file.read(4)
    opener = next((call for magic, (_, call) in WRAPPERS.items() if head.startswith(magic)), None)
    if opener is None:
        raise FormatError(path, "is not a zstd, lz4, bz2 or gzip file")
    limit = limit or max(LEAST_LIMIT, LARGEST_RATIO * path.stat().st_size)
    temporary = cast("IO[bytes]", tempfile.NamedTemporaryFile(prefix="replay-"))  # noqa: SIM115
    try:
        _unpack(opener, path, temporary, limit, notes)
        temporary.flush()
        temporary.seek(0)
    except OSError as error:
        temporary.close()
        where = tempfile.gettempdir()
        hint = f"free space in {where} or set TMPDIR"
        raise FormatError(path, f"cannot be unpacked: {error.strerror}", hint=hint) from error
    except BaseException:
        temporary.close()
        raise
    return temporary


def _unpack(
    opener: Callable[..., Any], path: Path, target: IO[bytes], limit: int, notes: Notes
) -> None:
    size = 0
    with opener(path, "rb") as packed:
        while True:
            try:
                piece = packed.read1(PIECE)
            except DAMAGE:
                notes.lose(path, "compressed file is cut or damaged", at=f"unpacked byte {size}")
                return
            if not piece:
                return
            if size + len(piece) > limit:
                notes.lose(path, f"unpacks to more than {limit} bytes; the rest is left out")
                return
            target.write(piece)
            size += len(piece)
