from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.grid import Evidence, Geometry, Grid, Update, logit, probability, terms

CELL = Geometry(1, 1, 0.05, 0.0, 0.0)
chances = st.floats(0.001, 0.999)


def seen(*counts: int) -> Evidence:
    """One cell, seen so often at each level."""
    return Evidence(CELL, np.array(counts, dtype=np.uint32).reshape(-1, 1, 1))


def prior(p_empty: float) -> Grid:
    return Grid(CELL, np.array([[logit(p_empty)]]))


def recursion(steps: list[int], p: list[float], p0: float, update: Update) -> float:
    """Equation 5 as printed, or the consistent step, one reading after the other."""
    l0 = logit(p0)
    value = l0
    for level in steps:
        value += logit(p[level]) - (l0 if update == "paper" else 0.0)
    return value


@given(st.floats(0.5, 1.0, exclude_max=True))
def test_log_odds_of_the_complement_are_opposite_to_the_bit(p: float) -> None:
    assert logit(1.0 - p) == -logit(p)


def test_equation_6_by_hand() -> None:
    assert logit(0.9) == pytest.approx(math.log(9.0), rel=1e-15)
    assert logit(0.2) == pytest.approx(-math.log(4.0), rel=1e-15)
    assert logit(0.5) == 0.0


@pytest.mark.parametrize("p", [0.0, 1.0, -0.1, 1.1, math.nan])
def test_no_log_odds_of_certainty(p: float) -> None:
    with pytest.raises(ValueError, match="strictly between 0 and 1"):
        logit(p)


@given(chances)
def test_equation_9_undoes_equation_6(p: float) -> None:
    assert float(probability(logit(p))) == pytest.approx(p, rel=1e-12)


def test_equation_9_does_not_overflow() -> None:
    assert probability([-1e6, 0.0, 1e6]).tolist() == [0.0, 0.5, 1.0]


def test_equation_5_by_hand() -> None:
    # Prior 0.8 empty, two readings of 0.9 empty: odds 9, then 9 * 9 / 4 under the paper's step.
    p = [0.1, 0.9]
    assert seen(0, 0).on(prior(0.8), p, "paper").values[0, 0] == logit(0.8)
    assert seen(0, 1).on(prior(0.8), p, "paper").values[0, 0] == pytest.approx(math.log(9))
    twice = seen(0, 2).on(prior(0.8), p, "paper")
    assert twice.values[0, 0] == pytest.approx(math.log(81 / 4))
    assert 1 - twice.p_occupied()[0, 0] == pytest.approx(81 / 85)
    assert seen(0, 2).on(prior(0.8), p).values[0, 0] == pytest.approx(math.log(81 * 4))


def test_the_papers_step_makes_a_wall_that_is_hit_emptier_where_the_prior_says_more() -> None:
    # A6: p_wall 0.1 * 0.9 lies below the sensor's own 0.1, so each hit adds log(91/9) - log(9) > 0.
    once, twice = (seen(k, 0).on(prior(0.09), [0.1, 0.9], "paper").values[0, 0] for k in (1, 2))
    assert once == pytest.approx(-math.log(9))
    assert twice == pytest.approx(-2 * math.log(9) + math.log(91 / 9))
    assert twice > once


@given(st.integers(0, 500), chances, chances)
def test_equation_12_closed_form(k: int, ism: float, p0: float) -> None:
    value = seen(k).on(prior(p0), [ism], "paper").values[0, 0]
    assert value == pytest.approx(k * logit(ism) - (k - 1) * logit(p0), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("update", ["bayes", "paper"])
@given(st.lists(st.integers(0, 3), max_size=60), st.lists(chances, min_size=4, max_size=4), chances)
def test_counts_equal_the_recursion(
    update: Update, steps: list[int], p: list[float], p0: float
) -> None:
    counts = [steps.count(level) for level in range(4)]
    value = seen(*counts).on(prior(p0), p, update).values[0, 0]
    assert value == pytest.approx(recursion(steps, p, p0, update), rel=1e-9, abs=1e-9)


@given(st.integers(0, 9), st.integers(0, 9), chances)
def test_equations_1_to_3_posterior_is_proportional_to_prior_free_posterior_times_prior(
    hits: int, misses: int, p0: float
) -> None:
    p = [0.3, 0.6]
    free = 0.3**hits * 0.6**misses, 0.7**hits * 0.4**misses  # of empty and of occupied
    expected = free[0] * p0 / (free[0] * p0 + free[1] * (1 - p0))
    value = 1 - seen(hits, misses).on(prior(p0), p).p_occupied()[0, 0]
    assert value == pytest.approx(expected, rel=1e-9)


@given(st.integers(1, 99), st.integers(0, 2000))
def test_as_many_hits_as_misses_of_equal_weight_are_a_tie_and_a_tie_is_empty(
    percent: int, k: int
) -> None:
    p_hit = percent / 100
    evidence, flat = seen(k, k), Grid(CELL, np.zeros((1, 1)))
    grid = evidence.on(flat, [1 - p_hit, 1 - round(1 - p_hit, 2)])
    assert grid.values[0, 0] == 0.0
    assert not grid.occupied()[0, 0]


def test_occupied_is_strict() -> None:
    grid = Grid(Geometry(1, 3, 1.0, 0, 0), np.array([[-1e-300, 0.0, 1e-300]]))
    assert grid.occupied().tolist() == [[True, False, False]]


def test_terms_by_hand() -> None:
    sizes, signs = terms([0.1, 0.9, 0.5, 0.25])
    assert sizes.tolist() == pytest.approx([math.log(3), math.log(9)])
    assert signs.tolist() == [[0, 0, 0, -1], [-1, 1, 0, 0]]


def test_terms_join_what_differs_by_rounding() -> None:
    assert terms([1 - 0.9, 0.9, 0.1])[1].tolist() == [[-1, 1, -1]]
    assert terms([0.5 + 1e-16, 0.5 - 1e-16])[0].size == 0


def test_each_level_has_one_sign_at_most() -> None:
    levels = [0.1 + 0.8 * k / 225 for k in range(226)]
    sizes, signs = terms(levels)
    assert (np.abs(signs).sum(axis=0) == 1).all()
    assert sizes @ signs == pytest.approx([math.log(p / (1 - p)) for p in levels])


@given(st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 2**20)), min_size=2, max_size=4))
def test_evidence_of_several_logs_adds_up_in_any_order_to_the_same_bits(
    logs: list[tuple[int, int]],
) -> None:
    one, other = seen(*logs[0]), seen(*logs[0])
    for k in range(1, len(logs)):
        one = one + seen(*logs[k])
    other = seen(*logs[-1])
    for log in reversed(logs[:-1]):
        other = seen(*log) + other
    assert one.counts.tobytes() == other.counts.tobytes()
    assert one.counts.ravel().tolist() == [sum(c) for c in zip(*logs, strict=True)]
    p = [0.3, 0.6]
    maps = [evidence.on(prior(0.81), p).values.tobytes() for evidence in (one, other)]
    assert maps[0] == maps[1]


def test_evidence_of_other_lattices_does_not_add_up() -> None:
    with pytest.raises(ValueError, match="one lattice"):
        seen(1, 2) + Evidence.empty(Geometry(1, 1, 0.05, 0.05, 0.0), 2)
    with pytest.raises(ValueError, match="one set of levels"):
        seen(1, 2) + seen(1, 2, 3)
    with pytest.raises(ValueError, match="different lattices"):
        seen(1, 2).on(Grid(Geometry(1, 1, 0.1, 0, 0), np.zeros((1, 1))), [0.1, 0.9])


def test_empty_evidence_of_a_large_lattice_is_not_resident() -> None:
    status = Path("/proc/self/statm")
    if not status.exists():
        pytest.skip("resident memory is read from /proc")
    before = int(status.read_text().split()[1])
    evidence = Evidence.empty(Geometry(5000, 4000, 0.05, 0, 0), 26)
    assert evidence.counts.nbytes > 2e9
    assert (int(status.read_text().split()[1]) - before) * 4096 < 20e6


def test_a_window_of_a_lattice_by_hand() -> None:
    """Rows 2 to 5 and columns 1 to 7 of a lattice at (-1, 3) begin at (-0.5, 4)."""
    part = Geometry(10, 20, 0.5, -1.0, 3.0).window(slice(2, 5), slice(1, 7))
    assert part == Geometry(3, 6, 0.5, -0.5, 4.0)
    assert part.extent == (-0.5, 4.0, 2.5, 5.5)


def test_covering_by_hand() -> None:
    assert Geometry.covering(-0.12, 0.0, 0.3, 0.2, 0.1) == Geometry(2, 5, 0.1, -0.2, 0.0)
    assert Geometry.covering(0.3, 0.3, 0.6, 0.6, 0.1).shape == (3, 3)  # 0.3 / 0.1 is 2.99...96
    assert Geometry.covering(0.07, 0.07, 0.07, 0.07, 0.05).shape == (1, 1)


@given(
    st.floats(-100, 100),
    st.floats(-100, 100),
    st.floats(0, 20),
    st.floats(0, 20),
    st.floats(0.01, 1),
)
def test_covering_holds_the_rectangle_on_whole_cells(
    x: float, y: float, width: float, height: float, resolution: float
) -> None:
    g = Geometry.covering(x, y, x + width, y + height, resolution)
    x0, y0, x1, y1 = g.extent
    near = 2e-6 * resolution + 1e-9
    assert x0 <= x + near
    assert y0 <= y + near
    assert x1 >= x + width - near
    assert y1 >= y + height - near
    assert x0 > x - resolution - near
    assert x1 < x + width + resolution + near
    assert g.x / resolution == pytest.approx(round(g.x / resolution), abs=1e-6)
    assert g.y / resolution == pytest.approx(round(g.y / resolution), abs=1e-6)
