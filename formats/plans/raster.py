"""Pictures of pixels: PNG, JPEG, TIFF, PNM, BMP of any depth, decoded in bounds, in silence."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes, printable
from formats.errors import Path as AnyPath
from formats.picture_header import (
    Header,
    PictureError,
    cut,
    read_bmp,
    read_jpeg,
    read_png,
    read_tiff,
)

Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
Grey = npt.NDArray[np.uint8]
COPY_AGAIN = "copy it again"
FATAL = ("premature end", "not enough", "error")


@dataclass(slots=True)
class Raster:
    """A decoded picture, row 0 on top.

    Attributes:
        pixels: (H, W) grey or (H, W, 3) BGR.
        alpha: (H, W) opacity, or None where all is opaque.
        full: the value of white and of opaque: 255, 65535 or a PGM's own maximum.
        header: what the file said of itself.
    """

    pixels: Pixels
    alpha: Pixels | None
    full: int
    header: Header

    def grey(self, *, upright: bool = True) -> Grey:
        """Brightness on white paper (H, W): 0 black, 255 white; turned as EXIF says."""
        import cv2

        height, width = self.pixels.shape[:2]
        out = np.empty((height, width), dtype=np.uint8)
        for rows in strips(height, width):
            part = self.pixels[rows]
            light = cv2.cvtColor(part, cv2.COLOR_BGR2GRAY) if part.ndim == 3 else part
            if self.alpha is None and self.full == 255:
                out[rows] = light
                continue
            shade = light.astype(np.float32) / self.full
            if self.alpha is not None:
                opacity = self.alpha[rows].astype(np.float32) / self.full
                shade = shade * opacity + (1 - opacity)
            out[rows] = np.rint(255 * shade)
        return turned(out, self.header.turn if upright else 1)


def strips(rows: int, cols: int) -> Iterator[slice]:
    """Row ranges of about a million pixels, so that temporary arrays stay small."""
    step = max(1, 1_000_000 // max(1, cols))
    for start in range(0, rows, step):
        yield slice(start, min(rows, start + step))


def turned(image: Grey, turn: int) -> Grey:
    """The picture (H, W) upright, for an EXIF orientation of 1 to 8."""
    upright: dict[int, Callable[[Grey], Grey]] = {
        1: lambda a: a,
        2: lambda a: a[:, ::-1],
        3: lambda a: a[::-1, ::-1],
        4: lambda a: a[::-1],
        5: lambda a: a.T,
        6: lambda a: a[::-1].T,
        7: lambda a: a[::-1, ::-1].T,
        8: lambda a: a.T[::-1],
    }
    return np.ascontiguousarray(upright[turn](image))


HEADERS: dict[bytes, Callable[[bytes], Header]] = {
    b"\x89PNG\r\n\x1a\n": read_png,
    b"\xff\xd8\xff": read_jpeg,
    b"II*\x00": read_tiff,
    b"MM\x00*": read_tiff,
    b"II+\x00": read_tiff,
    b"MM\x00+": read_tiff,
    b"BM": read_bmp,
}


def is_picture(head: bytes) -> bool:
    """Whether the first bytes are those of a picture that `read_raster` knows."""
    return head.startswith(tuple(HEADERS)) or re.match(rb"P[1-6][\s#]", head) is not None


def read_raster(path: AnyPath, data: bytes, notes: Notes, *, colour: bool = True) -> Raster:
    """Decode a picture. Its size is checked from its header before anything is decoded.

    Args:
        path: its name, for messages.
        data: the whole file.
        notes: what the decoder found odd.
        colour: False: colours may come as grey (luma) at once, which takes a third of the memory.

    Raises:
        FormatError: too large, cut, damaged, or of a kind that is not read.
    """
    try:
        if re.match(rb"P[25][\s#]", data):
            return read_pgm(path, data, notes)
        header = _header(data)
        header.check_size(colour=colour)
        pixels, remarks = _decode(data, header, colour)
    except PictureError as error:
        raise FormatError(path, error.problem, hint=error.hint) from None
    said = printable("; ".join(remarks))
    if pixels is None or any(word in said.lower() for word in FATAL):
        reason = f" ({said})" if said else ""
        raise FormatError(path, f"the picture is damaged or cut{reason}", hint=COPY_AGAIN)
    for remark in remarks:
        notes.warn(path, f"the picture's decoder says: {remark}")
    if header.pages > 1:
        notes.warn(path, "holds several pages; the first is read")
    return _opened(pixels, header)


def _header(data: bytes) -> Header:
    for magic, read in HEADERS.items():
        if data.startswith(magic):
            return read(data)
    return _pnm_header(data)[0]


def _decode(data: bytes, header: Header, colour: bool) -> tuple[Pixels | None, list[str]]:
    """Pixels as cv2 has them (None: it gave up), and what its libraries printed."""
    import cv2

    if header.alpha:
        flags = cv2.IMREAD_UNCHANGED
    else:
        flags = cv2.IMREAD_COLOR if colour and header.channels > 1 else cv2.IMREAD_GRAYSCALE
        flags |= cv2.IMREAD_IGNORE_ORIENTATION
        if header.kind in ("PNG", "PNM"):  # 16-bit TIFF is right in cv2 only when it makes 8 of 16
            flags |= cv2.IMREAD_ANYDEPTH
    with silenced() as remarks:
        try:
            pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
        except (cv2.error, MemoryError):
            pixels = None
    if pixels is not None and pixels.dtype not in (np.uint8, np.uint16):
        raise PictureError(f"pixels of type {pixels.dtype} are not read", "save it in 8 bits")
    return pixels, remarks  # type: ignore[return-value]


def _opened(pixels: Pixels, header: Header) -> Raster:
    """Colour and opacity apart."""
    full = 255 if pixels.dtype == np.uint8 else 65535
    alpha: Pixels | None = None
    if pixels.ndim == 3 and pixels.shape[2] == 4:
        pixels, alpha = pixels[:, :, :3], pixels[:, :, 3]
    elif header.clear is not None:
        alpha = (pixels != header.clear).astype(np.uint8)
        alpha = alpha * pixels.dtype.type(full)
    if alpha is not None and bool(alpha.min() == full):
        alpha = None
    return Raster(pixels, alpha, full, header)


def _pnm_header(data: bytes) -> tuple[Header, int, int]:
    """Header, maximum and start of the pixels of a PNM.

    Raises:
        PictureError: no size, or a maximum outside of 1 to 65535.
    """
    gap = rb"(?:\s+|#[^\n]*\n)+"
    fields = 2 if data[1:2] in b"14" else 3
    found = re.match(rb"P[1-6]" + (gap + rb"(\d{1,9})") * fields + rb"\s", data[:100_000])
    if found is None:
        raise PictureError("the PNM's header is not `P5 WIDTH HEIGHT MAXIMUM`")
    width, height, full = (int(n) for n in (*found.groups(), b"255")[:3])
    if not 1 <= full <= 65535:
        raise PictureError(f"the PNM's maximum is {full}, not 1 to 65535")
    channels = 3 if data[1:2] in b"36" else 1
    return Header("PNM", width, height, channels, 16 if full > 255 else 8), full, found.end()


def read_pgm(path: AnyPath, data: bytes, notes: Notes) -> Raster:
    """A PGM, plain (P2) or raw (P5), of 8 or 16 bits, with any maximum.

    Raises:
        FormatError: too large, cut, or not numbers.
    """
    try:
        header, full, start = _pnm_header(data)
        header.check_size()
        wanted = header.width * header.height
        if data[:2] == b"P2":
            values = _plain_numbers(data[start:], wanted)
        else:
            dtype = np.dtype(">u2" if full > 255 else "u1")
            if len(data) - start < wanted * dtype.itemsize:
                raise cut(len(data))
            values = np.frombuffer(data, dtype, wanted, start).astype(dtype.newbyteorder("="))
    except PictureError as error:
        raise FormatError(path, error.problem, hint=error.hint) from None
    pixels = values.reshape(header.height, header.width)
    if full not in (255, 65535):
        over = int(np.count_nonzero(pixels > full))
        if over:
            notes.warn(path, f"pixels over the maximum of {full} count as white", count=over)
            np.minimum(pixels, full, out=pixels)
    return Raster(pixels, None, full, header)


def _plain_numbers(text: bytes, wanted: int) -> Pixels:
    """The pixels of a plain PGM, as uint16."""
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            # Not by `count`: where there are fewer, numpy 2.4 fills up with whatever was in memory.
            values = np.fromstring(text.decode("ascii"), dtype=np.int32, sep=" ")[:wanted]
        except (ValueError, DeprecationWarning):
            raise PictureError("the PGM is cut, or not all of it is numbers", COPY_AGAIN) from None
    if len(values) < wanted:
        raise PictureError(f"the PGM holds {len(values)} of {wanted} pixels", COPY_AGAIN)
    if values.min() < 0 or values.max() > 65535:
        raise PictureError("the PGM holds numbers outside of 0 to 65535")
    return values.astype(np.uint16)


@contextlib.contextmanager
def silenced() -> Iterator[list[str]]:
    """Keep what C libraries print on stderr from the user; the list holds the lines afterwards."""
    lines: list[str] = []
    sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # stderr is closed
        yield lines
        return
    with tempfile.TemporaryFile() as heard:
        os.dup2(heard.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            heard.seek(0)
            text = heard.read(4096).decode(errors="replace")
            lines += dict.fromkeys(line.strip() for line in text.splitlines() if line.strip())
