"""Our drawn door symbols and plans, read by both methods: tables, and a sheet with the triangles.

    python -m scripts.score_symbols symbols     share found, alone and in a wall (24 turns, 4 sizes)
    python -m scripts.score_symbols plans       precision and recall on plans (a) to (e)
    python -m scripts.score_symbols ablation    Algorithm 1 with other tolerances
    python -m scripts.score_symbols sheet FILE  the picture of the symbols with what was found

A symbol is found where a door of plausible size lies over its opening. Alone it is asked of the
shortlist (D6) of Algorithm 1, since its later steps want walls.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import product

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing import Door, Method, corners, extract, triangles
from replay.drawing.georgiou import bounds, shortlist
from replay.drawing.ink import binarise
from replay.planning.scores import score_doors, score_walls
from replay.reproduction.example_plans import SYMBOLS, plan, symbol

METHODS: tuple[Method, ...] = ("structural", "georgiou")
SIZES = (40.0, 60.0, 90.0, 140.0)  # px, of the opening
TURNS = tuple(15.0 * k for k in range(24))
LEAF = {"double": 0.5, "uneven double": 0.65, "pivot": 0.8, "folding": 0.39}  # of the opening
LEAF_M = 0.9
COLOURS = {"structural": (178, 114, 0), "georgiou": (0, 94, 213)}  # blue, green, red


def read(kind: str, turn: float, size: float, in_wall: bool, method: Method) -> list[Door]:
    """Doors of one symbol's sheet."""
    drawn, _ = symbol(kind, turn, size, in_wall)
    resolution = LEAF_M / (size * LEAF.get(kind, 1.0))
    if method == "georgiou" and not in_wall:
        return shortlist(drawn.gray, binarise(drawn.gray), *bounds(drawn.gray, resolution))
    if method == "structural" and kind == "folding":
        resolution = LEAF_M / size  # the opening is a door's; by the panel it would be a gate's
    return extract(drawn.gray, resolution=resolution, method=method).doors


def over(doors: Iterable[Door], middle: tuple[float, float], size: float) -> list[Door]:
    """Those that lie over the opening."""
    return [
        door
        for door in doors
        if np.hypot(*(door.triangle().mean(axis=0) - middle)) < 0.75 * size
        and 0.3 * size < door.width < 1.4 * size
    ]


def share(kind: str, in_wall: bool, method: Method, turns: Iterable[float] = TURNS) -> float:
    """Share of a symbol's pictures in which it is found."""
    cases = list(product(turns, SIZES))
    hits = sum(
        bool(over(read(kind, turn, size, in_wall, method), (3 * size, 3 * size), size))
        for turn, size in cases
    )
    return hits / len(cases)


def symbols() -> None:
    """Print the table of symbols."""
    print("| symbol | structural, in a wall | alone | Algorithm 1, in a wall | alone (shortlist) |")
    print("|---|---|---|---|---|")
    for kind in SYMBOLS:
        row = [share(kind, wall, method) for method in METHODS for wall in (True, False)]
        print(f"| {kind} | " + " | ".join(f"{value:.2f}" for value in row) + " |", flush=True)


def plans() -> None:
    """Print the table of the five plans."""
    print(
        "| plan | method | walls: precision | recall | F1, 3 px | IoU | doors: precision | recall |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for letter, method in product("abcde", METHODS):
        drawn = plan(letter)
        found = extract(drawn.gray, method=method)
        walls = score_walls(found.walls, drawn.walls)
        doors = score_doors(found.doors, [door.sector() for door in drawn.doors])
        row = (
            walls.precision,
            walls.recall,
            walls.f1_3px,
            walls.iou,
            doors.precision,
            doors.recall,
        )
        print(f"| {letter} | {method} | " + " | ".join(f"{v:.3f}" for v in row) + " |", flush=True)


TRIED: tuple[tuple[str, object, str, tuple[object, ...]], ...] = (
    ("SideCheck: sides differ by", triangles, "SIDES", (0.02, 0.04, 0.08, 0.16)),
    (
        "AngleCheck: off a right angle, degrees",
        triangles,
        "ANGLES",
        tuple(tuple(np.radians((90.0 - d, 90.0 + d)).tolist()) for d in (5, 10, 18, 30)),
    ),
    ("ConnectivityCheck: inked share of a side", triangles, "JOINED", (0.6, 0.75, 0.85, 0.95)),
    ("Harris: response, of the strongest", corners, "STRENGTH", (0.002, 0.01, 0.05, 0.2)),
    ("Harris: K", corners, "K", (0.02, 0.04, 0.08, 0.15)),
    ("Harris: neighbourhood, px", corners, "BLOCK", (2, 3, 5, 7)),
)
ABLATED = ("single", "thick leaf", "double", "folding")


def ablation() -> None:
    """Print Algorithm 1's shares with one tolerance at a time changed.

    Found: of single, thick, double and folding symbols alone, at 8 turns and 4 sizes, on the
    shortlist. False: doors a plan of (a) to (e) that are none.
    """
    print("| tolerance | value | found | false doors a plan | doors found on the plans |")
    print("|---|---|---|---|---|")
    for name, module, constant, values in TRIED:
        kept = getattr(module, constant)
        for value in values:
            setattr(module, constant, value)
            hit = np.mean([share(kind, False, "georgiou", TURNS[::3]) for kind in ABLATED])
            wrong, right, true = 0, 0.0, 0
            for letter in "abcde":
                drawn = plan(letter)
                doors = extract(drawn.gray, method="georgiou").doors
                score = score_doors(doors, [door.sector() for door in drawn.doors])
                wrong += round(len(doors) * (1 - score.precision))
                right, true = right + score.recall * len(drawn.doors), true + len(drawn.doors)
            setattr(module, constant, kept)
            shown = np.round(90 - np.degrees(value[0])) if isinstance(value, tuple) else value
            mark = " (ours)" if value == kept else ""
            print(
                f"| {name} | {shown:g}{mark} | {hit:.2f} | {wrong / 5:.1f} | {right / true:.2f} |",
                flush=True,
            )


def sheet(path: str, size: float = 90.0) -> None:
    """Write a picture: each symbol at six turns, with the triangles of both methods."""
    rows: list[npt.NDArray[np.uint8]] = []
    for kind in SYMBOLS:
        row = []
        for turn in (0.0, 30.0, 75.0, 135.0, 210.0, 300.0):
            drawn, middle = symbol(kind, turn, size, True)
            tile = cv2.cvtColor(drawn.gray, cv2.COLOR_GRAY2BGR)
            for k, method in enumerate(METHODS):
                for door in over(read(kind, turn, size, True, method), middle, size):
                    lines = [np.rint(door.triangle() + k).astype(np.int32)]
                    cv2.polylines(tile, lines, True, COLOURS[method], 2, cv2.LINE_AA)
            half = round(1.6 * size)
            cut = slice(round(middle[0]) - half, round(middle[0]) + half)
            row.append(tile[cut, cut])
        cv2.putText(row[0], kind, (6, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 1, 16)
        rows.append(np.asarray(np.hstack(row), dtype=np.uint8))
    cv2.imwrite(path, np.vstack(rows))


def main() -> None:
    words = sys.argv[1:]
    match words:
        case ["symbols"]:
            symbols()
        case ["plans"]:
            plans()
        case ["ablation"]:
            ablation()
        case ["sheet", path]:
            sheet(path)
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
