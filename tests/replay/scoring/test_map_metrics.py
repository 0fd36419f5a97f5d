"""Metrics of maps against scikit-learn, slow ways, and numbers by hand."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isnan, log, nan
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.grid import Geometry, Grid, logit
from formats.result import Counts
from replay.scoring.count_metrics import METRICS, f_beta
from replay.scoring.map_metrics import (
    MAP_METRICS,
    boundary_f,
    brier,
    calibration,
    chamfer,
    cross_entropy,
    pr_auc,
    reliability_curve,
    roc_auc,
)
from replay.scoring.scorer import tell

Bools = npt.NDArray[np.bool_]
Case = tuple[Grid, Bools, Bools]


def grid(p_occupied: npt.ArrayLike, resolution: float = 0.05) -> Grid:
    """A map of such probabilities."""
    p = np.asarray(p_occupied, dtype=np.float64)
    values = np.vectorize(lambda q: -logit(float(q)))(p)
    rows, cols = p.shape
    return Grid(Geometry(rows, cols, resolution, 0.0, 0.0), values)


def case(seed: int, levels: int = 7, rows: int = 12, cols: int = 17) -> Case:
    """A map with many ties that knows something of the truth."""
    rng = np.random.default_rng(seed)
    wall = rng.random((rows, cols)) < 0.3
    said = np.clip(rng.normal(0.4 + 0.25 * wall, 0.2), 0.02, 0.98)
    p = np.round(said * levels) / levels
    return grid(np.clip(p, 0.02, 0.98)), wall, rng.random((rows, cols)) < 0.8


def flat(of: Case) -> tuple[npt.NDArray[np.float64], Bools]:
    """P(occupied) and truth of the cells that count."""
    found, wall, scored = of
    return found.p_occupied()[scored], wall[scored]


def sklearn_of(name: str) -> Callable[[Bools, npt.NDArray[np.float64]], float]:
    import sklearn.metrics as m

    named: dict[str, Callable[[Bools, npt.NDArray[np.float64]], float]] = {
        "brier": m.brier_score_loss,
        "cross_entropy": m.log_loss,
        "roc_auc": m.roc_auc_score,
        "pr_auc": m.average_precision_score,
    }
    return named[name]


@pytest.mark.parametrize("name", ["brier", "cross_entropy", "roc_auc", "pr_auc"])
@pytest.mark.parametrize("seed", range(8))
def test_probabilities_score_as_in_scikit_learn(name: str, seed: int) -> None:
    some = case(seed, levels=3 + seed)
    p, real = flat(some)
    # scikit-learn ranks by P, in which equal log-odds are equal too
    assert MAP_METRICS[name](*some) == pytest.approx(sklearn_of(name)(real, p), rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_counts_score_as_in_scikit_learn(seed: int) -> None:
    import sklearn.metrics as m

    found, wall, scored = case(seed)
    occupied, real = found.occupied()[scored], wall[scored]
    counts = tell(occupied, real)
    theirs = {
        "precision": m.precision_score(real, occupied),
        "recall": m.recall_score(real, occupied),
        "f2": m.fbeta_score(real, occupied, beta=2.0),
        "f1": m.f1_score(real, occupied),
        "iou": m.jaccard_score(real, occupied),
        "mcc": m.matthews_corrcoef(real, occupied),
    }
    assert {name: metric(counts) for name, metric in METRICS.items()} == pytest.approx(theirs)
    assert f_beta(counts, 0.5) == pytest.approx(m.fbeta_score(real, occupied, beta=0.5))


def test_reliability_as_in_scikit_learn() -> None:
    from sklearn.calibration import calibration_curve

    some = case(3, levels=37)  # no value on the border of two bins
    seen, said = calibration_curve(flat(some)[1], flat(some)[0], n_bins=10)
    ours = reliability_curve(*some)
    full = ours[:, 2] > 0
    assert ours[full, 0] == pytest.approx(said)
    assert ours[full, 1] == pytest.approx(seen)
    assert ours[:, 2].sum() == flat(some)[0].size
    assert np.isnan(ours[~full, :2]).all()


def test_by_hand() -> None:
    some = grid([[0.9, 0.6, 0.2, 0.5]]), np.array([[True, False, False, True]])
    every = np.ones((1, 4), dtype=bool)
    assert brier(*some, every) == pytest.approx((0.01 + 0.36 + 0.04 + 0.25) / 4)
    entropy = -(log(0.9) + log(0.4) + log(0.8) + log(0.5)) / 4
    assert cross_entropy(*some, every) == pytest.approx(entropy)
    assert roc_auc(*some, every) == pytest.approx(3 / 4)  # of 2 x 2 pairs, 0.5 < 0.6 is wrong
    assert pr_auc(*some, every) == pytest.approx((1 / 1 + 2 / 3) / 2)
    # bins: .9 -> 1 wall of 1, .6 -> 0 of 1, .2 -> 0 of 1, .5 -> 1 of 1
    assert calibration(*some, every) == pytest.approx((0.1 + 0.6 + 0.2 + 0.5) / 4)


def test_what_is_not_scored_does_not_count() -> None:
    some, wall, scored = case(5)
    other = wall ^ ~scored
    wild = Grid(some.geometry, np.where(scored, some.values, 50.0))
    for name in ("brier", "cross_entropy", "roc_auc", "pr_auc", "calibration"):
        metric = MAP_METRICS[name]
        assert metric(wild, other, scored) == metric(some, wall, scored), name


def test_very_sure_cells_keep_their_order() -> None:
    odds = np.array([[-900.0, -800.0, -40.0, 3.0]])  # P(occupied) rounds to 1 for three of them
    sure = Grid(Geometry(1, 4, 0.05, 0.0, 0.0), odds)
    every, wall = np.ones((1, 4), dtype=bool), np.array([[True, False, True, False]])
    assert roc_auc(sure, wall, every) == pytest.approx(3 / 4)
    assert cross_entropy(sure, wall, every) == pytest.approx((800.0 + np.log1p(np.exp(-3.0))) / 4)


def test_nothing_to_score_has_no_value() -> None:
    some, wall, _ = case(1)
    none = np.zeros_like(wall)
    values = {name: metric(some, wall, none) for name, metric in MAP_METRICS.items()}
    assert values.pop("boundary_f") == 0.0
    assert all(isnan(value) for value in values.values())
    for metric in (roc_auc, pr_auc, chamfer):
        assert isnan(metric(some, none, ~none))  # no wall
    assert isnan(roc_auc(some, ~none, ~none))  # nothing but wall


def shape(*rows: str) -> Bools:
    return np.array([[c == "#" for c in row] for row in rows])


def drawn(mask: Bools, resolution: float = 0.05) -> Grid:
    return grid(np.where(mask, 0.9, 0.1), resolution)


def test_a_wall_drawn_one_cell_off() -> None:
    wall = shape("......", "######", "......", "......", "......")
    found = drawn(np.roll(wall, 1, axis=0))
    every = np.ones_like(wall)
    assert chamfer(found, wall, every) == pytest.approx(0.05)
    assert boundary_f(found, wall, every, tolerance=0.05) == 1.0
    assert boundary_f(found, wall, every, tolerance=0.04) == 0.0
    assert boundary_f(drawn(wall), wall, every, tolerance=0.0) == 1.0
    assert chamfer(drawn(wall), wall, every) == 0.0


def test_half_of_a_wall_found_and_as_much_made_up() -> None:
    wall = shape("########", "........", "........", "........", "........")
    found = drawn(shape("####....", "........", "........", "........", "####...."))
    every = np.ones_like(wall)
    # 4 of 8 found cells lie on the wall; of the wall's 8 cells 4 are found, one more is 1 cell off.
    assert boundary_f(found, wall, every, tolerance=0.05) == pytest.approx(
        2 * 0.5 * 0.625 / (0.5 + 0.625)
    )
    there = (4 * 0.0 + 4 * 0.2) / 8
    back = (0.05 + 0.1 + 0.15 + 0.2) / 8
    assert chamfer(found, wall, every) == pytest.approx((there + back) / 2)


def test_a_solid_block_has_only_its_edges() -> None:
    block = np.zeros((9, 9), dtype=bool)
    block[2:7, 2:7] = True
    smaller = np.zeros_like(block)
    smaller[3:6, 3:6] = True
    # 8 edge cells found, each 1 cell from the truth's 16; the truth's corners are sqrt 2 away.
    every = np.ones_like(block)
    f = boundary_f(drawn(smaller), block, every, tolerance=0.05)
    assert f == pytest.approx(2 * 1.0 * 0.75 / 1.75)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_distances_cell_by_cell(seed: int) -> None:
    found, wall, scored = case(seed, rows=7, cols=8)
    a = np.argwhere(found.occupied() & scored)
    b = np.argwhere(wall & scored)

    def mean(one: npt.NDArray[np.int64], other: npt.NDArray[np.int64]) -> float:
        return float(np.mean([min(hypot(*(p - q)) for q in other) for p in one]))

    expected = nan if not len(a) or not len(b) else 0.025 * (mean(a, b) + mean(b, a))
    assert chamfer(found, wall, scored) == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize("name", list(MAP_METRICS))
def test_every_metric_says_what_it_is_and_likes_the_truth(name: str) -> None:
    _, wall, scored = case(2)
    metric = MAP_METRICS[name]
    assert metric.__doc__
    right, wrong = metric(drawn(wall), wall, scored), metric(drawn(~wall), wall, scored)
    better = right > wrong if name in ("roc_auc", "pr_auc", "boundary_f") else right < wrong
    assert better


def test_tables_share_no_name() -> None:
    assert not set(METRICS) & set(MAP_METRICS)
    assert isinstance(METRICS["mcc"](Counts(1, 0, 0, 1)), float)


def test_every_metric_is_in_the_docs() -> None:
    page = (Path(__file__).parents[3] / "docs" / "metrics.md").read_text()
    assert [name for name in (*METRICS, *MAP_METRICS) if f"| `{name}` |" not in page] == []
