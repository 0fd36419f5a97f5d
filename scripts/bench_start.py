"""How fast the command line answers: whole processes, warm, medians.

python -m scripts.bench_start
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

REPLAY = str(Path(sys.executable).with_name("replay"))


def median_ms(command: list[str], runs: int = 15) -> float:
    """Median wall time of a process in ms, after one that warms the caches."""
    times = []
    for _ in range(runs + 1):
        start = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - start)
    return 1000 * statistics.median(times[1:])


def main() -> None:
    """Prints the table."""
    floor = median_ms([sys.executable, "-c", "pass"])
    print(f"start-up, whole process, median of 15 (ms)\n  python -c pass        {floor:6.0f}")
    for words in (["--help"], ["run", "--help"], ["--version"]):
        took = median_ms([REPLAY, *words])
        print(f"  {'replay ' + ' '.join(words):<20}{took:8.0f}   {took / floor:.1f} x python")


if __name__ == "__main__":
    main()
