"""What a picture says of itself before it is decoded: kind, size, depth, turn, whether it is whole.

Bombs, cut files and bit flips are refused here, so that no decoder sees them.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

MAX_PIXELS = 200_000_000
MAX_BYTES = 420_000_000  # decoded; cv2 holds a PNG twice, and all shall stay under 1 GB
INCH = 0.0254  # m
EXIF = b"Exif\x00\x00"


class PictureError(ValueError):
    """What is wrong with a picture's bytes; `hint` says what to do."""

    def __init__(self, problem: str, hint: str = "") -> None:
        super().__init__(problem)
        self.problem, self.hint = problem, hint


@dataclass(frozen=True, slots=True)
class Header:
    """What the first bytes say.

    Attributes:
        kind: "PNG", "JPEG", "TIFF", "PNM" or "BMP".
        width, height: pixels as stored, before any turn.
        channels: 1 to 4, alpha among them.
        depth: bits of a channel.
        alpha: the last channel is opacity.
        turn: EXIF orientation still to be applied, 1 (upright) to 8.
        pages: pictures in the file; the first is read.
        clear: the grey that stands for transparent in a grey PNG (tRNS), None where none does.
        paper: m of paper a pixel, None where the file does not say.
    """

    kind: str
    width: int
    height: int
    channels: int
    depth: int
    alpha: bool = False
    turn: int = 1
    pages: int = 1
    clear: int | None = None
    paper: float | None = None

    def check_size(self, *, colour: bool = True) -> None:
        """Refuse what would not fit into memory.

        Args:
            colour: False: colours that have no opacity are decoded to grey at once.

        Raises:
            PictureError: over MAX_PIXELS, over MAX_BYTES decoded, or no pixel at all.
        """
        pixels = self.width * self.height
        size = f"{self.width} x {self.height} pixels"
        if pixels == 0:
            raise PictureError(f"the picture claims {size}")
        if pixels > MAX_PIXELS:
            raise PictureError(f"{size} is over the limit of {MAX_PIXELS:,}", "scale it down")
        channels = self.channels if colour or self.alpha else 1
        if pixels * channels * ((self.depth + 7) // 8) > MAX_BYTES:
            problem = f"{size} of {self.channels} x {self.depth} bits are over the limit"
            raise PictureError(f"{problem} of {MAX_BYTES // 10**6} MB", "save it in grey")


def cut(place: int) -> PictureError:
    """The picture ends before its data does."""
    return PictureError(f"the picture is cut at byte {place}", "copy it again")


def _paper(dots: float, unit: float | None) -> float | None:
    """Metres of paper a pixel, of the pixels in a unit of so many m."""
    return unit / dots if unit and dots > 0 else None


def read_png(data: bytes) -> Header:
    """Size, depth, transparency and turn of a PNG whose chunks are all there and intact (CRC).

    Raises:
        PictureError: cut, damaged, or no PNG in spite of its first bytes.
    """
    header: Header | None = None
    turn, bits, alpha, content = 1, 8, False, False
    clear: int | None = None
    paper: float | None = None
    for name, body in _png_chunks(data):
        if name == b"IHDR":
            if len(body) != 13 or header is not None:
                raise PictureError("the PNG's header is not 13 bytes, once")
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            if colour not in (0, 2, 3, 4, 6) or depth not in (1, 2, 4, 8, 16):
                raise PictureError(f"the PNG claims colour type {colour} of {depth} bits")
            channels = {0: 1, 2: 3, 3: 3, 4: 4, 6: 4}[colour]  # cv2 unfolds grey with alpha to 4
            alpha, bits = colour in (4, 6), depth
            header = Header("PNG", width, height, channels, max(8, depth))
        elif name == b"tRNS" and header is not None:
            if header.channels == 1 and len(body) == 2:  # cv2 drops this one
                clear = int.from_bytes(body, "big") * (255 // (2**bits - 1) if bits < 8 else 1)
            alpha = header.channels > 1
        elif name == b"eXIf":
            turn = exif_turn(body)
        elif name == b"pHYs" and len(body) == 9 and body[8] == 1:  # in pixels a metre
            paper = _paper(struct.unpack(">I", body[:4])[0], 1.0)
        content = content or name == b"IDAT"
    if header is None or not content:
        raise PictureError("the PNG holds no picture")
    channels = 4 if alpha else header.channels
    size = header.width, header.height
    return Header("PNG", *size, channels, header.depth, alpha, turn, clear=clear, paper=paper)


def _png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and bodies up to IEND, each against its CRC."""
    at, name = 8, b""
    while name != b"IEND":
        if at + 12 > len(data):
            raise cut(len(data))
        size, name = struct.unpack_from(">I4s", data, at)
        end = at + 12 + size
        if not name.isalpha() or size > 0x7FFFFFFF:
            raise PictureError(f"the picture is damaged at byte {at}", "copy it again")
        if end > len(data):
            raise cut(len(data))
        view = memoryview(data)[at + 4 : end - 4]
        if zlib.crc32(view) != struct.unpack_from(">I", data, end - 4)[0]:
            raise PictureError(f"the picture is damaged at byte {at} (wrong CRC)", "copy it again")
        yield name, bytes(view[4:]) if name != b"IDAT" else b""
        at = end


def read_jpeg(data: bytes) -> Header:
    """Size and turn of a JPEG whose end is there.

    Raises:
        PictureError: cut, or without a frame header.
    """
    at, turn = 2, 1
    paper: float | None = None
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            raise PictureError(f"the picture is damaged at byte {at}", "copy it again")
        mark = data[at + 1]
        if mark == 0xFF or mark == 0x01 or 0xD0 <= mark <= 0xD8:  # padding, marks without a body
            at += 1 if mark == 0xFF else 2
            continue
        size = int.from_bytes(data[at + 2 : at + 4], "big")
        body = data[at + 4 : at + 2 + size]
        if mark == 0xE1 and body.startswith(EXIF):
            turn = exif_turn(body[len(EXIF) :])
        if mark == 0xE0 and body.startswith(b"JFIF\0") and len(body) >= 10:
            paper = _paper(int.from_bytes(body[8:10], "big"), {1: INCH, 2: 0.01}.get(body[7]))
        if 0xC0 <= mark <= 0xCF and mark not in (0xC4, 0xC8, 0xCC):
            if len(body) < 6:
                raise cut(len(data))
            if data.rfind(b"\xff\xd9") < at:
                raise cut(len(data))
            depth, height, width, channels = struct.unpack(">BHHB", body[:6])
            return Header("JPEG", width, height, channels, depth, turn=turn, paper=paper)
        at += 2 + size
    raise cut(len(data))


def read_tiff(data: bytes) -> Header:
    """Size, depth and alpha of the first page of a TIFF or BigTIFF; cv2 turns it by itself.

    Raises:
        PictureError: cut (strips or tiles past the end), or without a size.
    """
    order = "<" if data[:2] == b"II" else ">"
    tags, following = tiff_tags(data, order)
    try:
        width, height = tags[256][0], tags[257][0]
    except (KeyError, IndexError):
        raise PictureError("the TIFF does not say its size") from None
    channels = tags.get(277, (1,))[0]
    alpha = bool(tags.get(338)) and tags[338][0] in (1, 2)
    depth = max(8, *tags.get(258, (1,)))
    if depth > 16:
        raise PictureError(f"TIFF samples of {depth} bits are not read", "save it with 8 or 16")
    header = Header("TIFF", width, height, channels, depth, alpha, pages=2 if following else 1)
    over, under = tags[282] if len(tags.get(282, ())) == 2 else (0, 1)
    unit = {1: None, 2: INCH, 3: 0.01}.get(tags.get(296, (2,))[0])
    header = replace(header, paper=_paper(over / under, unit) if under else None)
    header.check_size(colour=False)  # before the file is called cut
    for offsets, sizes in ((273, 279), (324, 325)):
        pairs = zip(tags.get(offsets, ()), tags.get(sizes, ()), strict=False)
        if any(start + size > len(data) for start, size in pairs):
            raise cut(len(data))
    return header


def exif_turn(data: bytes) -> int:
    """The orientation that EXIF asks for, 1 where it says nothing usable."""
    if data[:2] not in (b"II", b"MM"):
        return 1
    try:
        tags, _ = tiff_tags(data, "<" if data[:2] == b"II" else ">")
    except PictureError:
        return 1
    turn = tags.get(274, (1,))
    return turn[0] if turn and 1 <= turn[0] <= 8 else 1


def tiff_tags(data: bytes, order: str) -> tuple[dict[int, tuple[int, ...]], int]:
    """Whole and rational numbers of the first directory, where the next one is (0: nowhere).

    Raises:
        PictureError: the directory lies outside of the data.
    """
    big = struct.unpack_from(f"{order}H", data, 2)[0] == 43 if len(data) >= 16 else False
    word, count_code, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
    inline = struct.calcsize(word)
    tags: dict[int, tuple[int, ...]] = {}
    try:
        at = struct.unpack_from(order + word, data, 8 if big else 4)[0]
        count = struct.unpack_from(order + count_code, data, at)[0]
        at += struct.calcsize(count_code)
        if at + count * entry > len(data):
            raise cut(len(data))
        for place in range(at, at + count * entry, entry):
            tag, kind, n = struct.unpack_from(f"{order}HH{word}", data, place)
            code = {1: "B", 3: "H", 4: "I", 5: "I", 16: "Q"}.get(kind)
            n *= 2 if kind == 5 else 1  # a rational is two numbers
            if code is None or n > len(data):
                continue
            value = place + 4 + inline
            if n * struct.calcsize(code) > inline:
                value = struct.unpack_from(order + word, data, value)[0]
            tags[tag] = struct.unpack_from(f"{order}{n}{code}", data, value)
        following = struct.unpack_from(order + word, data, at + count * entry)[0]
    except (struct.error, OverflowError):
        raise cut(len(data)) from None
    return tags, following


def read_bmp(data: bytes) -> Header:
    """Size and depth of a BMP.

    Raises:
        PictureError: cut.
    """
    if len(data) < 30:
        raise cut(len(data))
    start = struct.unpack_from("<I", data, 10)[0]
    width, height, _, bits, packing = struct.unpack_from("<iiHHI", data, 18)
    width, height = abs(width), abs(height)
    header = Header("BMP", width, height, 4 if bits == 32 else 3, 8)
    header.check_size(colour=False)  # before the file is called cut
    if packing == 0 and start + ((width * bits + 31) // 32) * 4 * height > len(data):
        raise cut(len(data))
    return header
