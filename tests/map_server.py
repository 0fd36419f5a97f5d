"""map_server's reading of a map, told again pixel by pixel: the oracle for ours and our exports."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import yaml


def pgm_pixels(path: Path) -> list[list[tuple[int, ...]]]:
    """Rows of (grey,) of a raw 8-bit PGM, the first row on top."""
    data = path.read_bytes()
    words: list[bytes] = []
    at = 0
    while len(words) < 4:
        end = at
        while data[end : end + 1] not in b" \n":
            end += 1
        if data[at : at + 1] == b"#":
            end = data.index(b"\n", at)
        elif end > at:
            words.append(data[at:end])
        at = end + 1
    assert words[0] == b"P5"
    assert words[3] == b"255"
    width, height = int(words[1]), int(words[2])
    return [[(data[at + r * width + c],) for c in range(width)] for r in range(height)]


def png_pixels(path: Path) -> list[list[tuple[int, ...]]]:
    """Rows of channels of an 8-bit PNG without interlace (PNG specification, section 9)."""
    data, at, packed = path.read_bytes(), 8, b""
    width = height = colour = 0
    while at < len(data):
        size, name = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + size]
        if name == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            assert depth == 8
        packed += body if name == b"IDAT" else b""
        at += 12 + size
    step = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    raw, above, rows = zlib.decompress(packed), bytes(width * step), []
    for r in range(height):
        start = r * (width * step + 1)
        kind, line = raw[start], bytearray(raw[start + 1 : start + 1 + width * step])
        for i in range(len(line)):
            a = line[i - step] if i >= step else 0
            b, c = above[i], above[i - step] if i >= step else 0
            p = a + b - c
            paeth = min((a, b, c), key=lambda v, p=p: abs(p - v))  # type: ignore[misc]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[kind]) % 256
        above = bytes(line)
        rows.append([tuple(line[i : i + step]) for i in range(0, len(line), step)])
    return rows


def nav2_cell(pixel: tuple[int, ...], values: dict[str, object]) -> int:
    """-1 unknown, 0 to 100, by the rules in nav2_map_server's README and its loader."""
    colours = list(pixel[: len(pixel) - 1 + len(pixel) % 2])
    colours = colours * 3 if len(colours) == 1 else colours
    opaque = pixel[-1] if len(pixel) % 2 == 0 else 255
    if len(pixel) % 2 == 0 and values["mode"] == "trinary":
        colours.append(opaque)
    shade = sum(colours) / (len(colours) * 255)
    occupied = shade if values["negate"] else 1 - shade
    low, high = float(str(values["free_thresh"])), float(str(values["occupied_thresh"]))
    if values["mode"] == "raw":
        value = round(shade * 255)
        return value if value <= 100 else -1
    if values["mode"] == "scale" and opaque != 255:
        return -1
    if occupied > high:
        return 100
    if occupied < low:
        ros_1 = (
            values["mode"] == "trinary"
            and not values["negate"]
            and sum(colours) == 205 * len(colours)
        )
        return int(str(values.get("grey_205", 0))) if ros_1 else 0
    return -1 if values["mode"] == "trinary" else round((occupied - low) / (high - low) * 100)


def nav2_map(path: Path, grey_205: int = 0) -> tuple[list[list[int]], dict[str, object]]:
    """Cells of a map yaml, the lowest row first, and its values.

    grey_205: what the grey 205 is where nav2 has it free, in trinary.
    """
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    values.setdefault("mode", "trinary")
    picture = path.parent / values["image"]
    rows = (pgm_pixels if picture.suffix == ".pgm" else png_pixels)(picture)
    values["grey_205"] = grey_205
    return [[nav2_cell(pixel, values) for pixel in row] for row in reversed(rows)], values
