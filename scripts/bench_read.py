"""Reading speed on logs made on the spot: plain file read, ours, rosbags, mcap-ros2-support.

Microseconds a message (a LaserScan of 1081 beams), the median of several rounds in one process.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from formats import mcap_log
from formats.errors import Notes

BEAMS = 1081
TYPE = "sensor_msgs/msg/LaserScan"
PIECE = 1 << 20


def write_log(path: Path, scans: int, compression: str) -> None:
    """A log of `scans` LaserScans at 10 Hz in a slowly changing room; ranges have noise."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    rng = np.random.default_rng(1)
    room = 4 + np.sin(np.linspace(0, 20, BEAMS))
    empty = np.zeros(0, dtype=np.float32)
    kinds = {"none": CompressionType.NONE, "zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}
    with path.open("wb") as file:
        writer = Writer(file, compression=kinds[compression])
        writer.start(profile="ros2")
        text = store.generate_msgdef(TYPE, ros_version=2)[0]
        schema = writer.register_schema(TYPE, "ros2msg", text.encode())
        channel = writer.register_channel("/scan", "cdr", schema)
        for number in range(scans):
            at = 10**18 + number * 10**8
            ranges = np.round(room + rng.normal(0, 0.01, BEAMS), 3).astype(np.float32)
            message = store.types[TYPE](
                header=header(stamp(at // 10**9, at % 10**9), "laser"),
                angle_min=-2.356,
                angle_max=2.356,
                angle_increment=4.712 / (BEAMS - 1),
                time_increment=0.0,
                scan_time=0.1,
                range_min=0.1,
                range_max=30.0,
                ranges=ranges,
                intensities=empty,
            )
            writer.add_message(channel, at, bytes(store.serialize_cdr(message, TYPE)), at)
        writer.finish()


def plain_read(path: Path) -> None:
    """The file's bytes through one buffer."""
    buffer = bytearray(PIECE)
    with path.open("rb", buffering=0) as file:
        while file.readinto(buffer):
            pass


def whole_read(path: Path) -> None:
    """The file's bytes in memory."""
    path.read_bytes()


def our_messages(path: Path) -> None:
    """Ours: messages as bytes."""
    log = mcap_log.open_file(path, Notes())
    for _ in log.messages():
        pass
    log.close()


def our_scans(path: Path) -> None:
    """Ours: messages decoded to scans."""
    from formats import ros

    log = mcap_log.open_file(path, Notes())
    decode = ros.decoder(log.topics()[0])
    for message in log.messages():
        decode(message.data)
    log.close()


def rosbags_scans(path: Path) -> None:
    """AnyReader of rosbags with decoding."""
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def support_scans(path: Path) -> None:
    """mcap-ros2-support with decoding."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory  # type: ignore[import-not-found,unused-ignore]

    with path.open("rb") as file:
        for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            pass


def timed(job: Callable[[Path], None], path: Path, rounds: int) -> float:
    """Median seconds of `rounds` runs, after one that warms up."""
    job(path)
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        job(path)
        times.append(time.perf_counter() - begin)
    return median(times)


def main(argv: list[str] | None = None) -> int:
    """Print a table for uncompressed and zstd logs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=12_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args(argv)
    jobs: dict[str, Callable[[Path], None]] = {
        "plain file read, 1 MiB buffer": plain_read,
        "plain file read, whole": whole_read,
        "ours, messages": our_messages,
        "ours, to Scan": our_scans,
        "rosbags AnyReader, decoded": rosbags_scans,
    }
    slow: dict[str, Callable[[Path], None]] = {}
    if importlib.util.find_spec("mcap_ros2"):
        slow["mcap-ros2-support, decoded"] = support_scans
    else:
        print("mcap-ros2-support is not installed: left out", file=sys.stderr)
    print(f"{'us a message':32}{'none':>10}{'zstd':>10}")
    results: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("none", "zstd"):
            path = Path(folder) / f"{compression}.mcap"
            write_log(path, options.scans, compression)
            for name, job in jobs.items():
                seconds = timed(job, path, options.rounds)
                results.setdefault(name, {})[compression] = seconds / options.scans * 1e6
            for name, job in slow.items():
                short = Path(folder) / f"short-{compression}.mcap"
                write_log(short, 500, compression)
                results.setdefault(name, {})[compression] = timed(job, short, 1) / 500 * 1e6
    for name, row in results.items():
        print(f"{name:32}{row['none']:10.2f}{row['zstd']:10.2f}")
    ours = results["ours, to Scan"]
    for name, row in results.items():
        ratios = [row[kind] / ours[kind] for kind in ("none", "zstd")]
        print(f"{name + ' / ours':32}{ratios[0]:10.2f}{ratios[1]:10.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
