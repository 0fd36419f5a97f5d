"""The exact front is what trying every prior gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from pymoo.indicators.hv import HV

from formats.grid import Evidence, Update, probability
from formats.result import Counts
from replay.tuning.axes import door_front, sensors
from replay.tuning.cases import DOOR, KINDS, SPACE, Case, Ground, pooled
from replay.tuning.front import exact_front, grid_front, hypervolume
from replay.tuning.surfaces import Tables, Values, grid
from tests.tuning_worlds import rates, seeds, slow_counts, unbeaten, updates, world
from tests.tuning_worlds import sensors as sensor_pairs


def every_choice(evidence_total: np.ndarray, times: np.ndarray, scale: float) -> list[float]:
    """p below, at and above everything at which some cell could flip, within 0.1 to 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        edges = np.concatenate([evidence_total / times, -evidence_total, [0.0]])
    edges = np.unique(edges[np.isfinite(edges)])
    between = np.concatenate([[edges[0] - 1], (edges[1:] + edges[:-1]) / 2, [edges[-1] + 1]])
    p = probability(np.concatenate([between, edges])) / scale
    return sorted({0.1, 1.0, *p[(p > 0.1) & (p < 1.0)].tolist()})


@settings(max_examples=40, deadline=None)
@given(seeds, updates, sensor_pairs)
def test_it_equals_brute_force(seed: int, update: Update, levels: tuple[float, float]) -> None:
    ground, evidence = world(seed, most=3)
    values = Values(levels, update)
    tables = Tables(ground.case(evidence), values)
    choices = every_choice(
        evidence.total(levels).ravel(), evidence.visits().ravel() - 1.0, values.prior_scale
    )
    # The classes are independent, so distinct maps of each class are tried against each other.
    points = {
        rates(slow_counts(ground, evidence, values, p_wall, p_space))
        for p_wall in distinct(ground, evidence, values, choices, 0)
        for p_space in distinct(ground, evidence, values, choices, 1)
    }
    front = exact_front(tables)
    found = set(zip(front.scores.precision.tolist(), front.scores.recall.tolist(), strict=True))
    assert found == unbeaten(sorted(points))
    for k, (p_wall, p_space) in enumerate(front.points.tolist()):
        counts = slow_counts(ground, evidence, values, p_wall, p_space)
        assert (front.scores.tp[k], front.scores.fp[k]) == counts[:2]


def distinct(
    ground: Ground, evidence: Evidence, values: Values, choices: list[float], axis: int
) -> list[float]:
    """One p for each different map of one class."""
    seen: dict[Counts, float] = {}
    for p in choices:
        pair = (p, 0.5) if axis == 0 else (0.5, p)
        seen.setdefault(slow_counts(ground, evidence, values, *pair), p)
    return list(seen.values())


@given(seeds, updates)
@settings(max_examples=30, deadline=None)
def test_all_between_the_ends_of_a_span_gives_the_same(seed: int, update: Update) -> None:
    ground, evidence = world(seed)
    tables = Tables(ground.case(evidence), Values((0.1, 0.9), update))
    front = exact_front(tables)
    for share in (0.02, 0.31, 0.77, 0.98):
        p = front.spans[:, :, 0] + share * (front.spans[:, :, 2] - front.spans[:, :, 0])
        scores = tables.at(p[:, 0], p[:, 1])
        wide = (front.spans[:, :, 2] - front.spans[:, :, 0] > 1e-12).all(axis=1)
        assert np.array_equal(scores.tp[wide], front.scores.tp[wide])
        assert np.array_equal(scores.fp[wide], front.scores.fp[wide])


def test_no_prior_of_a_fine_grid_beats_it() -> None:
    ground, evidence = world(3, most=9)
    tables = Tables(ground.case(evidence), Values((0.1, 0.9), "paper"))
    front, fine = exact_front(tables), grid_front(tables, grid(181))
    for precision, recall in zip(fine.scores.precision, fine.scores.recall, strict=True):
        assert ((front.scores.precision >= precision) & (front.scores.recall >= recall)).any()


@given(seeds)
def test_hypervolume_is_that_of_pymoo(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.8, 3.0, (12, 2))
    assert hypervolume(points) == pytest.approx(HV(ref_point=np.array([2.5, 2.5])).do(points))


def test_hypervolume_by_hand() -> None:
    # 1.5 x 0.5 under (1, 2), and 0.5 x 0.5 more under (2, 1.5)
    assert hypervolume(np.array([[1.0, 2.0], [2.0, 1.5], [2.1, 2.1], [1.0, np.inf]])) == 1.0


def test_runs_pooled_are_counted_together() -> None:
    parts = [world(seed)[0].case(world(seed)[1]) for seed in (1, 2)]
    whole = Tables(pooled(parts), Values((0.3, 0.6)))
    p = grid(10)
    both = [Tables(part, Values((0.3, 0.6))).surface(p, p) for part in parts]
    assert np.array_equal(whole.surface(p, p).tp, both[0].tp + both[1].tp)
    assert np.array_equal(whole.surface(p, p).fp, both[0].fp + both[1].fp)
    assert whole.walls == both[0].walls + both[1].walls


def with_doors(seed: int) -> Case:
    ground, evidence = world(seed)
    kinds = ground.kinds.copy()
    kinds[::3] = np.where(kinds[::3] == KINDS.index(SPACE), KINDS.index(DOOR), kinds[::3])
    return replace(ground, kinds=kinds).case(evidence)


@pytest.mark.parametrize("update", ["bayes", "paper"])
def test_a_third_axis_for_doors_is_exact_too(update: Update) -> None:
    case, values = with_doors(8), Values((0.1, 0.9), update)
    front = door_front(case, values)
    assert front is not None
    best = 0.0
    for p_door in grid(19).tolist():
        scores = Tables(case, replace(values, p_door=p_door)).surface(grid(46), grid(46))
        best = max(best, float(scores.f2.max()))
        beaten = (front.scores.recall[:, None, None] <= scores.recall) & (
            front.scores.precision[:, None, None] < scores.precision
        )
        assert not beaten.any()
    assert front.scores.f2.max() >= best
    for k, (p_wall, p_space, p_door) in enumerate(front.points.tolist()):
        scores = Tables(case, replace(values, p_door=p_door)).at([p_wall], [p_space])
        assert (scores.tp[0], scores.fp[0]) == (front.scores.tp[k], front.scores.fp[k])


def test_other_sensors_are_tried_on_the_same_counts() -> None:
    ground, evidence = world(4)
    case, values = ground.case(evidence), Values((0.3, 0.6))
    found = sensors(case, values, lambda hit, miss: (1 - hit, 1 - miss), (0.6, 0.9), (0.1, 0.4))
    for i, hit in enumerate((0.6, 0.9)):
        for j, miss in enumerate((0.1, 0.4)):
            alone = exact_front(Tables(case, Values((1 - hit, 1 - miss))))
            assert found.f2[i, j] == alone.scores.f2.max()
            p_wall, p_space = found.points[i, j].tolist()
            counts = slow_counts(ground, evidence, Values((1 - hit, 1 - miss)), p_wall, p_space)
            assert (counts.tp, counts.fp) in set(
                zip(alone.scores.tp.tolist(), alone.scores.fp.tolist(), strict=True)
            )


def test_a_prior_that_mixes_both_has_no_exact_front() -> None:
    ground, evidence = world(1)
    kinds, shares = ground.kinds.copy(), ground.shares.copy()
    kinds[:9], shares[:9] = KINDS.index("mixed"), np.repeat([0.25, 0.5, 0.75], 3)
    mixed = replace(ground, kinds=kinds, shares=shares)
    tables = Tables(mixed.case(evidence), Values((0.3, 0.6)))
    with pytest.raises(ValueError, match="no exact front"):
        exact_front(tables)
    single = tables.at([0.2, 0.4], [0.9, 0.6])
    surface = tables.surface([0.2, 0.4], [0.9, 0.6])
    assert single.tp.tolist() == [surface.tp[0, 0], surface.tp[1, 1]]
    assert len(grid_front(tables, grid(10)).scores.tp) > 0
