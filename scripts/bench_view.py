"""What viewing costs: a long log with .rrd and without, in turn, and the size of the recording.

python -m scripts.bench_view [--minutes 60] [--pairs 5]

Wall time is what the user waits; processor time is of all processes of a run, the one that draws
included. Ratios are medians over pairs, so that what else the machine does falls out, mostly.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import cv2

from scripts.bench_run import BEAMS, REPLAY, make_log
from scripts.flat import LEFT, LOW, picture, plan_boxes
from scripts.make_sample_logs import YAML

ONCE = 10.0  # minutes that are cast; a longer log repeats them


class Cost(NamedTuple):
    """Of one run: s, s of all its processes, MB that the largest of them held."""

    wall: float
    processor: float
    peak: float


def cost(folder: Path, *words: str) -> Cost:
    """Runs the log in the folder."""
    command = [REPLAY, "run", "log.mcap", "--prior", "plan.png", "--json", "--force"]
    start = time.perf_counter()
    process = subprocess.Popen(
        [*command, "-o", "out.replay.mcap", *words], cwd=folder, stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status:
        sys.exit(f"replay run failed: {command}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def main() -> None:
    """Prints a line a pair, and the ratios."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--pairs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cv2.imwrite(str(folder / "plan.png"), picture(plan_boxes(), 0.02))
        text = YAML.format(image="plan.png", resolution=0.02, x=LEFT - 0.4, y=LOW - 0.4)
        (folder / "plan.yaml").write_text(text)
        once = min(options.minutes, ONCE)
        scans = make_log(folder / "log.mcap", once, max(1, round(options.minutes / once)))
        print(f"viewing, {scans} scans of {BEAMS} beams: with .rrd / without")
        cost(folder, "--rrd", "out.rrd")  # kernels and files are warm from here on
        pairs: list[tuple[Cost, Cost]] = []
        for _ in range(options.pairs):
            pairs.append((cost(folder, "--rrd", "out.rrd"), cost(folder)))
            seen, bare = pairs[-1]
            print(
                f"  wall {seen.wall:6.2f} / {bare.wall:6.2f} s   "
                f"processor {seen.processor:6.2f} / {bare.processor:6.2f} s   "
                f"memory {seen.peak:4.0f} / {bare.peak:4.0f} MB",
                flush=True,
            )
        wall = statistics.median(seen.wall / bare.wall for seen, bare in pairs)
        processor = statistics.median(seen.processor / bare.processor for seen, bare in pairs)
        size = (folder / "out.rrd").stat().st_size / 1e6
        print(
            f"  viewing costs {wall - 1:+.0%} of wall time (aim: under 20 %), "
            f"{processor - 1:+.0%} of processor time; .rrd {size:.1f} MB (aim: under 200)"
        )


if __name__ == "__main__":
    main()
