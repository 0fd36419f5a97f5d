"""Reading speed on logs made on the spot: plain file read, ours, rosbags, mcap-ros2-support.

Microseconds a message (a LaserScan of 1081 beams), the median of several rounds in one process.
The plain file read that readers are held against is that of the same bytes in pieces of a message's
size, each a bytes object of its own, through Python's buffered file with its own buffer of 8 KiB:
what any reader in Python must do at least to hand out messages. The same through a buffer of 1 MiB,
the bytes alone through one buffer, and the whole file at once are printed beside it.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from formats.errors import Notes
from formats.mcap import log as mcap_log
from formats.ros import decoders as ros
from formats.streaming.scanning import scanner
from scripts import bench_depth
from scripts.timing import medians

BEAMS = 1081
TYPE = "sensor_msgs/msg/LaserScan"
MESSAGE = 4400  # bytes of a scan's message
PIECE = 1 << 20
LEVEL = np.eye(4)


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


def message_read(path: Path, buffering: int = -1) -> None:
    """The file's bytes, a message's size at a time."""
    with path.open("rb", buffering=buffering) as file:
        while file.read(MESSAGE):
            pass


def through_one_buffer(path: Path) -> None:
    """The file's bytes, each piece over the last one."""
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


def our_nouns(path: Path) -> None:
    """Ours: messages decoded."""
    log = mcap_log.open_file(path, Notes())
    decode = ros.decoder(log.topics()[0])
    for _, _, data in log.messages():
        decode(data)
    log.close()


def our_scans(path: Path) -> None:
    """Ours: messages made Scans of a level sensor, as the frame stream does it."""
    log = mcap_log.open_file(path, Notes())
    scan = scanner(log.topics()[0])
    for _, _, data in log.messages():
        scan(data, LEVEL, None)
    log.close()


def rosbags_scans(path: Path) -> None:
    """AnyReader of rosbags with decoding."""
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def support_scans(path: Path) -> None:
    """mcap-ros2-support with decoding."""
    with path.open("rb") as file:
        for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            pass


PLAIN, OURS = "plain file read, by message", "ours, to Scan"
ROSBAGS, SUPPORT = "rosbags AnyReader, decoded", "mcap-ros2-support, decoded"
JOBS: dict[str, Callable[[Path], None]] = {
    PLAIN: message_read,
    "  with a buffer of 1 MiB": partial(message_read, buffering=PIECE),
    "  through one buffer of 1 MiB": through_one_buffer,
    "  whole": whole_read,
    "ours, messages": our_messages,
    "ours, decoded": our_nouns,
    OURS: our_scans,
    ROSBAGS: rosbags_scans,
}


def peak(path: Path) -> int:
    """The most memory in kB (VmHWM) of a process of its own that makes Scans of a log."""
    code = (
        "import sys; from pathlib import Path; from scripts.bench_read import our_scans; "
        "our_scans(Path(sys.argv[1])); print(open('/proc/self/status').read())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], check=True, capture_output=True, text=True
    )
    found = re.search(r"VmHWM:\s+(\d+)", done.stdout)
    assert found is not None
    return int(found[1])


def memory(gigabytes: float) -> None:
    """Print the peak memory for a log and for a tenth of it."""
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("none", "zstd"):
            for share in (0.1, 1.0):
                scans = round(share * gigabytes * 1e9 / MESSAGE)
                path = Path(folder) / "long.mcap"
                write_log(path, scans, compression)
                size, kb = path.stat().st_size / 1e9, peak(path)
                print(f"{compression:5}{scans:9} scans, {size:.2f} GB: VmHWM {kb / 1024:.0f} MB")


def ratio(results: dict[str, dict[str, float]], one: str, other: str, compression: str) -> float:
    """How many times as long one job takes as another."""
    return results[one][compression] / results[other][compression]


def main(argv: list[str] | None = None) -> int:
    """Print a table for uncompressed and zstd logs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=12_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--memory", type=float, help="GB of a log whose peak memory is told")
    options = parser.parse_args(argv)
    if options.memory:
        memory(options.memory)
        return 0
    slow: dict[str, Callable[[Path], None]] = {SUPPORT: support_scans}
    results: dict[str, dict[str, float]] = {name: {} for name in (*JOBS, *slow)}
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("none", "zstd"):
            for jobs, scans, rounds in ((JOBS, options.scans, options.rounds), (slow, 500, 1)):
                path = Path(folder) / f"{compression}-{scans}.mcap"
                write_log(path, scans, compression)
                for name, seconds in medians(jobs, path, rounds).items():
                    results[name][compression] = seconds / scans * 1e6
    print(f"{'us a message, times of ours':32}{'none':>10}{'':8}{'zstd':>10}")
    for name, row in results.items():
        cells = ""
        for compression, figure in row.items():
            cells += f"{figure:10.2f}{figure / results['ours, to Scan'][compression]:7.2f}x"
        print(f"{name:32}{cells}")
    for what, share, aim in (
        ("ours / plain read, uncompressed", ratio(results, OURS, PLAIN, "none"), "at most 3"),
        ("rosbags / ours, uncompressed", ratio(results, ROSBAGS, OURS, "none"), "at least 4"),
        ("rosbags / ours, zstd", ratio(results, ROSBAGS, OURS, "zstd"), "at least 2.5"),
        ("mcap-ros2-support / ours", ratio(results, SUPPORT, OURS, "none"), "at least 100"),
    ):
        print(f"{what:36}{share:8.2f}   aim: {aim}")
    return bench_depth.main([])


if __name__ == "__main__":
    raise SystemExit(main())
