"""The cells of maps against the truth, counted: occupied is positive (paper, section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Evidence, terms
from formats.result import Counts, Curve, Split
from replay.scoring.kernels import (
    FEW,
    MOST_CURVES,
    OBSERVED,
    SCORED,
    SURE,
    WALL,
    rescore,
)
from replay.sensors.observer import Touched

Bools = npt.NDArray[np.bool_]


def tell(occupied: Bools, wall: Bools) -> Counts:
    """Count cells: true and false positives, false and true negatives."""
    tp = int(np.count_nonzero(occupied & wall))
    fp, fn = int(np.count_nonzero(occupied)) - tp, int(np.count_nonzero(wall)) - tp
    return Counts(tp, fp, fn, occupied.size - tp - fp - fn)


def count(occupied: Bools, truth_wall: Bools, scored: Bools, observed: Bools) -> Split:
    """A map against the truth, in the cells that some reading observed and in the others.

    Args:
        occupied: the map's cells whose P(empty) < 0.5, strictly.
        truth_wall: cells that are wall in truth.
        scored: cells that count.
        observed: cells that a reading showed. All are of one shape.
    """
    inside, outside = scored & observed, scored & ~observed
    return Split(
        tell(occupied[inside], truth_wall[inside]), tell(occupied[outside], truth_wall[outside])
    )


def table(curves: Mapping[str, Curve]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Sizes (curves, m) and signs (curves, m, levels) of the curves' terms, padded with zeros."""
    parts = [terms(curve.p_levels) for curve in curves.values()]
    most, levels = max(len(size) for size, _ in parts), parts[0][1].shape[1]
    sizes = np.zeros((len(parts), most))
    signs = np.zeros((len(parts), most, levels), dtype=np.int64)
    for k, (size, sign) in enumerate(parts):
        sizes[k, : len(size)], signs[k, : len(size)] = size, sign
    return sizes, signs


class Joined(NamedTuple):
    """Curves as the kernels take them.

    Attributes:
        priors: (priors, cells) l0, each set once.
        places: (curves,) which of them.
        sizes, signs: see `table`.
        weights: (curves, levels) the log-odds of each level.
        paper: (curves,) by the paper's update.
    """

    priors: npt.NDArray[np.float64]
    places: npt.NDArray[np.int64]
    sizes: npt.NDArray[np.float64]
    signs: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]
    paper: Bools


def joined(curves: Mapping[str, Curve]) -> Joined:
    """Curves of one number of levels, side by side."""
    sizes, signs = table(curves)
    distinct = list({id(curve.prior): curve.prior for curve in curves.values()}.values())
    places = np.array(
        [[prior is curve.prior for prior in distinct].index(True) for curve in curves.values()]
    )
    priors = np.stack([prior.values.ravel() for prior in distinct])
    weights = np.einsum("km,kml->kl", sizes, signs)
    paper = np.array([curve.update == "paper" for curve in curves.values()])
    return Joined(priors, places, sizes, signs, weights, paper)


class Scorer:
    """Scores of several curves over one evidence, kept up to date reading by reading.

    After every update they equal a full recount, `count(curve.of(evidence).occupied(), ...)`.

    Args:
        truth_wall: (rows, cols) cells that are wall in truth.
        scored: (rows, cols) cells that count.
        curves: by name; 29 at most.
        evidence: what was seen before; None: nothing.

    Raises:
        ValueError: no curve, too many, or curves of different numbers of levels.
    """

    def __init__(
        self,
        truth_wall: Bools,
        scored: Bools,
        curves: Mapping[str, Curve],
        evidence: Evidence | None = None,
    ) -> None:
        levels = {len(curve.p_levels) for curve in curves.values()}
        if not 0 < len(curves) <= MOST_CURVES or len(levels) > 1:
            raise ValueError(f"1 to {MOST_CURVES} curves with one number of levels are needed")
        self._names, self._terms = list(curves), joined(curves)
        self._words = np.zeros(truth_wall.size, dtype=np.uint32)
        self._tally = np.zeros((len(curves), 2, 4), dtype=np.int64)
        seen = None if evidence is None else evidence.visits()
        self._readings = 0 if seen is None else int(seen.max(initial=0))
        observed = np.zeros_like(scored) if seen is None else seen > 0
        self._words |= np.where(scored, SCORED, 0).ravel().astype(np.uint32)
        self._words |= np.where(truth_wall, WALL, 0).ravel().astype(np.uint32)
        # Cells that are not scored count as observed, so that nothing draws the kernel to them.
        self._words |= np.where(observed | ~scored, OBSERVED, 0).ravel().astype(np.uint32)
        for k, curve in enumerate(curves.values()):
            occupied = (curve.prior if evidence is None else curve.of(evidence)).occupied()
            self._tally[k] = count(occupied, truth_wall, scored, observed)
            self._words |= (occupied & scored).ravel().astype(np.uint32) << np.uint32(k)

    def scores(self) -> dict[str, Split]:
        """Counts by curve, as they stand."""
        return {
            name: Split(Counts(*seen), Counts(*unseen))
            for name, (seen, unseen) in zip(self._names, self._tally.tolist(), strict=True)
        }

    def update(self, evidence: Evidence, touched: Touched) -> dict[str, Split]:
        """Counts by curve after a reading.

        Args:
            evidence: with the reading counted in.
            touched: the cells that it showed. Every reading must come here, once.
        """
        self._readings += 1
        counts = evidence.counts.reshape(evidence.counts.shape[0], -1)
        sure = SURE if self._readings < FEW else np.inf
        rescore(touched.runs, counts, *self._terms, sure, self._words, self._tally)
        return self.scores()
