"""Compressed depth images, as image_transport writes them, whole and damaged."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest

from formats.depth.packed import depth_image
from formats.messages import CompressedImage
from formats.payload import Undecodable

MM = np.array([[0, 1, 255, 256], [1000, 4095, 65534, 65535]], dtype=np.uint16)


def png(pixels: np.ndarray[tuple[int, ...], np.dtype[np.uint16 | np.uint8]]) -> bytes:
    done, content = cv2.imencode(".png", pixels)
    assert done
    return content.tobytes()


def message(data: bytes, form: str = "16UC1; compressedDepth png") -> CompressedImage:
    return CompressedImage(5, "camera", form, np.frombuffer(data, np.uint8))


HEAD = struct.pack("<iff", 0, 0.0, 0.0)


@pytest.mark.parametrize("head", [HEAD, b""])
@pytest.mark.parametrize(
    ("form", "encoding"),
    [
        ("16UC1; compressedDepth", "16UC1"),
        ("16UC1; compressedDepth png", "16UC1"),
        ("mono16; compressedDepth", "mono16"),
        ("png", "16UC1"),
    ],
)
def test_whole_numbers_come_back(head: bytes, form: str, encoding: str) -> None:
    image = depth_image(message(head + png(MM), form))
    assert image[:5] == (5, "camera", 2, 4, encoding)
    assert image.step == 8
    found = image.data.view(np.uint16).reshape(2, 4)
    np.testing.assert_array_equal(found, MM)


def test_metres_of_inverse_depth() -> None:
    """A = 10, B = -2: 8 stands for 10 / (8 + 2) = 1 m, 18 for 0.5 m; 0 for none."""
    coded = np.array([[0, 8], [18, 98]], dtype=np.uint16)
    data = struct.pack("<iff", 0, 10.0, -2.0) + png(coded)
    image = depth_image(message(data, "32FC1; compressedDepth"))
    assert image.encoding == "32FC1"
    found = image.data.view(np.float32).reshape(2, 2)
    np.testing.assert_allclose(found, [[np.nan, 1.0], [0.5, 0.1]], rtol=1e-6)


def test_every_cut_and_a_flipped_bit_are_undecodable() -> None:
    data = HEAD + png(np.arange(300, dtype=np.uint16).reshape(15, 20))
    for size in range(len(data)):
        with pytest.raises(Undecodable):
            depth_image(message(data[:size]))
    for at in range(12 + 8, len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 4
        with pytest.raises(Undecodable, match="damaged PNG"):
            depth_image(message(bytes(damaged)))


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def test_bomb_is_refused_by_its_header() -> None:
    """30000 x 30000 pixels of 16 bits are 1.8 GB."""
    size = struct.pack(">IIBBBBB", 30_000, 30_000, 16, 0, 0, 0, 0)
    rows = zlib.compress(bytes(1000))
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    with pytest.raises(Undecodable, match=r"too many pixels \(30000 x 30000\)"):
        depth_image(message(data))


@pytest.mark.parametrize(
    ("data", "form", "reason"),
    [
        (HEAD + b"jpeg data", "16UC1; compressedDepth jpeg", "no PNG in the compressed image"),
        (b"", "", "no PNG in the compressed image"),
        (png(MM.astype(np.uint8)), "png", "PNG that is no depth"),
        (png(np.zeros((2, 2, 3), np.uint16)), "png", "PNG that is no depth"),
        (png(MM), "32FC1; compressedDepth", "compressed depth without its scale"),
    ],
)
def test_what_is_no_depth(data: bytes, form: str, reason: str) -> None:
    with pytest.raises(Undecodable) as caught:
        depth_image(message(data, form))
    assert caught.value.reason == reason
