"""Depth images that were compressed: PNG or RVL, as image_transport's compressedDepth writes them.

Source: ros-perception/image_transport_plugins, compressed_depth_image_transport: 12 bytes (kind,
A, B) stand before the picture; of 32FC1 it holds A / depth + B as whole numbers, 0 where there is
none.
"""

from __future__ import annotations

import struct
import sys

import numpy as np
import numpy.typing as npt

from formats.depth.png import check_png, png_pixels
from formats.depth.rvl import check_rvl, rvl_pixels
from formats.messages import CompressedImage, Image
from formats.payload import Undecodable


def depth_image(message: CompressedImage) -> Image:
    """The depth image in a compressed one: 16UC1 in mm, 32FC1 in m.

    Raises:
        Undecodable: there is no whole one of 16 bits in it, or one of too many pixels.
    """
    head, found = rvl_pixels(message) if _is_rvl(message) else png_pixels(message)
    encoding = message.format.partition(";")[0].strip()
    pixels: npt.NDArray[np.uint16] | npt.NDArray[np.float32] = found
    if encoding == "32FC1":
        pixels = metres(found, head)
    elif encoding != "mono16":
        encoding = "16UC1"
    height, width = pixels.shape
    step = width * pixels.itemsize
    big = sys.byteorder == "big"
    content = np.ascontiguousarray(pixels).view(np.uint8).ravel()
    return Image(message.stamp_ns, message.frame, height, width, encoding, big, step, content)


def check_packed(message: CompressedImage) -> None:
    """Whether depth_image may be asked; nothing is decoded yet.

    Raises:
        Undecodable: as for depth_image, as far as can be told.
    """
    if _is_rvl(message):
        check_rvl(message)
    else:
        check_png(message)


def _is_rvl(message: CompressedImage) -> bool:
    return message.format.lower().rstrip().endswith("rvl")


def metres(found: npt.NDArray[np.uint16], head: bytes) -> npt.NDArray[np.float32]:
    """Depths in m from whole numbers of inverse depth; head: what stands before the PNG."""
    if len(head) < 12:
        raise Undecodable("compressed depth without its scale")
    _, a, b = struct.unpack("<iff", head[-12:])
    with np.errstate(all="ignore"):
        depth = np.float32(a) / (found.astype(np.float32) - np.float32(b))
    return np.where(found == 0, np.float32(np.nan), depth)
