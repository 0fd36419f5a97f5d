"""Everything that is to be found under one rule of update: surfaces, fronts, search, picks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from formats.grid import Update
from replay.prior import breaks_e13
from replay.tuning import axes, checkpoint, picks
from replay.tuning.cases import Case, Floats, pooled
from replay.tuning.clusters import Clusters, cluster
from replay.tuning.early import Course, course, mean_surface
from replay.tuning.front import Front, exact_front, grid_front, hypervolume
from replay.tuning.genetic import evolve
from replay.tuning.objectives import OBJECTIVES, ObjectiveName
from replay.tuning.search import Found, Search, stalled
from replay.tuning.sources import Source
from replay.tuning.surfaces import Scores, Tables, grid

STEPS = 91  # of the surfaces on which the robust and the early prior are chosen: 0.01
SAVE_EVERY = 25  # generations between checkpoints


@dataclass
class Tuned:
    """All that was found under one rule of update.

    Attributes:
        update: the rule.
        cases: each run's cells, and `whole`: all of them pooled.
        tables: each run's sorted tables, and `together`: of the pool.
        courses: each run as it went on.
        p: (steps,) probabilities of the surfaces.
        early: (steps, steps) mean F2 over what was explored, mean over the runs.
        fronts: each run's front; `front`: of the pool. Exact, or of the grid p.
        exact: whether the fronts are exact.
        search: what the genetic search found on the pool.
        clusters: of the fronts' acceptable points, of all runs.
        points: (n, 2) those points.
        picks: name -> (p_wall, p_space).
        doors: the front with p_door; None where no doors are known.
        sensors: the best prior of each sensor; None where it was not asked for.
        seconds: stage -> s.
    """

    update: Update
    cases: list[Case]
    whole: Case
    tables: list[Tables]
    together: Tables
    courses: list[Course]
    p: Floats
    early: Floats
    fronts: list[Front]
    front: Front
    exact: bool
    search: Found
    clusters: Clusters
    points: Floats
    picks: dict[str, tuple[float, float]]
    doors: Front | None
    sensors: axes.Sensors | None
    seconds: dict[str, float]

    def broken(self, p_wall: float, p_space: float) -> str | None:
        """Where a prior breaks Equation 13 under `paper`; under `bayes` it need not hold."""
        if self.update != "paper":
            return None
        levels = self.together.values.p_levels
        scale = self.together.values.prior_scale
        return breaks_e13(1 - levels[0], 1 - levels[-1], p_wall, p_space, scale)


def tuned(
    sources: Sequence[Source],
    update: Update,
    search: Search,
    *,
    objective: ObjectiveName = "exact",
    steps: int = STEPS,
    recall_weight: float = 0.5,
    sensors: bool = False,
    resume: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Tuned:
    """Everything under one rule."""
    clock, seconds = perf_counter(), {}

    def lap(stage: str) -> None:
        nonlocal clock
        now = perf_counter()
        seconds[stage], clock = now - clock, now

    values = [source.values(update) for source in sources]
    cases = [source.case() for source in sources]
    tables = [Tables(case, value) for case, value in zip(cases, values, strict=True)]
    whole = pooled(cases) if len(cases) > 1 else cases[0]
    together = Tables(whole, values[0]) if len(cases) > 1 else tables[0]
    lap("tables")
    exact = not whole.mixed
    p = grid(steps)
    fronts = [exact_front(one) if exact else grid_front(one, p) for one in tables]
    front = exact_front(together) if exact else grid_front(together, p)
    lap("front")
    found = searched(OBJECTIVES[objective](together), search, resume, progress)
    lap("search")
    courses = [
        course(source.keyframes, value) for source, value in zip(sources, values, strict=True)
    ]
    early = mean_surface(courses, p)
    lap("early")
    points = np.concatenate([one.acceptable.points for one in fronts])
    chosen = chosen_of(front, tables, together, p, early, recall_weight)
    lap("picks")
    doors = axes.door_front(whole, values[0])
    tried = None
    if sensors and exact:
        tried = axes.sensors(whole, values[0], sources[0].levels)
    lap("axes")
    return Tuned(
        update,
        cases,
        whole,
        tables,
        together,
        courses,
        p,
        early,
        fronts,
        front,
        exact,
        found,
        cluster(points),
        points,
        chosen,
        doors,
        tried,
        seconds,
    )


def searched(
    objective: Callable[[Floats], Floats],
    search: Search,
    resume: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Found:
    """The genetic search, from its checkpoint where there is one."""
    mark = checkpoint.fingerprint(objective, search)
    state = checkpoint.load(resume, mark) if resume and resume.exists() else None
    if state and state.generation < search.generations and not stalled(state.spreads):
        state.ended = ""  # it had run out of generations, of which there now are more

    def after(now: Any) -> None:
        if progress:
            progress(now.generation, search.generations)
        if resume and (now.ended or now.generation % SAVE_EVERY == 0):
            checkpoint.save(resume, now, mark)

    return evolve(objective, search, state=state, after=after)


def chosen_of(
    front: Front,
    tables: Sequence[Tables],
    together: Tables,
    p: Floats,
    early: Floats,
    recall_weight: float,
) -> dict[str, tuple[float, float]]:
    """The picks, by name."""
    out: dict[str, tuple[float, float]] = {"paper": picks.PAPER}
    good = front.acceptable if len(front.acceptable.scores.tp) else front
    for name, k, of in (
        ("f2", picks.best_f2(front), front),
        ("weights", picks.by_weights(good.scores.objectives(), recall_weight), good),
        ("knee", picks.knee(good.scores.objectives()), good),
    ):
        if k >= 0:
            out[name] = float(of.points[k, 0]), float(of.points[k, 1])
    if len(tables) > 1:
        out["robust"] = picks.robust(tables, p)[:2]
    i, j = picks.middle_of_best(early)
    out["early"] = float(p[i]), float(p[j])
    ten = grid(10)
    surface = together.surface(ten, ten).f2
    wall, space = np.meshgrid(ten, ten, indexing="ij")
    listed = np.where(picks.in_shortlist(wall, space), surface, -1.0)
    i, j = picks.middle_of_best(listed)
    out["shortlist"] = float(ten[i]), float(ten[j])
    return out


def shares_of_hypervolume(tuned: Tuned) -> tuple[float, float, float]:
    """The exact hypervolume, and what of it the search's front and its archive reach.

    Points are scored anew by the exact objectives, also where the search saw interpolated ones.
    """
    whole = hypervolume(tuned.front.scores.objectives())
    if whole <= 0.0:
        return 0.0, 0.0, 0.0
    shares = []
    for x in (tuned.search.x, tuned.search.archive_x):
        scores: Scores = tuned.together.at(x[:, 0], x[:, 1])
        shares.append(hypervolume(scores.objectives()) / whole)
    return whole, shares[0], shares[1]
