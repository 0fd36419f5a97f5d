"""Picks, clusters and the mean over what was explored, by hand and against other libraries."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from sklearn.cluster import KMeans

from replay.tuning import picks
from replay.tuning.clusters import cluster
from replay.tuning.early import Course, course, keyframes
from replay.tuning.front import exact_front
from replay.tuning.surfaces import Tables, Values, grid
from tests.tuning_worlds import seeds, world


@settings(deadline=None)
@given(seeds)
def test_pseudo_weights_choose_as_pymoo_does(seed: int) -> None:
    with warnings.catch_warnings():  # pymoo imports a name that SciPy has deprecated
        warnings.simplefilter("ignore", DeprecationWarning)
        from pymoo.mcdm.pseudo_weights import PseudoWeights
    random = np.random.default_rng(seed)
    front = np.column_stack([np.sort(random.random(9)), -np.sort(-random.random(9))]) + 1.0
    mine = picks.by_weights(front, 0.7)
    assert mine == PseudoWeights(np.array([0.3, 0.7])).do(front)


def test_the_knee_of_a_bent_front() -> None:
    assert picks.knee(np.array([[1.0, 2.0], [1.1, 1.2], [1.9, 1.1], [2.0, 1.0]])) == 1
    assert picks.knee(np.zeros((0, 2))) == -1


def test_the_best_f2_is_on_the_front() -> None:
    ground, evidence = world(6, most=9)
    tables = Tables(ground.case(evidence), Values((0.3, 0.6)))
    front = exact_front(tables)
    fine = tables.surface(grid(181), grid(181)).f2
    assert front.scores.f2[picks.best_f2(front)] >= fine.max()


def test_the_robust_prior_has_the_best_worst_f2() -> None:
    several = [
        Tables(world(seed)[0].case(world(seed)[1]), Values((0.3, 0.6))) for seed in (1, 2, 3)
    ]
    p = grid(19)
    p_wall, p_space, least = picks.robust(several, p)
    assert least == min(float(one.at([p_wall], [p_space]).f2[0]) for one in several)
    for a in p:
        for b in p:
            assert min(float(one.at([a], [b]).f2[0]) for one in several) <= least


def test_the_papers_shortlist() -> None:
    wall = np.array([0.2, 0.2, 0.2, 0.4, 0.5, 0.4, 0.3, 0.2, 0.18])
    space = np.array([0.6, 0.9, 1.0, 0.7, 0.8, 0.9, 0.9, 0.5, 0.95])
    listed = [True, True, True, True, True, False, False, False, True]
    assert picks.in_shortlist(wall, space).tolist() == listed


@settings(max_examples=15, deadline=None)
@given(seeds)
def test_clusters_are_as_tight_as_scikit_learns(seed: int) -> None:
    points = np.random.default_rng(seed).random((40, 2))
    mine = cluster(points, 3)
    theirs = KMeans(3, n_init=20, random_state=1).fit(points)
    assert mine.inertia <= theirs.inertia_ * 1.02
    assert mine.inertia == pytest.approx(((points - mine.centres[mine.labels]) ** 2).sum())


def test_the_proposed_cluster_has_low_walls_and_high_space() -> None:
    random = np.random.default_rng(1)
    middles = np.array([[0.2, 0.9], [0.8, 0.9], [0.2, 0.3]])
    points = np.concatenate([m + 0.02 * random.standard_normal((20, 2)) for m in middles])
    found = cluster(points)
    assert found.centres[found.proposed] == pytest.approx([0.2, 0.9], abs=0.02)
    assert (found.labels[:20] == found.proposed).all()
    assert len(cluster(points[:1]).centres) == 1
    assert len(cluster(points[:0]).centres) == 0


def test_a_course_starts_with_the_prior_alone_and_weighs_by_what_is_explored() -> None:
    ground, evidence = world(2)
    values = Values((0.3, 0.6))
    found = course(keyframes(ground, [(1.0, evidence)]), values)
    seen = (evidence.visits().ravel()[ground.where] > 0).mean()
    assert found.explored.tolist() == [0.0, seen]
    assert found.weights.tolist() == [0.5, 0.5]
    f2 = found.f2([0.2], [0.9])[:, 0]
    # Without a reading the map is the plan: its walls against the truth's.
    walls, real = ground.kinds == 0, ground.wall > 0
    tp, fp, fn = (walls & real).sum(), (walls & ~real).sum(), (real & ~walls).sum()
    assert f2[0] == pytest.approx(5 * tp / (5 * tp + 4 * fn + fp))
    assert found.mean([0.2], [0.9])[0] == pytest.approx(f2.mean())
    p = grid(10)
    assert found.surface(p)[1, 8] == pytest.approx(f2.mean())
    assert found.without_prior()[0] == 0.0


def test_the_weights_of_a_course_by_hand() -> None:
    explored = np.array([0.0, 0.2, 0.2, 0.6])
    weights = Course(explored, [], np.zeros(4)).weights
    # trapezoids of 0.2, 0 and 0.4 over 0.6
    assert weights == pytest.approx(np.array([0.1, 0.1, 0.2, 0.2]) / 0.6)
    assert Course(np.zeros(3), [], np.zeros(3)).weights.tolist() == [0.0, 0.0, 1.0]
