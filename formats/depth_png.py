"""Depth images that were compressed: PNG, as image_transport's compressedDepth writes it.

Source: ros-perception/image_transport_plugins, compressed_depth_image_transport: 12 bytes (kind,
A, B) stand before the PNG; of 32FC1 it holds A / depth + B as whole numbers, 0 where there is none.
"""

from __future__ import annotations

import struct
import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import printable
from formats.messages import CompressedImage, Image
from formats.picture_header import Header, PictureError, read_png
from formats.ros_wire import Undecodable

MAGIC = b"\x89PNG\r\n\x1a\n"
MOST_PIXELS = 1 << 25


def depth_image(message: CompressedImage) -> Image:
    """The depth image in a compressed one: 16UC1 in mm, 32FC1 in m.

    Raises:
        Undecodable: there is no whole PNG of 16 bits in it, or one of too many pixels.
    """
    head, png, header = check_png(message)
    import cv2

    found: Any = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if found is None or found.dtype != np.uint16 or found.shape != (header.height, header.width):
        raise Undecodable("damaged PNG")
    encoding = message.format.partition(";")[0].strip()
    if encoding == "32FC1":
        found = metres(found, head)
    elif encoding != "mono16":
        encoding = "16UC1"
    height, width = found.shape
    step = width * found.itemsize
    big = sys.byteorder == "big"
    content = np.ascontiguousarray(found).view(np.uint8).ravel()
    return Image(message.stamp_ns, message.frame, height, width, encoding, big, step, content)


def check_png(message: CompressedImage) -> tuple[bytes, bytes, Header]:
    """What stands before the PNG, the PNG, and its header; nothing is decoded yet.

    Raises:
        Undecodable: as for depth_image, but for pixels that are damaged under sound checksums.
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


def metres(found: npt.NDArray[np.uint16], head: bytes) -> npt.NDArray[np.float32]:
    """Depths in m from whole numbers of inverse depth; head: what stands before the PNG."""
    if len(head) < 12:
        raise Undecodable("compressed depth without its scale")
    _, a, b = struct.unpack("<iff", head[-12:])
    with np.errstate(all="ignore"):
        depth = np.float32(a) / (found.astype(np.float32) - np.float32(b))
    return np.where(found == 0, np.float32(np.nan), depth)
