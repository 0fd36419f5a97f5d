"""Time-critical use: how good a prior is while the building is being explored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Evidence
from formats.results.file import RunFile
from replay.tuning.cases import Case, Floats, Ground
from replay.tuning.surfaces import Tables, Values


class Course(NamedTuple):
    """A run as it went on.

    Attributes:
        explored: (n,) share of the scored cells that some reading had shown, ascending from 0.
        tables: (n,) the scores of every prior at that keyframe; the first without a reading.
        times: (n,) s since the run's start.
    """

    explored: Floats
    tables: list[Tables]
    times: Floats

    @property
    def weights(self) -> Floats:
        """(n,) of the trapezoids over the explored share; they add up to 1."""
        steps = np.diff(self.explored)
        out = np.zeros(len(self.explored))
        out[:-1] += steps / 2
        out[1:] += steps / 2
        if out.sum() <= 0.0:  # nothing was explored: only the last keyframe counts
            out[-1] = 1.0
        return np.asarray(out / out.sum())

    def surface(self, p: Floats) -> Floats:
        """Mean F2 over the explored share, for all pairs of p, (len(p), len(p))."""
        out = np.zeros((len(p), len(p)))
        for weight, tables in zip(self.weights.tolist(), self.tables, strict=True):
            if weight > 0.0:
                out += weight * tables.surface(p, p).f2
        return out

    def f2(self, p_wall: npt.ArrayLike, p_space: npt.ArrayLike) -> Floats:
        """(keyframes, n) F2 of single priors, both (n,)."""
        return np.array([tables.at(p_wall, p_space).f2 for tables in self.tables])

    def mean(self, p_wall: npt.ArrayLike, p_space: npt.ArrayLike) -> Floats:
        """(n,) mean F2 of single priors over the explored share."""
        return np.asarray(self.weights @ self.f2(p_wall, p_space))

    def without_prior(self) -> Floats:
        """(keyframes,) F2 of 0.5 everywhere."""
        return np.array([float(tables.without_prior().f2) for tables in self.tables])


class Keyframe(NamedTuple):
    """What had been seen at a time.

    Attributes:
        time: s since the start.
        explored: share of the scored cells.
        case: the cells with their readings.
    """

    time: float
    explored: float
    case: Case


def keyframes(ground: Ground, seen: Iterable[tuple[float, Evidence]]) -> list[Keyframe]:
    """Keyframes of growing evidence, the first without any reading.

    Args:
        ground: what does not change.
        seen: s since the start, and the evidence so far; ascending.
    """
    out: list[Keyframe] = []
    for time, evidence in seen:
        if not out:
            nothing = Evidence.empty(evidence.geometry, len(evidence.counts))
            out.append(Keyframe(0.0, 0.0, ground.case(nothing)))
        there = np.count_nonzero(evidence.visits().ravel()[ground.where])
        out.append(Keyframe(time, there / max(len(ground.where), 1), ground.case(evidence)))
    return out


def course(seen: Iterable[Keyframe], values: Values) -> Course:
    """The tables of every keyframe under one rule and sensor."""
    kept = list(seen)
    return Course(
        np.array([keyframe.explored for keyframe in kept]),
        [Tables(keyframe.case, values) for keyframe in kept],
        np.array([keyframe.time for keyframe in kept]),
    )


def keyframes_of(run: RunFile, ground: Ground) -> list[Keyframe]:
    """A result's keyframes."""
    start = int(run.times_ns[0])
    return keyframes(ground, (((time - start) / 1e9, e) for _, time, e in run.keyframes()))


def mean_surface(courses: Sequence[Course], p: Floats) -> Floats:
    """The mean of several runs' surfaces."""
    return np.asarray(np.mean([one.surface(p) for one in courses], axis=0))
