"""tune(): results and drawings in; surfaces, fronts, and the prior to use out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from formats.errors import Notes, UsageError
from formats.grid import Update
from formats.output import check_output, is_folder
from replay.drawn import PlanMethod
from replay.tuning import picks
from replay.tuning.choosing import STEPS, tuned
from replay.tuning.objectives import OBJECTIVES, ObjectiveName
from replay.tuning.search import ALGORITHMS, Algorithm, Search
from replay.tuning.simulated import Setup
from replay.tuning.sources import Source, open_source
from replay.tuning.writing import write_all

Files = str | PathLike[str]
Rules = Literal["bayes", "paper", "both"]


def tune(
    sources: Files | Sequence[Files],
    *,
    truth: Files | None = None,
    output: Files | None = None,
    force: bool = False,
    update: Rules = "both",
    pick: str | None = None,
    p_hit: float | None = None,
    p_miss: float | None = None,
    prior_scale: float | None = None,
    objective: ObjectiveName = "exact",
    algorithm: Algorithm = "gamultiobj",
    seed: int = 1,
    population: int = 50,
    generations: int = 400,
    steps: int = STEPS,
    recall_weight: float = 0.5,
    sensors: bool = True,
    cell: int = 5,
    plan_resolution: float | None = None,
    plan_method: PlanMethod = "auto",
    resume: Files | None = None,
    figures: bool = True,
    notes: Notes | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Find the prior's values that suit results of runs, or drawings, best. Nothing is replayed.

    Args:
        sources: results of `run`; plans, which the paper's robot then explores.
        truth: of the plans.
        output: a folder or the stem of the files' names; None: "tune" in the current folder.
        force: replace outputs that exist.
        update: the rule or both.
        pick: which prior is written, see picks.PICKS; None: the best F2 of one run, the best worst
            F2 of several.
        p_hit, p_miss: P(occupied) of another sensor than the runs'; None: theirs.
        prior_scale: another one than the runs'.
        objective: of the genetic search: exact, or interpolated from a 10 x 10 grid (PAPER A21).
        algorithm, seed, population, generations: of it.
        steps: a side of the surfaces for robust and early.
        recall_weight: of the pick by pseudo-weights; that of precision is the rest.
        sensors: also try other sensor probabilities.
        cell: map pixels along a cell's side, for plans.
        plan_resolution: m a pixel, for plans.
        plan_method: how drawings become plans.
        resume: a checkpoint of the search: gone on from where it exists, and kept up to date.
        figures: draw them.
        notes: what was odd.
        progress: is told (generations done, at most).

    Returns:
        what `--json` prints.

    Raises:
        FormatError: an input cannot be used, or an output cannot be written.
        UsageError: an option is not possible.
    """
    notes = Notes() if notes is None else notes
    paths = [Path(sources)] if isinstance(sources, str | PathLike) else [Path(s) for s in sources]
    _checked(paths, pick, algorithm, objective, steps, update)
    pick = pick or ("robust" if len(paths) > 1 else "f2")
    stem = stem_of(output)
    check_output(stem.with_name(stem.name + "_prior.json"), force=force, inputs=paths)
    opened = [
        open_source(
            path,
            notes,
            setup=Setup(cell=cell),
            truth=Path(truth) if truth else None,
            plan_resolution=plan_resolution,
            plan_method=plan_method,
            p_hit=p_hit,
            p_miss=p_miss,
            prior_scale=prior_scale,
        )
        for path in paths
    ]
    search = Search(algorithm, seed, population, generations)
    _alike(opened)
    rules: list[Update] = ["bayes", "paper"] if update == "both" else [update]
    found = {
        rule: tuned(
            opened,
            rule,
            search,
            objective=objective,
            steps=steps,
            recall_weight=recall_weight,
            sensors=sensors,
            resume=None if resume is None else kept_at(Path(resume), rule, len(rules)),
            progress=progress,
        )
        for rule in rules
    }
    return write_all(
        opened, found, stem, pick, search, objective, figures=figures, force=force, notes=notes
    )


def kept_at(resume: Path, rule: Update, rules: int) -> Path:
    """The checkpoint of one rule: the name itself where there is but one."""
    return resume if rules == 1 else resume.with_name(f"{resume.stem}_{rule}{resume.suffix}")


def stem_of(output: Files | None) -> Path:
    """Folder and first part of the names of all files."""
    if output is None:
        return Path("tune")
    return Path(output) / "tune" if is_folder(output) else Path(output)


def _checked(
    paths: Sequence[Path],
    pick: str | None,
    algorithm: str,
    objective: str,
    steps: int,
    update: str,
) -> None:
    """Refuse what is not possible before any work is done."""
    if not paths:
        raise UsageError("", "nothing to tune", hint="give results of `replay run`, or a plan")
    for name, value, known in (
        ("pick", pick, [None, *picks.PICKS]),
        ("algorithm", algorithm, ALGORITHMS),
        ("objective", objective, OBJECTIVES),
        ("update", update, ("bayes", "paper", "both")),
    ):
        if value not in known:
            there = ", ".join(str(one) for one in known if one)
            raise UsageError("", f"there is no {name} {value!r}", hint=f"there are {there}")
    if steps < 2:
        raise UsageError("", "--steps must be 2 at least")


def _alike(sources: Sequence[Source]) -> None:
    """Refuse runs that cannot be counted together."""
    for source in sources[1:]:
        if source.values("bayes") != sources[0].values("bayes"):
            raise UsageError(
                source.path,
                f"was made with another sensor or other values than {sources[0].path}",
                hint="run it again with the same, or tune each by itself",
            )
