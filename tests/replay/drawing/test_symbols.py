from __future__ import annotations

import numpy as np
import pytest

from replay.drawing import extract
from replay.drawing.georgiou import bounds, shortlist
from replay.drawing.ink import binarise
from replay.drawing.shapes import Door
from replay.planning.scores import score_doors, score_walls
from replay.reproduction.example_plans import SYMBOLS, plan, symbol
from scripts.score_symbols import share

WIDTH = 60.0
LEAF = {"double": 0.5, "uneven double": 0.65, "pivot": 0.8, "folding": 0.39}


def found(doors: list[Door], middle: tuple[float, float]) -> bool:
    """Whether a door of plausible size lies over the opening."""
    return any(
        np.hypot(*(door.triangle().mean(axis=0) - middle)) < 0.75 * WIDTH
        and 0.3 * WIDTH < door.width < 1.4 * WIDTH
        for door in doors
    )


def test_every_symbol_is_drawn_and_none_twice_the_same() -> None:
    pictures = [symbol(kind, 0.0, WIDTH, True)[0].gray.tobytes() for kind in SYMBOLS]
    assert len(SYMBOLS) >= 8
    assert len(set(pictures)) == len(SYMBOLS)


@pytest.mark.parametrize("kind", ["single", "thick leaf", "double", "half open"])
@pytest.mark.parametrize("turn_deg", [0.0, 15.0, 45.0, 105.0])
def test_swing_doors_in_a_wall_are_found_at_any_turn(kind: str, turn_deg: float) -> None:
    drawn, middle = symbol(kind, turn_deg, WIDTH, True)
    resolution = 0.9 / (WIDTH * LEAF.get(kind, 1.0))
    assert found(extract(drawn.gray, resolution=resolution).doors, middle)


@pytest.mark.parametrize("kind", ["single", "thick leaf", "uneven double", "folding"])
@pytest.mark.parametrize("turn_deg", [0.0, 15.0, 45.0, 105.0])
def test_their_triangles_are_on_the_shortlist_of_the_paper(kind: str, turn_deg: float) -> None:
    drawn, middle = symbol(kind, turn_deg, WIDTH, False)
    low, high = bounds(drawn.gray, 0.9 / (WIDTH * LEAF.get(kind, 1.0)))
    assert found(shortlist(drawn.gray, binarise(drawn.gray), low, high), middle)


@pytest.mark.parametrize("letter", list("abcde"))
def test_the_five_plans_are_read_exactly(letter: str) -> None:
    drawn = plan(letter)
    read = extract(drawn.gray)
    walls = score_walls(read.walls, drawn.walls)
    assert walls.f1_3px > 0.995
    assert walls.iou > 0.98
    assert score_doors(read.doors, [door.sector() for door in drawn.doors]) == (1, 1, 1)


@pytest.mark.parametrize("letter", list("abcde"))
def test_algorithm_1_reads_the_five_plans(letter: str) -> None:
    drawn = plan(letter)
    read = extract(drawn.gray, method="georgiou")
    assert score_walls(read.walls, drawn.walls).f1_3px > 0.98
    doors = score_doors(read.doors, [door.sector() for door in drawn.doors])
    assert doors.precision == 1.0
    assert doors.recall >= 0.8  # the door in the outer wall has no corner on its hinge side


FLOORS = {"sliding": 0.7, "pocket": 0.85}  # at small sizes their leaves are as thick as walls


@pytest.mark.slow
@pytest.mark.parametrize("kind", SYMBOLS)
def test_symbols_in_a_wall_are_found_at_any_turn_and_size(kind: str) -> None:
    assert share(kind, True, "structural", [15.0 * k for k in range(0, 24, 3)]) >= FLOORS.get(
        kind, 0.95
    )
