"""Mapping speed: one scan into the map, ours against MRPT's C++ on the same scans, in one run.

1081 beams over 270 degrees, 0.05 m cells, readings to 10 m (a beam without a return clears 10 m in
both), in a hall with pillars; the grids have their size before the first scan. Microseconds a scan,
medians over rounds that take turns. MRPT comes from Debian's libmrpt-maps-dev.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from math import ceil, cos, floor, pi, sin
from pathlib import Path
from statistics import median

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Frame, Pose, Scan
from formats.grid import Counted, Geometry
from formats.jit import njit
from replay.mapper import Mapper

BEAMS, STEP, FAR, CELL, HALF = 1081, pi / 720, 10.0, 0.05, 13.0
PILLARS = [(3, 2, 0.3), (-4, 3, 0.5), (2, -4, 0.2), (-3, -3, 0.4), (6, -1, 0.25), (-6, 0, 0.3)]
SOURCE = Path(__file__).with_name("mrpt_insert.cpp")
MISSING = "MRPT was not measured; it needs `apt-get install g++ libmrpt-maps-dev`"
OURS, MRPT = ("sectors", "polygon", "ray by ray"), ("MRPT plain", "MRPT widening beams")
PAIRS = [("sectors", "MRPT widening beams", 3.0), ("polygon", "MRPT plain", 3.0)]


def ranges(pose: Pose, bearings: Floats, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """What a lidar sees in a hall of 18 x 12 m with round pillars, with 1 cm of noise."""
    u, v = np.cos(bearings + pose.yaw), np.sin(bearings + pose.yaw)
    with np.errstate(divide="ignore"):
        r = np.minimum((np.copysign(9, u) - pose.x) / u, (np.copysign(6, v) - pose.y) / v)
    for x, y, radius in PILLARS:
        dx, dy = x - pose.x, y - pose.y
        along = dx * u + dy * v
        deep = radius**2 - (dx**2 + dy**2 - along**2)
        near = along - np.sqrt(np.maximum(deep, 0.0))
        r = np.where((deep > 0) & (along > 0), np.minimum(r, near), r)
    return (r + rng.normal(0, 0.01, r.size)).astype(np.float32)


def drive(scans: int) -> list[Frame]:
    """A circle through the hall."""
    rng = np.random.default_rng(1)
    bearings: Floats = (np.arange(BEAMS) - BEAMS // 2).astype(np.float64) * STEP
    widths = np.full(BEAMS, STEP)
    frames = []
    for k, a in enumerate(np.linspace(0.0, 2 * pi, scans, endpoint=False)):
        pose = Pose(2 * cos(a), 2 * sin(a), float(a))
        scan = Scan(bearings, widths, ranges(pose, bearings, rng), 0.05, FAR)
        frames.append(Frame(k, pose, scan))
    return frames


@njit
def trace(
    r: Floats, u: Floats, v: Floats, x: float, y: float, seen: Counted, now: int, counts: Counted
) -> None:
    """The usual way: cells along every ray, each once a scan; x, y and r in cells."""
    for i in range(r.size):
        if r[i] < FAR / CELL:
            row, col = floor(y + r[i] * v[i]), floor(x + r[i] * u[i])
            if seen[row, col] != now:
                seen[row, col] = now
                counts[0, row, col] += 1
    for i in range(r.size):
        length = min(r[i] - 0.5, FAR / CELL)
        n = max(ceil(length * max(abs(u[i]), abs(v[i]))), 1)
        du, dv = length * u[i] / n, length * v[i] / n
        for k in range(n):
            row, col = floor(y + k * dv), floor(x + k * du)
            if seen[row, col] != now:
                seen[row, col] = now
                counts[1, row, col] += 1


class RayByRay:
    """A mapper of that kind."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry, self._now = geometry, 0
        self._seen = np.zeros(geometry.shape, dtype=np.uint32)
        self._counts = np.zeros((2, *geometry.shape), dtype=np.uint32)

    def insert(self, frame: Frame) -> None:
        """Count a reading."""
        g, pose, scan = self._geometry, frame.pose, frame.scan
        self._now += 1
        angles = scan.bearings + pose.yaw
        r = scan.ranges.astype(np.float64) / CELL
        x, y = (pose.x - g.x) / CELL, (pose.y - g.y) / CELL
        trace(r, np.cos(angles), np.sin(angles), x, y, self._seen, self._now, self._counts)


def time_ours(frames: list[Frame], rounds: int) -> dict[str, list[float]]:
    """Microseconds of every insertion."""
    geometry = Geometry.covering(-HALF, -HALF, HALF, HALF, CELL)
    mappers: dict[str, Mapper | RayByRay] = {
        "sectors": Mapper(geometry, max_range=FAR, no_return="clear"),
        "polygon": Mapper(geometry, max_range=FAR, no_return="clear", shape="polygon"),
        "ray by ray": RayByRay(geometry),
    }
    took: dict[str, list[float]] = {name: [] for name in mappers}
    for name, mapper in mappers.items():
        mapper.insert(frames[0])  # compiles
        for frame in frames * rounds:
            start = time.perf_counter_ns()
            mapper.insert(frame)
            took[name].append((time.perf_counter_ns() - start) / 1e3)
    return took


def build(folder: Path) -> Path | None:
    """MRPT's side, compiled on the spot; None where it cannot be."""
    include = [*Path("/usr/include/mrpt").glob("*/include"), Path("/usr/include/eigen3")]
    program = folder / "mrpt_insert"
    libraries = [f"-lmrpt-{part}" for part in ("maps", "obs", "poses", "math", "system", "core")]
    flags = [f"-I{path}" for path in include]
    command = ["g++", "-std=c++17", "-O2", *flags, str(SOURCE), "-o", str(program), *libraries]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return None
    print(done.stderr[-2000:], file=sys.stderr, end="")
    return program if done.returncode == 0 else None


def time_mrpt(program: Path, scans: Path, rounds: int) -> dict[str, list[float]]:
    """Microseconds of every insertion."""
    took = {}
    for widening, name in enumerate(MRPT):
        command = [str(program), str(scans), str(widening), str(rounds)]
        out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        took[name] = [float(line) / 1e3 for line in out.split()]
    return took


def write_scans(path: Path, frames: list[Frame]) -> None:
    """The scans as `mrpt_insert` reads them: eight float64, then pose and ranges of each."""
    head = [len(frames), BEAMS, (BEAMS - 1) * STEP, FAR, CELL, HALF, 0.7, 0.6]
    with path.open("wb") as file:
        file.write(np.array(head, dtype=np.float64).tobytes())
        for frame in frames:
            file.write(np.array(frame.pose, dtype=np.float64).tobytes())
            file.write(frame.scan.ranges.astype(np.float32).tobytes())


def main(argv: list[str] | None = None) -> int:
    """Measure, print a table and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=4)
    args = parser.parse_args(argv)
    frames = drive(args.scans)
    took: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        program, scans = build(Path(folder)), Path(folder) / "scans.bin"
        write_scans(scans, frames)
        for _ in range(args.rounds):  # in turns, so that a slow moment hits all of them
            part = time_ours(frames, 1)
            if program:
                part |= time_mrpt(program, scans, 1)
            for name, times in part.items():
                took.setdefault(name, []).extend(times)
    print(f"a scan into the map, us, median of {len(took['sectors'])}")
    for name, times in took.items():
        print(f"  {name:<20} {median(times):7.1f}   (10 %: {np.percentile(times, 10):.1f})")
    if program is None:
        print(MISSING)
        return 0
    for ours, theirs, goal in PAIRS:
        ratio = median(took[theirs]) / median(took[ours])
        print(f"  {ours}: {ratio:.1f} times as fast as {theirs} (goal: {goal:.0f})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
