"""FastSLAM's accuracy and time: ours against MRPT's `rbpf-slam` on the same log, in one run.

MRPT's filter, from Debian's libmrpt-slam-dev, runs with configurations of Debian's mrpt-common: its
two for the Intel log, and the sparse one for grids that was written for another, and
is fed the scans and the odometry that ours gets; its own program cannot read what its own
`carmen2rawlog` writes. Ours runs with its defaults, and as that configuration does: 10 particles,
updated every 1.2 m or 35 degrees. Errors are those of Freiburg's relations within the part that is
taken; seconds are of the filter alone, though ours reads the log within them.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from math import pi
from pathlib import Path
from typing import Unpack

import numpy as np

from formats.errors import Notes
from formats.frame import Floats
from formats.relations import Relations, read_relations
from formats.stream import open_log, survey
from formats.streaming.drive import Drive
from replay.localise.localising import localise
from replay.localise.options import Options
from replay.localise.poses import carried
from replay.trajectories.errors import planar_trajectory
from replay.trajectories.relations import relation_errors
from scripts.bench_localise import MISSING, build

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "carmen" / "mola_radish"
CONFIG = Path("/usr/share/mrpt/config_files/rbpf-slam")
CONFIGS = (
    "gridmapping_RBPF_ICPbased_intel.ini",
    "gridmapping_intel.ini",
    "gridmapping_RBPF_grid_ICPbased_malaga.ini",
)
SOURCE = Path(__file__).with_name("mrpt_slam.cpp")
THEIRS: Options = {"particles": 10, "update_min_d": 1.2, "update_min_a": 35 * pi / 180}
FAR = 50.0  # m: Intel's 81.9 is no return


def write(path: Path, drive: Drive, scans: int) -> None:
    """As `mrpt_slam` reads it: scans, beams, aperture, middle, range; pose and ranges of each."""
    frames = list(drive.frames())[:scans]
    bearings = frames[0].scan.bearings
    aperture, middle = float(bearings[-1] - bearings[0]), float(bearings[-1] + bearings[0]) / 2
    head = [len(frames), len(bearings), aperture, middle, FAR]
    with path.open("wb") as file:
        file.write(np.array(head, dtype=np.float64).tobytes())
        for frame, pose in zip(frames, drive.poses, strict=False):
            ranges = np.nan_to_num(frame.scan.ranges, nan=2 * FAR, posinf=2 * FAR)
            file.write(np.array(pose, dtype=np.float64).tobytes())
            file.write(ranges.astype(np.float32).tobytes())


def mrpt(program: Path, config: Path, path: Path, drive: Drive) -> tuple[float, Floats]:
    """Seconds, and poses (m, 3) of all frames: odometry between MRPT's updates."""
    command = [str(program), str(config), str(path), str(path.with_suffix(".txt"))]
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    lines = path.with_suffix(".txt").read_text(encoding="ascii").splitlines()
    found = np.array([[float(word) for word in line.split()] for line in lines[1:]])
    rows = found[:, 0].astype(np.intp)
    last = np.append(np.diff(rows) > 0, True)
    return float(lines[0]), carried(drive.times_ns, drive.poses, rows[last], found[last, 1:])


def ours(drive: Drive, seed: int, **options: Unpack[Options]) -> tuple[float, Floats]:
    """The same of `localise`."""
    begin = time.perf_counter()
    found = localise(drive, None, method="fastslam", seed=seed, **options)
    return time.perf_counter() - begin, found.poses


def said(name: str, drive: Drive, poses: Floats, seconds: float, relations: Relations) -> str:
    """A row of the table."""
    times = drive.times_ns
    fresh = np.append(True, np.diff(times) > 0)
    errors = relation_errors(planar_trajectory(times[fresh], poses[fresh]), relations)
    metres, degrees = errors.metres, np.degrees(errors.radians)
    return (
        f"  {name:<9}{seconds:8.1f} s   {metres.mean():7.3f} +- {metres.std():.3f} m   "
        f"{degrees.mean():6.2f} +- {degrees.std():.2f} deg   {len(metres)} relations"
    )


def main(argv: list[str] | None = None) -> int:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--log", choices=["intel", "aces"], default="intel")
    parser.add_argument("--seconds", type=float, default=988.0, help="of the log's beginning")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--config", action="append", help="of MRPT")
    args = parser.parse_args(argv)
    source = DATA / f"{args.log}.clf.bz2"
    if not source.exists():
        print(f"FastSLAM was not measured; it needs {source}")
        return 0
    notes = Notes()
    drive = survey(open_log(source, notes), notes, poses="odometry", duration=args.seconds)
    relations = read_relations(source.with_name(f"{args.log}.relations"))
    localise(
        survey(open_log(source, notes), notes, poses="odometry", duration=20.0),
        None,
        method="fastslam",
        particles=2,
    )  # compiles
    print(f"{args.log}: {len(drive)} scans")
    seconds, poses = ours(drive, args.seed)
    print(said("ours", drive, poses, seconds, relations), flush=True)
    few, poses = ours(drive, args.seed, **THEIRS)
    print(said("sparse", drive, poses, few, relations), "  10 particles, 1.2 m or 35 deg")
    print(said("odometry", drive, drive.poses, 0.0, relations), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        program, path = build(Path(folder), SOURCE), Path(folder) / "scans.bin"
        if program is None or not CONFIG.exists():
            print(MISSING)
            return 0
        write(path, drive, len(drive))
        for config in args.config or CONFIGS:
            theirs, poses = mrpt(program, CONFIG / config, path, drive)
            print(said("MRPT", drive, poses, theirs, relations), f"  {config}")
            print(f"    of its time ours takes {seconds / theirs:.2f}, sparse {few / theirs:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
