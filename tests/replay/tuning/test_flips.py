"""Look-up in the sorted tables gives what drawing and counting the map gives."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.grid import Update
from replay.sensors.observer import MODELS
from replay.tuning.cases import Case, Cells
from replay.tuning.flips import last_empty
from replay.tuning.surfaces import Scores, Tables, Values, grid, worst
from tests.tuning_worlds import seeds, sensors, slow_counts, updates, with_openings, world


@settings(max_examples=40, deadline=None)
@given(seeds, updates, sensors, st.sampled_from([0.9, 1.0]), st.sampled_from([0.3, 0.5, 0.7]))
def test_every_prior_scores_as_its_map_does(
    seed: int, update: Update, levels: tuple[float, float], scale: float, outside: float
) -> None:
    ground, evidence = world(seed)
    values = Values(levels, update, scale, p_outside=outside)
    tables = Tables(ground.case(evidence), values)
    p = [0.1, 0.2, 0.3, 0.5, 5 / 9, 0.6, 2 / 3, 0.7, 7 / 9, 0.9, 1.0]  # some of them tie
    scores = tables.surface(p, p)
    for i, p_wall in enumerate(p):
        for j, p_space in enumerate(p):
            counts = slow_counts(ground, evidence, values, p_wall, p_space)
            assert (scores.tp[i, j], scores.fp[i, j]) == counts[:2]
            assert scores.walls == counts.tp + counts.fn


@settings(max_examples=30, deadline=None)
@given(
    seeds, updates, st.sampled_from([None, 0.4, 5 / 9, 1.0]), st.sampled_from([None, 0.3, 5 / 9])
)
def test_openings_and_cells_that_are_partly_wall(
    seed: int, update: Update, p_door: float | None, p_window: float | None
) -> None:
    ground, evidence = world(seed)
    ground = with_openings(ground, np.random.default_rng(seed))
    tables = Tables(
        ground.case(evidence), Values((0.3, 0.6), update, p_door=p_door, p_window=p_window)
    )
    p = [0.1, 0.3, 5 / 9, 0.8, 1.0]
    scores = tables.surface(p, p)
    for i, p_wall in enumerate(p):
        for j, p_space in enumerate(p):
            counts = slow_counts(ground, evidence, tables.values, p_wall, p_space)
            assert (scores.tp[i, j], scores.fp[i, j]) == counts[:2]
            single = tables.at([p_wall], [p_space])
            assert (single.tp[0], single.fp[0], single.walls) == (*counts[:2], scores.walls)
    # Without a prior all are at one half, openings too: printed, that is 0.5 / 0.9.
    half = replace(tables.values, p_door=5 / 9, p_window=5 / 9, p_outside=0.5)
    none = tables.without_prior()
    counts = slow_counts(ground, evidence, half, 5 / 9, 5 / 9)
    assert (int(none.tp), int(none.fp)) == counts[:2]


def test_the_worst_of_surfaces_and_the_objectives_of_many_by_hand() -> None:
    surfaces = [np.array([[0.1, 0.9], [0.5, 0.2]]), np.array([[0.3, 0.4], [0.5, 0.7]])]
    assert worst(surfaces).tolist() == [[0.1, 0.4], [0.5, 0.2]]
    scores = Scores(np.array([[1, 2], [4, 0]]), np.array([[1, 6], [0, 3]]), 4)
    wanted = [[[2.0, 4.0], [4.0, 2.0]], [[1.0, 1.0], [np.inf, np.inf]]]
    assert scores.objectives().tolist() == wanted


def test_single_pairs_are_the_surface() -> None:
    ground, evidence = world(5)
    tables = Tables(ground.case(evidence), Values((0.3, 0.6)))
    p = grid(10)
    surface = tables.surface(p, p)
    wall, space = np.meshgrid(p, p, indexing="ij")
    single = tables.at(wall.ravel(), space.ravel())
    assert np.array_equal(single.tp, surface.tp.ravel())
    assert np.array_equal(single.fp, surface.fp.ravel())


@given(st.lists(st.tuples(st.floats(-1e4, 1e4), st.integers(1, 10**6)), min_size=1, max_size=20))
def test_the_last_empty_l0_is_the_last_by_one_rounding(pairs: list[tuple[float, int]]) -> None:
    total = np.array([a for a, _ in pairs])
    times = np.array([float(b) for _, b in pairs])
    found = last_empty(total, times)
    assert not (times * found > total).any()
    assert (times * np.nextafter(found, np.inf) > total).all()
    for (a, b), l0 in zip(pairs, found.tolist(), strict=True):  # near the true quotient
        assert abs(Fraction(l0) - Fraction(a) / b) <= Fraction(1, 10**9) * (1 + abs(Fraction(a)))


def test_without_a_prior_every_class_is_at_one_half() -> None:
    ground, evidence = world(11)
    values = Values((0.3, 0.6), prior_scale=1.0)
    tables = Tables(ground.case(evidence), values)
    counts = slow_counts(ground, evidence, values, 0.5, 0.5)
    none = tables.without_prior()
    assert (int(none.tp), int(none.fp)) == counts[:2]


def test_rates_of_scores_by_hand() -> None:
    scores = Scores(np.array([0, 6, 8]), np.array([0, 2, 8]), 10)
    assert scores.precision.tolist() == [0.0, 0.75, 0.5]
    assert scores.recall.tolist() == [0.0, 0.6, 0.8]
    # 5 * .75 * .6 / (4 * .75 + .6) = 2.25 / 3.6; 5 * .5 * .8 / (4 * .5 + .8) = 2 / 2.8
    assert np.allclose(scores.f2, [0.0, 0.625, 2 / 2.8], rtol=1e-15)
    assert scores.objectives()[0].tolist() == [np.inf, np.inf]


@given(st.sampled_from([0.15, 0.35, 0.55, 0.75, 0.95]), st.integers(0, 25))
def test_seen_often_under_the_papers_rule_p_is_a_threshold_on_coverage(p: float, k: int) -> None:
    # PAPER A2: k ISM - (k - 1) l0 has the sign of ISM - l0 for large k, and Equation 10 is
    # logit(0.9 x share): a cell is occupied iff its empty share is below its own p.
    share = k / 25
    if not 0.12 <= share <= 1.0:  # the sensor says nothing below 0.1
        return
    model = replace(MODELS["eq10"], samples=5)
    counts = np.zeros((26, 1), dtype=np.int64)
    counts[k] = 1000
    one = np.ones(1, dtype=np.int64)
    case = Case("one cell", {("wall", 0.0): Cells(counts, one, 0 * one)})
    tables = Tables(case, Values(tuple(model.p_levels()), "paper", 0.9))
    assert bool(tables.at([p], [0.9]).tp[0]) == (share < p)
