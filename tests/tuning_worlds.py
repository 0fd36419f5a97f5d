"""Small made-up runs for the search, and slow, obvious scores of a prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from formats.grid import Evidence, Geometry, Grid, Update, logit
from formats.result import Counts
from replay.prior import used
from replay.scoring.scorer import count
from replay.tuning.cases import DOOR, KINDS, MIXED, OUTSIDE, SPACE, WALL, WINDOW, Ground
from replay.tuning.surfaces import Values

LEVELS = (0.3, 0.6)
SHAPE = (6, 7)
GEOMETRY = Geometry(*SHAPE, 1.0, 0.0, 0.0)


def world(seed: int, most: int = 4, levels: int = 2) -> tuple[Ground, Evidence]:
    """A plan that is partly right, and readings that are partly right."""
    random = np.random.default_rng(seed)
    kinds = random.choice([0, 1, 1, 4], SHAPE).ravel().astype(np.int8)
    wall = np.where(random.random(kinds.size) < 0.8, kinds == 0, kinds != 0).astype(np.int64)
    counts = random.integers(0, most + 1, (levels, kinds.size)) * (random.random(kinds.size) < 0.7)
    there = np.flatnonzero(random.random(kinds.size) < 0.9)
    ground = Ground(
        "made up", there, kinds[there], np.zeros(len(there)), wall[there], 1 - wall[there]
    )
    return ground, Evidence(GEOMETRY, counts.reshape(levels, *SHAPE).astype(np.uint32))


def with_openings(ground: Ground, random: np.random.Generator) -> Ground:
    """Some cells are doors, windows, or partly wall."""
    kinds, shares = ground.kinds.copy(), ground.shares.copy()
    for kind in (DOOR, WINDOW, MIXED):
        kinds[random.random(kinds.size) < 0.2] = KINDS.index(kind)
    mixed = kinds == KINDS.index(MIXED)
    shares[mixed] = random.choice([0.25, 0.5, 0.75], int(mixed.sum()))
    return replace(ground, kinds=kinds, shares=shares)


def slow_counts(
    ground: Ground, evidence: Evidence, values: Values, p_wall: float, p_space: float
) -> Counts:
    """The map is drawn and counted cell by cell, as a run would."""
    scale = values.prior_scale
    p = {
        WALL: used(p_wall, scale),
        SPACE: used(p_space, scale),
        DOOR: used(p_space if values.p_door is None else values.p_door, scale),
        WINDOW: used(p_wall if values.p_window is None else values.p_window, scale),
        OUTSIDE: used(values.p_outside, 1.0),
    }
    l0 = np.zeros(GEOMETRY.rows * GEOMETRY.cols)
    for cell, k, share in zip(ground.where, ground.kinds, ground.shares, strict=True):
        mixture = share * p[WALL] + (1.0 - share) * p[SPACE]
        l0[cell] = logit(float(mixture if KINDS[k] == MIXED else p[KINDS[k]]))
    prior = Grid(evidence.geometry, l0.reshape(SHAPE))
    occupied = evidence.on(prior, values.p_levels, values.update).occupied()
    wall, scored = np.zeros(l0.size, dtype=np.bool_), np.zeros(l0.size, dtype=np.bool_)
    wall[ground.where], scored[ground.where] = ground.wall > 0, True
    return count(occupied, wall.reshape(SHAPE), scored.reshape(SHAPE), evidence.visits() > 0).whole


def rates(counts: Counts) -> tuple[float, float]:
    """Precision and recall."""
    tp, fp, fn, _ = counts
    return (tp / (tp + fp), tp / (tp + fn)) if tp else (0.0, 0.0)


def unbeaten(points: Sequence[tuple[float, float]]) -> set[tuple[float, float]]:
    """Points that no other has more of both of (or as much of one): every pair is compared."""
    return {
        a
        for a in points
        if a[0] > 0 and not any(b != a and b[0] >= a[0] and b[1] >= a[1] for b in points)
    }


UPDATES: tuple[Update, ...] = ("bayes", "paper")
updates = st.sampled_from(UPDATES)
seeds = st.integers(0, 2**32 - 1)
sensors = st.sampled_from([(0.3, 0.6), (0.1, 0.9), (0.2, 0.8), (0.25, 0.7)])
