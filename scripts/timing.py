"""How long jobs take on the same file, held against each other."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median


def medians(jobs: dict[str, Callable[[Path], None]], path: Path, rounds: int) -> dict[str, float]:
    """Median seconds of each job; the jobs take turns, so that a busy spell hits all alike."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for number in range(rounds + 1):
        for name, job in jobs.items():
            begin = time.perf_counter()
            job(path)
            if number:  # the first round warms up
                times[name].append(time.perf_counter() - begin)
    return {name: median(found) for name, found in times.items()}
