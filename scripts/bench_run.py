"""`replay run` on a log made on the spot: real-time factor, shares, memory.

python -m scripts.bench_run [--minutes 10] [--times 10]
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from scripts.flat import LEFT, LOW, cast, drive, picture, plan_boxes, real_boxes
from scripts.make_sample_logs import YAML, Messages, at

REPLAY = str(Path(sys.executable).with_name("replay"))
BEAMS, HZ, FAR = 1081, 10.0, 30.0
START_NS = 1_700_000_000_000_000_000


def make_log(path: Path, minutes: float, repeat: int = 1) -> int:
    """A drive of `minutes` through the flat with a 270 degree lidar, `repeat` times; its scans."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    make, track, boxes = Messages(store, ros1=False), drive(), real_boxes()
    rng = np.random.default_rng(1)
    step = np.deg2rad(0.25)
    angles = (np.arange(BEAMS) - BEAMS // 2) * step
    scan_type, tf_type = "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
    once = round(minutes * 60 * HZ)
    readings = []
    for i in range(once):
        # There and back again along the drive, for as long as it takes.
        t = abs((i / HZ + track.times[-1]) % (2 * track.times[-1]) - track.times[-1])
        x, y, yaw = at(track, t)
        ranges = cast(boxes, x, y, angles + yaw, FAR) + rng.normal(0, 0.01, BEAMS)
        readings.append((x, y, yaw, ranges))
    with path.open("wb") as f:
        writer = Writer(f, compression=CompressionType.ZSTD)
        writer.start(profile="ros2")
        channels = {}
        for topic, kind in (("/scan", scan_type), ("/tf", tf_type), ("/tf_static", tf_type)):
            text = store.generate_msgdef(kind, ros_version=2)[0].encode()
            schema = writer.register_schema(kind, "ros2msg", text)
            channels[topic] = writer.register_channel(topic, "cdr", schema)

        def put(topic: str, t_ns: int, message: object, kind: str) -> None:
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], t_ns, data, t_ns)

        fixed = make.transform(START_NS, "base_link", "laser", (0.0, 0.0, 0.2), 0.0)
        put("/tf_static", START_NS, make.tf(fixed), tf_type)
        for i in range(once * repeat):
            x, y, yaw, ranges = readings[i % once]
            t_ns = START_NS + round(i / HZ * 1e9)
            moved = make.transform(t_ns, "map", "base_link", (x, y, 0.0), yaw)
            put("/tf", t_ns, make.tf(moved), tf_type)
            put("/scan", t_ns, make.laser(t_ns, "laser", angles[0], step, FAR, ranges), scan_type)
        writer.finish()
    return once * repeat


def run(folder: Path, log: Path, *words: str) -> tuple[float, float, dict[str, object]]:
    """Seconds of the whole process, its peak resident MB, and what it answered."""
    command = [REPLAY, "run", str(log), "--prior", str(folder / "plan.png"), "--json", "--force"]
    command += ["-o", str(folder / "out.replay.mcap"), *words]
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    out = process.stdout.read() if process.stdout else b""
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    if status:
        sys.exit(f"replay run failed: {command}")
    return seconds, usage.ru_maxrss / 1024, json.loads(out)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--times", type=int, default=10, help="how much longer the long log is")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cv2.imwrite(str(folder / "plan.png"), picture(plan_boxes(), 0.02))
        text = YAML.format(image="plan.png", resolution=0.02, x=LEFT - 0.4, y=LOW - 0.4)
        (folder / "plan.yaml").write_text(text)
        log = folder / "log.mcap"
        scans = make_log(log, options.minutes)
        span = options.minutes * 60
        print(f"replay run, {scans} scans of {BEAMS} beams, {span:.0f} s, 0.05 m, result and .rrd")
        runs = [run(folder, log, "--rrd", str(folder / "out.rrd")) for _ in range(6)][1:]
        seconds = statistics.median(took for took, _, _ in runs)
        peak = statistics.median(mb for _, mb, _ in runs)
        print(
            f"  whole process   {seconds:6.2f} s   {span / seconds:.0f} x real time   {peak:.0f} MB"
        )
        plain = statistics.median(run(folder, log)[0] for _ in range(5))
        print(f"  without .rrd    {plain:6.2f} s   {span / plain:.0f} x real time")
        shares = runs[-1][2]["seconds"]
        assert isinstance(shares, dict)
        for stage, took in shares.items():
            print(f"    {stage:<12}{took:8.2f} s   {1e6 * took / scans:6.0f} us a scan")
        long = folder / "long.mcap"
        make_log(long, options.minutes, options.times)
        _, more, _ = run(folder, long, "--rrd", str(folder / "out.rrd"))
        _, bare, _ = run(folder, long)
        print(f"  {options.times} times as long: {more:.0f} MB against {peak:.0f} MB", end="")
        print(f" ({bare:.0f} MB without .rrd)")


if __name__ == "__main__":
    main()
