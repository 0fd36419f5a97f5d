"""What `replay rescore` prints: medians then and now, and what could not be scored."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

from formats.errors import printable
from replay.archive.rescored import Scored
from replay.scoring.map_metrics import ERRORS

NAMES = {"none": "no prior", "bayes": "prior, bayes", "paper": "prior, paper"}
BEST = 10  # priors of a grid that are shown


def report(scored: Scored, written: Sequence[str] = ()) -> str:
    """Lines that a person reads, without the last line break."""
    counted = scored.results + len(scored.failed)
    lossy = f", {scored.lossy} with data loss" if scored.lossy else ""
    failed = f", {len(scored.failed)} failed" if scored.failed else ""
    lines = [f"{counted} result{'s' * (counted != 1)}: {scored.results} scored{lossy}{failed}"]
    last = at_the_end(scored.rows)
    if last:
        lines += of_grid(scored, last) if len(scored.priors) > 1 else of_one(scored, last)
    for depends, count in scored.depending.items():
        lines.append(
            f"poses   of {count} depend on {depends}: a run of its own under another prior may "
            "find others"
        )
    for name, error in scored.failed.items():
        lines.append(f"failed  {printable(name)}: {error}")
    lines += [f"wrote   {printable(path)}" for path in written]
    return "\n".join(lines)


def at_the_end(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of each result's last frame."""
    last: dict[str, int] = {}
    for row in rows:
        last[row["result"]] = max(last.get(row["result"], -1), row.get("frame", -1))
    return [row for row in rows if row.get("frame", -1) == last[row["result"]]]


def titled(metric: str) -> str:
    """A metric as a person writes it."""
    return metric.upper() if len(metric) < 4 else metric


def of_one(scored: Scored, rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each curve: medians then and now."""
    metric = scored.metric
    label = next(iter(scored.priors))
    lines = [f"{label:<34}{'median ' + titled(metric):>16}{'was':>9}{'better':>9}{'worse':>8}"]
    for curve in dict.fromkeys(row["curve"] for row in rows):
        each = [row for row in rows if row["curve"] == curve]
        pairs = [(row[metric], row[f"was_{metric}"]) for row in each if row[metric] is not None]
        if not pairs:
            lines.append(f"  {NAMES.get(curve, printable(curve)):<32}{'none':>16}")
            continue
        known = [(now, then) for now, then in pairs if then is not None]
        then = f"{median(b for _, b in known):>9.3f}" if known else f"{'':>9}"
        better, worse = sum(a > b for a, b in known), sum(a < b for a, b in known)
        if metric in ERRORS:
            better, worse = worse, better
        name = NAMES.get(curve, printable(curve))
        now = median(a for a, _ in pairs)
        lines.append(f"  {name:<32}{now:>16.3f}{then}{better:>9}{worse:>8}")
    return lines


def of_grid(scored: Scored, rows: Sequence[dict[str, Any]]) -> list[str]:
    """The best priors by the median of the main curve."""
    metric = scored.metric
    groups: dict[str, list[float]] = {}
    first = next(iter(scored.priors))
    before: list[float] = []
    for row in rows:
        curve = row["update"] if row["curve"] != "none" else ""
        if row["curve"] == curve and row[metric] is not None:
            groups.setdefault(row["prior"], []).append(row[metric])
            then = row[f"was_{metric}"]
            before += [then] if then is not None and row["prior"] == first else []
    if not groups:
        return [f"{len(scored.priors)} priors, and no result with a plan"]
    sign, last, worst, on = (-1, min, "least", "down")
    if metric in ERRORS:
        sign, last, worst, on = (1, max, "most", "up")
    order = sorted(groups, key=lambda label: sign * median(groups[label]))
    width = max(34, *(len(label) + 2 for label in order[:BEST]))
    was = f" (was {median(before):.3f})" if before else ""
    head = f"{len(scored.priors)} priors{was}"
    lines = [f"{head:<{width}}{'median ' + titled(metric):>16}{worst:>9}"]
    for label in order[:BEST]:
        values = groups[label]
        lines.append(f"  {label:<{width - 2}}{median(values):>16.3f}{last(values):>9.3f}")
    if len(order) > BEST:
        lines.append(f"  ... and {len(order) - BEST} more, {on} to {median(groups[order[-1]]):.3f}")
    return lines
