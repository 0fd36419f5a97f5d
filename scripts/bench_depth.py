"""Depth images of 640 x 480 made on the spot: reading them, and making scans of them.

Microseconds an image, the median of several rounds in one process. The floor of reading is the
file's bytes read in order, and what is compressed decompressed, chunk by chunk; ours checks the
CRC of each chunk and hands out decoded images on top. An image becomes a scan by the rows of a
level camera that see into a slab as thin as the 40 rows that depthimage_to_laserscan would take,
and by those of the usual slab.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
import zstandard
from mcap.reader import make_reader

from formats.depth.cameras import CAMERA_TYPES
from formats.depth.scans import SLAB, depth_scan, levelled, scaled, view_of
from formats.errors import Notes
from formats.mcap import log as mcap_log
from formats.messages import CameraInfo, Image
from formats.ros import decoders as ros
from scripts.kinect import FOCAL, HEIGHT, RATE, ROWS, write_log
from scripts.timing import medians

TOPIC = "/camera/depth/image_raw"
THIN = 0.2 * 17.1 / FOCAL  # m above and below the camera: 40 rows see it from 0.2 m away on
READ, OURS = "read and decompressed", "ours, decoded"


def read_and_decompress(path: Path) -> None:
    """The file's bytes, chunk by chunk."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        file.seek(0)
        machine = zstandard.ZstdDecompressor()
        for chunk in sorted(summary.chunk_indexes, key=lambda c: c.chunk_start_offset):
            file.seek(chunk.chunk_start_offset + chunk.chunk_length - chunk.compressed_size)
            packed = file.read(chunk.compressed_size)
            if chunk.compression == "zstd":
                machine.decompress(packed, chunk.uncompressed_size)


def our_images(path: Path) -> None:
    """Ours: messages as Images."""
    log = mcap_log.open_file(path, Notes())
    topic = next(topic for topic in log.topics() if topic.name == TOPIC)
    decode = ros.decoder(topic)
    for _, _, data in log.messages([topic]):
        decode(data)
    log.close()


def an_image(path: Path) -> tuple[Image, CameraInfo]:
    """The first image of a log, and its calibration."""
    log = mcap_log.open_file(path, Notes())
    found = {}
    for topic in log.topics():
        if topic.name == TOPIC or topic.type in CAMERA_TYPES:
            found[topic.name == TOPIC] = ros.decode(topic, next(log.messages([topic]))[2])
    image, info = found[True], found[False]
    assert isinstance(image, Image)
    assert isinstance(info, CameraInfo)
    return image._replace(data=image.data.copy()), info


def to_scan(image: Image, info: CameraInfo, slab: tuple[float, float]) -> tuple[int, float]:
    """Rows that see into the slab, and microseconds an image."""
    level = np.eye(4)
    level[:3, :3], level[2, 3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], HEIGHT
    times = []
    for _ in range(300):
        begin = perf_counter()
        depth_scan(image, info, level, slab)
        times.append(perf_counter() - begin)
    lens = scaled(info, image.height, image.width)[0]
    size = image.height, image.width
    view = view_of(lens, *size, levelled(level, 2), slab, (0.2, 10.0), "u2", 0.001)
    return view.last - view.first, sorted(times)[len(times) // 2] * 1e6


def main(argv: list[str] | None = None) -> int:
    """Print a table for uncompressed and zstd logs, and what a scan costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=8.0, help="of the log, at 30 Hz")
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args(argv)
    jobs: dict[str, Callable[[Path], None]] = {READ: read_and_decompress, OURS: our_images}
    print(f"\n{'us a depth image':32}{READ:>24}{OURS:>16}{'ratio':>8}   aim: at most 1.3")
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("none", "zstd"):
            path = Path(folder) / f"{compression}.mcap"
            count = write_log(path, "depth", options.seconds, compression)
            found = medians(jobs, path, options.rounds)
            plain, ours = (found[name] / count * 1e6 for name in (READ, OURS))
            print(f"  {compression:30}{plain:24.0f}{ours:16.0f}{ours / plain:8.2f}")
        image, info = an_image(path)
    for slab, aim in (((HEIGHT - THIN, HEIGHT + THIN), "   aim: at most 40"), (SLAB, "")):
        rows, us = to_scan(image, info, slab)
        print(f"image to scan, {rows:3} of {ROWS} rows, us{us:12.1f}{aim}")
    print(f"(a camera at {RATE:.0f} Hz leaves {1e6 / RATE:.0f} us an image)")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
