"""What may be tuned for: results of runs, and drawings that the paper's robot explores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from formats.errors import FormatError, Notes, UsageError
from formats.grid import Evidence, Update
from formats.plans.file import open_plan
from formats.results.file import read_result
from replay.drawn import PlanMethod, taken_apart
from replay.sensors.observer import MODELS
from replay.tuning.cases import Case, Ground
from replay.tuning.early import Keyframe, keyframes, keyframes_of
from replay.tuning.reading import ground_of, values_of
from replay.tuning.simulated import Explored, Setup
from replay.tuning.surfaces import Values

MCAP_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class Source:
    """One run or drawing.

    Attributes:
        path: of the file.
        ground: classes and truth of its cells.
        evidence: of the whole run.
        values: rule -> what holds beside p_wall and p_space.
        keyframes: the run as it went on.
        levels: p_hit, p_miss -> P(empty) of each level of its sensor model.
        inputs: files that were read.
        depends: what its poses depend on beside the log: "plan, seed 1", or "".
    """

    path: Path
    ground: Ground
    evidence: Evidence
    values: Callable[[Update], Values]
    keyframes: list[Keyframe]
    levels: Callable[[float, float], Sequence[float]]
    inputs: tuple[str, ...]
    depends: str = ""

    def case(self) -> Case:
        """The cells at the end of the run."""
        return self.ground.case(self.evidence)


def open_source(
    path: Path,
    notes: Notes,
    *,
    setup: Setup | None = None,
    truth: Path | None = None,
    plan_resolution: float | None = None,
    plan_method: PlanMethod = "auto",
    p_hit: float | None = None,
    p_miss: float | None = None,
    prior_scale: float | None = None,
) -> Source:
    """A result, or else a plan, told apart by the first bytes.

    Args:
        path: of the file.
        notes: what was odd.
        setup: how plans are explored.
        truth: of a plan: what really stands there; None: its own walls.
        plan_resolution: m a pixel of a plan.
        plan_method: how a drawing becomes a plan.
        p_hit, p_miss: another sensor than the run's.
        prior_scale: another one than the run's.

    Raises:
        FormatError: it cannot be read or is neither.
    """

    def scaled(values: Values) -> Values:
        return values if prior_scale is None else replace(values, prior_scale=prior_scale)

    if is_mcap(path):
        run = read_result(path, notes)
        ground = ground_of(run)
        name = str(run.settings.get("sensor", "beam"))
        depends = str(run.facts.get("poses_depend_on", "log"))
        if name not in MODELS:
            raise UsageError(path, f"there is no sensor model {name!r}")
        return Source(
            path,
            ground,
            run.evidence(),
            lambda update: scaled(values_of(run, update, p_hit, p_miss)),
            keyframes_of(run, ground),
            MODELS[name].p_levels,
            (str(path),),
            ", ".join(part for part in depends.split(", ") if part != "log"),
        )
    explored = explore(path, notes, setup, truth, plan_resolution, plan_method)
    model = explored.model

    def values(update: Update) -> Values:
        levels = tuple(model.p_levels(p_hit, p_miss))
        return scaled(replace(explored.values(update), p_levels=levels))

    return Source(
        path,
        explored.ground,
        explored.evidence,
        values,
        keyframes(explored.ground, explored.evidences()),
        model.p_levels,
        (str(path), *([str(truth)] if truth else [])),
    )


def is_mcap(path: Path) -> bool:
    """Whether a file begins as an MCAP does.

    Raises:
        FormatError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None


def explore(
    path: Path,
    notes: Notes,
    setup: Setup | None,
    truth: Path | None,
    plan_resolution: float | None,
    plan_method: PlanMethod,
) -> Explored:
    """A plan explored by the paper's robot.

    Raises:
        FormatError: it cannot be read; there is no room for a robot; the truth has another size.
        UsageError: nothing says how large a pixel is.
    """
    plan = open_plan(path, notes, resolution=plan_resolution)
    scale = plan.scale
    prior, _ = taken_apart(plan, plan_method, notes)
    real = open_plan(truth, notes, resolution=scale) if truth else prior
    if real.occupancy.shape != prior.occupancy.shape:
        raise UsageError(truth or path, "the truth and the plan are of different sizes")
    if not real.wall.any():
        raise UsageError(path, "shows no walls: there is nothing to tune")
    return Explored(path.stem, real.wall, prior.wall, scale, setup, about=path)
