"""Writes the two documents of numbers from what the scripts print: docs/benchmarks.md, quality.md.

python -m scripts.numbers benchmarks    # speed and memory, against peers and floors, in one run
python -m scripts.numbers quality       # what it finds on real logs, drawings and maps
python -m scripts.numbers quality --only drawings
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("REPLAY_SHARED_DATA", ROOT.parent / "shared" / "data"))


class Table(NamedTuple):
    """One table of a document.

    Attributes:
        name: of its section.
        about: what it shows, one or two sentences.
        command: that prints it, `DATA` standing for the folder of recorded data.
    """

    name: str
    about: str
    command: str


BENCHMARKS = [
    Table("Start-up", "Whole processes, warm.", "python -m scripts.bench_start"),
    Table(
        "Reading",
        "Microseconds a message from a file to what an algorithm consumes.",
        "python -m scripts.bench_read",
    ),
    Table(
        "Memory of reading",
        "The most that a process held that made scans of a log, and of a tenth of it.",
        "python -m scripts.bench_read --memory 1",
    ),
    Table("Clouds", "Microseconds a cloud of a 3D lidar.", "python -m scripts.bench_clouds"),
    Table("Mapping", "Microseconds a scan; MRPT is C++.", "python -m scripts.bench_map"),
    Table("Localisation", "A filter update; MRPT is C++.", "python -m scripts.bench_localise"),
    Table("FastSLAM", "The Intel log; MRPT is C++.", "python -m scripts.bench_slam"),
    Table(
        "Placement",
        "Seconds a map of a process that has its kernels compiled, in the last column.",
        "python -m scripts.score_align halmstad",
    ),
    Table("Tuning", "Surfaces and fronts from sorted evidence.", "python -m scripts.bench_tune"),
    Table("Re-scoring", "Results a second, files read.", "python -m scripts.bench_rescore"),
    Table(
        "Viewing",
        "An hour's log with the viewer's recording and without, in alternating pairs.",
        "python -m scripts.bench_view",
    ),
    Table("End to end", "`replay run` as a whole process.", "python -m scripts.bench_run"),
]
QUALITY = [
    Table(
        "Walls and doors of drawings",
        "CVC-FP and MLSTRUCT-FP, scored against their annotations.",
        "python -m scripts.score_drawings",
    ),
    Table(
        "Placement: Halmstad", "18 maps on their layouts.", "python -m scripts.score_align halmstad"
    ),
    Table("Placement: a real drawing", "UJI's maps.", "python -m scripts.score_align uji"),
    Table("Trajectories", "Poses that were found.", "python -m scripts.trajectories DATA"),
    Table("Door symbols", "Share found.", "python -m scripts.score_symbols symbols"),
    Table("Cut recordings", "Messages that readers get.", "python -m scripts.score_damage"),
    Table("F2 on recorded logs", "See prior.md.", "python -m scripts.prior_worth DATA"),
    Table(
        "Placement: how sure it says it is",
        "Random flats, half of them of another building.",
        "python -m scripts.score_align random 0 40",
    ),
]
DOCUMENTS = {
    "benchmarks": ("Benchmarks", BENCHMARKS, "Compare ratios, not times."),
    "quality": ("Quality", QUALITY, "Recorded by others; none of the data is part of the project."),
}


def printed(command: str) -> str:
    """What a command prints, without the paths of this machine; its complaint where it fails."""
    words = [word.replace("DATA", str(DATA)) for word in command.split()]
    words[0] = str(Path(sys.executable).with_name(words[0]))
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "NO_COLOR": "1", "COLUMNS": "100"}
    done = subprocess.run(words, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    text = done.stdout if done.returncode == 0 else f"{done.stdout}{done.stderr[-600:]}"
    for path, name in ((str(DATA), "DATA"), (str(ROOT), ".")):
        text = text.replace(path, name)
    return re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE).strip("\n")


def document(name: str, only: str) -> str:
    """The whole page."""
    title, tables, remark = DOCUMENTS[name]
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
    lines = [f"# {title}", f"Written by `python -m scripts.numbers {name}` in one run on a"]
    lines += [f"machine with {machine}. {remark}"]
    for table in tables:
        if only.lower() in table.name.lower():
            print(f"{name}: {table.name}", file=sys.stderr)
            lines += ["", f"## {table.name}", table.about, "", "```text", f"$ {table.command}"]
            lines += [printed(table.command), "```"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write a document, or print it where only some of its tables are asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("document", choices=DOCUMENTS)
    parser.add_argument("--only", default="", help="tables whose names hold this; prints them")
    options = parser.parse_args()
    page = document(options.document, options.only)
    if options.only:
        print(page)
    else:
        (ROOT / "docs" / f"{options.document}.md").write_text(page)


if __name__ == "__main__":
    main()
