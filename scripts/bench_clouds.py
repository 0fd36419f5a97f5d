"""Point clouds of a 3D lidar made on the spot: ours against kiss-icp's loaders, in one run.

Microseconds a PointCloud2 of 64 rings x 1024 points, the median of several rounds that take turns.
The floor is the file's bytes read and decompressed, chunk by chunk. kiss-icp (pip install kiss-icp)
reads all three by its loader for rosbags, which drops the points without a return; its MCAP loader
fails with mcap-ros2-support 0.6.
Ours goes one step further as well, to the scan that the points in a slab of heights make.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from formats.errors import Notes
from formats.opening import open_log
from formats.ros import decoders as ros
from formats.streaming.scanning import scanner
from scripts.bench_depth import read_and_decompress
from scripts.timing import medians

RINGS, COLUMNS = 64, 1024
TOPIC, TYPE = "/points", "sensor_msgs/msg/PointCloud2"
FIELDS = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
AT = np.eye(4) + np.outer([0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.5])  # half a metre up


def clouds(count: int) -> list[np.ndarray]:
    """Points of a lidar that turns in a room of 12 x 8 x 3 m, ranges with 2 cm of noise."""
    rng = np.random.default_rng(1)
    up = np.linspace(-0.4, 0.3, RINGS)[:, None]
    turn = np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)[None]
    towards = np.stack(
        np.broadcast_arrays(np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up))
    )
    walls = np.array([6.0, 4.0, 1.5])[:, None, None]
    with np.errstate(divide="ignore"):
        far = np.min(walls / np.abs(towards), axis=0)
    made = []
    for _ in range(count):
        cloud = np.zeros((RINGS, COLUMNS), dtype=FIELDS)
        reach = far + rng.normal(0, 0.02, far.shape)
        for axis, values in zip("xyz", towards * reach, strict=True):
            cloud[axis] = values
        made.append(cloud)
    return made


def write_logs(folder: Path, count: int) -> dict[str, Path]:
    """The same clouds as MCAP, uncompressed and zstd, and as a ROS 1 bag."""
    some = clouds(8)
    old, new = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    logs = {name: folder / name for name in ("none.mcap", "zstd.mcap", "clouds.bag")}
    writers = []
    for name in ("none", "zstd"):
        writer = McapWriter(str(logs[f"{name}.mcap"]), compression=CompressionType[name.upper()])
        writer.start(profile="ros2")
        text = new.generate_msgdef(TYPE, ros_version=2)[0].encode()
        writer.register_channel(TOPIC, "cdr", writer.register_schema(TYPE, "ros2msg", text))
        writers.append(writer)
    with BagWriter(logs["clouds.bag"]) as bag:
        connection = bag.add_connection(TOPIC, TYPE, typestore=old)
        for number in range(count):
            at, cloud = 10**18 + number * 10**8, some[number % len(some)]
            bag.write(
                connection, at, bytes(old.serialize_ros1(message(old, at, cloud, seq=number), TYPE))
            )
            payload = bytes(new.serialize_cdr(message(new, at, cloud), TYPE))
            for writer in writers:
                writer.add_message(1, at, payload, at)
    for writer in writers:
        writer.finish()
    return logs


def message(store: Typestore, at: int, cloud: np.ndarray, **ros1: int) -> object:
    """One cloud as a message of ROS 1 or 2, whose headers differ."""
    types = store.types
    time = types["builtin_interfaces/msg/Time"](at // 10**9, at % 10**9)
    field = types["sensor_msgs/msg/PointField"]
    return types[TYPE](
        header=types["std_msgs/msg/Header"](**ros1, stamp=time, frame_id="lidar"),
        height=RINGS,
        width=COLUMNS,
        fields=[field(name, 4 * i, 7, 1) for i, name in enumerate(FIELDS.names or ())],
        is_bigendian=False,
        point_step=FIELDS.itemsize,
        row_step=FIELDS.itemsize * COLUMNS,
        data=np.frombuffer(cloud.tobytes(), dtype=np.uint8),
        is_dense=True,
    )


def our_points(path: Path) -> None:
    """Ours: messages as points."""
    log = open_log(path, Notes())
    decode = ros.decoder(log.topics()[0])
    for _, _, data in log.messages():
        decode(data)
    log.close()


def our_scans(path: Path) -> None:
    """Ours: messages made Scans, as the frame stream does it."""
    log = open_log(path, Notes())
    scan = scanner(log.topics()[0])
    for _, _, data in log.messages():
        scan(data, AT, None)
    log.close()


def kiss_icp(path: Path) -> None:
    """kiss-icp's loader."""
    from kiss_icp.datasets.rosbag import RosbagDataset

    loader = RosbagDataset(path, TOPIC)
    for number in range(len(loader)):
        loader[number]


def main(argv: list[str] | None = None) -> int:
    """Print a line a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clouds", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args(argv)
    jobs: dict[str, Callable[[Path], None]] = {"ours, points": our_points, "ours, scans": our_scans}
    if find_spec("kiss_icp"):
        jobs["kiss-icp"] = kiss_icp
    print(f"{'us a cloud of 65,536 points':28}{'floor':>8}", *(f"{name:>13}" for name in jobs))
    with tempfile.TemporaryDirectory() as folder:
        for name, path in write_logs(Path(folder), options.clouds).items():
            floor = {"floor": read_and_decompress} if path.suffix == ".mcap" else {}
            took = medians({**floor, **jobs}, path, options.rounds)
            row = [f"{1e6 * took[job] / options.clouds:.0f}" for job in jobs]
            least = f"{1e6 * took['floor'] / options.clouds:.0f}" if floor else "-"
            print(f"  {name:26}{least:>8}", *(f"{value:>13}" for value in row), end="")
            ratio = took["kiss-icp"] / took["ours, points"] if "kiss-icp" in jobs else 0.0
            print(f"   {ratio:.1f} x as fast as kiss-icp" if ratio else "")
    if "kiss-icp" not in jobs:
        print("kiss-icp is not installed: pip install kiss-icp")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
