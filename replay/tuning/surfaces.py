"""Precision, recall and F2 over (p_wall, p_space): an outer sum of two vectors, without replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Update, logit
from replay.prior import P_OUTSIDE, PRIOR_SCALE, used
from replay.tuning.cases import DOOR, OUTSIDE, SPACE, WALL, WINDOW, Case, Floats, Ints
from replay.tuning.flips import Flips, flips


class Scores(NamedTuple):
    """Counts over any shape of priors.

    Attributes:
        tp, fp: true and false positives.
        walls: all of the truth's wall.
    """

    tp: Ints
    fp: Ints
    walls: int

    @property
    def precision(self) -> Floats:
        """0 where nothing is occupied (PAPER A13)."""
        return share(self.tp, self.tp + self.fp)

    @property
    def recall(self) -> Floats:
        """0 where there is no wall."""
        return self.tp / max(self.walls, 1)

    @property
    def f2(self) -> Floats:
        """Equation 14 from the counts: 5 tp / (5 tp + 4 fn + fp)."""
        return share(5 * self.tp, self.tp + self.fp + 4 * self.walls)

    def objectives(self) -> Floats:
        """(..., 2): 1 / precision and 1 / recall (Equation 7); inf where one is 0."""
        both = np.stack([self.precision, self.recall], axis=-1)
        return np.divide(1.0, both, out=np.full_like(both, np.inf), where=both > 0)


def share(part: Ints, whole: Ints) -> Floats:
    """The quotient; 0/0 is 0."""
    return np.asarray(part / np.maximum(whole, 1))  # a part of nothing is nothing


@dataclass(frozen=True)
class Values:
    """What holds beside p_wall and p_space.

    Attributes:
        p_levels: P(empty) of each level of a reading.
        update: the rule.
        prior_scale: multiplies the values of the prior before use.
        p_door, p_window: P(empty) of openings; None: as space, as wall.
        p_outside: of everything outside, unscaled.
    """

    p_levels: tuple[float, ...]
    update: Update = "bayes"
    prior_scale: float = PRIOR_SCALE
    p_door: float | None = None
    p_window: float | None = None
    p_outside: float = P_OUTSIDE

    def l0(self, p: npt.ArrayLike) -> Floats:
        """Log-odds of printed probabilities, by the one arithmetic that the maps use."""
        p = np.asarray(p, dtype=np.float64)
        values = [logit(used(value, self.prior_scale)) for value in p.ravel().tolist()]
        return np.array(values).reshape(p.shape)


class Tables:
    """The sorted tables of a case: scores of any prior without the readings.

    Args:
        case: the cells.
        values: what holds beside p_wall and p_space.

    Attributes:
        wall, space: step functions of the two classes that are searched.
        fixed: (tp, fp) of all other cells.
    """

    def __init__(self, case: Case, values: Values) -> None:
        self.case, self.values, self.walls = case, values, case.walls
        self.wall = self._flips(WALL, *([WINDOW] if values.p_window is None else []))
        self.space = self._flips(SPACE, *([DOOR] if values.p_door is None else []))
        self.mixtures = [
            (part, flips(cells, values.p_levels, values.update)) for part, cells in case.mixtures()
        ]
        tp, fp = self._flips(OUTSIDE).counts(logit(used(values.p_outside, 1.0)))
        for kind, p in ((DOOR, values.p_door), (WINDOW, values.p_window)):
            if p is not None:
                more = self._flips(kind).counts(values.l0(p))
                tp, fp = tp + more[0], fp + more[1]
        self.fixed = int(tp), int(fp)

    def _flips(self, *kinds: str) -> Flips:
        return flips(self.case.of(*kinds), self.values.p_levels, self.values.update)

    def surface(self, p_wall: npt.ArrayLike, p_space: npt.ArrayLike) -> Scores:
        """Scores over all pairs, (a, b) for a values of p_wall and b of p_space."""
        walls = self.wall.counts(self.values.l0(p_wall))
        spaces = self.space.counts(self.values.l0(p_space))
        tp, fp = (
            (w + fixed)[:, None] + s[None, :]
            for w, s, fixed in zip(walls, spaces, self.fixed, strict=True)
        )
        if self.mixtures:
            grid = np.meshgrid(p_wall, p_space, indexing="ij")
            more = self._mixed(grid[0].ravel(), grid[1].ravel())
            tp, fp = tp + more[0].reshape(tp.shape), fp + more[1].reshape(fp.shape)
        return Scores(tp, fp, self.walls)

    def at(self, p_wall: npt.ArrayLike, p_space: npt.ArrayLike) -> Scores:
        """Scores of single pairs, both (n,)."""
        walls = self.wall.counts(self.values.l0(p_wall))
        spaces = self.space.counts(self.values.l0(p_space))
        tp, fp = (w + s + f for w, s, f in zip(walls, spaces, self.fixed, strict=True))
        if self.mixtures:
            more = self._mixed(np.asarray(p_wall), np.asarray(p_space))
            tp, fp = tp + more[0], fp + more[1]
        return Scores(tp, fp, self.walls)

    def without_prior(self) -> Scores:
        """Scores of 0.5 everywhere, which is never scaled (PAPER A4): a single one, shape ()."""
        parts = [self.wall, self.space, *(flip for _, flip in self.mixtures)]
        counts = [part.counts(0.0) for part in parts]
        named = [(OUTSIDE, True), (DOOR, self.values.p_door), (WINDOW, self.values.p_window)]
        counts += [self._flips(kind).counts(0.0) for kind, p in named if p is not None]
        return Scores(
            np.asarray(sum(tp for tp, _ in counts)),
            np.asarray(sum(fp for _, fp in counts)),
            self.walls,
        )

    def _mixed(self, p_wall: Floats, p_space: Floats) -> tuple[Ints, Ints]:
        """True and false positives of the MIXED cells of single pairs."""
        scale = self.values.prior_scale
        wall = np.array([used(p, scale) for p in p_wall.tolist()])
        space = np.array([used(p, scale) for p in p_space.tolist()])
        tp, fp = np.zeros(len(wall), dtype=np.int64), np.zeros(len(wall), dtype=np.int64)
        for part, steps in self.mixtures:
            l0 = np.array([logit(p) for p in (part * wall + (1.0 - part) * space).tolist()])
            more = steps.counts(l0)
            tp, fp = tp + more[0], fp + more[1]
        return tp, fp


def grid(steps: int, low: float = 0.1, high: float = 1.0) -> Floats:
    """Evenly spaced probabilities, rounded so that 0.3 is 0.3; 10 steps are the paper's."""
    return np.round(np.linspace(low, high, steps), 12)


def worst(surfaces: Sequence[Floats]) -> Floats:
    """The least of several surfaces, point by point."""
    return np.asarray(np.min(np.stack(surfaces), axis=0))
