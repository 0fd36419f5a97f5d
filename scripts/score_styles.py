"""One building in many drawing styles, read by both methods: a row for each style.

    python -m scripts.score_styles [--only STYLE] [--method structural] [--pictures FOLDER]

Walls: F1 with 3 px forgiven, and IoU. Doors: F1 of swept sectors at IoU 0.5.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from replay.drawing import Method, extract
from replay.planning.pictures import overlay
from replay.planning.scores import score_doors, score_walls
from scripts.styled import STYLES, Sheet

METHODS: tuple[Method, ...] = ("structural", "georgiou")


def scored(sheet: Sheet, method: Method, picture: Path | None = None) -> tuple[float, float, float]:
    """Walls' F1 at 3 px and IoU, doors' F1."""
    found = extract(sheet.gray, method=method)
    if picture is not None:
        cv2.imwrite(f"{picture}.png", sheet.gray)
        cv2.imwrite(f"{picture} {method}.png", overlay(found))
    walls = score_walls(found.walls, sheet.walls)
    doors = score_doors(found.doors, [door.sector() for door in sheet.doors])
    return walls.f1_3px, walls.iou, doors.f1


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--only", default="", help="styles whose names hold this")
    parser.add_argument("--method", action="append", choices=METHODS)
    parser.add_argument("--pictures", type=Path, help="folder for the drawings and what was read")
    options = parser.parse_args()
    methods: list[Method] = options.method or list(METHODS)
    if options.pictures is not None:
        options.pictures.mkdir(parents=True, exist_ok=True)
    head = " | ".join(f"{m}: walls F1, 3 px | IoU | doors F1" for m in methods)
    print(f"| style | {head} |\n|{'---|' * (1 + 3 * len(methods))}")
    rows = []
    for name, draw in STYLES.items():
        if options.only not in name:
            continue
        sheet = draw()
        picture = options.pictures / name if options.pictures is not None else None
        row = [value for method in methods for value in scored(sheet, method, picture)]
        rows.append(row)
        print(f"| {name} | " + " | ".join(f"{value:.3f}" for value in row) + " |", flush=True)
    mean, least = np.mean(rows, axis=0), np.min(rows, axis=0)
    for name, values in (("mean", mean), ("least", least)):
        print(f"| **{name}** | " + " | ".join(f"{value:.3f}" for value in values) + " |")


if __name__ == "__main__":
    main()
