"""Rows 65, 71 and 72: maps and drawings."""

from __future__ import annotations

import struct
import zlib
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tests import pictures
from tests.drawing_files import pdf, svg
from tests.faults_case import Given, Table
from tests.faults_world import PIXEL, YAML, drive, plan_pixels, write_plan
from tests.formats.test_map_yaml import FAULTS
from tests.pictures import pgm, png, png_claiming

table = Table()
PLACE = ["--plan-resolution", str(PIXEL), "--plan-origin", "-1.1,-1.1"]
Pixels = npt.NDArray[np.integer]


def log(d: Path) -> Path:
    return drive().write(d / "drive.mcap")


def picture(d: Path, data: bytes, name: str = "drawing.png") -> Given:
    """The sound drive over another picture, which lies where the plan does."""
    (d / name).write_bytes(data)
    return Given(log(d), d / name, PLACE)


def mapped(d: Path, data: bytes, name: str = "map.pgm", **values: str) -> Given:
    """The sound drive over another map, by its yaml."""
    text = YAML.format(image=name, resolution=PIXEL)
    for key, value in values.items():
        text = "".join(
            f"{key}: {value}\n" if line.startswith(f"{key}:") else line
            for line in text.splitlines(keepends=True)
        )
    (d / name).write_bytes(data)
    (d / "map.yaml").write_text(text, encoding="utf-8")
    return Given(log(d), d / "map.yaml")


# ---------------------------------------------------------------------------- 65: a grid in a log


@table(65, "hostile OccupancyGrids beside", quiet=True)
def _(d: Path) -> Path:
    made = drive()
    for k, (side, resolution, origin) in enumerate(
        [(100_000, 0.05, 0.0), (3, 0.0, 0.0), (3, float("nan"), 0.0), (3, 0.05, float("nan"))]
    ):
        info = {
            "resolution": resolution,
            "width": side,
            "height": side,
            "origin": {"position": {"x": origin}},
        }
        data = np.arange(9, dtype=np.int8) * 30
        header = made.header(k / 10, "map", None)
        made.say(k / 10, "/map", "nav_msgs/msg/OccupancyGrid", header=header, info=info, data=data)
    return made.write(d / "drive.mcap")


@table(65, "a log as the prior", "is a log", code=1)
def _(d: Path) -> Given:
    return Given(log(d), d / "drive.mcap")


# ---------------------------------------------------------------------------- 71: map yamls


def faulty(d: Path, text: str | bytes) -> Given:
    (d / "map.pgm").write_bytes(pgm(plan_pixels()))
    (d / "map.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return Given(log(d), d / "map.yaml")


for name, text, _at, words in FAULTS:
    table(71, name, words, code=1)(partial(faulty, text=text))

ROOM = plan_pixels()
GREY = pgm(ROOM)
table(71, "a sound one", quiet=True)(partial(mapped, data=GREY))
table(71, "byte order mark", quiet=True)(
    lambda d: (
        mapped(d, GREY),
        (d / "map.yaml").write_bytes(b"\xef\xbb\xbf" + (d / "map.yaml").read_bytes()),
    )[0]
)
table(71, "cut PGM", "cut", code=1)(partial(mapped, data=GREY[:-500]))
table(71, "huge PGM", "", code=1)(partial(mapped, data=b"P5\n2000000 2000000\n255\n" + bytes(99)))
table(71, "PGM of 10^30", "", code=1)(partial(mapped, data=b"P5\n%d 1\n255\n" % 10**30))
table(71, "PGM of 16 bit", quiet=True)(
    partial(mapped, data=pgm(ROOM.astype(np.uint16) * 257, 65535))
)
table(71, "text PGM", quiet=True)(
    partial(
        mapped,
        data=b"P2\n44 44\n255\n" + b" ".join(b"%d" % v for v in ROOM.ravel().tolist()) + b"\n",
    )
)
table(71, "picture not there", "is not there", code=1)(
    partial(mapped, data=b"", name="x.txt", image="gone.pgm")
)
table(71, "picture outside", "is not there", code=1)(
    partial(mapped, data=b"", name="x.txt", image="/nonexistent/../etc/x.pgm")
)
table(71, "resolution 1e-9", "", code=1)(partial(mapped, data=GREY, resolution="1e-9"))
table(71, "resolution 1e9", "beyond reason", code=1)(partial(mapped, data=GREY, resolution="1e9"))
table(71, "resolution 1e-4: 4 mm of plan", "", code=1)(
    partial(mapped, data=GREY, resolution="1e-4")
)
table(71, "resolution 900: a plan of 40 km", "beyond reason", code=1)(
    partial(mapped, data=GREY, resolution="900")
)
table(71, "origin far away", "do not overlap", code=1)(
    partial(mapped, data=GREY, origin="[1e6, 1e6, 0]")
)

# ---------------------------------------------------------------------------- 72: drawings

WHITE = np.full_like(ROOM, 255)
CLEAR = np.dstack([np.zeros_like(ROOM)] * 3 + [255 - ROOM])
PALETTE = pictures.chunk(b"PLTE", bytes([0, 0, 0, 255, 255, 255]))

table(72, "PNG of 0.9 GB", "over the limit", code=1)(
    lambda d: picture(d, png_claiming(30_000, 30_000))
)
table(72, "PNG that claims 2^31 pixels a side", "", code=1)(
    partial(
        picture, data=png_claiming(1, 1).replace(struct.pack(">II", 1, 1), b"\x7f\xff\xff\xff" * 2)
    )
)
table(72, "white", "every pixel is white", code=1)(partial(picture, data=png(WHITE)))
table(72, "black", "every pixel is black", code=1)(partial(picture, data=png(WHITE * 0)))
table(72, "inverted", "turned over")(partial(picture, data=png(255 - ROOM)))
table(72, "black on a transparent ground")(partial(picture, data=png(CLEAR, pictures.RGBA)))
table(72, "white on a transparent ground", "opacity")(
    partial(
        picture,
        data=png(np.dstack([WHITE, WHITE, WHITE, 255 - ROOM]), pictures.RGBA),
    )
)
table(72, "16 bit", quiet=True)(
    partial(picture, data=png(ROOM.astype(np.uint16) * 257, pictures.GREY, 16))
)
table(72, "colours", quiet=True)(partial(picture, data=png(np.dstack([ROOM] * 3), pictures.RGB)))
table(72, "palette", quiet=True)(
    partial(picture, data=png((ROOM > 0).astype(np.uint8), pictures.PALETTE, extra=PALETTE))
)
table(72, "TIFF", quiet=True)(partial(picture, data=pictures.tiff(ROOM), name="drawing.tif"))
table(72, "no suffix", quiet=True)(partial(picture, data=png(ROOM), name="drawing"))
table(72, "EXIF turn", quiet=True)(
    partial(picture, data=pictures.tiff(np.rot90(ROOM), turn=6), name="drawing.tif")
)
table(72, "SVG without a size", "SVG", code=1)(partial(picture, data=svg(head="")))
table(72, "SVG of 10^9 pixels", "beyond reason", code=1)(
    partial(picture, data=svg(head="width='1e9' height='1e9'"), name="drawing.svg")
)
table(72, "PDF cut", "PDF", code=1)(partial(picture, data=b"%PDF-1.7\n", name="drawing.pdf"))
table(72, "PDF of an empty page", "every pixel is white", code=1)(partial(picture, data=pdf()))
table(72, "DXF cut", "is cut", code=1)(
    partial(picture, data=b"  0\nSECTION\n  2\nENT", name="drawing.dxf")
)
table(72, "PNG cut", "cut", code=1)(partial(picture, data=png(ROOM)[:-30]))
table(72, "PNG with a flipped bit", "", code=1)(
    lambda d: picture(d, (lambda b: b[:70] + bytes([b[70] ^ 4]) + b[71:])(png(ROOM)))
)
table(72, "PNG whose data ends early", "", code=1)(
    partial(
        picture,
        data=png(ROOM)[:33]
        + pictures.chunk(b"IDAT", zlib.compress(bytes(45 * 10)))
        + pictures.chunk(b"IEND", b""),
    )
)
table(72, "empty", "empty", code=1)(partial(picture, data=b""))
table(72, "Git LFS pointer", "Git LFS pointer", code=1)(
    partial(picture, data=b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
)
table(72, "text chunk of 500 MB", "", code=1)(
    partial(
        picture,
        data=png(ROOM)[:33] + struct.pack(">I", 500_000_000) + b"zTXt" + zlib.compress(bytes(999)),
    )
)

table(72, "a picture of one pixel", "every pixel is white", code=1)(
    partial(picture, data=png(WHITE[:1, :1]))
)


@table(72, "nothing says how large a pixel is", "--plan-resolution", code=2)
def _(d: Path) -> Given:
    (d / "drawing.png").write_bytes(png(ROOM))
    return Given(log(d), d / "drawing.png", PLACE[2:])


@table(72, "a truth of another size", "size is not the plan's", code=1)
def _(d: Path) -> Given:
    (d / "truth.png").write_bytes(png(ROOM[:-3]))
    return Given(log(d), write_plan(d), ["--truth", d / "truth.png"])


@table(72, "a truth without walls", "every pixel is white", code=1)
def _(d: Path) -> Given:
    (d / "truth.png").write_bytes(png(WHITE))
    return Given(log(d), write_plan(d), ["--truth", d / "truth.png"])
