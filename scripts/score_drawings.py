"""Walls and doors of annotated drawings, scored: a row for each drawing, means by set and half.

    python -m scripts.score_drawings [--method structural] [--method georgiou] [--only NAME]

CVC-FP's drawings at even places of their sorted list were looked at while the structural method
was built ("tuned"); those at odd places were not ("held out").
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

from formats.errors import Notes
from formats.plans.annotations import read_truth
from formats.plans.file import open_plan
from replay.drawing import Method, extract
from replay.planning.scores import score

ROOT = Path(__file__).resolve().parent.parent
SHORT = {"walls": "w", "doors": "d", "doors_hinge": "dh"}
COLUMNS = (
    ("walls", "precision"),
    ("walls", "recall"),
    ("walls", "f1"),
    ("walls", "iou"),
    ("walls", "f1_3px"),
    ("doors", "precision"),
    ("doors", "recall"),
    ("doors", "f1"),
    ("doors_hinge", "f1"),
)
Row = tuple[float, ...]


def drawings(data: Path) -> Iterator[tuple[str, Path, Path]]:
    """(set, drawing, truth) of every annotated drawing."""
    folder = data / "plans_gt" / "cvc_fp"
    pictures = sorted(p for p in folder.glob("*") if p.suffix in (".png", ".jpg"))
    for place, picture in enumerate(pictures):
        half = "cvc_fp held out" if place % 2 else "cvc_fp tuned"
        yield half, picture, next(iter(folder.glob(f"{picture.stem}_gt_*.svg")))
    folder = data / "plans_gt" / "mlstructfp"
    for picture in sorted(folder.glob("*.png")):
        yield "mlstructfp", picture, folder / "fp.json"


def scored(picture: Path, annotation: Path, method: Method) -> Row:
    """The columns and the seconds of one drawing."""
    grey = open_plan(picture, Notes()).grey
    truth = read_truth(annotation, (grey.shape[0], grey.shape[1]), picture)
    started = perf_counter()
    found = score(extract(grey, method=method), truth)
    seconds = perf_counter() - started
    values = [found.get(part, {}).get(name, float("nan")) for part, name in COLUMNS]
    return (*values, seconds)


def line(name: str, row: Row) -> str:
    """One row of the table; what the truth does not say is a dash."""
    cells = [f"{v:9.3f}" if np.isfinite(v) else f"{'-':>9}" for v in row[:-1]]
    return f"{name[:24]:24}" + "".join(cells) + f"{row[-1]:7.1f}"


def table(data: Path, method: Method, only: str) -> None:
    """Print a method's rows and means."""
    print("\nw: walls, d: doors, dh: doors by their hinges")
    print(f"{method:24}" + "".join(f"{SHORT[part]} {n[:6]}".rjust(9) for part, n in COLUMNS), " s")
    sets: dict[str, list[Row]] = {}
    for name, picture, annotation in drawings(data):
        if only in picture.stem:
            row = scored(picture, annotation, method)
            sets.setdefault(name, []).append(row)
            print(line(picture.stem, row), flush=True)
    both = [row for name, rows in sets.items() if name.startswith("cvc") for row in rows]
    for name, rows in {**sets, "cvc_fp": both}.items():
        if rows:
            mean = tuple(float(v) for v in np.mean(rows, axis=0))
            least = min(row[4] for row in rows)
            print(line(f"= {name} ({len(rows)})", mean), f" least f1_3px {least:.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--method", action="append", choices=("structural", "georgiou"))
    parser.add_argument("--only", default="", help="drawings whose names hold this")
    options = parser.parse_args()
    data = Path(os.environ.get("REPLAY_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not data.is_dir():
        sys.exit(f"annotated drawings are not at {data} (set REPLAY_SHARED_DATA)")
    methods: list[Method] = options.method or ["structural", "georgiou"]
    for method in methods:
        table(data, method, options.only)


if __name__ == "__main__":
    main()
