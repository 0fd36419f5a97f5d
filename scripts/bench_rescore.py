"""Results scored a second under other priors, and how much faster that is than running again.

python -m scripts.bench_rescore [--results 200] [--minutes 10]
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from formats.results.kept import read_kept
from replay import rescore, run
from replay.archive.rescoring import at_the_end
from scripts.bench_run import make_log
from scripts.flat import LEFT, LOW, picture, plan_boxes
from scripts.make_sample_logs import YAML

ROWS, COLS, SIDE = 200, 860, 0.05  # cells, and m a cell: a corridor of 10 x 43 m
PIXEL = 0.02


def corridor(folder: Path) -> Path:
    """The flat of the other benches within walls of 43 x 10 m; the lattice is the plan's."""
    flat = picture(plan_boxes(), PIXEL)
    out = np.full((round(ROWS * SIDE / PIXEL), round(COLS * SIDE / PIXEL)), 255, dtype=np.uint8)
    out[:10], out[-10:], out[:, :10], out[:, -10:] = 0, 0, 0, 0
    out[20 : 20 + flat.shape[0], 20 : 20 + flat.shape[1]] = flat
    for x in range(700, out.shape[1], 150):
        out[:350, x : x + 6] = 0
    cv2.imwrite(str(folder / "plan.png"), out)
    low = LOW - 0.4 - (out.shape[0] - 20 - flat.shape[0]) * PIXEL
    text = YAML.format(image="plan.png", resolution=PIXEL, x=LEFT - 0.8, y=low)
    (folder / "plan.yaml").write_text(text)
    return folder / "plan.png"


def timed(work: Callable[[], object], times: int = 5) -> float:
    """Median seconds, the first time aside."""
    took = []
    for _ in range(times + 1):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return statistics.median(took[1:])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--results", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=10.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan, log = corridor(folder), folder / "log.mcap"
        scans = make_log(log, options.minutes)
        first = folder / "runs" / "0.replay.mcap"
        first.parent.mkdir()

        def again() -> None:
            run(log, plan, output=first, force=True, max_range=2.0)

        slow = timed(again, 3)
        kept = read_kept(first)
        rows, cols = kept.geometry.shape
        if (rows, cols) != (ROWS, COLS):
            sys.exit(f"the lattice is {rows} x {cols}")
        assert kept.groups is not None
        size = first.stat().st_size / 1e6
        for i in range(1, options.results):
            shutil.copy(first, first.with_name(f"{i}.replay.mcap"))
        print(f"{options.results} results of {scans} scans, {rows} x {cols} cells, {size:.1f} MB,")
        cells, groups = int(kept.groups.cells.sum()), len(kept.groups.kind)
        print(f"  {cells} scored cells in {groups} groups; files read every time, one core")
        one = timed(lambda: rescore(first.parent, p_wall=0.3, p_space=0.8)) / options.results
        print(f"  one prior, at the end      {1 / one:8.0f} results a second")
        read = timed(lambda: [read_kept(path) for path in first.parent.iterdir()])
        print(f"    of that, reading         {read / options.results / one:8.0%}")
        grid = {"p_wall": np.linspace(0.05, 0.5, 10).tolist()}
        grid["p_space"] = np.linspace(0.5, 0.95, 10).tolist()
        priors = [{"p_wall": w, "p_space": s} for w in grid["p_wall"] for s in grid["p_space"]]
        many = timed(lambda: at_the_end(read_kept(first), priors))
        print(f"  100 priors, at the end     {1 / many:8.0f} results a second", end="")
        print(f", {100 / many:.0f} scores a second")
        rows100 = timed(lambda: rescore(first.parent, grid=grid), 1) / options.results
        print(f"    with rows of all metrics {1 / rows100:8.0f} results a second")
        slower = timed(lambda: rescore(first, p_wall=0.3, over_time=True))
        print(f"  one prior, at keyframes    {1 / slower:8.0f} results a second")
        print(f"  running the log again      {slow:8.2f} s: {slow / one:.0f} times as long")


if __name__ == "__main__":
    main()
