"""Pictures of every depth open alike; bombs, cut and damaged ones are one clear line."""

from __future__ import annotations

import contextlib
import os
import struct
import tracemalloc
import zlib
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from formats.errors import FormatError, Notes
from formats.picture_header import (
    MAX_PIXELS,
    Header,
    PictureError,
    read_jpeg,
    read_png,
    read_tiff,
)
from formats.plans.raster import HEADERS, is_picture, read_raster, silenced, strips, turned
from tests import pictures
from tests.pictures import chunk, exif, jpeg_turned, pgm, png, png_claiming, tiff

STEPS = np.arange(24, dtype=np.uint8).reshape(4, 6) * 10
NOISE = np.random.default_rng(7).integers(0, 256, (120, 90), dtype=np.uint8)


def grey_of(data: bytes, notes: Notes | None = None) -> npt.NDArray[np.uint8]:
    return read_raster("p", data, notes or Notes()).grey()


def encoded(suffix: str, pixels: npt.NDArray[np.uint8], *options: int) -> bytes:
    ok, data = cv2.imencode(suffix, pixels, list(options))
    assert ok
    return bytes(data)


SAME = {
    "png 8": png(STEPS),
    "png 16": png(STEPS.astype(np.uint16) * 257, depth=16),
    "png rgb": png(np.dstack([STEPS] * 3), pictures.RGB),
    "png grey + alpha": png(np.dstack([STEPS, STEPS * 0 + 255]), pictures.GREY_ALPHA),
    "png rgba": png(np.dstack([STEPS] * 3 + [STEPS * 0 + 255]), pictures.RGBA),
    "png palette": png(
        STEPS // 10,
        pictures.PALETTE,
        extra=chunk(b"PLTE", b"".join(bytes([i * 10] * 3) for i in range(24))),
    ),
    "pgm 8": pgm(STEPS),
    "pgm 16": pgm(STEPS.astype(np.uint16) * 257, 65535),
    "pgm of maximum 23": pgm(STEPS // 10, 23),
    "tiff 8": tiff(STEPS),
    "tiff 8 big-endian": tiff(STEPS, order=">"),
    "tiff 16": tiff(STEPS.astype(np.uint16) * 257, 16),
    "tiff, 0 is white": tiff(255 - STEPS, black=0),
    "tiff 16, 0 is white": tiff(65535 - STEPS.astype(np.uint16) * 257, 16, black=0),
    "tiff lzw": encoded(".tiff", STEPS),
    "bmp": encoded(".bmp", STEPS),
}


@pytest.mark.parametrize("name", SAME)
def test_one_picture_in_every_dress(name: str) -> None:
    wanted = STEPS // 10 * 255.0 / 23 if "23" in name else STEPS
    assert np.array_equal(grey_of(SAME[name]), np.rint(wanted))


def test_every_magic_is_tried() -> None:
    tried = {magic for magic in HEADERS for data in SAME.values() if data.startswith(magic)}
    tried |= {b"\xff\xd8\xff", b"II+\x00", b"MM\x00+"}  # JPEG and BigTIFF below
    assert tried == set(HEADERS)


def test_plain_pgm_with_comments() -> None:
    rows = "\n".join(" ".join(map(str, row)) + " # a row" for row in STEPS.tolist())
    text = f"P2 # plain\n# size\n6 4\n255\n{rows}\n"
    assert np.array_equal(grey_of(text.encode()), STEPS)


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_packed_greys(bits: int) -> None:
    """A row of all the greys of 1, 2 and 4 bits, packed by hand."""
    n = 2**bits
    row = int("".join(format(i, f"0{bits}b") for i in range(n)).ljust(8, "0"), 2)
    packed = row.to_bytes((max(8, n * bits)) // 8, "big")
    head = struct.pack(">IIBBBBB", n, 1, bits, 0, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head)
    data += chunk(b"IDAT", zlib.compress(b"\0" + packed)) + chunk(b"IEND", b"")
    assert grey_of(data).tolist() == [[255 * i // (n - 1) for i in range(n)]]


def test_jpeg_of_flat_patches() -> None:
    patches = np.array([[0, 255], [128, 64]], np.uint8).repeat(16, 0).repeat(16, 1)
    assert np.abs(grey_of(encoded(".jpg", patches)).astype(int) - patches).max() <= 2


def test_cmyk_jpeg() -> None:
    image = pytest.importorskip("PIL.Image", reason="Pillow writes the CMYK picture")
    from io import BytesIO

    patches = np.array([[0, 255], [128, 64]], np.uint8).repeat(16, 0).repeat(16, 1)
    buffer = BytesIO()
    image.fromarray(patches).convert("CMYK").save(buffer, "JPEG", quality=95)
    assert np.abs(grey_of(buffer.getvalue()).astype(int) - patches).max() <= 4


def test_colours_are_weighed_by_brightness() -> None:
    """Rec. 601: red 0.299, green 0.587, blue 0.114 of 255."""
    rgb = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255]]], np.uint8)
    assert grey_of(png(rgb, pictures.RGB)).tolist() == [[76, 150, 29]]


ALPHAS = {
    "rgba": png(np.array([[[0, 0, 0, 0], [0, 0, 0, 255], [0, 0, 0, 51]]], np.uint8), pictures.RGBA),
    "rgba 16": png(
        np.array([[[0, 0, 0, 0], [0, 0, 0, 65535], [0, 0, 0, 13107]]]), pictures.RGBA, 16
    ),
    "grey + alpha": png(np.array([[[0, 0], [0, 255], [0, 51]]], np.uint8), pictures.GREY_ALPHA),
}


@pytest.mark.parametrize("name", ALPHAS)
def test_alpha_lies_on_white_paper(name: str) -> None:
    """Black at opacity 0, 1 and 0.2."""
    assert grey_of(ALPHAS[name]).tolist() == [[255, 0, 204]]


def test_one_grey_may_stand_for_transparent() -> None:
    """tRNS: 0 is clear in the 8-bit picture, 17 * 1 in the 4-bit one."""
    clear = chunk(b"tRNS", b"\0\0")
    assert grey_of(png(np.array([[0, 9]], np.uint8), extra=clear)).tolist() == [[255, 9]]
    head = struct.pack(">IIBBBBB", 2, 1, 4, 0, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"tRNS", b"\0\1")
    data += chunk(b"IDAT", zlib.compress(b"\0\x10")) + chunk(b"IEND", b"")
    assert grey_of(data).tolist() == [[255, 0]]


def test_palette_with_a_clear_colour() -> None:
    extra = chunk(b"PLTE", bytes(6)) + chunk(b"tRNS", b"\0\xff")  # both black, the first clear
    data = png(np.array([[0, 1]], np.uint8), pictures.PALETTE, extra=extra)
    assert grey_of(data).tolist() == [[255, 0]]


# What the stored picture [[1, 2, 3], [4, 5, 6]] looks like for each orientation (EXIF 2.32, 4.6.4).
UPRIGHT = {
    1: [[1, 2, 3], [4, 5, 6]],
    2: [[3, 2, 1], [6, 5, 4]],
    3: [[6, 5, 4], [3, 2, 1]],
    4: [[4, 5, 6], [1, 2, 3]],
    5: [[1, 4], [2, 5], [3, 6]],
    6: [[4, 1], [5, 2], [6, 3]],
    7: [[6, 3], [5, 2], [4, 1]],
    8: [[3, 6], [2, 5], [1, 4]],
}


@pytest.mark.parametrize("turn", UPRIGHT)
def test_turns(turn: int) -> None:
    stored = np.array(UPRIGHT[1], np.uint8)
    assert turned(stored, turn).tolist() == UPRIGHT[turn]
    assert grey_of(png(stored, extra=chunk(b"eXIf", exif(turn)))).tolist() == UPRIGHT[turn]
    assert grey_of(tiff(stored, turn=turn)).tolist() == UPRIGHT[turn]
    blocks = (stored * 40).repeat(16, 0).repeat(16, 1)
    seen = grey_of(jpeg_turned(encoded(".jpg", blocks), turn))[8::16, 8::16]
    assert np.rint(seen / 40).tolist() == UPRIGHT[turn]


@pytest.mark.parametrize("turn", [0, 9, 65535])
def test_an_unknown_turn_is_none(turn: int) -> None:
    assert read_png(png(STEPS, extra=chunk(b"eXIf", exif(turn)))).turn == 1


def test_headers_agree_with_the_pictures() -> None:
    rgba = np.zeros((5, 7, 4), np.uint8)
    assert read_png(png(rgba, pictures.RGBA)) == Header("PNG", 7, 5, 4, 8, alpha=True)
    assert read_png(png(STEPS, depth=16)) == Header("PNG", 6, 4, 1, 16)
    assert read_tiff(tiff(STEPS, 16)) == Header("TIFF", 6, 4, 1, 16)
    assert read_jpeg(jpeg_turned(encoded(".jpg", NOISE), 6)) == Header(
        "JPEG", 90, 120, 1, 8, turn=6
    )


def test_a_big_tiff_says_its_size() -> None:
    tags = [(256, 7), (257, 5), (258, 8), (277, 1)]
    entries = b"".join(struct.pack("<HHQQ", tag, 4, 1, value) for tag, value in tags)
    data = b"II+\0" + struct.pack("<HHQQ", 8, 0, 16, len(tags)) + entries + bytes(8)
    assert read_tiff(data) == Header("TIFF", 7, 5, 1, 8)


BOMBS = {
    "png 30000 x 30000": png_claiming(30_000, 30_000, depth=1),
    "png 14000 x 14000 of 16-bit colours": png(STEPS)[:16]
    + struct.pack(">II", 14_000, 14_000)
    + b"\x10\x06\0\0\0",
    "pgm": b"P5 30000 30000 255\n",
    "pgm of nines": b"P5 999999999 999999999 255\n",
    "plain pgm": b"P2 30000 30000 255\n0",
    "tiff": tiff(STEPS).replace(struct.pack("<I", 6), struct.pack("<I", 90_000_000), 1),
    "jpeg": encoded(".jpg", NOISE).replace(struct.pack(">HH", 120, 90), b"\xff\xff\xff\xff", 1),
    "bmp": encoded(".bmp", NOISE)[:18] + struct.pack("<ii", 2**31 - 1, -(2**31)) + bytes(50),
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_are_refused_by_their_header(name: str) -> None:
    data = BOMBS[name]
    if name.startswith("png 14"):  # give the forged header its CRC
        data = data[:29] + struct.pack(">I", zlib.crc32(data[12:29]))
        data += chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    tracemalloc.start()
    try:
        with pytest.raises(FormatError, match="over the limit") as caught:
            read_raster("bomb.png", data, Notes())
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith("bomb.png: ")


def test_the_limit_is_200_megapixels() -> None:
    Header("PNG", MAX_PIXELS // 10, 10, 1, 8).check_size()
    with pytest.raises(PictureError, match="200,000,000"):
        Header("PNG", MAX_PIXELS // 10 + 1, 10, 1, 8).check_size()


def test_the_limit_counts_bytes_too() -> None:
    """14,000 x 14,000 in colour: 588 MB decoded, but 196 MB as grey; opacity cannot be left out."""
    colours = Header("PNG", 14_000, 14_000, 3, 8)
    colours.check_size(colour=False)
    with pytest.raises(PictureError, match=r"3 x 8 bits are over the limit of 420 MB"):
        colours.check_size()
    with pytest.raises(PictureError, match="4 x 8 bits"):
        Header("PNG", 14_000, 14_000, 4, 8, alpha=True).check_size(colour=False)


CUTTABLE = {
    "png": png(NOISE),
    "pgm": pgm(NOISE),
    "tiff": tiff(NOISE),
    "jpeg": encoded(".jpg", NOISE),
    "bmp": encoded(".bmp", NOISE),
    "plain pgm": b"P2 90 120 255\n" + " ".join(map(str, NOISE.ravel().tolist())).encode(),
}


@pytest.mark.parametrize("name", CUTTABLE)
def test_cut_pictures_are_one_line(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    data = CUTTABLE[name]
    # the last bytes of a PNG and of plain numbers: a checksum, and digits that may well be absent
    for end in range(12, len(data) - 4, len(data) // 40):
        with pytest.raises(FormatError) as caught:
            read_raster("plan", data[:end], Notes())
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith("plan: ")
    assert capfd.readouterr().err == ""


def test_a_jpeg_with_its_middle_missing_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encoded(".jpg", NOISE)
    with pytest.raises(FormatError, match="damaged or cut"):
        read_raster("plan", whole[: len(whole) // 2] + b"\xff\xd9", Notes())
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("step", [1, 7, 64])
def test_no_flipped_bit_of_a_png_goes_unseen(step: int) -> None:
    whole = png(STEPS, extra=chunk(b"tEXt", b"Title\0plan"))
    for place in range(8, len(whole) - 12, step):
        for bit in range(8):
            data = bytearray(whole)
            data[place] ^= 1 << bit
            with pytest.raises(FormatError):
                read_raster("plan", bytes(data), Notes())


def test_flipped_bits_elsewhere_never_raise_anything_else(
    capfd: pytest.CaptureFixture[str],
) -> None:
    rng = np.random.default_rng(3)
    for whole in CUTTABLE.values():
        for _ in range(60):
            data = bytearray(whole)
            data[int(rng.integers(2, len(data)))] ^= 1 << int(rng.integers(8))
            with contextlib.suppress(FormatError):
                assert min(read_raster("plan", bytes(data), Notes()).pixels.shape) > 0
    assert capfd.readouterr().err == ""


def test_a_lying_png_is_refused() -> None:
    """Right checksums, but fewer rows than it claims."""
    head = struct.pack(">IIBBBBB", 4, 4, 8, 0, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head)
    data += chunk(b"IDAT", zlib.compress(b"\0abcd")) + chunk(b"IEND", b"")
    with pytest.raises(FormatError, match="Not enough image data"):
        read_raster("plan", data, Notes())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P5 4 4 0\n" + bytes(16), "maximum is 0"),
        (b"P5 4 4 70000\n" + bytes(32), "maximum is 70000"),
        (b"P5 4 x 255\n" + bytes(32), "header is not"),
        (b"P5 0 4 255\n", "claims 0 x 4 pixels"),
        (b"P2 2 2 255\n1 2 3 -4", "outside of 0 to 65535"),
        (b"P2 2 2 255\n1 2 nan 4", "not all of it is numbers"),
        (b"\x89PNG\r\n\x1a\n" + chunk(b"IEND", b""), "holds no picture"),
        (tiff(STEPS).replace(struct.pack("<HH", 256, 4), b"\0\0\4\0", 1), "does not say its size"),
    ],
)
def test_nonsense_is_one_line(data: bytes, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        read_raster("plan", data, Notes())


def test_pixels_over_the_maximum_are_white() -> None:
    notes = Notes()
    assert grey_of(pgm(np.array([[0, 5, 200]], np.uint8), 10), notes).tolist() == [[0, 128, 255]]
    assert [str(n) for n in notes] == ["p: pixels over the maximum of 10 count as white"]


def test_magic_decides() -> None:
    assert all(is_picture(data[:4096]) for data in SAME.values())
    assert not any(is_picture(head) for head in (b"", b"P5x", b"%PDF", b"image: a.pgm"))


def test_strips_cover_every_row_once() -> None:
    for rows, cols in ((1, 1), (7, 10**7), (10_000, 7000)):
        got = [r for part in strips(rows, cols) for r in range(rows)[part]]
        assert got == list(range(rows))


def test_a_closed_stderr_does_no_harm() -> None:
    """In a process of its own, since the descriptor is the whole process's."""
    import subprocess
    import sys

    code = (
        "import os; os.close(2); from formats.plans.raster import silenced\nwith silenced(): pass"
    )
    root = Path(__file__).resolve().parents[2]
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0


def test_what_libraries_print_is_heard(capfd: pytest.CaptureFixture[str]) -> None:
    with silenced() as heard:
        os.write(2, b"libpng warning: x\nlibpng warning: x\n\n")
    assert heard == ["libpng warning: x"]
    assert capfd.readouterr().err == ""
