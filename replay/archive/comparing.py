"""compare(): archives, priors or curves side by side, log by log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.output import check_output, write_text
from formats.result import Counts
from replay.archive.finding import places
from replay.archive.places import Place
from replay.archive.priors import Values
from replay.archive.rescored import CELLS, Scored, rescore
from replay.archive.sides import Comparison, Side, Versus
from replay.archive.summary import at_the_end
from replay.scoring.count_metrics import METRICS
from replay.scoring.intervals import paired, paired_means
from replay.scoring.map_metrics import ERRORS
from replay.scoring.measuring import of_results

WORST = 5  # logs that are named
TIE = 1e-12


def compare(
    archives: Place | Iterable[Place],
    *,
    priors: Mapping[str, Values] | None = None,
    prior_values: Place | Sequence[Place] | None = None,
    curves: Sequence[str] = (),
    labels: Sequence[str] = (),
    metric: str = "f2",
    html: Place | None = None,
    force: bool = False,
    notes: Notes | None = None,
) -> Comparison:
    """Hold archives, priors or curves against the first of them, on the logs that all have.

    Args:
        archives: two or more; or one, with priors or curves. A log is known by its content where
            `replay batch` made the results, one of each, else by the result's name.
        priors: label -> values, of one archive; held against the result as it was.
        prior_values: files that `replay tune` wrote, likewise.
        curves: of one archive: "none", "bayes", "paper"; of several: the one to compare.
        labels: of the archives.
        metric: one of docs/metrics.md; those of maps are compared by their means over the logs.
        html: a page to write.
        force: replace it where it exists.
        notes: takes what was odd.

    Returns:
        values, differences with intervals, wins and losses.

    Raises:
        UsageError: there is nothing to compare.
        FormatError: no log that all sides have.
    """
    metric = of_results(metric)
    sides = sides_of(places(archives), priors or {}, prior_values, curves, labels)
    if html is not None:
        check_output(html, force=force)
    scored = [
        rescore(side.place, priors={side.label: side.values}, metric=metric, notes=notes)
        for side in sides
    ]
    out = held_together(sides, scored, metric)
    if html is not None:
        from replay.archive.comparison_page import page_of

        write_text(html, page_of(out), force=force)
    return out


def sides_of(
    archives: Sequence[Place],
    priors: Mapping[str, Values],
    prior_values: Place | Sequence[Place] | None,
    curves: Sequence[str],
    labels: Sequence[str],
) -> list[Side]:
    """What is to be compared, the first being what the others are held against.

    Raises:
        UsageError: there are not two of anything, or of too many things.
    """
    from replay.archive.priors import asked_for

    asked = asked_for(prior_values, priors, None, {}) if priors or prior_values else {}
    if len(archives) > 1:
        if asked or len(curves) > 1:
            hint = "one archive with several priors or curves, or several archives"
            raise UsageError("", "too much to compare at once", hint=hint)
        names = list(labels) or distinct([str(place).rstrip("/") for place in archives])
        if len(set(names)) != len(archives):
            raise UsageError("", f"{len(archives)} archives need as many different labels")
        curve = curves[0] if curves else ""
        return [Side(name, place, {}, curve) for name, place in zip(names, archives, strict=True)]
    if asked and len(curves) > 1:
        raise UsageError(
            "", "too much to compare at once", hint="several priors, or several curves"
        )
    if len(curves) > 1:
        return [Side(curve, archives[0], {}, curve) for curve in curves]
    if not asked:
        hint = "give another archive, --prior-values, --p or --curves"
        raise UsageError(archives[0], "nothing to compare it with", hint=hint)
    curve = curves[0] if curves else ""
    first = Side("as it was", archives[0], {}, curve)
    return [first, *(Side(name, archives[0], each, curve) for name, each in asked.items())]


def distinct(paths: Sequence[str]) -> list[str]:
    """The last names of paths; of those that share it, more of the path."""
    for parts in range(1, 20):
        names = ["/".join(path.split("/")[-parts:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [f"{path} ({i})" for i, path in enumerate(paths, 1)]


def rows_by_log(side: Side, scored: Scored) -> dict[str, dict[str, Any]]:
    """Result -> the row of the side's curve."""
    last = at_the_end(scored.rows)
    drawn = {row["result"] for row in last if row["curve"] == "bayes"}
    out: dict[str, dict[str, Any]] = {}
    for row in last:
        own = row["update"] if row["result"] in drawn else "none"
        if row["curve"] == (side.curve or own):
            out[row["result"]] = row
    return out


def held_together(sides: list[Side], scored: list[Scored], metric: str) -> Comparison:
    """The sides on their common logs.

    Raises:
        FormatError: there are none.
    """
    tables = [rows_by_log(side, each) for side, each in zip(sides, scored, strict=True)]
    hashes = [[row["log_sha256"] for row in table.values()] for table in tables]
    known = all(all(each) and len(set(each)) == len(each) for each in hashes)
    keyed = [
        {(row["log_sha256"] if known else name): row for name, row in table.items()}
        for table in tables
    ]
    valued = ({key for key, row in each.items() if row[metric] is not None} for each in keyed)
    common = set.intersection(*valued)
    if not common:
        where = ", ".join(side.label for side in sides)
        raise FormatError(where, "have no log in common", hint="are they of the same logs?")
    order = sorted(common, key=lambda key: keyed[0][key]["result"])
    names = [keyed[0][key]["result"].removesuffix(".replay.mcap") for key in order]
    counts = np.array([[counts_of(each[key]) for key in order] for each in keyed], dtype=np.int64)
    sign = -1.0 if metric in ERRORS else 1.0
    values = np.array([[each[key][metric] for key in order] for each in keyed])
    out = Comparison(metric, sides, names, values, counts, [])
    for side, each, result in zip(sides, keyed, scored, strict=True):
        others = [row["result"] for key, row in each.items() if key not in common]
        if others:
            out.alone[side.label] = sorted(others)
        if result.failed:
            out.failed[side.label] = result.failed
        out.found[side.label] = {
            name: each[key]["result"] for name, key in zip(names, order, strict=True)
        }
    for i, side in enumerate(sides[1:], 1):
        less = values[i] - values[0]
        gain = sign * less
        worst = [int(k) for k in np.argsort(gain, kind="stable")[:WORST] if gain[k] < -TIE]
        out.versus.append(
            Versus(
                side.label,
                paired(METRICS[metric], counts[i], counts[0])
                if metric in METRICS
                else paired_means(values[i], values[0]),
                median(less.tolist()),
                int((gain > TIE).sum()),
                int((gain < -TIE).sum()),
                int((np.abs(less) <= TIE).sum()),
                [(names[k], float(less[k])) for k in worst],
            )
        )
    return out


def counts_of(row: Mapping[str, Any]) -> Counts:
    """The counts of a row's scored region."""
    parts = ("observed",) if row["region"] == "observed" else ("observed", "unobserved")
    return Counts(*(sum(row[f"{part}_{name}"] for part in parts) for name in CELLS))
