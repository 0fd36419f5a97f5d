"""Localisation speed: one update of AMCL, ours against MRPT's C++ on the same scans, in one run.

2000 particles, 180 beams over 270 degrees, likelihood fields on cells of 0.05 m, in a hall with
pillars: move by odometry with noise, weigh, resample. Microseconds an update, medians over rounds
that take turns. MRPT, from Debian's libmrpt-slam-dev, runs with its own settings, but for all beams
instead of every fifth, and resampling at every update as ours does.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from math import cos, hypot, pi, sin
from pathlib import Path
from statistics import median

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Pose
from formats.grid import Geometry
from replay.localise.amcl import Amcl, Parameters
from replay.localise.estimate import Estimate
from replay.localise.field import Field
from replay.localise.likelihood import LikelihoodField, Reading

BEAMS, APERTURE, FAR, CELL, PARTICLES = 180, 1.5 * pi, 25.0, 0.05, 2000
PILLARS = [(3, 2, 0.3), (-4, 3, 0.5), (2, -4, 0.2), (-3, -3, 0.4), (6, -1, 0.25), (-6, 0, 0.3)]
HALL = Geometry(260, 380, CELL, -9.5, -6.5)
SOURCE = Path(__file__).with_name("mrpt_localise.cpp")
MISSING = "MRPT was not measured; it needs `apt-get install g++ libmrpt-slam-dev mrpt-common`"
GOAL = 12.0
Walls = npt.NDArray[np.bool_]


def hall() -> Walls:
    """A hall of 18 x 12 m with round pillars: (rows, cols), row 0 lowest."""
    x = HALL.x + (np.arange(HALL.cols) + 0.5) * CELL
    y = (HALL.y + (np.arange(HALL.rows) + 0.5) * CELL)[:, None]
    wall = (np.abs(x) > 9) | (np.abs(y) > 6)
    for px, py, radius in PILLARS:
        wall |= np.hypot(x - px, y - py) < radius
    return wall


def ranges(pose: Pose, bearings: Floats, rng: np.random.Generator) -> Floats:
    """What a lidar sees there, with 1 cm of noise."""
    u, v = np.cos(bearings + pose.yaw), np.sin(bearings + pose.yaw)
    with np.errstate(divide="ignore"):
        r = np.minimum((np.copysign(9, u) - pose.x) / u, (np.copysign(6, v) - pose.y) / v)
    for x, y, radius in PILLARS:
        dx, dy = x - pose.x, y - pose.y
        along = dx * u + dy * v
        deep = radius**2 - (dx**2 + dy**2 - along**2)
        near = along - np.sqrt(np.maximum(deep, 0.0))
        r = np.where((deep > 0) & (along > 0), np.minimum(r, near), r)
    return r + rng.normal(0, 0.01, r.size)


def drive(scans: int) -> list[tuple[Pose, Reading]]:
    """A circle through the hall, 20 cm a scan."""
    rng = np.random.default_rng(1)
    bearings: Floats = np.linspace(-0.5 * APERTURE, 0.5 * APERTURE, BEAMS)
    found = []
    for k in range(scans):
        a = 0.1 * k
        pose = Pose(2 * cos(a), 2 * sin(a), a + 0.5 * pi)
        found.append((pose, Reading(Pose(0, 0, 0), bearings, ranges(pose, bearings, rng), FAR)))
    return found


def field(wall: Walls) -> Field:
    """Distances from the faces of the walls."""
    from scipy.ndimage import distance_transform_edt

    outside, inside = distance_transform_edt(~wall), distance_transform_edt(wall)
    distance = np.where(wall, 0.5 - inside, outside - 0.5) * CELL
    return Field(HALL, distance.astype(np.float32), np.flatnonzero(~wall))


def time_ours(
    way: list[tuple[Pose, Reading]], wall: Walls
) -> tuple[list[float], list[float], Pose]:
    """Microseconds of every update, of its weighing alone, and the last pose."""
    ground = field(wall)
    model = LikelihoodField(ground)
    fixed = Parameters(min_particles=PARTICLES, max_particles=PARTICLES)
    start = Estimate(way[0][0], np.diag([1e-6, 1e-6, 1e-6]))
    Amcl(ground, model, fixed, start=start).update(*way[0])  # compiles
    filtering = Amcl(ground, model, fixed, start=start)
    whole, weighing = [], []
    for pose, reading in way:
        begin = time.perf_counter_ns()
        filtering.update(pose, reading)
        whole.append((time.perf_counter_ns() - begin) / 1e3)
        begin = time.perf_counter_ns()
        model.costs(filtering.particles, reading)
        weighing.append((time.perf_counter_ns() - begin) / 1e3)
    return whole, weighing, filtering.estimate.pose


def build(folder: Path, source: Path = SOURCE) -> Path | None:
    """MRPT's side, compiled on the spot; None where it cannot be."""
    include = [*Path("/usr/include/mrpt").glob("*/include"), Path("/usr/include/eigen3")]
    program = folder / source.stem
    parts = ("slam", "maps", "obs", "bayes", "poses", "math", "random", "config", "system", "core")
    flags = [f"-I{path}" for path in include]
    libraries = [f"-lmrpt-{part}" for part in parts]
    command = ["g++", "-std=c++17", "-O2", *flags, str(source), "-o", str(program), *libraries]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return None
    return program if done.returncode == 0 else None


def time_mrpt(program: Path, path: Path, scans: int) -> tuple[list[float], list[float], Pose]:
    """The same of MRPT."""
    out = subprocess.run([program, path], capture_output=True, text=True, check=True).stdout
    numbers = [float(line) for line in out.split()]
    whole, weighing = numbers[:scans], numbers[scans : 2 * scans]
    return [ns / 1e3 for ns in whole], [ns / 1e3 for ns in weighing], Pose(*numbers[-3:])


def write(path: Path, way: list[tuple[Pose, Reading]], wall: Walls) -> None:
    """As `mrpt_localise` reads it: ten float64, the walls, then pose and ranges of each scan."""
    head = [len(way), BEAMS, APERTURE, FAR, CELL, HALL.cols, HALL.rows, HALL.x, HALL.y, PARTICLES]
    with path.open("wb") as file:
        file.write(np.array(head, dtype=np.float64).tobytes())
        file.write(wall.astype(np.uint8).tobytes())
        for pose, reading in way:
            file.write(np.array(pose, dtype=np.float64).tobytes())
            file.write(reading.ranges.astype(np.float32).tobytes())


def main(argv: list[str] | None = None) -> int:
    """Measure, print a table and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=4)
    args = parser.parse_args(argv)
    way, wall = drive(args.scans), hall()
    took: dict[str, tuple[list[float], list[float]]] = {"ours": ([], [])}
    ended: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        program, path = build(Path(folder)), Path(folder) / "scans.bin"
        write(path, way, wall)
        for _ in range(args.rounds):  # in turns, so that a slow moment hits both
            parts = {"ours": time_ours(way, wall)}
            if program:
                parts["MRPT"] = time_mrpt(program, path, args.scans)
            for name, (whole, weighing, pose) in parts.items():
                found = took.setdefault(name, ([], []))
                found[0].extend(whole[1:])
                found[1].extend(weighing[1:])
                ended[name] = hypot(pose.x - way[-1][0].x, pose.y - way[-1][0].y)
    print(f"{PARTICLES} particles x {BEAMS} beams, us, median of {len(took['ours'][0])}")
    for name, (whole, weighing) in took.items():
        print(
            f"  {name:<6} update {median(whole):8.1f}   weighing alone {median(weighing):8.1f}   "
            f"ended {ended[name]:.2f} m off"
        )
    if program is None:
        print(MISSING)
        return 0
    for k, what in enumerate(("update", "weighing")):
        ratio = median(took["MRPT"][k]) / median(took["ours"][k])
        print(f"  {what}: {ratio:.1f} times as fast as MRPT (goal: {GOAL:.0f})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
