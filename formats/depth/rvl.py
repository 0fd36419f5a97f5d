"""Depth images compressed by RVL, as image_transport's compressedDepth writes them on request.

Source: Wilson, "Fast Lossless Depth Image Compression", ISS 2017: runs of zeros, runs of others,
each of these as its zigzag difference to the one before; all numbers in nibbles of three bits, low
ones first, the fourth saying that more follow; eight nibbles a 32-bit word, high ones first.
Columns and rows stand before the words, 12 bytes (kind, A, B) before these.
"""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

from formats.jit import njit
from formats.messages import CompressedImage
from formats.payload import Undecodable

HEAD, SIZES = 12, struct.Struct("<II")
MOST_PIXELS = 1 << 25


def check_rvl(message: CompressedImage) -> tuple[int, int]:
    """Rows and columns; nothing is decoded yet.

    Raises:
        Undecodable: too short, or of too many pixels.
    """
    data = message.data
    if len(data) < HEAD + SIZES.size:
        raise Undecodable("cut short", f"{len(data)} bytes of an RVL image")
    columns, rows = SIZES.unpack(data[HEAD : HEAD + SIZES.size].tobytes())
    if rows * columns > MOST_PIXELS:
        raise Undecodable("RVL image of too many pixels", f"{columns} x {rows}")
    return rows, columns


def rvl_pixels(message: CompressedImage) -> tuple[bytes, npt.NDArray[np.uint16]]:
    """What stands before the image, and its (rows, columns) whole numbers.

    Raises:
        Undecodable: as check_rvl, or the runs do not fill the image.
    """
    shape = check_rvl(message)
    packed = message.data[HEAD + SIZES.size :].tobytes()
    words = np.frombuffer(packed + bytes(-len(packed) % 4), dtype="<u4").astype(np.uint32)
    found = np.zeros(shape[0] * shape[1], dtype=np.uint16)
    if not unpack(words, found):
        raise Undecodable("damaged RVL image")
    return message.data[:HEAD].tobytes(), found.reshape(shape)


@njit
def number(words: npt.NDArray[np.uint32], at: int) -> tuple[int, int]:
    """The number at a nibble, and the nibble behind it; -1 where there is no whole one."""
    found = 0
    for shift in range(0, 30, 3):
        if at >= 8 * len(words):
            break
        nibble = (words[at >> 3] >> np.uint32(28 - 4 * (at & 7))) & np.uint32(15)
        found |= int(nibble & np.uint32(7)) << shift
        at += 1
        if nibble < 8:
            return found, at
    return 0, -1


@njit
def unpack(words: npt.NDArray[np.uint32], found: npt.NDArray[np.uint16]) -> bool:
    """Fill in `found`, all 0 before; whether the runs are as long as it is.

    Args:
        words: eight nibbles each.
        found: (n,) pixels.
    """
    at, filled, pixel = 0, 0, 0
    while filled < len(found):
        zeros, at = number(words, at)
        if at < 0 or zeros > len(found) - filled:
            return False
        filled += zeros
        others, at = number(words, at)
        if at < 0 or others > len(found) - filled:
            return False
        for _ in range(others):
            zigzag, at = number(words, at)
            if at < 0:
                return False
            pixel += (zigzag >> 1) ^ -(zigzag & 1)
            found[filled] = pixel & 0xFFFF
            filled += 1
    return True
