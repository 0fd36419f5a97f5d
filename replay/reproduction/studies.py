"""The five drawings as the paper's robot explores them, each explored once for all rows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.grid import Grid, Update, probability
from replay.drawing import Drawing, Method, extract
from replay.reproduction.example_plans import PX_PER_M, plan
from replay.reproduction.example_plans import Plan as Drawn
from replay.tuning.early import Keyframe, keyframes
from replay.tuning.simulated import Explored, ScoredRegion, Setup
from replay.tuning.surfaces import Tables

LETTERS = "abcde"
CELLS = (3, 5, 10)  # map pixels along a cell's side
PIXEL = 1.0 / PX_PER_M
Key = tuple[str, int, Update, float, ScoredRegion]


@dataclass
class Study:
    """Everything that several rows share.

    Attributes:
        letters: the drawings that are looked at; all five unless a test wants fewer.
        cells: the cell sizes.
        method: how walls are found in the drawings: the paper's Algorithm 1.
        setup: of the exploration.
    """

    letters: str = LETTERS
    cells: tuple[int, ...] = CELLS
    method: Method = "georgiou"
    setup: Setup = field(default_factory=Setup)
    _explored: dict[tuple[str, int], Explored] = field(default_factory=dict)
    _moments: dict[tuple[str, int], list[Keyframe]] = field(default_factory=dict)
    _tables: dict[Key, Tables] = field(default_factory=dict)

    @cached_property
    def drawn(self) -> dict[str, Drawn]:
        """Letter -> the drawing with its exact truth."""
        return {letter: plan(letter) for letter in self.letters}

    @cached_property
    def read(self) -> dict[str, Drawing]:
        """Letter -> what Algorithm 1 reads in it."""
        return {
            letter: extract(drawn.gray, resolution=PIXEL, method=self.method)
            for letter, drawn in self.drawn.items()
        }

    def explored(self, letter: str, cell: int) -> Explored:
        """A drawing explored on cells of a size."""
        key = letter, cell
        if key not in self._explored:
            walls = self.read[letter].walls
            setup = replace(self.setup, cell=cell)
            self._explored[key] = Explored(letter, self.drawn[letter].walls, walls, PIXEL, setup)
        return self._explored[key]

    def keyframes(self, letter: str, cell: int) -> list[Keyframe]:
        """A drawing while it is explored."""
        key = letter, cell
        if key not in self._moments:
            one = self.explored(letter, cell)
            self._moments[key] = keyframes(one.ground, one.evidences())
        return self._moments[key]

    def tables(
        self,
        letter: str,
        cell: int,
        update: Update = "paper",
        prior_scale: float = 0.9,
        region: ScoredRegion = "footprint",
    ) -> Tables:
        """Sorted tables of a drawing under one reading of what the paper leaves open."""
        key: Key = (letter, cell, update, prior_scale, region)
        if key not in self._tables:
            one = self.explored(letter, cell)
            if region == one.setup.region:
                ground = one.ground
            else:
                other = Explored(
                    letter, one.truth, one.prior, PIXEL, replace(one.setup, region=region)
                )
                ground = other.ground
            case = ground.case(one.evidence)
            self._tables[key] = Tables(case, one.values(update, prior_scale))
        return self._tables[key]


def shade(grid: Grid, pixels: int = 1) -> npt.NDArray[np.float64]:
    """A map as a picture: 1 empty (white) to 0 occupied, row 0 on top, cells so many pixels."""
    grey = probability(grid.values)[::-1]
    return np.asarray(grey.repeat(pixels, axis=0).repeat(pixels, axis=1))


def three(scores: Any) -> str:
    """Precision, recall and F2 of a single score, in a line."""
    values = (float(np.ravel(v)[0]) for v in (scores.precision, scores.recall, scores.f2))
    return "precision {:.3f}, recall {:.3f}, F2 {:.3f}".format(*values)
