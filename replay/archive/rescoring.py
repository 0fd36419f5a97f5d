"""Scores of a result under other priors and sensors: the counts of a fresh run, without its log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, UsageError
from formats.grid import Evidence, Floats, Geometry, terms
from formats.result import Curve
from formats.results.groups import (
    ANY,
    DOOR,
    KINDS,
    MOST,
    OUTSIDE,
    WINDOW,
    Groups,
    grouped,
    scored_cells,
)
from formats.results.kept import Kept
from replay.archive.rescoring_kernels import Ints, sums, tally
from replay.cells import CellLayers
from replay.options import DEFAULTS, effective
from replay.prior import informative
from replay.scoring.scorer import count as score
from replay.sensors.observer import MODELS
from replay.world import curves_of

PRIOR = ("p_wall", "p_space", "p_outside", "prior_scale", "p_door", "p_window")
SENSOR = ("p_hit", "p_miss", "update")
VALUES = (*PRIOR, *SENSOR)  # what a result may be scored under anew
FIXED = ("sensor", "cell_rule")  # what its evidence and layers depend on
FEW = 8  # priors for which groups at every keyframe do not pay


class Table(NamedTuple):
    """Curves as the kernel takes them, those of one list of values after those of the other.

    Attributes:
        names: of the curves of each list of values.
        sensors: P(empty) by level, each set once.
        sensor: (curves,) which of them.
        l0: (curves, kinds).
        paper: (curves,).
    """

    names: tuple[str, ...]
    sensors: tuple[tuple[float, ...], ...]
    sensor: Ints
    l0: Floats
    paper: npt.NDArray[np.bool_]


def kinds_of_cells() -> tuple[CellLayers, dict[str, Floats]]:
    """A strip with a cell of each kind, as a plan would say it: layers, and openings by name."""
    kind = np.arange(KINDS, dtype=np.uint32)[None]
    wall = (kind & (ANY | MOST) != 0).astype(np.uint32)
    known = np.where((wall > 0) & (kind & MOST == 0), 3, 1).astype(np.uint32)
    footprint = kind & OUTSIDE == 0
    layers = CellLayers(Geometry(1, KINDS, 1.0, 0.0, 0.0), known, wall, known, footprint)
    openings = {"door": kind & DOOR, "window": kind & WINDOW}
    return layers, {name: (cells > 0).astype(np.float64) for name, cells in openings.items()}


def options_of(kept: Kept, values: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a fresh run that would give these scores.

    Raises:
        UsageError: a value that cannot be changed, or out of its range.
        FormatError: the result is of a sensor model that is not known here.
    """
    for name in values:
        if name not in VALUES:
            raise UsageError("", f"{name} cannot be changed without the log")
    if kept.settings.get("plan_confidence"):
        problem = "its prior is scaled cell by cell (--plan-confidence): it cannot be re-scored"
        raise FormatError(kept.path, problem, hint="run its log again")
    chosen = {name: kept.settings.get(name, DEFAULTS[name]) for name in (*VALUES, *FIXED)}  # type: ignore[literal-required]
    chosen |= {name: value for name, value in values.items() if value is not None}
    effective(chosen)
    if chosen["sensor"] not in MODELS:
        raise FormatError(kept.path, f"of a sensor model that is not known: {chosen['sensor']}")
    return chosen


@lru_cache(maxsize=64)
def _table(drawn: bool, priors: tuple[tuple[tuple[str, Any], ...], ...]) -> Table:
    """Curves of each of the options."""
    layers, openings = kinds_of_cells()
    found: list[tuple[str, Curve]] = []
    for items in priors:
        options = dict(items)
        values = {name: options[name] for name in (*PRIOR, "cell_rule")}
        prior = informative(layers, openings, **values) if drawn else None
        sensor = {name: options[name] for name in ("sensor", *SENSOR)}
        found += curves_of(layers, prior, **sensor).items()
    sensors = list(dict.fromkeys(curve.p_levels for _, curve in found))
    return Table(
        tuple(dict.fromkeys(name for name, _ in found)),
        tuple(sensors),
        np.array([sensors.index(curve.p_levels) for _, curve in found]),
        np.stack([curve.prior.values.ravel() for _, curve in found]),
        np.array([curve.update == "paper" for _, curve in found]),
    )


def table_of(kept: Kept, priors: Sequence[Mapping[str, Any]]) -> Table:
    """The curves of a result under each of several lists of values.

    Raises:
        UsageError, FormatError: see `options_of`.
    """
    options = tuple(tuple(sorted(options_of(kept, values).items())) for values in priors)
    return _table("bayes" in kept.curves, options)


def needs_layers(kept: Kept) -> bool:
    """Whether groups do not say enough: where a cell's prior goes by the share of its walls."""
    return bool(kept.settings.get("cell_rule") == "fraction")


def count(groups: Groups, table: Table) -> Ints:
    """(curves, 2, 4) cells observed and unobserved: tp, fp, fn, tn."""
    visits = np.empty(groups.kind.size, dtype=np.int64)
    totals = np.empty((len(table.sensors), groups.kind.size))
    for row, p_levels in zip(totals, table.sensors, strict=True):
        sums(groups.counts, *terms(p_levels), row, visits)
    out = np.zeros((len(table.paper), 2, 4), dtype=np.int64)
    tally(groups.kind, groups.cells, totals, visits, *table[2:], out)
    return out


def at_the_end(kept: Kept, priors: Sequence[Mapping[str, Any]]) -> list[dict[str, Ints]]:
    """Counts after the last frame: for each list of values, curve -> (2, 4).

    Args:
        kept: with groups.
        priors: names from VALUES -> value; what is not said is as it was in the run.

    Raises:
        UsageError: a value that cannot be changed, or out of its range.
        FormatError: the run scored nothing, or is of an unknown sensor model.
    """
    table = table_of(kept, priors)
    if kept.groups is None:
        raise FormatError(kept.path, "scored nothing: there was neither plan nor truth")
    if needs_layers(kept):
        if not kept.layers:
            raise ValueError("a prior that goes by shares: read the result whole")
        evidence = kept.evidence()
        return [cell_by_cell(kept, values, evidence) for values in priors]
    return _by_prior(table, count(kept.groups, table))


def _by_prior(table: Table, counts: Ints) -> list[dict[str, Ints]]:
    each = len(table.names)
    return [
        dict(zip(table.names, counts[i : i + each], strict=True))
        for i in range(0, len(counts), each)
    ]


def through_time(
    kept: Kept, priors: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[int, int, list[dict[str, Ints]]]]:
    """Frame, time (ns) and counts as `at_the_end` has them, keyframe by keyframe.

    Args:
        kept: read whole.
        priors: as there.

    Raises:
        UsageError, FormatError: as there.
    """
    table = table_of(kept, priors)
    evidence = Evidence.empty(kept.geometry, kept.levels)
    cells = scored_cells(kept.layers, evidence.counts)
    if cells is None:
        raise FormatError(kept.path, "scored nothing: there was neither plan nor truth")
    if needs_layers(kept):
        for time, change in kept.changes:
            change.add_to(evidence)
            yield change.frame, time, [cell_by_cell(kept, values, evidence) for values in priors]
        return
    lattice = kept.geometry.rows * kept.geometry.cols
    place = np.full(lattice, -1, dtype=np.int64)  # of each cell among the scored ones
    place[np.flatnonzero(kept.layers["truth_scored"])] = np.arange(len(cells.kind))
    so_far, marked = count(grouped(cells), table), np.zeros(len(cells.kind), dtype=np.bool_)
    for time, change in kept.changes:
        level, cell = np.divmod(change.where, lattice)
        here = place[cell] >= 0
        level, cell, added = level[here], place[cell[here]], change.added[here]
        marked[cell] = True  # many times as fast as np.unique
        touched = np.flatnonzero(marked)
        marked[touched] = False
        so_far -= count(some(cells, touched, len(priors)), table)
        cells.counts[level, cell] += added
        so_far += count(some(cells, touched, len(priors)), table)
        yield change.frame, time, _by_prior(table, so_far.copy())


def some(cells: Groups, where: Ints, priors: int) -> Groups:
    """Some of the cells, in groups where so many priors make that pay."""
    part = Groups(cells.kind[where], cells.counts[:, where], cells.cells[where])
    return part if priors <= FEW else grouped(part)


def curves_under(kept: Kept, values: Mapping[str, Any]) -> dict[str, Curve]:
    """The curves of a result under other values, cell by cell, as a run builds them.

    Args:
        kept: read whole.
        values: names from VALUES -> value.
    """
    options = options_of(kept, values)
    share = kept.layers["wall"].astype(np.float64)
    # A share is so much wall of one known pixel.
    layers = CellLayers(
        kept.geometry,
        np.ones(share.shape, dtype=np.uint32),
        share,  # type: ignore[arg-type]
        np.ones(share.shape, dtype=np.uint32),
        kept.layers["outside"] == 0,
    )
    openings: dict[str, Floats] = {
        name: kept.layers[name] for name in ("door", "window") if name in kept.layers
    }
    chosen = {name: options[name] for name in (*PRIOR, "cell_rule")}
    prior = informative(layers, openings, **chosen) if "bayes" in kept.curves else None
    return curves_of(layers, prior, **{name: options[name] for name in ("sensor", *SENSOR)})


def cell_by_cell(kept: Kept, values: Mapping[str, Any], evidence: Evidence) -> dict[str, Ints]:
    """The same cell by cell, as a run does it: where the prior goes by the walls' shares.

    Args:
        kept: read whole.
        values: names from VALUES -> value.
        evidence: of the result, at some time.
    """
    truth, scored = kept.layers["truth_wall"] != 0, kept.layers["truth_scored"] != 0
    seen = evidence.visits() > 0
    return {
        name: np.array(score(curve.of(evidence).occupied(), truth, scored, seen))
        for name, curve in curves_under(kept, values).items()
    }
