"""rescore(): results under other priors, sensors, truths and metrics, without their logs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from formats.errors import FormatError, Notes, UsageError, printable
from formats.result import Counts
from formats.results.kept import Kept, read_kept
from replay.archive.finding import FAILED, Found, places, results_in
from replay.archive.map_scores import map_scores
from replay.archive.places import RESULT, Place, local
from replay.archive.priors import Values, asked_for
from replay.archive.rescoring import VALUES, at_the_end, needs_layers, options_of, through_time
from replay.archive.rescoring_kernels import Ints
from replay.scoring.count_metrics import METRICS
from replay.scoring.map_metrics import MAP_METRICS
from replay.scoring.measuring import of_results

if TYPE_CHECKING:
    import pandas as pd

CELLS = ("tp", "fp", "fn", "tn")


@dataclass
class Scored:
    """Scores of an archive.

    Attributes:
        rows: a row for each result, prior, keyframe and curve.
        priors: what was asked for, by label.
        metric: that a summary shows.
        results: that were read.
        lossy: of them, whose logs had lost data.
        depending: of them, whose poses depend on more than the log.
        failed: name -> what is wrong with a result that could not be read, or a log that failed.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    priors: dict[str, Values] = field(default_factory=dict)
    metric: str = "f2"
    results: int = 0
    lossy: int = 0
    depending: dict[str, int] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    def frame(self) -> pd.DataFrame:
        """The rows as a DataFrame."""
        from replay.archive.tables import frame

        return frame(self.rows)

    def _repr_html_(self) -> str:
        from replay.archive.tables import html_table

        caption = f"{self.results} results, {len(self.failed)} failed"
        return html_table([_short(row, self.metric) for row in self.rows], caption)


def _short(row: Mapping[str, Any], metric: str) -> dict[str, Any]:
    names = ("result", "prior", "frame", "curve", metric, f"was_{metric}")
    return {name: row[name] for name in names if name in row}


def rescore(
    results: Place | Iterable[Place],
    *,
    prior_values: Place | Sequence[Place] | None = None,
    priors: Mapping[str, Values] | Sequence[Values] | None = None,
    grid: Mapping[str, Sequence[float]] | None = None,
    truth: Place | None = None,
    region: str | None = None,
    metric: str = "f2",
    over_time: bool = False,
    notes: Notes | None = None,
    progress: Callable[[int, int], None] | None = None,
    **values: Any,
) -> Scored:
    """Score results anew from the evidence that they keep.

    Args:
        results: result files, folders of them, patterns, or addresses in object storage.
        prior_values: files that `replay tune` wrote; each is a prior of its own.
        priors: several lists of values, perhaps by label.
        grid: name -> values; all their combinations.
        truth: another truth, for all of the results.
        region: "observed" scores the observed cells alone; None: as the run did.
        metric: one of docs/metrics.md, for the summary. Those of counts are always there; another
            one is a column more, and takes each result's maps (see `map_scores`).
        over_time: at every keyframe, not at the end alone.
        notes: takes what was odd.
        progress: is told (done, all) results.
        values: p_wall, p_space, p_outside, prior_scale, p_door, p_window, p_hit, p_miss, update;
            they hold for all priors that do not say otherwise.

    Returns:
        the rows, and what could not be read.

    Raises:
        FormatError: there are no results, or the truth cannot be used.
        UsageError: a value that needs the log, or out of its range.
    """
    notes = Notes() if notes is None else notes
    metric = of_results(metric)
    if region not in (None, "observed"):
        raise UsageError(region, "that region cannot be had without the log", hint="observed can")
    asked = asked_for(prior_values, priors, grid, values)
    found, bad = list(results_in(results)), failures(results)
    if not found and not bad:
        hint = "`replay batch` and `replay run` write them"
        raise FormatError(_named(results), f"holds no results (*{RESULT})", hint=hint)
    out = Scored(priors=asked, metric=metric, failed=bad)
    for number, one in enumerate(found):
        if progress:
            progress(number, len(found))
        try:
            kept = _read(one, truth, over_time or metric in MAP_METRICS, notes)
            other = truth is not None
            rows = rows_of(one, kept, asked, region, metric, over_time, other_truth=other)
        except UsageError:
            raise
        except FormatError as error:
            if truth is not None and str(error.path) == str(truth):
                raise
            out.failed[one.name] = said(error, one)
            continue
        out.rows += rows
        out.results += 1
        out.lossy += bool(kept.facts.get("lost"))
        depends = beyond_the_log(kept)
        if depends:
            out.depending[depends] = out.depending.get(depends, 0) + 1
    return out


def said(error: FormatError, one: Found) -> str:
    """An error about a result without its path, which the reader of the table knows."""
    return str(error).removeprefix(f"{one.place}: ")


def _named(results: Place | Iterable[Place]) -> str:
    return ", ".join(map(str, places(results)))


def _read(one: Found, truth: Place | None, whole: bool, notes: Notes) -> Kept:
    path = local(one.place)
    kept = read_kept(path, notes, whole=whole or truth is not None)
    if needs_layers(kept) and not kept.layers:
        kept = read_kept(path, notes, whole=True)
    if truth is not None:
        from replay.archive.truths import with_truth

        kept = with_truth(kept, local(truth), notes)
    return kept


def beyond_the_log(kept: Kept) -> str:
    """What else the poses depend on: "plan, seed 1", or ""."""
    parts = str(kept.facts.get("poses_depend_on", "log")).split(", ")
    return ", ".join(part for part in parts if part != "log")


def failures(results: Place | Iterable[Place]) -> dict[str, str]:
    """Name -> error of the logs for which `replay batch` left a note in place of a result."""
    out = {}
    for one in results_in(results, FAILED):
        try:
            note = json.loads(local(one.place).read_text(encoding="utf-8"))
            out[one.name.removesuffix(FAILED)] = printable(note["error"], 500)
        except (ValueError, KeyError, TypeError, OSError):
            out[one.name.removesuffix(FAILED)] = "failed, and its note cannot be read"
    return out


def rows_of(
    one: Found,
    kept: Kept,
    asked: Mapping[str, Values],
    region: str | None,
    metric: str,
    over_time: bool,
    *,
    other_truth: bool = False,
) -> list[dict[str, Any]]:
    """The rows of one result.

    Raises:
        UsageError, FormatError: see `rescoring.at_the_end`.
    """
    priors = list(asked.values())
    if over_time:
        moments = [
            ({"frame": frame, "time_ns": time}, found)
            for frame, time, found in through_time(kept, priors)
        ]
    else:
        moments = [({}, at_the_end(kept, priors))]
    observed = (region or kept.settings.get("region")) == "observed"
    of_maps: Iterator[list[dict[str, float | None]]] = iter(())
    if metric in MAP_METRICS:
        told = kept.facts.get("metrics", {})
        before = {curve: told.get(curve, {}).get(metric) for curve in kept.curves}
        if not other_truth:
            ((before,),) = map_scores(kept, [{}], metric, observed=observed)
        of_maps = map_scores(kept, priors, metric, observed=observed, over_time=over_time)
    else:
        before = {curve: was(kept, curve, metric, observed) for curve in kept.curves}
    batched = kept.facts.get("archive", {})
    source = {
        "log": " ".join(batched.get("logs", [])) or str(kept.facts.get("log", "")),
        "log_sha256": " ".join(batched.get("sha256", [])),
    }
    depends = beyond_the_log(kept)
    options = [options_of(kept, values) for values in priors]
    fixed = {"region": "observed" if observed else kept.settings.get("region", "footprint")}
    rows = []
    for moment, found in moments:
        maps: list[dict[str, float | None]] = next(of_maps, [{} for _ in priors])
        for label, chosen, curves, of_map in zip(asked, options, found, maps, strict=True):
            said = {name: chosen[name] for name in VALUES}
            for curve, counts in curves.items():
                more = {metric: of_map[curve]} if of_map else {}
                rows.append(
                    {"result": one.name, **source, "prior": label, **moment, "curve": curve}
                    | {**said, **fixed, **scores(counts, observed), **more}
                    | {f"was_{metric}": before.get(curve), "poses_depend_on": depends}
                )
    return rows


def scores(counts: Ints, observed: bool) -> dict[str, Any]:
    """Metrics, and the counts of all scored cells, apart for the observed and the others."""
    seen, unseen = (Counts(*row) for row in counts.tolist())
    whole = seen if observed else seen + unseen
    cells = sum(seen) + sum(unseen)
    return (
        {name: metric(whole) for name, metric in METRICS.items()}
        | {"observed_f2": METRICS["f2"](seen), "unobserved_f2": METRICS["f2"](unseen)}
        | {"explored": sum(seen) / cells if cells else 0.0}
        | {f"observed_{name}": n for name, n in zip(CELLS, seen, strict=True)}
        | {f"unobserved_{name}": n for name, n in zip(CELLS, unseen, strict=True)}
    )


def was(kept: Kept, curve: str, metric: str, observed: bool) -> float | None:
    """The score that the run itself gave."""
    part = kept.facts.get("observed" if observed else "scores", {}).get(curve)
    if not part:
        return None
    return METRICS[metric](Counts(*(int(part[name]) for name in CELLS)))
