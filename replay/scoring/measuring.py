"""What of a run's maps is measured beyond precision, recall and F2, when it is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from math import isfinite
from typing import Any

from formats.errors import UsageError
from formats.grid import Grid
from replay.scoring.count_metrics import METRICS
from replay.scoring.intervals import block_counts, interval, paired
from replay.scoring.map_metrics import MAP_METRICS, Bools
from replay.scoring.scorer import tell

PREDICTIVE = "predictive"  # of scans, not of a map: see `predictive`


def names() -> list[str]:
    """Of every metric."""
    return [*METRICS, *MAP_METRICS, PREDICTIVE]


def checked(asked: Iterable[str]) -> list[str]:
    """Names of metrics, each once; several may stand in one, with commas between.

    Raises:
        UsageError: there is no such metric.
    """
    out, known = [part.strip() for name in asked for part in name.split(",")], names()
    for name in out:
        if name not in known:
            close = get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(known)}"
            raise UsageError(name, "no such metric", hint=hint)
    return list(dict.fromkeys(out))


def of_results(name: str) -> str:
    """The name of a metric that needs no log.

    Raises:
        UsageError: there is no such metric, or it is of the scans.
    """
    found = checked([name])
    if len(found) != 1:
        raise UsageError(name, "one metric at a time")
    if found == [PREDICTIVE]:
        hint = f"`replay run --metric {PREDICTIVE}` has it"
        raise UsageError(name, "is of the scans, which a result does not keep", hint=hint)
    return found[0]


def measured(
    names: Iterable[str],
    grids: Mapping[str, Grid],
    wall: Bools,
    scored: Bools,
    predicted: Mapping[str, float],
) -> dict[str, dict[str, float | None]]:
    """Curve -> metric -> value, None where it has none.

    Args:
        names: of metrics.
        grids: the last maps.
        wall, scored: (rows, cols) truth, and the cells that count.
        predicted: curve -> predictive score.
    """
    out: dict[str, dict[str, float | None]] = {}
    for curve, grid in grids.items():
        counts = tell(grid.occupied()[scored], wall[scored])
        values = {}
        for name in names:
            if name in METRICS:
                values[name] = METRICS[name](counts)
            elif name in MAP_METRICS:
                values[name] = MAP_METRICS[name](grid, wall, scored)
            else:
                values[name] = predicted[curve]
        out[curve] = {name: v if isfinite(v) else None for name, v in values.items()}
    return out


def sureness(
    names: Iterable[str], grids: Mapping[str, Grid], wall: Bools, scored: Bools
) -> dict[str, Any]:
    """Bootstrap intervals of each curve's metrics of counts, and the gain of each prior over none.

    Returns:
        "intervals": curve -> metric -> [low, high]; "gain": curve -> metric -> difference, low,
        high and p. Empty where nothing is scored.
    """
    chosen = {name: METRICS[name] for name in names if name in METRICS}
    resolution = next(iter(grids.values())).geometry.resolution
    tables = {
        curve: block_counts(grid.occupied(), wall, scored, resolution)
        for curve, grid in grids.items()
    }
    if not scored.any():
        return {"intervals": {}, "gain": {}}
    intervals = {
        curve: {name: list(interval(metric, table)[1:]) for name, metric in chosen.items()}
        for curve, table in tables.items()
    }
    gain = {
        curve: {
            name: paired(metric, table, tables["none"])._asdict() for name, metric in chosen.items()
        }
        for curve, table in tables.items()
        if curve != "none"
    }
    return {"intervals": intervals, "gain": gain}
