"""RVL, against an encoder that is written as the paper prints it, and against damage."""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from formats.depth.packed import check_packed, depth_image
from formats.messages import CompressedImage
from formats.payload import Undecodable

HEAD = struct.pack("<iff", 0, 10.0, -2.0)


def nibbles(number: int) -> list[int]:
    """Three bits each, low ones first; the fourth says that more follow."""
    found: list[int] = []
    while True:
        nibble, number = number & 7, number >> 3
        if not number:
            return [*found, nibble]
        found.append(nibble | 8)


def rvl(pixels: npt.NDArray[np.uint16]) -> bytes:
    """Figure 2 of the paper, with the sizes before it."""
    row, out, at, previous = pixels.ravel().tolist(), list[int](), 0, 0
    while at < len(row):
        zeros = 0
        while at + zeros < len(row) and row[at + zeros] == 0:
            zeros += 1
        at += zeros
        others = 0
        while at + others < len(row) and row[at + others] != 0:
            others += 1
        out += nibbles(zeros) + nibbles(others)
        for pixel in row[at : at + others]:
            delta = pixel - previous
            out += nibbles((delta << 1) ^ (delta >> 31))
            previous = pixel
        at += others
    out += [0] * (-len(out) % 8)
    words = [int("".join(f"{n:x}" for n in out[i : i + 8]), 16) for i in range(0, len(out), 8)]
    sizes = struct.pack("<II", pixels.shape[1], pixels.shape[0])
    return sizes + struct.pack(f"<{len(words)}I", *words)


def message(data: bytes, form: str = "16UC1; compressedDepth rvl") -> CompressedImage:
    return CompressedImage(5, "camera", form, np.frombuffer(data, np.uint8))


def test_a_word_by_hand() -> None:
    """1 zero, 2 others: +5 (zigzag 10 = 2 | 8, 1), -1 (zigzag 1)."""
    packed = struct.pack("<III", 3, 1, 0x12A11000)
    found = depth_image(message(HEAD + packed))
    assert found.data.view(np.uint16).tolist() == [0, 5, 4]
    assert rvl(np.array([[0, 5, 4]], np.uint16)) == packed


SHAPES = st.tuples(st.integers(1, 9), st.integers(1, 9))
PIXELS = st.one_of(st.just(0), st.integers(0, 300), st.integers(0, 65535))


@given(arrays(np.uint16, SHAPES, elements=PIXELS))
@settings(max_examples=200, deadline=None)
def test_pixels_come_back(pixels: npt.NDArray[np.uint16]) -> None:
    image = depth_image(message(HEAD + rvl(pixels)))
    assert image[:6] == (5, "camera", *pixels.shape, "16UC1", False)
    np.testing.assert_array_equal(image.data.view(np.uint16).reshape(pixels.shape), pixels)


def test_metres_of_inverse_depth() -> None:
    packed = rvl(np.array([[0, 8], [18, 98]], dtype=np.uint16))
    image = depth_image(message(HEAD + packed, "32FC1; compressedDepth rvl"))
    found = image.data.view(np.float32).reshape(2, 2)
    np.testing.assert_allclose(found, [[np.nan, 1.0], [0.5, 0.1]], rtol=1e-6)


@given(st.binary(max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_bytes_give_an_image_or_undecodable(data: bytes) -> None:
    packed = HEAD + struct.pack("<II", 5, 4) + data
    try:
        image = depth_image(message(packed))
    except Undecodable:
        return
    assert len(image.data) == 40


def test_cuts_and_sizes_that_cannot_be() -> None:
    whole = HEAD + rvl(np.arange(1000, 1800, dtype=np.uint16).reshape(20, 40))
    for size in range(0, len(whole) - 4, 7):
        with pytest.raises(Undecodable, match=r"cut short|damaged RVL"):
            depth_image(message(whole[:size]))
    huge = HEAD + struct.pack("<II", 1 << 16, 1 << 16) + bytes(8)
    with pytest.raises(Undecodable, match="too many pixels"):
        check_packed(message(huge))
    check_packed(message(whole))
