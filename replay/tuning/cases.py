"""What is tuned for: the cells of a run by class of the prior, evidence and truth, alike ones once.

The prior gives one l0 to every cell of a class, so cells of one class with the same counts fall
together whatever the probabilities are: each distinct column of counts is kept once, with the
weight of the truth's wall and space that it stands for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Evidence
from replay.cells import Rule

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

WALL, SPACE, DOOR, WINDOW, OUTSIDE, MIXED = "wall", "space", "door", "window", "outside", "mixed"
KINDS = (WALL, SPACE, DOOR, WINDOW, OUTSIDE, MIXED)


class Cells(NamedTuple):
    """Cells of one class.

    Attributes:
        counts: (levels, n) readings at each level, distinct columns.
        wall, space: (n,) how much of the truth's wall and space they hold: cells, or map pixels.
    """

    counts: Ints
    wall: Ints
    space: Ints

    @classmethod
    def distinct(cls, counts: Ints, wall: Ints, space: Ints) -> Cells:
        """Alike cells joined, in a fixed order."""
        key = np.zeros(counts.shape[1], dtype=np.int64)
        for row in counts[counts.any(axis=1)]:  # exact: each time the keys are numbered anew
            most = int(row.max(initial=0)) + 1
            _, key = np.unique(key * most + row, return_inverse=True)
        first = np.zeros(int(key.max(initial=-1)) + 1, dtype=np.int64)
        first[key[::-1]] = np.arange(len(key))[::-1]
        weights = [np.zeros(len(first), dtype=np.int64) for _ in range(2)]
        for total, part in zip(weights, (wall, space), strict=True):
            np.add.at(total, key, part)
        return cls(counts[:, first], *weights)

    @classmethod
    def joined(cls, parts: Sequence[Cells]) -> Cells:
        """Several classes or runs as one."""
        return cls.distinct(*(np.concatenate(column, axis=-1) for column in zip(*parts)))  # noqa: B905


@dataclass(frozen=True)
class Case:
    """One run, drawing, or several of them pooled, as the search sees it.

    Attributes:
        name: for the tables.
        classes: (kind, share of wall) -> cells; the share matters for MIXED cells alone, whose
            P(empty) is share * p_wall + (1 - share) * p_space.
    """

    name: str
    classes: dict[tuple[str, float], Cells]

    @property
    def walls(self) -> int:
        """All of the truth's wall: what recall is a share of."""
        return sum(int(cells.wall.sum()) for cells in self.classes.values())

    @property
    def size(self) -> int:
        """All that is scored."""
        return self.walls + sum(int(cells.space.sum()) for cells in self.classes.values())

    @property
    def mixed(self) -> bool:
        """Whether some l0 depends on p_wall and p_space at once."""
        return any(kind == MIXED for kind, _ in self.classes)

    def of(self, *kinds: str) -> Cells | None:
        """The cells of some kinds together; None where there are none."""
        parts = [cells for (kind, _), cells in self.classes.items() if kind in kinds]
        return Cells.joined(parts) if parts else None

    def mixtures(self) -> Iterator[tuple[float, Cells]]:
        """Share of wall and cells of the MIXED classes."""
        for (kind, share), cells in self.classes.items():
            if kind == MIXED:
                yield share, cells


def pooled(cases: Sequence[Case], name: str = "all") -> Case:
    """Cases as one: their cells are counted together."""
    parts: dict[tuple[str, float], list[Cells]] = {}
    for case in cases:
        for key, cells in case.classes.items():
            parts.setdefault(key, []).append(cells)
    return Case(name, {key: Cells.joined(cells) for key, cells in parts.items()})


@dataclass(frozen=True)
class Ground:
    """What of a run does not change with its readings, cell by cell over those that are scored.

    Attributes:
        name: for the tables.
        where: (n,) flat indices into the lattice.
        kinds: (n,) indices into KINDS.
        shares: (n,) share of wall, 0 but for MIXED cells.
        wall, space: (n,) weight of the truth's wall and space.
        observed_only: cells are scored once some reading showed them.
    """

    name: str
    where: Ints
    kinds: npt.NDArray[np.int8]
    shares: Floats
    wall: Ints
    space: Ints
    observed_only: bool = False

    def case(self, evidence: Evidence) -> Case:
        """The cells with what the readings showed of them."""
        counts = evidence.counts.reshape(len(evidence.counts), -1)
        classes = {}
        for key, members in self.members.items():
            there = counts[:, self.where[members]].astype(np.int64)
            chosen = members
            if self.observed_only:
                seen = there.any(axis=0)
                there, chosen = there[:, seen], members[seen]
            if len(chosen):
                classes[key] = Cells.distinct(there, self.wall[chosen], self.space[chosen])
        return Case(self.name, classes)

    @cached_property
    def members(self) -> dict[tuple[str, float], Ints]:
        """Class -> places of its cells in the arrays."""
        out = {}
        for kind in np.unique(self.kinds).tolist():
            of_kind = np.flatnonzero(self.kinds == kind)
            for share in np.unique(self.shares[of_kind]).tolist():
                out[KINDS[kind], share] = of_kind[self.shares[of_kind] == share]
        return out


def ground(
    name: str,
    wall_fraction: Floats,
    outside: Bools,
    truth_wall: Ints,
    truth_all: Ints,
    *,
    rule: Rule = "any",
    door: Floats | None = None,
    window: Floats | None = None,
    observed_only: bool = False,
) -> Ground:
    """Classes of the prior as `build_world` gives l0 to them; all arrays are (rows, cols).

    Args:
        name: for the tables.
        wall_fraction: wall among the plan's known pixels of a cell.
        outside: cells that get p_outside.
        truth_wall: weight of the truth's wall in a cell: 0 or 1, or pixels.
        truth_all: weight of all that is scored in it; 0: not scored.
        rule: when a cell of the prior is wall.
        door, window: share of a cell that an opening takes.
        observed_only: see Ground.
    """
    shut = wall_fraction > 0 if rule == "any" else 2 * wall_fraction > 1
    kinds = np.where(shut, KINDS.index(WALL), KINDS.index(SPACE)).astype(np.int8)
    shares = np.zeros(wall_fraction.shape)
    if rule == "fraction":
        mixed = (wall_fraction > 0) & (wall_fraction < 1)
        kinds[wall_fraction <= 0], kinds[wall_fraction >= 1] = KINDS.index(SPACE), 0
        kinds[mixed], shares[mixed] = KINDS.index(MIXED), wall_fraction[mixed]
    for opening, kind in ((door, DOOR), (window, WINDOW)):
        if opening is not None:
            cells = (opening > 0) & ~(shut & (kind == DOOR))
            kinds[cells], shares[cells] = KINDS.index(kind), 0.0
    kinds[outside], shares[outside] = KINDS.index(OUTSIDE), 0.0
    where = np.flatnonzero(truth_all > 0)
    wall = truth_wall.reshape(-1)[where].astype(np.int64)
    return Ground(
        name,
        where,
        kinds.reshape(-1)[where],
        shares.reshape(-1)[where],
        wall,
        truth_all.reshape(-1)[where].astype(np.int64) - wall,
        observed_only,
    )
