"""Bootstrap and paired test: against theory, by hand, and their own promises."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from formats.result import Counts
from replay.scoring.count_metrics import METRICS, f2, precision
from replay.scoring.intervals import block_counts, interval, paired, paired_means
from replay.scoring.scorer import count


def units(
    n: int, seed: int, quality: float = 0.7
) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Counts of n blocks of 100 cells, about 20 of them wall."""
    rng = np.random.default_rng(seed)
    wall = rng.binomial(100, 0.2, n)
    tp, fp = rng.binomial(wall, quality), rng.binomial(100 - wall, 0.05)
    return np.stack((tp, fp, wall - tp, 100 - wall - fp), axis=1)


def test_blocks_add_up_to_the_whole() -> None:
    rng = np.random.default_rng(4)
    occupied, wall, scored = (rng.random((53, 71)) < share for share in (0.3, 0.4, 0.7))
    table = block_counts(occupied, wall, scored, 0.05, 0.5)
    assert len(table) == 6 * 8
    whole = count(occupied, wall, scored, np.ones_like(wall)).observed
    assert table.sum(axis=0).tolist() == list(whole)
    first = count(occupied[:10, :10], wall[:10, :10], scored[:10, :10], np.ones((10, 10), bool))
    assert table[0].tolist() == list(first.observed)
    scored[:10, :10] = False
    assert len(block_counts(occupied, wall, scored, 0.05, 0.5)) == 6 * 8 - 1


def test_the_interval_of_a_share_is_the_binomials() -> None:
    # One found cell a unit, 70 of 100 right: the share's standard error is sqrt(.7 .3 / 100).
    table = np.array([[1, 0, 0, 0]] * 70 + [[0, 1, 0, 0]] * 30)
    found = interval(precision, table, rounds=20_000)
    error = 1.96 * (0.7 * 0.3 / 100) ** 0.5
    assert found == pytest.approx((0.7, 0.7 - error, 0.7 + error), abs=0.011)


def test_95_of_100_intervals_hold_the_truth() -> None:
    truth = f2(Counts(*units(200_000, 1).sum(axis=0).tolist()))
    held = 0
    for seed in range(200):
        found = interval(f2, units(60, 100 + seed), rounds=400)
        held += found.low <= truth <= found.high
    assert 0.90 <= held / 200 <= 0.985  # 0.95, less what 60 units cost the percentile bootstrap


def test_the_same_rows_give_the_same_numbers() -> None:
    assert interval(f2, units(30, 5)) == interval(f2, units(30, 5))
    assert interval(f2, units(30, 5), seed=1) != interval(f2, units(30, 5), seed=2)


def test_p_by_all_swaps_of_a_few_units() -> None:
    first, second = units(8, 1, 0.8), units(8, 2, 0.6)
    second[:, 2] += first[:, [0, 2]].sum(axis=1) - second[:, [0, 2]].sum(axis=1)
    difference = f2(Counts(*first.sum(axis=0).tolist())) - f2(Counts(*second.sum(axis=0).tolist()))
    large = 0
    for swap in product([False, True], repeat=8):
        moved = np.array(swap)[:, None]
        a = Counts(*np.where(moved, second, first).sum(axis=0).tolist())
        b = Counts(*np.where(moved, first, second).sum(axis=0).tolist())
        large += abs(f2(a) - f2(b)) >= abs(difference) - 1e-12
    found = paired(f2, first, second, rounds=20_000)
    assert found.difference == pytest.approx(difference)
    assert found.p == pytest.approx(large / 256, abs=0.005)


def test_equal_maps_differ_by_nothing() -> None:
    table = units(20, 3)
    assert paired(f2, table, table, rounds=200) == (0.0, 0.0, 0.0, 1.0)


def test_p_is_uniform_where_there_is_no_difference() -> None:
    below = sum(
        paired(f2, units(40, 2 * s), units(40, 2 * s + 1), rounds=300).p < 0.1 for s in range(200)
    )
    assert 0.05 <= below / 200 <= 0.16


def test_a_real_difference_is_sure_with_many_units() -> None:
    found = paired(f2, units(80, 1, 0.8), units(80, 2, 0.5), rounds=999)
    assert found.p == pytest.approx(0.001)
    assert 0.1 < found.low < found.difference < found.high < 0.5


@pytest.mark.parametrize("name", list(METRICS))
def test_every_metric_of_counts_has_an_interval(name: str) -> None:
    found = interval(METRICS[name], units(25, 6), rounds=200)
    assert found.low <= found.value <= found.high
    assert found.low < found.high


def test_scores_of_units_are_compared_by_their_means() -> None:
    first, second = np.array([0.25, 0.5, 0.75, 1.0]), np.array([0.25, 0.25, 0.25, 0.25])
    found = paired_means(first, second, rounds=4000)
    assert found.difference == pytest.approx(0.375, rel=1e-15)
    # draws of four differences 0, .25, .5, .75: all zeros, or all the largest, are too rare
    assert 0.0 < found.low < 0.375 < found.high < 0.75
    # the three that differ all have one sign: by chance so in 2 of 8 tosses
    assert found.p == pytest.approx(0.25, abs=0.03)
    same = paired_means(first, first)
    assert (same.difference, same.low, same.high, same.p) == (0.0, 0.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="same units"):
        paired_means(first, second[:2])


def test_no_units() -> None:
    with pytest.raises(ValueError, match="at least one"):
        interval(f2, np.zeros((0, 4), dtype=np.int64))
    with pytest.raises(ValueError, match="same units"):
        paired(f2, units(3, 1), units(4, 1))
