"""The genetic search as the paper has it: NSGA-II with controlled elitism. Only here is pymoo.

The paper used MATLAB's `gamultiobj`, which is documented as a controlled elitist variant of
NSGA-II: population 50 for two variables, 200 generations a variable, at most 0.35 of the
population on the first front, tournaments of 2, 0.8 of the children by intermediate crossover and
the rest by mutation within the bounds, crowding distance in objective space, an end when the
spread changes by less than 1e-4 over 100 generations. Its mutation's step is not documented: ours
is a random direction whose length grows when the front moves and shrinks when it does not.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import binary_tournament
from pymoo.core.mating import Mating
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.operators.selection.tournament import TournamentSelection
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

from replay.tuning.cases import Floats
from replay.tuning.front import ACCEPTABLE, HIGH, LOW
from replay.tuning.search import STALL, Algorithm, Found, Objective, Search, State, stalled

FAR = 1e6  # what 1 / 0 counts as: crowding distances want finite numbers


class PriorProblem(Problem):  # type: ignore[misc]
    """Equation 7: minimise 1 / precision and 1 / recall, both below 2.5."""

    def __init__(self, objective: Objective, low: float, high: float) -> None:
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=2, xl=low, xu=high)
        self.objective = objective

    def _evaluate(self, x: Floats, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        f = np.minimum(self.objective(x), FAR)
        out["F"], out["G"] = f, f - np.nextafter(ACCEPTABLE, 0.0)


class ControlledElitism(RankAndCrowding):  # type: ignore[misc]
    """Survival that leaves room for later fronts, so that the search does not narrow early.

    Args:
        quotas: (individuals, fronts) -> how many may stay of each front.
    """

    def __init__(self, quotas: Callable[[int, int], list[int]]) -> None:
        super().__init__()
        self.quotas = quotas

    def _do(self, problem: Any, pop: Any, *args: Any, n_survive: int = 0, **kwargs: Any) -> Any:
        fronts = NonDominatedSorting().do(pop.get("F"))
        for rank, front in enumerate(fronts):
            crowding = self.crowding_func.do(pop[front].get("F"), n_remove=0)
            for i, distance in zip(front, crowding, strict=True):
                pop[i].set("rank", rank)
                pop[i].set("crowding", distance)
        # Of each front the least crowded, up to its quota; ties by their order.
        ordered = [
            front[np.argsort(-pop[front].get("crowding").astype(float), kind="stable")]
            for front in fronts
        ]
        left, taken = n_survive, []
        for quota, front in zip(self.quotas(n_survive, len(fronts)), ordered, strict=True):
            taken.append(min(quota, len(front), left))
            left -= taken[-1]
        for k, front in enumerate(ordered):  # what later fronts cannot fill goes to the best
            more = min(left, len(front) - taken[k])
            taken[k], left = taken[k] + more, left - more
        return pop[np.concatenate([front[:n] for front, n in zip(ordered, taken, strict=True)])]


def pareto_fraction(fraction: float) -> Callable[[int, int], list[int]]:
    """At most this share on the first front; the others as plain NSGA-II has them."""

    def quotas(individuals: int, fronts: int) -> list[int]:
        return [max(1, int(fraction * individuals))] + [individuals] * (fronts - 1)

    return quotas


def geometric(reduction: float) -> Callable[[int, int], list[int]]:
    """Deb and Goel (2001): n_i = N (1 - r) / (1 - r^K) r^(i - 1) individuals of front i of K."""

    def quotas(individuals: int, fronts: int) -> list[int]:
        weights = reduction ** np.arange(fronts)
        return [int(n) for n in np.floor(individuals * weights / weights.sum())]

    return quotas


def start(objective: Objective, search: Search, low: float = LOW, high: float = HIGH) -> State:
    """The first population, evaluated and ranked."""
    random = np.random.default_rng(search.seed)
    problem = PriorProblem(objective, low, high)
    x = random.uniform(low, high, (search.population, 2))
    pop = _evaluated(problem, x)
    state = State(x, x, np.zeros(0, dtype=np.int64), x, {})
    _keep(state, search, problem, pop, random)
    state.evaluated, state.values = [x], [np.asarray(pop.get("F"))]
    return state


def advance(
    objective: Objective, search: Search, state: State, low: float = LOW, high: float = HIGH
) -> None:
    """One generation; `state.ended` says why there is no more."""
    problem = PriorProblem(objective, low, high)
    random = np.random.default_rng(0)
    random.bit_generator.state = state.random
    pop = _evaluated(problem, state.x, state.f)
    pop.set("rank", state.rank, "crowding", state.crowding)
    children = CHILDREN[search.algorithm](problem, pop, search, state, random)
    off = _evaluated(problem, np.clip(children, low, high))
    before = _first(state)
    _keep(state, search, problem, Population.merge(pop, off), random)
    state.evaluated.append(np.asarray(off.get("X")))
    state.values.append(np.asarray(off.get("F")))
    state.generation += 1
    state.spreads.append(spread(_first(state), before))
    moved = not np.array_equal(_first(state), before)
    state.step = min(0.5, 2.0 * state.step) if moved else max(1e-3, 0.5 * state.step)
    if state.generation >= search.generations:
        state.ended = f"{search.generations} generations"
    elif stalled(state.spreads):
        state.ended = f"the spread stood still for {STALL} generations"


def found(state: State) -> Found:
    """What there is so far."""
    good = (state.f < ACCEPTABLE).all(axis=1) & (state.rank == 0)
    order = np.lexsort((state.x[good, 1], state.x[good, 0]))
    archive = np.concatenate(state.evaluated), np.concatenate(state.values)
    return Found(
        state.x[good][order], state.f[good][order], *archive, state.generation, state.ended
    )


def evolve(
    objective: Objective,
    search: Search | None = None,
    *,
    low: float = LOW,
    high: float = HIGH,
    state: State | None = None,
    after: Callable[[State], object] = lambda state: None,
) -> Found:
    """Search until it ends.

    Args:
        objective: (n, 2) probabilities -> (n, 2) of 1 / precision and 1 / recall.
        search: the settings.
        low, high: bounds of the probabilities.
        state: go on from here.
        after: is told the state after every generation.
    """
    search = search or Search()
    state = state or start(objective, search, low, high)
    while not state.ended:
        advance(objective, search, state, low, high)
        after(state)
    return found(state)


def spread(front: Floats, before: Floats) -> float:
    """How unevenly a front is spread and how far its ends moved, as `gamultiobj` documents it.

    (mu + sigma) / (mu + Q d): sigma and d are standard deviation and mean of the finite crowding
    distances of its Q points, mu how far the extreme points of both objectives moved.
    """
    if not len(front) or not len(before):
        return 1.0
    ends = [
        np.linalg.norm(front[front[:, k].argmin()] - before[before[:, k].argmin()]) for k in (0, 1)
    ]
    distance = RankAndCrowding().crowding_func.do(front, n_remove=0)
    finite = distance[np.isfinite(distance)]
    sigma, mean = (float(finite.std()), float(finite.mean())) if len(finite) else (0.0, 0.0)
    moved = float(sum(ends))
    whole = moved + len(front) * mean
    return (moved + sigma) / whole if whole > 0.0 else 0.0


def _first(state: State) -> Floats:
    """Objectives of the acceptable first front."""
    return state.f[(state.rank == 0) & (state.f < ACCEPTABLE).all(axis=1)]


def _evaluated(problem: PriorProblem, x: Floats, f: Floats | None = None) -> Any:
    """A population with objectives and constraints."""
    out: dict[str, Any] = {}
    if f is None:
        problem._evaluate(x, out)
    else:
        out = {"F": f, "G": f - np.nextafter(ACCEPTABLE, 0.0)}
    pop = Population.new("X", x)
    pop.set("F", out["F"], "G", out["G"])
    return pop


def _keep(
    state: State, search: Search, problem: PriorProblem, pop: Any, random: np.random.Generator
) -> None:
    """The survivors of a population become the state's."""
    survival: Any = RankAndCrowding()
    if search.algorithm == "gamultiobj":
        survival = ControlledElitism(pareto_fraction(search.fraction))
    elif search.algorithm == "geometric":
        survival = ControlledElitism(geometric(search.reduction))
    for individual in pop:  # infeasible ones are not ranked: last, by how far they are off
        individual.set("rank", LAST)
        individual.set("crowding", 0.0)
    kept = survival.do(problem, pop, n_survive=search.population, random_state=random)
    state.x, state.f = np.asarray(kept.get("X")), np.asarray(kept.get("F"))
    state.rank = np.asarray(kept.get("rank"), dtype=np.int64)
    state.crowding = np.asarray(kept.get("crowding"), dtype=np.float64)
    state.random = dict(random.bit_generator.state)


LAST = 1 << 30


def _children_of_gamultiobj(
    problem: PriorProblem, pop: Any, search: Search, state: State, random: np.random.Generator
) -> Floats:
    """Intermediate crossover of tournament winners, and mutants of some."""
    size = search.population
    crossed = round(search.crossover * size)
    excess = np.maximum(state.f - ACCEPTABLE, 0.0).sum(axis=1)
    order = np.lexsort((-state.crowding, state.rank, excess))
    place = np.empty(size, dtype=np.int64)
    place[order] = np.arange(size)
    rivals = random.integers(0, size, (2 * crossed + size - crossed, 2))
    winners = np.where(place[rivals[:, 0]] <= place[rivals[:, 1]], rivals[:, 0], rivals[:, 1])
    a, b, c = np.split(state.x[winners], [crossed, 2 * crossed])
    crossover = a + random.random((crossed, 1)) * (b - a)
    turns = random.uniform(0.0, 2.0 * np.pi, size - crossed)
    length = state.step * random.random(size - crossed)
    span = np.asarray(problem.xu - problem.xl)
    mutants = c + (length[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])) * span
    return np.concatenate([crossover, mutants])


def _children_of_nsga2(
    problem: PriorProblem, pop: Any, search: Search, state: State, random: np.random.Generator
) -> Floats:
    """Simulated binary crossover and polynomial mutation (Deb et al. 2002), as pymoo has them."""
    mating = Mating(
        TournamentSelection(func_comp=binary_tournament), SBX(eta=15, prob=0.9), PM(eta=20)
    )
    algorithm = SimpleNamespace(tournament_type="comp_by_dom_and_crowding", random_state=random)
    off = mating.do(problem, pop, search.population, algorithm=algorithm, random_state=random)
    return np.asarray(off.get("X"), dtype=np.float64)


CHILDREN: dict[Algorithm, Callable[..., Floats]] = {
    "gamultiobj": _children_of_gamultiobj,
    "geometric": _children_of_gamultiobj,
    "nsga2": _children_of_nsga2,
}
