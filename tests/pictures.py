"""Pictures made by hand for tests: PNG, PGM and TIFF from bytes, without any picture library."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGBA: 4}
Array = npt.NDArray[np.integer]


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png(pixels: Array, colour: int = GREY, depth: int = 8, extra: bytes = b"") -> bytes:
    """A PNG of (H, W) or (H, W, channels) pixels of 8 or 16 bits; `extra` chunks before IDAT."""
    height, width = pixels.shape[:2]
    rows = pixels.astype(">u2" if depth == 16 else "u1").reshape(height, -1)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    body = extra + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + body


def png_claiming(width: int, height: int, colour: int = GREY, depth: int = 8) -> bytes:
    """A bomb: the right number of zero rows, squeezed."""
    bits = CHANNELS[colour] * depth
    packer = zlib.compressobj(9)
    row = bytes(1 + (width * bits + 7) // 8)
    data = b"".join(packer.compress(row) for _ in range(height)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    body = chunk(b"IDAT", data) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + body


def pgm(pixels: Array, full: int = 255) -> bytes:
    """A raw PGM."""
    data = pixels.astype(">u2" if full > 255 else "u1").tobytes()
    return b"P5\n# by hand\n%d %d\n%d\n" % (pixels.shape[1], pixels.shape[0], full) + data


def exif(turn: int) -> bytes:
    """A TIFF header with the orientation alone, big-endian."""
    entry = struct.pack(">HHIHH", 274, 3, 1, turn, 0)
    return b"MM\0*" + struct.pack(">IH", 8, 1) + entry + bytes(4)


def jpeg_turned(jpeg: bytes, turn: int) -> bytes:
    """A JPEG with an EXIF segment that asks for a turn."""
    body = b"Exif\0\0" + exif(turn)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:]


def tiff(pixels: Array, bits: int = 8, *, order: str = "<", black: int = 1, turn: int = 1) -> bytes:
    """An uncompressed grey TIFF in one strip; black: 1, or 0 where 0 stands for white."""
    height, width = pixels.shape
    data = pixels.astype(f"{order}u{bits // 8}").tobytes()
    tags: list[tuple[int, str, int]] = [
        (256, "I", width), (257, "I", height), (258, "H", bits), (259, "H", 1), (262, "H", black),
        (273, "I", 8 + 2 + 11 * 12 + 4), (274, "H", turn), (277, "H", 1), (278, "I", height),
        (279, "I", len(data)), (284, "H", 1),
    ]  # fmt: skip
    entries = b""
    for tag, kind, value in tags:
        packed = struct.pack(order + kind, value).ljust(4, b"\0")
        entries += struct.pack(f"{order}HHI", tag, 3 if kind == "H" else 4, 1) + packed
    magic = b"II*\0" if order == "<" else b"MM\0*"
    return magic + struct.pack(f"{order}IH", 8, len(tags)) + entries + bytes(4) + data


def drawn(rows: Sequence[str], greys: dict[str, int]) -> npt.NDArray[np.uint8]:
    """A picture from text, one character a pixel, the first line on top."""
    return np.array([[greys[c] for c in row] for row in rows], dtype=np.uint8)
