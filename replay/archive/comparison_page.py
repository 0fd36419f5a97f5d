"""The page of a comparison: differences, every log, F2 through time, maps and errors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from formats.results.kept import Kept, read_kept
from replay.archive.finding import results_in
from replay.archive.map_scores import map_scores
from replay.archive.places import local
from replay.archive.rescored import scores
from replay.archive.rescoring import curves_under, through_time
from replay.archive.sides import Comparison, Side
from replay.archive.summary import titled
from replay.figures import Chart, Line, charts
from replay.pictures import FALSE, FOUND, MISSED, errors, gray, png
from replay.reporting.markup import figure, key, page, picture, table, text
from replay.scoring.map_metrics import MAP_METRICS

SHOWN = 3  # logs that lose most, and that gain most, with maps
MOST_ROWS = 500
SIDE = 420  # cells of a thumbnail, at most


def page_of(found: Comparison) -> str:
    """The whole page; it needs nothing else."""
    labels = [side.label for side in found.sides]
    title = f"{' against '.join(reversed(labels[:2]))}" if len(labels) == 2 else ", ".join(labels)
    return page(f"Comparison: {title}", body(found))


def body(found: Comparison) -> Iterator[str]:
    """The parts of the page, in their order."""
    name, first = titled(found.metric), found.sides[0].label
    of_maps = found.metric in MAP_METRICS
    what = "the means over all logs" if of_maps else "the counts of all logs together"
    yield f"<h1>{text(', '.join(side.label for side in found.sides))}</h1>"
    yield f'<p class="soft">{text(name)} of {len(found.names)} logs, held against {text(first)}</p>'
    yield table(
        ["side", "difference", "95 % interval", "p", "median", "better", "worse", "same"],
        [
            [
                side.label,
                f"{side.paired.difference:+.4f}",
                f"{side.paired.low:+.4f} to {side.paired.high:+.4f}",
                f"{side.paired.p:.4f}",
                f"{side.median:+.4f}",
                side.wins,
                side.losses,
                side.ties,
            ]
            for side in found.versus
        ],
        numbers=7,
    )
    yield (
        f"<p class='soft'>The difference is of {what}; its interval draws "
        "logs anew (2000 times), p swaps the sides log by log at random. The median is of the "
        "differences log by log.</p>"
    )
    yield "<h2>Log by log</h2>"
    yield figure(
        picture(overview(found), "the metric of each log"), "Logs by what the first scores."
    )
    yield "<h2>The logs that differ most</h2>"
    for log in extremes(found):
        yield from of_log(found, log)
    yield "<h2>All logs</h2>"
    rows = found.rows()
    head = list(rows[0])
    yield table(
        head,
        [[row[n] if n == "log" else f"{row[n]:.4f}" for n in head] for row in rows[:MOST_ROWS]],
        numbers=len(head) - 1,
    )
    if len(rows) > MOST_ROWS:
        yield f"<p>... and {len(rows) - MOST_ROWS} more</p>"
    for label, failed in found.failed.items():
        yield f"<h3>Failed in {text(label)}</h3>"
        yield table(["result", "error"], list(failed.items()))
    for label, alone in found.alone.items():
        yield f"<h3>Only in {text(label)}</h3><p>{text(', '.join(alone))}</p>"


def extremes(found: Comparison) -> list[str]:
    """Logs that lose most and gain most in any of the sides."""
    less = found.values[1:] - found.values[0]
    lowest, highest = np.argsort(less.min(axis=0)), np.argsort(-less.max(axis=0))
    picked = [*lowest[:SHOWN].tolist(), *highest[:SHOWN].tolist()]
    return [found.names[i] for i in dict.fromkeys(picked)]


def overview(found: Comparison) -> bytes:
    """The metric of every side, logs in the order of the first side's."""
    order = np.argsort(found.values[0], kind="stable")
    x = np.arange(1, len(order) + 1)
    lines = [
        Line(side.label, x, values[order], "-" if i == 0 else ".")
        for i, (side, values) in enumerate(zip(found.sides, found.values, strict=True))
    ]
    chart = Chart("", "logs", titled(found.metric), lines)
    return charts([chart], cols=1, width=9.0, height=3.6)


def of_log(found: Comparison, log: str) -> Iterator[str]:
    """A log's curves through time, and each side's map with its errors."""
    i = found.names.index(log)
    yield f"<h3>{text(log)}</h3>"
    lines, pictures = [], []
    for side, value in zip(found.sides, found.values[:, i], strict=True):
        kept = whole(side, found.found[side.label][log])
        curve = side.curve or own(kept, side)
        lines.append(Line(side.label, *through(kept, side, curve, found.metric)))
        shown, wrong = thumbnails(kept, side, curve)
        caption = f"{text(side.label)}: {text(titled(found.metric))} {value:.3f}"
        both = figure(picture(shown, "map"), caption) + figure(picture(wrong, "errors"), caption)
        pictures.append(f'<div class="row">{both}</div>')
    chart = Chart("", "seconds of the log", titled(found.metric), lines)
    curves = charts([chart], cols=1, width=9.0, height=2.8)
    yield figure(picture(curves, "the metric through time"), "At keyframes.")
    yield from pictures
    legend = key(FOUND, "found") + key(MISSED, "missed") + key(FALSE, "false")
    yield f'<p class="soft">Errors:{legend}</p>'


def whole(side: Side, name: str) -> Kept:
    """A result of a side, read whole."""
    place = next(one.place for one in results_in(side.place) if one.name == name)
    return read_kept(local(place), whole=True)


def own(kept: Kept, side: Side) -> str:
    """The curve that is the side's map."""
    if "bayes" not in kept.curves:
        return "none"
    return str(side.values.get("update") or kept.settings.get("update") or "bayes")


def through(kept: Kept, side: Side, curve: str, metric: str) -> tuple[Any, Any]:
    """Seconds and metric at keyframes."""
    observed = kept.settings.get("region") == "observed"
    times, values = [], []
    if metric in MAP_METRICS:
        maps = map_scores(kept, [side.values], metric, observed=observed, over_time=True)
        values = [each[curve] for (each,) in maps]
        times = [time for time, _ in kept.changes]
        return (np.array(times) - times[0]) / 1e9, np.array(values, dtype=np.float64)
    for _, time, (found,) in through_time(kept, [side.values]):
        times.append(time)
        values.append(scores(found[curve], observed)[metric])
    return (np.array(times) - times[0]) / 1e9, np.array(values)


def thumbnails(kept: Kept, side: Side, curve: str) -> tuple[bytes, bytes]:
    """PNGs of the map and of its errors, cut to the scored region, highest row on top."""
    grid = curves_under(kept, side.values)[curve].of(kept.evidence())
    truth, scored = kept.layers["truth_wall"] != 0, kept.layers["truth_scored"] != 0
    wrong = errors(grid.occupied(), truth, scored)
    rows, cols = np.flatnonzero(scored.any(axis=1)), np.flatnonzero(scored.any(axis=0))
    step = max(1, -(-max(np.ptp(rows), np.ptp(cols)) // SIDE)) if len(rows) else 1
    part = (
        slice(rows[0], rows[-1] + 1, step) if len(rows) else slice(None),
        slice(cols[0], cols[-1] + 1, step) if len(cols) else slice(None),
    )
    white = np.where(wrong[..., 3:] > 0, wrong[..., :3], 255).astype(np.uint8)
    opaque = np.dstack([white, np.full(truth.shape, 255, dtype=np.uint8)])
    return png(gray(grid)[part][::-1]), png(opaque[part][::-1])
