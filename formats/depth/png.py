"""Depth images as PNG, in a compressedDepth message or as they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import printable
from formats.messages import CompressedImage
from formats.payload import Undecodable
from formats.picture_header import Header, PictureError, read_png

MAGIC = b"\x89PNG\r\n\x1a\n"
MOST_PIXELS = 1 << 25


def png_pixels(message: CompressedImage) -> tuple[bytes, npt.NDArray[np.uint16]]:
    """What stands before the PNG, and its (rows, columns) whole numbers.

    Raises:
        Undecodable: there is no whole PNG of 16 bits in it, or one of too many pixels.
    """
    head, png, header = check_png(message)
    import cv2

    found: Any = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if found is None or found.dtype != np.uint16 or found.shape != (header.height, header.width):
        raise Undecodable("damaged PNG")
    return head, np.asarray(found, dtype=np.uint16)


def check_png(message: CompressedImage) -> tuple[bytes, bytes, Header]:
    """What stands before the PNG, the PNG, and its header; nothing is decoded yet.

    Raises:
        Undecodable: as for png_pixels, but for pixels that are damaged under sound checksums.
    """
    data = message.data.tobytes()
    at = data.find(MAGIC)
    if at < 0:
        raise Undecodable("no PNG in the compressed image", printable(message.format, 40))
    png = data[at:]
    try:
        header = read_png(png)
    except PictureError as error:
        raise Undecodable("damaged PNG", error.problem) from None
    if header.width * header.height > MOST_PIXELS:
        size = f"{header.width} x {header.height}"
        raise Undecodable("PNG of too many pixels", size)
    if (header.depth, header.channels) != (16, 1):
        raise Undecodable("PNG that is no depth", f"{header.channels} x {header.depth} bits")
    return data[:at], png, header
