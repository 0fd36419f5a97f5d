"""Where a map lies on a plan: candidates, polished, ranked, and how sure the best one is."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from formats.errors import FormatError
from replay.registration.polish import Bench, Fit
from replay.registration.search import Candidate, search
from replay.registration.seen import LEAST, Doubles, Mask, Seen

STEP = 1.045  # ratio of neighbouring scales
SLACK = 1.04  # of a known scale: drift stretches maps
FREE = (0.5, 2.2)  # plan pixels a map cell, where nothing is known
METRIC = (0.4, 8.0)  # the same where the cells are of a known size: plans of 0.6 to 12 cm a pixel
SHARE = (0.1, 1.6)  # of the plan's longer side that the map's takes
EACH, MOST, KEPT = 16, 120, 60  # candidates of each scale, of the only one, polished to the end
COARSE, FINE = (4.0, 3.0, 3.0, 2.0, 2.0), (3.0, 2.0, 2.0, 1.5, 1.5, 1.0, 1.0, 1.0, 1.0, 1.0)
HELD, SHARP = (2.0, 1.5, 1.0, 1.0), (0.7, 0.5, 0.5, 0.35, 0.35)
BENT = 0.02  # of the score, which a map bent by drift loses when it is held to its scale
APART = 0.1  # of the map's diagonal: nearer places are one
SMALLEST = 32.0  # px of the plan that a map's diagonal takes: of smaller ones all fits a dot
RUNNERS = 5
MIRROR = 0.04  # what being mirrored costs of the score: plans seldom are
# How sure, as a logistic of the lead over the next place, as a share of what the best one leaves
# unexplained, and of the lead in what lies on walls by length; fitted to 504 random buildings and
# maps, and held against others (scripts/score_align.py; the table is in docs/align.md).
OFFSET, GAIN, ALONG = -1.76, 14.6, 20.6
ROOM, FULL = 0.978, 0.9  # a lead over a score above FULL says no more than over FULL
NONE_LEFT = 0.3  # the lead where there is no other place
SURE = 0.95
DOUBTED = 0.5  # the most that is said of a place that another one contradicts
MORE = 0.08  # of what was seen, by length, that another place explains beyond the best


@dataclass(frozen=True)
class Place:
    """Where the map may lie.

    Attributes:
        matrix: (2, 3) from the map picture's pixels, or a log's metres, to the plan's pixels.
        mirrored: the plan shows the building mirrored.
        score: 0 to 1, how well both pictures explain each other.
        explained: share of the occupied cells on walls; confirmed: share of the walls seen.
    """

    matrix: Doubles
    mirrored: bool
    score: float
    explained: float
    confirmed: float

    @property
    def scale(self) -> float:
        """Plan pixels a map pixel or metre."""
        return float(np.hypot(self.matrix[0, 0], self.matrix[1, 0]))

    @property
    def turn_deg(self) -> float:
        """Clockwise on the screen, of the map's x axis; -180 to 180."""
        return float(np.degrees(np.arctan2(self.matrix[1, 0], self.matrix[0, 0])))

    def facts(self) -> dict[str, Any]:
        """What `--json` says of it."""
        return {
            "mirrored": self.mirrored,
            "scale": self.scale,
            "turn_deg": self.turn_deg,
            "x": float(self.matrix[0, 2]),
            "y": float(self.matrix[1, 2]),
            "matrix": self.matrix.tolist(),
            "score": self.score,
        }


@dataclass(frozen=True)
class Alignment:
    """Places, the likeliest first; the probability that the first is right; how long it took."""

    places: list[Place]
    confidence: float
    seconds: float = field(compare=False)

    @property
    def best(self) -> Place:
        """The likeliest place."""
        return self.places[0]

    @property
    def confident(self) -> bool:
        """Whether it may be used unasked."""
        return self.confidence >= SURE

    def facts(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "confident": self.confident,
            **self.best.facts(),
            "confidence": self.confidence,
            "runners_up": [place.facts() for place in self.places[1:]],
            "seconds": self.seconds,
        }


def align(
    seen: Seen,
    walls: Mask,
    *,
    scale: float | tuple[float, float] | None = None,
    mirrored: bool | None = None,
    name: str = "",
) -> Alignment:
    """Find the place of a map on a plan.

    Args:
        seen: what the robot saw.
        walls: (H, W) the plan's ink.
        scale: plan pixels a map cell, where it is known (kept to within 4 %), or from and to;
            None: searched.
        mirrored: None: both ways are tried.
        name: of the map, for errors.

    Raises:
        FormatError: no place fits at all; the plan is of one colour.
    """
    started = perf_counter()
    check_ink(walls, name)
    if isinstance(scale, tuple):
        low, high = scale
    else:
        low, high = (scale / SLACK, scale * SLACK) if scale else scale_range(seen, walls)
    count = int(np.ceil(np.log(high / low) / np.log(STEP))) + 1
    scales = np.geomspace(low, high, count).tolist()
    mirrors = [False, True] if mirrored is None else [mirrored]
    picked = _picked(search(seen, walls, scales, mirrors))
    bench = Bench(seen, walls)
    within = (low / 1.03, high * 1.03)
    rough = [bench.weigh(bench.polish(c.matrix, COARSE, within), 2.0) for c in picked]
    rough.sort(key=lambda f: -f.score)
    fits = [bench.weigh(bench.polish(f.matrix, FINE, within)) for f in _varied(rough)]
    fits = [f for f in fits if f.explained > 0 and f.confirmed > 0 and bench.size(f) >= SMALLEST]
    if not fits:
        raise FormatError(name, "no place on the plan fits it at all")
    known = scale if isinstance(scale, float) else None
    best = [_sharpened(bench, fit, known, within) for fit in distinct(fits, seen)[: 1 + RUNNERS]]
    best.sort(key=_rank, reverse=True)
    places = [_place(fit.matrix @ whole_of(seen), fit) for fit in best]
    spread = [bench.spread(f.matrix) for f in best]
    sure = confidence([_rank(f) for f in best], spread)
    if contradicted([f.score for f in best], spread):
        sure = min(sure, DOUBTED)
    return Alignment(places, sure, perf_counter() - started)


def _sharpened(bench: Bench, fit: Fit, known: float | None, within: tuple[float, float]) -> Fit:
    """The last rounds; with the known scale to the letter, where that fits about as well."""
    if known is not None:
        held = bench.weigh(bench.polish(fit.matrix, HELD + SHARP, (known, known)))
        if held.score >= fit.score - BENT:
            return held
    sharp = bench.weigh(bench.polish(fit.matrix, SHARP, within))
    return sharp if sharp.score >= fit.score - BENT else fit


def align_place(seen: Seen, walls: Mask, matrix: Doubles, name: str = "") -> Place:
    """A place that somebody gave, weighed; it is taken as sure.

    Args:
        seen: what the robot saw.
        walls: (H, W) the plan's ink.
        matrix: (2, 3) as a place's.
        name: of the map, for errors.

    Raises:
        FormatError: the plan is of one colour.
    """
    check_ink(walls, name)
    fit = Bench(seen, walls).weigh(matrix @ np.linalg.inv(whole_of(seen)))
    return _place(matrix, fit)


def _place(matrix: Doubles, fit: Fit) -> Place:
    return Place(matrix, fit.mirrored, fit.score, fit.explained, fit.confirmed)


def check_ink(walls: Mask, name: str) -> None:
    """A plan has ink and paper.

    Raises:
        FormatError: it is of one colour, or next to it.
    """
    hint = "is it the right picture?"
    if int(walls.sum()) < LEAST:
        raise FormatError(name, "the plan has next to no ink to lay it on", hint=hint)
    if walls.all():
        raise FormatError(name, "the plan is nothing but ink", hint=hint)


def whole_of(seen: Seen) -> Doubles:
    """(3, 3) from the user's coordinates to cells."""
    return np.vstack([seen.to_cells, [0.0, 0.0, 1.0]])


def scale_range(seen: Seen, walls: Mask) -> tuple[float, float]:
    """Scales worth trying where nothing says which."""
    low, high = FREE if seen.resolution is None else METRIC
    sides = [
        max(float(np.ptp(np.flatnonzero(mask.any(axis=axis)))) + 1 for axis in (0, 1))
        for mask in (walls, seen.occupied)
    ]
    ratio = sides[0] / sides[1]
    low, high = max(low, SHARE[0] * ratio), min(high, SHARE[1] * ratio)
    return (low, high) if low < high else (SHARE[0] * ratio, SHARE[1] * ratio)


def _picked(candidates: list[Candidate]) -> list[Candidate]:
    """The best of each scale, since scores of different scales do not compare."""
    by_scale: dict[float, list[Candidate]] = {}
    for candidate in candidates:
        by_scale.setdefault(candidate.scale, []).append(candidate)
    each = max(EACH, MOST // len(by_scale))
    return [c for some in by_scale.values() for c in sorted(some, key=lambda c: -c.score)[:each]]


def _varied(fits: list[Fit]) -> list[Fit]:
    """The best to polish on, without the same place twice."""
    chosen: list[Fit] = []
    for fit in fits:
        if all(np.abs(fit.matrix - other.matrix).max() > 1.0 for other in chosen):
            chosen.append(fit)
        if len(chosen) == KEPT:
            break
    return chosen


def _rank(fit: Fit) -> float:
    """The score, less what being mirrored costs."""
    return fit.score - (MIRROR if fit.mirrored else 0.0)


def distinct(fits: list[Fit], seen: Seen) -> list[Fit]:
    """Best first, each place once."""
    points = seen.points
    low, high = points.min(axis=0), points.max(axis=0)
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    diagonal = float(np.hypot(*(high - low)))
    chosen: list[tuple[Fit, Doubles]] = []
    for fit in sorted(fits, key=_rank, reverse=True):
        at = corners @ fit.matrix[:, :2].T + fit.matrix[:, 2]
        limit = APART * diagonal * fit.scale
        if all(np.hypot(*(at - other).T).mean() > limit for _, other in chosen):
            chosen.append((fit, at))
    return [fit for fit, _ in chosen]


def confidence(ranks: list[float], spread: list[float]) -> float:
    """Probability that the first place is right.

    Args:
        ranks: scores of all places, less what being mirrored costs, the likeliest first.
        spread: of each, the share of what was seen that lies on walls, by length.
    """
    lead, along = NONE_LEFT, 0.0
    if len(ranks) > 1:
        lead, along = ranks[0] - ranks[1], spread[0] - max(spread[1:])
    share = lead / (ROOM - min(ranks[0], FULL))
    return float(1.0 / (1.0 + np.exp(-(OFFSET + GAIN * share + ALONG * along))))


def contradicted(scores: list[float], spread: list[float]) -> bool:
    """Whether another place speaks against the first, however far it leads.

    It does where it fits as well and comes second for being mirrored alone, and where it lays
    clearly more of the map's length on walls: it lost by ink that the robot did not see, which
    hatching and furniture may be, and the first place leaves much of the map beside the building.

    Args:
        scores: of all places, the likeliest first, without what being mirrored costs.
        spread: of each, the share of what was seen that lies on walls, by length.
    """
    return max(scores[1:], default=0.0) >= scores[0] or max(spread) > spread[0] + MORE
