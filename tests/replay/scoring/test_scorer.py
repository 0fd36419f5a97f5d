from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.grid import Evidence, Geometry, Grid, logit
from formats.result import Counts, Curve, Split
from replay.scoring.count_metrics import METRICS, f2, f_beta, precision, recall
from replay.scoring.kernels import FEW
from replay.scoring.scorer import Scorer, count
from replay.sensors.observer import MODELS, Touched
from tests import oracles
from tests.replay.test_mapper import ROOM, frames, mapper_of

Bools = npt.NDArray[np.bool_]
tallies = st.builds(Counts, *[st.integers(0, 10**9)] * 4)


def test_by_hand() -> None:
    # 6 of 8 found cells are walls, 6 of 12 walls are found: pre .75, rec .5,
    # F2 = 5 * .75 * .5 / (4 * .75 + .5) = 1.875 / 3.5 (Equation 14).
    counts = Counts(tp=6, fp=2, fn=6, tn=100)
    assert precision(counts) == 0.75
    assert recall(counts) == 0.5
    assert f2(counts) == pytest.approx(1.875 / 3.5, rel=1e-15)
    assert f_beta(counts, 1.0) == pytest.approx(0.6, rel=1e-15)


def test_nothing_over_nothing_is_nothing() -> None:
    for counts in (Counts(0, 0, 0, 0), Counts(0, 0, 0, 9), Counts(0, 3, 0, 0), Counts(0, 0, 3, 0)):
        assert [metric(counts) for metric in METRICS.values()] == [0.0] * len(METRICS)


@pytest.mark.parametrize("name", list(METRICS))
@given(tallies)
def test_every_metric_is_described_and_equals_its_oracle(name: str, counts: Counts) -> None:
    assert METRICS[name].__doc__
    assert METRICS[name](counts) == pytest.approx(float(oracles.SCORES[name](counts)), rel=1e-12)


def test_every_oracle_has_its_metric() -> None:
    assert set(oracles.SCORES) == set(METRICS)
    assert oracles.SCORES["f2"](Counts(6, 2, 6, 0)) == Fraction(15, 28)


def bools(*rows: str) -> Bools:
    return np.array([[c == "#" for c in row] for row in rows])


def test_count_by_hand() -> None:
    split = count(
        occupied=bools("##..", "##.."),
        truth_wall=bools("#.#.", "#.#."),
        scored=bools("####", "###."),
        observed=bools("####", "...."),
    )
    assert split == Split(Counts(1, 1, 1, 1), Counts(1, 1, 1, 0))
    assert split.whole == Counts(2, 2, 2, 1)


# The scorer against a full recount.


def world(seed: int, p_wall: float = 0.18, p_space: float = 0.81) -> tuple[Bools, Bools, Grid]:
    """The room of `frames`, a stale and noisy plan of it, and a region to score."""
    rng = np.random.default_rng(seed)
    far = np.abs((np.arange(60) + 0.5) * 0.1 - 3.0)
    wall = np.abs(np.maximum(far[:, None], far[None, :]) - 2.55) < 0.06
    plan = wall ^ (rng.random(wall.shape) < 0.1)
    return (
        wall,
        rng.random(wall.shape) < 0.8,
        Grid(ROOM, np.where(plan, *map(logit, (p_wall, p_space)))),
    )


def curves(name: str, informative: Grid) -> dict[str, Curve]:
    """Those of a run."""
    model, none = MODELS[name], Grid(ROOM, np.zeros(ROOM.shape))
    own, paper = tuple(model.p_levels()), tuple(model.p_levels(0.9, 0.1))
    return {
        "none": Curve(none, own),
        "bayes": Curve(informative, own),
        "paper": Curve(informative, paper, "paper"),
        "paper, own sensor": Curve(informative, own, "paper"),
    }


def recount(chosen: dict[str, Curve], evidence: Evidence, wall: Bools, scored: Bools) -> Any:
    observed = evidence.visits() > 0
    return {
        name: count(curve.of(evidence).occupied(), wall, scored, observed)
        for name, curve in chosen.items()
    }


@pytest.mark.parametrize(("p_wall", "p_space"), [(0.18, 0.81), (0.1, 0.9), (0.7, 0.3), (0.4, 0.6)])
@pytest.mark.parametrize("name", list(MODELS))
def test_scores_equal_a_full_recount_after_every_scan(
    name: str, p_wall: float, p_space: float
) -> None:
    wall, scored, informative = world(1, p_wall, p_space)
    chosen, mapper = curves(name, informative), mapper_of(name)
    scorer = Scorer(wall, scored, chosen)
    assert scorer.scores() == recount(chosen, mapper.evidence, wall, scored)
    for frame in frames(40 if name == "beam" else 12):
        touched = mapper.insert(frame)
        assert scorer.update(mapper.evidence, touched) == recount(
            chosen, mapper.evidence, wall, scored
        )


STEPS = st.lists(st.lists(st.integers(-1, 1), min_size=6, max_size=6), min_size=1, max_size=40)


@settings(deadline=None)
@given(
    STEPS,
    st.lists(st.sampled_from([0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9]), min_size=6, max_size=6),
    st.sampled_from([(0.1, 0.9), (0.25, 0.75), (0.3, 0.6), (0.5, 0.9), (0.6, 0.3), (0.1, 0.5)]),
    st.integers(0, 2),
)
def test_ties_and_any_order_of_readings(
    steps: list[list[int]], priors: list[float], p: tuple[float, float], first: int
) -> None:
    # Log-odds that cancel exactly, priors that equal the sensor, sensors turned round.
    g = Geometry(1, 6, 1.0, 0.0, 0.0)
    prior = Grid(g, np.array([[logit(value) for value in priors]]))
    wall, scored = bools("#.#.#."), bools("####.#")
    chosen = {
        "none": Curve(Grid(g, np.zeros(g.shape)), p),
        "bayes": Curve(prior, p),
        "paper": Curve(prior, p, "paper"),
    }
    evidence = Evidence.empty(g, 2)
    evidence.counts[0, 0, :first] = 1 + np.arange(first) % 2  # seen before, once or twice
    scorer = Scorer(wall, scored, chosen, evidence)
    assert scorer.scores() == recount(chosen, evidence, wall, scored)
    for step in steps:
        runs = [[cell, cell + 1, level] for cell, level in enumerate(step) if level >= 0]
        for cell, _, level in runs:
            evidence.counts[level, 0, cell] += 1
        touched = Touched(np.array(runs, dtype=np.int32).reshape(-1, 3))
        assert scorer.update(evidence, touched) == recount(chosen, evidence, wall, scored)


def test_after_very_many_readings_nothing_is_taken_for_sure() -> None:
    # Where the prior nearly equals the sensor, steps under `paper` are as small as rounding.
    g = Geometry(1, 4, 1.0, 0.0, 0.0)
    p = (0.3, 0.6)
    l0 = logit(0.6)
    prior = Grid(g, np.array([[l0 + 1e-12, l0 - 1e-12, np.nextafter(l0, 1), l0]]))
    chosen = {"paper": Curve(prior, p, "paper")}
    wall = scored = bools("####")
    evidence = Evidence.empty(g, 2)
    evidence.counts[1] = FEW
    evidence.counts[0] = 3
    scorer = Scorer(wall, scored, chosen, evidence)
    for _ in range(5):
        evidence.counts[1] += 1
        touched = Touched(np.array([[0, 4, 1]], dtype=np.int32))
        assert scorer.update(evidence, touched) == recount(chosen, evidence, wall, scored)


def test_log_odds_that_cancel_after_three_readings_are_empty() -> None:
    # 0.3 / 0.7 and one wall prior of 0.3: a miss brings the cell to exactly 0.
    g = Geometry(1, 1, 1.0, 0.0, 0.0)
    chosen = {"bayes": Curve(Grid(g, np.array([[logit(0.3)]])), (0.3, 0.7))}
    evidence, wall = Evidence.empty(g, 2), bools("#")
    scorer = Scorer(wall, wall, chosen)
    assert scorer.scores()["bayes"].unobserved == Counts(1, 0, 0, 0)
    for level, expected in (
        (1, Counts(0, 0, 1, 0)),
        (0, Counts(1, 0, 0, 0)),
        (1, Counts(0, 0, 1, 0)),
    ):
        evidence.counts[level] += 1
        touched = Touched(np.array([[0, 1, level]], dtype=np.int32))
        assert scorer.update(evidence, touched)["bayes"] == Split(expected, Counts(0, 0, 0, 0))


def test_curves_that_cannot_be_scored_together_are_refused() -> None:
    g, wall = Geometry(1, 1, 1.0, 0.0, 0.0), bools("#")
    flat = Grid(g, np.zeros((1, 1)))
    for chosen in (
        {},
        {"a": Curve(flat, (0.1, 0.9)), "b": Curve(flat, (0.1, 0.5, 0.9))},
        {str(k): Curve(flat, (0.1, 0.9)) for k in range(30)},
    ):
        with pytest.raises(ValueError, match="1 to 29 curves"):
            Scorer(wall, wall, chosen)
