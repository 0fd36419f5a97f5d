"""The genetic search against the exact front, its settings, and its checkpoints."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pymoo.core.population import Population
from pymoo.core.problem import Problem

from formats.errors import FormatError, UsageError
from formats.grid import Update
from replay.reproduction.example_plans import PX_PER_M, plan
from replay.tuning import checkpoint
from replay.tuning.choosing import searched
from replay.tuning.front import exact_front, hypervolume
from replay.tuning.genetic import ControlledElitism, evolve, geometric, pareto_fraction, spread
from replay.tuning.objectives import exact, interpolated
from replay.tuning.search import ALGORITHMS, Algorithm, Found, Search, State, stalled
from replay.tuning.simulated import Explored, Setup
from replay.tuning.surfaces import Tables, Values, grid
from tests.tuning_worlds import UPDATES, world

QUICK = Search(generations=40)


def tables(seed: int = 3, update: Update = "paper") -> Tables:
    ground, evidence = world(seed, most=9)
    return Tables(ground.case(evidence), Values((0.1, 0.9), update))


@pytest.mark.parametrize("update", UPDATES)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_nothing_it_evaluates_beats_the_exact_front(algorithm: Algorithm, update: Update) -> None:
    one = tables(7, update)
    found, front = evolve(exact(one), Search(algorithm, 2, generations=40)), exact_front(one)
    f = front.scores.objectives()
    for a in found.archive_f:
        assert not ((a <= f).all(axis=1) & (a < f).any(axis=1)).any()


@pytest.mark.parametrize("update", UPDATES)
def test_what_it_evaluated_covers_nearly_all_of_the_exact_hypervolume(update: Update) -> None:
    explored = Explored(
        "d", plan("d").walls, plan("d").walls, 1 / PX_PER_M, Setup(cell=10, places=60)
    )
    one = Tables(explored.ground.case(explored.evidence), explored.values(update))
    whole = hypervolume(exact_front(one).scores.objectives())
    found = evolve(exact(one))
    assert found.evaluations <= 50 * 401
    assert hypervolume(found.archive_f) >= 0.99 * whole


def test_the_same_seed_finds_the_same() -> None:
    one, two = (evolve(exact(tables()), QUICK) for _ in range(2))
    assert one.archive_x.tobytes() == two.archive_x.tobytes()
    other = evolve(exact(tables()), Search(seed=2, generations=40))
    assert one.archive_x.tobytes() != other.archive_x.tobytes()


def test_at_most_35_per_cent_of_the_population_stay_on_the_first_front() -> None:
    sizes = []
    evolve(exact(tables()), QUICK, after=lambda state: sizes.append(int((state.rank == 0).sum())))
    assert max(sizes) <= 17  # 0.35 * 50, unless later fronts cannot fill the rest
    plain: list[int] = []
    evolve(
        exact(tables()),
        Search("nsga2", generations=40),
        after=lambda state: plain.append(int((state.rank == 0).sum())),
    )
    assert max(plain) > 17


def test_later_fronts_fill_the_rest_by_crowding() -> None:
    # A front of six on a line, whose middle ones are crowded, and one of four behind.
    first = [[0.0, 10.0], [4.0, 6.0], [4.5, 5.5], [5.0, 5.0], [6.0, 4.0], [10.0, 0.0]]
    second = [[a + 20.0, b + 20.0] for a, b in first[:4]]
    pop = Population.new("X", np.zeros((10, 2)), "F", np.array(first + second))
    for individual in pop:
        individual.set("G", np.array([-1.0]))
    problem = Problem(n_var=2, n_obj=2)
    kept = ControlledElitism(pareto_fraction(0.5)).do(problem, pop, n_survive=6)
    assert (kept.get("rank") == 0).sum() == 3
    assert {tuple(f) for f in kept.get("F")} >= {(0.0, 10.0), (10.0, 0.0)}  # the ends stay
    # Where later fronts are too small, the first takes what is left.
    many = ControlledElitism(pareto_fraction(0.1)).do(problem, pop, n_survive=8)
    assert (many.get("rank") == 0).sum() == 4
    assert (many.get("rank") == 1).sum() == 4


def test_geometric_quotas_halve_from_front_to_front() -> None:
    # Deb and Goel: 50 * (1 - .5) / (1 - .5^3) * (1, .5, .25) = 28.6, 14.3, 7.1
    assert geometric(0.5)(50, 3) == [28, 14, 7]
    assert pareto_fraction(0.35)(50, 3) == [17, 50, 50]


def test_the_spread_by_hand() -> None:
    # Crowding distances of the inner points are 1.0 each (ends are inf), so sigma is 0; the ends
    # have not moved: 0 / (3 * 1).
    even = np.array([[0.0, 2.0], [1.0, 1.0], [2.0, 0.0]])
    assert spread(even, even) == 0.0
    # The first end has moved by 1: (1 + 0) / (1 + 3 d)
    moved = even - [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    assert 0.0 < spread(moved, even) < 1.0
    assert spread(np.zeros((0, 2)), even) == 1.0


def test_a_spread_that_stands_still_ends_the_search() -> None:
    assert stalled([0.5] * 101)
    assert not stalled([0.5] * 100)
    assert not stalled((0.5 + 0.1 * np.sin(np.arange(200.0))).tolist())


def test_interpolated_objectives_agree_on_the_grid_and_lie_between() -> None:
    one = tables()
    objective, p = interpolated(one), grid(10)
    corners = np.array([[a, b] for a in p for b in p])
    assert np.allclose(1 / objective(corners), 1 / exact(one)(corners), rtol=1e-12)
    scores = one.surface(p[2:4], p[5:7])
    middle = 1 / objective(np.array([[0.35, 0.65]]))[0]
    assert middle == pytest.approx([scores.precision.mean(), scores.recall.mean()])


def test_a_search_that_was_cut_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    objective, path = exact(tables()), tmp_path / "search.npz"
    whole = evolve(objective, QUICK)
    mark = checkpoint.fingerprint(objective, QUICK)

    def cut(state: State) -> None:
        if state.generation == 15:
            checkpoint.save(path, state, mark)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evolve(objective, QUICK, after=cut)
    rest = evolve(objective, QUICK, state=checkpoint.load(path, mark))
    for a, b in zip(rest, whole, strict=True):
        assert np.array_equal(np.asarray(a), np.asarray(b))


def test_more_generations_go_on_from_a_finished_search(tmp_path: Path) -> None:
    objective, path = exact(tables()), tmp_path / "search.npz"
    short = searched(objective, Search(generations=20), path)
    long = searched(objective, QUICK, path)
    assert (short.generations, long.generations) == (20, 40)
    assert np.array_equal(long.archive_x, evolve(objective, QUICK).archive_x)
    again = searched(objective, QUICK, path)
    assert isinstance(again, Found)
    assert np.array_equal(again.archive_x, long.archive_x)


def test_a_checkpoint_of_another_search_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "search.npz"
    searched(exact(tables()), QUICK, path)
    with pytest.raises(UsageError, match="another search"):
        searched(exact(tables()), Search(seed=9, generations=40), path)
    with pytest.raises(UsageError, match="another search"):
        searched(exact(tables(5)), QUICK, path)


def test_what_is_no_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "search.npz"
    for data in (b"", b"PK\x03\x04 cut", b"\x80\x04K\x01.", json.dumps({}).encode()):
        path.write_bytes(data)
        with pytest.raises(FormatError, match="no checkpoint"):
            checkpoint.load(path, "")
    np.savez(path, x=np.zeros(3))
    with pytest.raises(FormatError, match="no checkpoint"):
        checkpoint.load(path, "")
