"""The steps of the exact front, each by hand or against every combination."""

from __future__ import annotations

from math import log, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.grid import Update
from replay.tuning.flips import Flips
from replay.tuning.front import Front, Pieces, grid_front, joined, pareto, pieces, unbeaten
from replay.tuning.surfaces import Scores, Tables, Values
from tests.tuning_worlds import rates, seeds, slow_counts, updates, world
from tests.tuning_worlds import unbeaten as by_every_pair


def spans(*ends: tuple[float, float], part: float = 0.5) -> np.ndarray:
    """(n, 1, 3) of one probability, with its middle at a part of the way."""
    return np.array([[[low, low + part * (high - low), high]] for low, high in ends])


def test_acceptable_is_above_forty_per_cent_of_both() -> None:
    # Of 5 walls: recall .4 | precision and recall .6 | precision .4 | precision .2
    scores = Scores(np.array([2, 3, 4, 5]), np.array([0, 2, 6, 20]), 5)
    front = Front(scores, spans((0, 0.1), (0.1, 0.2), (0.2, 0.3), (0.3, 0.4)))
    kept = front.acceptable
    assert (kept.scores.tp.tolist(), kept.scores.fp.tolist(), kept.scores.walls) == ([3], [2], 5)
    assert kept.spans.tolist() == spans((0.1, 0.2)).tolist()


def halfway(a: float, b: float) -> float:
    """The probability halfway between two in log-odds: the geometric mean of their odds."""
    odds = sqrt(a / (1 - a) * b / (1 - b))
    return odds / (1 + odds)


def test_pieces_of_a_class_by_hand() -> None:
    # The prior is scaled by 0.8, so what flips at 0.05, 0.625, 0.75 and 0.95 as it is printed:
    used = [0.04, 0.5, 0.6, 0.76]
    steps = Flips(
        np.array([log(p / (1 - p)) for p in used]),
        np.array([9, 9, 8, 7, 6, 5, 4, 3, 0]),
        np.array([9, 9, 5, 4, 3, 3, 1, 1, 0]),
    )
    found = pieces(steps, Values((0.3, 0.6), prior_scale=0.8), 0.1, 0.9)
    # 0.75 itself gives 5 and 3, which all between 0.625 and 0.75 beat with 6 and 3.
    assert (found.tp.tolist(), found.fp.tolist()) == ([4, 6, 7, 8], [1, 3, 4, 5])
    expected = [
        [0.75, halfway(0.6, 0.72) / 0.8, 0.9],
        [0.625, halfway(0.5, 0.6) / 0.8, 0.75],
        [0.625, 0.625, 0.625],
        [0.1, halfway(0.08, 0.5) / 0.8, 0.625],
    ]
    assert found.spans.shape == (4, 1, 3)
    np.testing.assert_allclose(found.spans[:, 0], expected, rtol=1e-12)


def test_of_equal_pieces_the_widest_is_kept() -> None:
    tp, fp = np.array([5, 5, 5, 4]), np.array([2, 2, 3, 2])
    wide = spans((0.1, 0.4), part=0.9)  # its middle lies near its end
    ends = spans((0.8, 0.9), (0.1, 0.4), (0.5, 0.6), (0.6, 0.7), part=0.1)
    ends[1] = wide[0]
    found = unbeaten(tp, fp, ends)
    assert (found.tp.tolist(), found.fp.tolist()) == ([5], [2])
    assert found.spans.tolist() == wide.tolist()


choice = st.tuples(st.integers(0, 4), st.integers(0, 3), st.integers(1, 4), st.integers(0, 5))


@given(st.lists(choice, min_size=1, max_size=6), st.lists(choice, min_size=1, max_size=6))
def test_two_classes_together_are_the_best_of_all_pairs(
    first: list[tuple[int, int, int, int]], second: list[tuple[int, int, int, int]]
) -> None:
    """Also of choices that are no staircase; `tp` ascends, whose last bounds the sums."""
    both = []
    for rows in (sorted(first), sorted(second)):
        tp, fp, width, low = np.array(rows).T
        middle = low + width * (tp % 2)
        both.append(Pieces(tp, fp, np.stack([low, middle, low + width], axis=1)[:, None] * 0.125))
    a, b = both
    every = [
        (int(a.tp[i] + b.tp[j]), int(a.fp[i] + b.fp[j]), i, j)
        for i in range(len(a.tp))
        for j in range(len(b.tp))
    ]
    points = {(tp, fp) for tp, fp, _, _ in every}
    best = sorted(
        (tp, fp)
        for tp, fp in points
        if not any((t, f) != (tp, fp) and t >= tp and f <= fp for t, f in points)
    )
    found = joined(a, b)
    assert list(zip(found.tp.tolist(), found.fp.tolist(), strict=True)) == best
    for row, point in zip(found.spans, best, strict=True):
        areas = [
            np.ptp(a.spans[i]) * np.ptp(b.spans[j]) for tp, fp, i, j in every if (tp, fp) == point
        ]
        assert np.ptp(row[0]) * np.ptp(row[1]) == max(areas)
        assert any(
            (row == np.concatenate([a.spans[i], b.spans[j]])).all()
            for tp, fp, i, j in every
            if (tp, fp) == point
        )


def test_points_that_no_other_beats_by_hand() -> None:
    # Of 10 walls: nothing | 1 of 1 | 4 of 8 | 4 of 5, twice | 8 of 12 | 6 of 12
    scores = Scores(np.array([0, 1, 4, 4, 4, 8, 6]), np.array([0, 0, 4, 1, 1, 4, 6]), 10)
    ends = [(k / 10, k / 10 + 0.05) for k in range(7)]
    front = pareto(scores, spans(*ends))
    assert front.scores.tp.tolist() == [1, 4, 8]
    assert front.scores.fp.tolist() == [0, 1, 4]
    assert front.spans.tolist() == spans(ends[1], ends[3], ends[5]).tolist()
    assert front.points.ravel() == pytest.approx([0.125, 0.325, 0.525])
    nothing = pareto(Scores(np.array([0, 0]), np.array([0, 3]), 10), spans(*ends[:2]))
    assert nothing.spans.shape == (0, 1, 3)


@given(seeds, updates)
def test_the_front_among_pairs_of_a_grid(seed: int, update: Update) -> None:
    ground, evidence = world(seed)
    values = Values((0.3, 0.6), update)
    p = np.array([0.1, 0.4, 0.5, 0.8])
    front = grid_front(Tables(ground.case(evidence), values), p)
    every = [rates(slow_counts(ground, evidence, values, w, s)) for w in p for s in p]
    found = list(zip(front.scores.precision.tolist(), front.scores.recall.tolist(), strict=True))
    assert set(found) == by_every_pair(every)
    assert (front.spans == front.points[:, :, None]).all()
    for k, (p_wall, p_space) in enumerate(front.points.tolist()):
        assert rates(slow_counts(ground, evidence, values, p_wall, p_space)) == found[k]
