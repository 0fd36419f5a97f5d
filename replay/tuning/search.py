"""A genetic search's settings, where it stands, what it found, and when it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from replay.tuning.cases import Floats, Ints

Algorithm = Literal["gamultiobj", "geometric", "nsga2"]
ALGORITHMS: tuple[Algorithm, ...] = ("gamultiobj", "geometric", "nsga2")
Objective = Callable[[Floats], Floats]
STALL, TOLERANCE = 100, 1e-4


@dataclass(frozen=True)
class Search:
    """Settings of a search; the defaults are those that MATLAB documents.

    Attributes:
        algorithm: "gamultiobj" (at most `fraction` of the population on the first front),
            "geometric" (Deb and Goel 2001: quotas over all fronts), or "nsga2" (plain).
        seed: of all that is random.
        population: individuals.
        generations: at most; the search ends earlier when the spread stands still.
        fraction: ParetoFraction.
        crossover: share of the children that come of crossover.
        reduction: of Deb and Goel's quotas, from one front to the next.
    """

    algorithm: Algorithm = "gamultiobj"
    seed: int = 1
    population: int = 50
    generations: int = 400
    fraction: float = 0.35
    crossover: float = 0.8
    reduction: float = 0.5


@dataclass
class State:
    """Where a search stands: enough to go on as if it had never stopped.

    Attributes:
        x, f: (population, 2) individuals and their objectives.
        rank, crowding: (population,) as the last survival left them.
        random: state of the random generator.
        generation: done so far; the first population is 0.
        step: length of a mutation, in shares of the range.
        spreads: (generation,) of the first front.
        evaluated: (n, 2) every individual ever evaluated, in order, and `values` its objectives.
    """

    x: Floats
    f: Floats
    rank: Ints
    crowding: Floats
    random: dict[str, Any]
    generation: int = 0
    step: float = 0.5
    ended: str = ""
    spreads: list[float] = field(default_factory=list)
    evaluated: list[Floats] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)


class Found(NamedTuple):
    """What a search found.

    Attributes:
        x, f: (n, 2) the acceptable first front of the last population, by x.
        archive_x, archive_f: (evaluations, 2) all that was ever evaluated.
        generations: done.
        ended: why it ended.
    """

    x: Floats
    f: Floats
    archive_x: Floats
    archive_f: Floats
    generations: int
    ended: str

    @property
    def evaluations(self) -> int:
        """How many priors were evaluated."""
        return len(self.archive_x)


def stalled(spreads: list[float]) -> bool:
    """Whether the spread changes by less than the tolerance, and is no larger than its mean.

    The geometric mean of the relative changes over the last STALL generations, as documented.
    """
    if len(spreads) <= STALL:
        return False
    last = np.array(spreads[-STALL - 1 :])
    change = np.abs(np.diff(last)) / np.maximum(np.abs(last[:-1]), 1e-300)
    mean = float(np.exp(np.mean(np.log(np.maximum(change, 1e-300)))))
    return mean < TOLERANCE and bool(last[-1] <= last[1:].mean())
