"""What is left of a recording that was cut short: by rosbags, by mcap's reader, and by ours.

    python -m scripts.score_damage [--cuts 54]

One drive (scans of 360 beams, a pose after each) written as MCAP, bag and db3 by the libraries of
mcap and rosbags; each file cut at evenly spaced bytes, and what readers hand out before they end or
fail held against the messages whose bytes are physically there. Of a chunk that is cut these are
the ones that its decompressor, fed byte by byte, gives whole.
"""

from __future__ import annotations

import argparse
import bz2
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame
import numpy as np
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from formats.compression import zstd
from formats.errors import FormatError, Notes
from formats.stream import open_log

BEAMS, SCANS, CUTS = 360, 2000, 54
CHUNK = 256 << 10  # bytes, so that several chunks lie in a small file
SCAN, POSE = "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/PoseStamped"
PIECE, STRIDE = 16, 400  # bytes of a payload that are looked for in the file, and how far apart
MACHINES: dict[str, Callable[[], Any]] = {
    "zstd": zstd.ZstdDecompressor,
    "lz4": lz4.frame.LZ4FrameDecompressor,
    "bz2": bz2.BZ2Decompressor,
}
Said = tuple[str, str, int, bytes]  # topic, type, log time, payload


def drive(ros: int) -> Iterator[Said]:
    """Scans with noise and poses; numbers differ from message to message."""
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    types, serialize = store.types, store.serialize_ros1 if ros == 1 else store.serialize_cdr
    counted = {"seq": 0} if ros == 1 else {}
    rng = np.random.default_rng(1)
    room = 4 + np.sin(np.linspace(0, 20, BEAMS))
    for number in range(SCANS):
        at = 1_700_000_000 * 10**9 + number * 10**8
        stamp = types["builtin_interfaces/msg/Time"](*divmod(at, 10**9))
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="laser", **counted)
        scan = types[SCAN](
            header=header,
            angle_min=-np.pi,
            angle_max=np.pi,
            angle_increment=2 * np.pi / (BEAMS - 1),
            time_increment=0.0,
            scan_time=0.1,
            range_min=0.1,
            range_max=30.0,
            ranges=np.round(room + rng.normal(0, 0.01, BEAMS), 3).astype(np.float32),
            intensities=np.zeros(0, np.float32),
        )
        yield "/scan", SCAN, at, bytes(serialize(scan, SCAN))
        point = types["geometry_msgs/msg/Point"](*rng.normal(size=3).tolist())
        turn = types["geometry_msgs/msg/Quaternion"](*rng.normal(size=4).tolist())
        posed = types["geometry_msgs/msg/Pose"](point, turn)
        yield "/pose", POSE, at + 1, bytes(serialize(types[POSE](header, posed), POSE))


def write_mcap(path: Path, kind: str) -> None:
    """By the mcap library; without chunks where `kind` is "unchunked"."""
    with path.open("wb") as file:
        packed = CompressionType.ZSTD if kind == "zstd" else CompressionType.NONE
        chunked = kind != "unchunked"
        writer = McapWriter(file, chunk_size=CHUNK, compression=packed, use_chunking=chunked)
        writer.start(profile="ros2")
        store, channels = get_typestore(Stores.ROS2_HUMBLE), dict[str, int]()
        for topic, kind_, at, data in drive(2):
            if topic not in channels:
                text = store.generate_msgdef(kind_, ros_version=2)[0].encode()
                schema = writer.register_schema(kind_, "ros2msg", text)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], at, data, at)
        writer.finish()


def write_bag(path: Path, kind: str) -> None:
    """By rosbags."""
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = CHUNK
    if kind != "none":
        writer.set_compression(rosbag1.Writer.CompressionFormat[kind.upper()])
    with writer:
        store, found = get_typestore(Stores.ROS1_NOETIC), dict[str, Any]()
        for topic, kind_, at, data in drive(1):
            if topic not in found:
                found[topic] = writer.add_connection(topic, kind_, typestore=store)
            writer.write(found[topic], at, data)


def write_db3(path: Path, _kind: str) -> None:
    """By rosbags; the file without its folder."""
    folder = path.with_suffix(".folder")
    with rosbag2.Writer(folder, version=8, storage_plugin=rosbag2.StoragePlugin.SQLITE3) as writer:
        store, found = get_typestore(Stores.ROS2_HUMBLE), dict[str, Any]()
        for topic, kind_, at, data in drive(2):
            if topic not in found:
                found[topic] = writer.add_connection(topic, kind_, typestore=store)
            writer.write(found[topic], at, data)
    next(folder.glob("*.db3")).rename(path)


class Case(NamedTuple):
    """A kind of file: its suffix, the ROS of its payloads, who writes it, with what compression."""

    suffix: str
    ros: int
    write: Callable[[Path, str], None]
    kind: str


CASES = {
    "MCAP, zstd": Case(".mcap", 2, write_mcap, "zstd"),
    "MCAP, unchunked": Case(".mcap", 2, write_mcap, "unchunked"),
    "bag, none": Case(".bag", 1, write_bag, "none"),
    "bag, lz4": Case(".bag", 1, write_bag, "lz4"),
    "bag, bz2": Case(".bag", 1, write_bag, "bz2"),
    "db3": Case(".db3", 2, write_db3, ""),
}


def packed_chunks(path: Path) -> list[tuple[int, int]]:
    """Where the compressed data of chunks begin and end, as the libraries see it."""
    if path.suffix == ".mcap":
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        ends = [c.chunk_start_offset + c.chunk_length for c in summary.chunk_indexes]
        sizes = [c.compressed_size for c in summary.chunk_indexes]
        return [(end - size, end) for end, size in zip(ends, sizes, strict=True)]
    with rosbag1.Reader(path) as reader:
        return [(c.datapos, c.datapos + c.datasize) for c in reader.chunks.values()]


def needs(data: bytes, payload: bytes) -> int:
    """Where in the data a payload ends, whose pieces may lie apart (pages of a database)."""
    at = range(len(payload) % STRIDE % PIECE, len(payload) - PIECE, STRIDE)
    pieces = [payload[i : i + PIECE] for i in (*at, len(payload) - PIECE)]
    return max(data.find(piece) + PIECE for piece in pieces)


def there(path: Path, case: Case, cuts: list[int]) -> int:
    """Messages whose bytes lie before each of the cuts, all together."""
    whole, payloads = path.read_bytes(), [said[3] for said in drive(case.ros)]
    if case.kind not in MACHINES:
        ends = [needs(whole, payload) for payload in payloads]
        return sum(end <= cut for cut in cuts for end in ends)
    found, rest = 0, iter(payloads)
    payload = next(rest, None)
    for begin, end in packed_chunks(path):
        data = MACHINES[case.kind]().decompress(whole[begin:end])
        ends, at = [], 0
        while payload is not None and (at := data.find(payload, at)) >= 0:
            at += len(payload)
            ends.append(at)
            payload = next(rest, None)
        for cut in cuts:
            out = len(data) if cut >= end else unpacked(case.kind, whole[begin : max(cut, begin)])
            found += sum(at <= out for at in ends)
    assert payload is None
    return found


def unpacked(kind: str, packed: bytes) -> int:
    """Bytes that come out of a cut chunk, fed byte by byte."""
    machine = MACHINES[kind]()
    return sum(len(machine.decompress(packed[i : i + 1])) for i in range(len(packed)))


def by_rosbags(path: Path, case: Case) -> Iterator[object]:
    """AnyReader of rosbags."""
    store = get_typestore(Stores.ROS1_NOETIC if case.ros == 1 else Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        yield from reader.messages()


def by_mcap(path: Path, _case: Case) -> Iterator[object]:
    """NonSeekingReader of mcap."""
    with path.open("rb") as file:
        yield from NonSeekingReader(file).iter_messages(log_time_order=False)


def by_us(path: Path, _case: Case) -> Iterator[object]:
    """Ours."""
    try:
        log = open_log(path, Notes())
    except FormatError:
        return
    yield from log.messages()
    log.close()


def recovered(read: Callable[[Path, Case], Iterator[object]], path: Path, case: Case) -> int:
    """Messages that a reader hands out before it ends or fails."""
    count = 0
    try:
        for _ in read(path, case):
            count += 1
    except Exception:
        if read is by_us:
            raise
    return count


def main(argv: list[str] | None = None) -> int:
    """Print the table; 1 where ours gets less than 98 % of what is there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cuts", type=int, default=CUTS)
    options = parser.parse_args(argv)
    print("| container | there | AnyReader | NonSeekingReader | ours |\n|---|---|---|---|---|")
    short = False
    with tempfile.TemporaryDirectory() as folder:
        for name, case in CASES.items():
            path = Path(folder) / f"whole{case.suffix}"
            path.unlink(missing_ok=True)
            case.write(path, case.kind)
            whole = path.read_bytes()
            cuts = [len(whole) * k // (options.cuts + 1) for k in range(1, options.cuts + 1)]
            physically, counts = there(path, case, cuts), dict.fromkeys((by_rosbags, by_us), 0)
            if case.suffix == ".mcap":
                counts[by_mcap] = 0
            for read in counts:
                assert recovered(read, path, case) == 2 * SCANS
            cut_file = Path(folder) / f"cut{case.suffix}"
            for cut in cuts:
                cut_file.write_bytes(whole[:cut])
                for read in counts:
                    counts[read] += recovered(read, cut_file, case)
            ours, other = counts[by_us], counts.get(by_mcap, "-")
            share = f"{ours} ({100 * ours / physically:.1f} %)"
            print(f"| {name} | {physically} | {counts[by_rosbags]} | {other} | {share} |")
            sys.stdout.flush()
            short |= ours < 0.98 * physically
    return int(short)


if __name__ == "__main__":
    raise SystemExit(main())
