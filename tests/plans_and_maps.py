"""Small buildings as text, maps of parts of them, and the verb that lays one on the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from click.testing import CliRunner

from replay.cli.align import command
from replay.registration.search import matrix_of
from replay.registration.seen import Seen
from tests.pictures import pgm, png

Array = npt.NDArray[np.float64]
FLAT = """
##########################
#.....#........#.........#
#.....#........#.........#
#..............#.........#
#.....#..................#
#.....#........#.........#
###.########.#############
#......................###
#......................###
#..###.#####.####.########
#..#.......#.............#
#..#.......#.............#
#..#.......#.....#########
#..#.............#.......#
####.......#.............#
...#.......#.....#.......#
...#######################
"""
OTHER = """
################....
#..#...........#....
#..#...........#####
#..............#...#
#..#...............#
#..######.######...#
#..#........#..#...#
#...........#......#
####..#############.
...#..#.............
...#..############..
...#.............#..
...####..#####...#..
......#..#...#...#..
......#..#####...#..
......#..........#..
......############..
"""
ROOMS = """
##########.##########
#........#.#........#
#........#.#........#
#..........#.........
#........#.#........#
##########.##########
.....................
##########.##########
#........#.#........#
#........#.#........#
#..........#.........
#........#.#........#
##########.##########
"""
ROOM = (46 / 416, 46 / 288, 204 / 416, 140 / 288)  # the first of them, of the whole picture
SIDE = 16  # px a character
BORDER = 40  # px of paper around


def plan_of(text: str) -> npt.NDArray[np.bool_]:
    """Walls of 4 px through the middles of the characters."""
    cells = np.array([[c == "#" for c in row] for row in text.split()])
    rows, cols = cells.shape
    wall = np.zeros((rows * SIDE, cols * SIDE), np.uint8)
    for r, c in zip(*np.nonzero(cells), strict=True):
        middle = (c * SIDE + SIDE // 2, r * SIDE + SIDE // 2)
        cv2.rectangle(wall, np.subtract(middle, 2).tolist(), np.add(middle, 1).tolist(), 1, -1)
        for dr, dc in ((0, 1), (1, 0)):
            if r + dr < rows and c + dc < cols and cells[r + dr, c + dc]:
                to = (middle[0] + dc * SIDE, middle[1] + dr * SIDE)
                cv2.rectangle(wall, np.subtract(middle, 2).tolist(), np.add(to, 1).tolist(), 1, -1)
    return np.pad(wall, BORDER) > 0


def map_of(walls: npt.NDArray[np.bool_], matrix: Array, size: tuple[int, int], part: Array) -> Seen:
    """What a robot would have drawn of a part (x0, y0, x1, y1 of the plan): OpenCV's warp.

    `matrix` leads from the map's pixels to the plan's, as WARP_INVERSE_MAP wants it.
    """
    known = np.zeros(walls.shape, np.uint8)
    x0, y0, x1, y1 = part.astype(int)
    known[y0:y1, x0:x1] = 1
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    wall = cv2.warpAffine(walls.astype(np.uint8), matrix, size, flags=flags) > 0
    seen = cv2.warpAffine(known, matrix, size, flags=flags) > 0
    return Seen(wall & seen, seen & ~wall)


def case(
    text: str, scale: float, turn: float, mirrored: bool, part: tuple[float, ...]
) -> tuple[npt.NDArray[np.bool_], Seen, Array]:
    """A plan, a map of a part of it, and the matrix."""
    walls = plan_of(text)
    high, wide = walls.shape
    box = np.array(part) * [wide, high, wide, high]
    matrix = matrix_of(scale, turn, mirrored)
    corners = box[[[0, 1], [2, 1], [2, 3], [0, 3]]] @ np.linalg.inv(matrix[:, :2]).T
    low = corners.min(axis=0) - 15
    matrix[:, 2] = matrix[:, :2] @ low
    size = np.ceil(corners.max(axis=0) - low + 15).astype(int)
    return walls, map_of(walls, matrix, (int(size[0]), int(size[1])), box), matrix


def off(found: Array, true: Array, seen: Seen) -> float:
    """The largest distance in plan px between what two matrices make of the map's corners."""
    h, w = seen.free.shape
    corners = np.array([[0, 0, 1], [w, 0, 1], [0, h, 1], [w, h, 1]], dtype=float)
    return float(np.hypot(*(corners @ (found - true).T).T).max())


def files(folder: Path, walls: npt.NDArray[np.bool_], seen: Seen) -> tuple[str, str]:
    """A plan and a map as pictures."""
    grey = np.where(seen.occupied, 0, np.where(seen.free, 254, 205)).astype(np.uint8)
    (folder / "map.pgm").write_bytes(pgm(grey))
    (folder / "plan.png").write_bytes(png(np.where(walls, 0, 255).astype(np.uint8)))
    return str(folder / "map.pgm"), str(folder / "plan.png")


def run(*arguments: str) -> tuple[Any, str, str]:
    runner = CliRunner()
    result = runner.invoke(command, list(arguments), standalone_mode=False)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.return_value, result.stdout, result.stderr
