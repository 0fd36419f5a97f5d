"""Metrics of probabilities and places of a result under other priors: cell by cell, from its maps.

Counts come from groups of cells in a millisecond; these need every cell of every keyframe, and cost
what reading the result whole and building its maps costs: tens of milliseconds a result and prior.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

from formats.errors import FormatError
from formats.grid import Evidence
from formats.result import Curve
from formats.results.kept import Kept
from replay.archive.rescoring import curves_under
from replay.scoring.map_metrics import MAP_METRICS

Values = dict[str, float | None]  # by curve; None where the metric has none


def map_scores(
    kept: Kept,
    priors: Sequence[Mapping[str, Any]],
    metric: str,
    *,
    observed: bool,
    over_time: bool = False,
) -> Iterator[list[Values]]:
    """After each keyframe, or after the last frame alone: for each list of values, curve -> score.

    Args:
        kept: read whole.
        priors: names from `rescoring.VALUES` -> value.
        metric: one of MAP_METRICS.
        observed: the cells that a reading has shown count alone.
        over_time: at every keyframe.

    Raises:
        UsageError, FormatError: see `rescoring.at_the_end`.
    """
    if "truth_scored" not in kept.layers:
        raise FormatError(kept.path, "scored nothing: there was neither plan nor truth")
    curves = [curves_under(kept, values) for values in priors]
    evidence = Evidence.empty(kept.geometry, kept.levels)
    for _, change in kept.changes:
        change.add_to(evidence)
        if over_time:
            yield [_scored(kept, each, evidence, metric, observed) for each in curves]
    if not over_time:
        yield [_scored(kept, each, evidence, metric, observed) for each in curves]


def _scored(
    kept: Kept, curves: Mapping[str, Curve], evidence: Evidence, metric: str, observed: bool
) -> Values:
    wall, scored = kept.layers["truth_wall"] != 0, kept.layers["truth_scored"] != 0
    if observed:
        scored = scored & (evidence.visits() > 0)
    found = {
        name: MAP_METRICS[metric](curve.of(evidence), wall, scored)
        for name, curve in curves.items()
    }
    return {name: value if isfinite(value) else None for name, value in found.items()}
