"""What a report says of one run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePath
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.results.file import RunFile
from formats.results.records import ratios
from replay.facts import SHOWN
from replay.options import DEFAULTS
from replay.pictures import (
    CURVE_COLOURS,
    CURVE_NAMES,
    FALSE,
    FOUND,
    MISSED,
    Bools,
    errors,
    gray,
)
from replay.reporting.drawings import Curve, chart, map_drawing, window
from replay.reporting.markup import bullets, figure, key, picture, table, text
from replay.surveying.deviating import listed, of_run
from replay.surveying.showing import picture as deviation_picture
from replay.viewing.making import around

MARGIN = 1.0  # m around what is shown
MOST_WALLS = 40  # of the table of deviations
NAMES = {"precision": "Precision", "recall": "Recall", "f2": "F2"}


def sections(run: RunFile, name: str, notes: Notes) -> Iterator[str]:
    """One run, section by section; what the result does not hold is left out."""
    facts = run.facts
    yield f"<h1>{text(name)}</h1>"
    log, plan = (PurePath(str(facts.get(part) or "")).name for part in ("log", "plan"))
    over = f"over the plan <code>{text(plan)}</code>" if plan else "without a plan"
    span = f"{facts['log_seconds']:.1f} s" if "log_seconds" in facts else ""
    yield (
        f'<p class="soft">The log <code>{text(log)}</code> {over}: {len(run.times_ns)} scans'
        f"{', ' + span if span else ''}; written {text(run.written or 'at a time not known')}.</p>"
    )
    if run.counts and facts.get("scores"):
        yield from _scores(run)
    yield from _maps(run)
    if run.counts and run.layers.get("truth_scored", np.zeros(1)).any():
        yield from _curves(run)
    yield from _deviations(run)
    yield "<h2>How it was read</h2>"
    for word, lines in facts.get("said", {}).items():
        yield f"<h3>{text(word).capitalize()}</h3>{bullets(lines)}"
    yield "<h2>Warnings and losses</h2>"
    odd = [*facts.get("notes", []), *(f"{note.kind}: {note}" for note in notes)]
    yield bullets(odd) if odd else "<p>None: every scan was read and used.</p>"
    yield from _settings(run)


def _scores(run: RunFile) -> Iterator[str]:
    facts = run.facts
    main, none = facts["scores"].get(run.main, {}), facts["scores"].get("none", {})
    yield '<div class="big">'
    if run.main != "none" and main:
        yield f"<div><b>{main['f2']:.2f}</b>F2 with the prior</div>"
    if none:
        yield f"<div><b>{none['f2']:.2f}</b>F2 without</div>"
    yield f"<div><b>{facts['explored']:.0%}</b>of the scored cells seen</div></div>"
    rows = []
    for curve, score in facts["scores"].items():
        sensor = facts.get("sensor", {}).get(curve, "")
        parts = [facts[part][curve]["f2"] for part in ("observed", "unobserved")]
        values = [f"{value:.2f}" for value in (*(score[m] for m in SHOWN), *parts)]
        rows.append([f"{CURVE_NAMES.get(curve, curve)} ({sensor})", *values])
    head = [facts.get("against", ""), "precision", "recall", "F2", "F2 seen", "F2 unseen"]
    yield table(head, rows, numbers=5)
    yield (
        '<p class="soft">Of the map\'s occupied cells, precision is the share that are walls; '
        "recall is the share of the walls that the map has; F2 weighs recall higher. Seen cells "
        "are those that some scan observed: in the others only the prior speaks. In brackets the "
        "sensor's P(occupied) of a hit and of a miss.</p>"
    )


def _maps(run: RunFile) -> Iterator[str]:
    evidence, layers = run.evidence(), run.layers
    walls: Bools = layers.get("wall", np.zeros(run.geometry.shape)) > 0
    scored: Bools = layers.get("truth_scored", np.zeros(run.geometry.shape)) > 0
    shown = walls | scored
    extent = around(shown if shown.any() else evidence.visits() > 0, run.geometry)
    extent = (extent[0] - MARGIN, extent[1] - MARGIN, extent[2] + MARGIN, extent[3] + MARGIN)
    part = window(extent, run.geometry)
    geometry, path = run.geometry.window(*part), run.poses[:, :2]
    yield '<h2>Maps</h2><div class="row">'
    maps = {run.main: "The map with the plan's prior", "none": "The map without a prior"}
    if run.main == "none":
        maps = {"none": "The map"}
    for curve, caption in maps.items():
        if curve in run.curves:
            cells = gray(run.curves[curve].of(evidence))[part]
            said = f"{caption}: white is empty, black occupied, the path green."
            yield figure(map_drawing(cells, geometry, path, caption), text(said))
    if scored.any():
        wall = (layers["truth_wall"] > 0) & scored
        occupied = run.curves[run.main].of(evidence).occupied()
        cells = errors(occupied, wall, scored)[part]
        legend = "".join(
            key(colour, word)
            for colour, word in ((FOUND, "found"), (MISSED, "missed"), (FALSE, "false"))
        )
        caption = f"Walls {text(run.facts.get('against', ''))}:{legend}"
        yield figure(map_drawing(cells, geometry, path, "Errors of the map"), caption)
    yield "</div>"


def _curves(run: RunFile) -> Iterator[str]:
    seconds = (run.times_ns - run.times_ns[0]) / 1e9
    values = {name: ratios(counts.sum(axis=1)) for name, counts in run.counts.items()}
    legend = "".join(
        key(CURVE_COLOURS.get(name, (0, 0, 0)), CURVE_NAMES.get(name, name)) for name in values
    )
    yield '<h2>Scores over time</h2><div class="row">'
    for metric in ("f2", "precision", "recall"):
        column = ("precision", "recall", "f2").index(metric)
        lines = [
            Curve(CURVE_NAMES.get(name, name), CURVE_COLOURS.get(name, (0, 0, 0)), v[:, column])
            for name, v in values.items()
        ]
        title = f"{NAMES[metric]} over time"
        yield figure(chart(seconds, lines, "s", title), f"{NAMES[metric]}:{legend}")
    yield "</div>"


def _deviations(run: RunFile) -> Iterator[str]:
    """The plan against the building, wall by wall, where there was a plan."""
    try:
        found = of_run(run)
    except FormatError:
        return
    import cv2

    facts, each = found.facts(), listed(found, Pose(0.0, 0.0, 0.0))
    metres: dict[str, float] = facts["metres"]
    seen = sum(metres[state] for state in ("confirmed", "moved", "not there"))
    yield "<h2>The plan against the building</h2>"
    rows = [
        [state, f"{metres[state]:.1f}", f"{metres[state] / seen:.0%}" if seen else ""]
        for state in ("confirmed", "moved", "not there")
    ]
    rows += [[state, f"{metres[state]:.1f}", ""] for state in ("unseen", "found")]
    yield table(["walls", "m", "of those seen"], rows, numbers=2)
    done, data = cv2.imencode(".png", deviation_picture(found))
    if done:
        said = "Walls of the plan by what the scans say of them, and faces that it lacks."
        yield figure(picture(data.tobytes(), said), text(said))
    deviant = [w for w in each["walls"] if w["state"] in ("moved", "not there")]
    deviant += [{**w, "state": "not in the plan"} for w in each["found"] if w["inside"]]
    deviant.sort(key=lambda wall: -wall["length"])
    if deviant:
        lines = [
            [w["id"], w["state"], *(f"{v:.2f}" for v in (*w["from"], *w["to"], w["length"]))]
            for w in deviant[:MOST_WALLS]
        ]
        yield table(["wall", "", "from x", "y", "to x", "y", "m long"], lines, numbers=5)
        if len(deviant) > MOST_WALLS:
            more = len(deviant) - MOST_WALLS
            yield f'<p class="soft">and {more} shorter ones: see <code>replay deviation</code></p>'


def _settings(run: RunFile) -> Iterator[str]:
    """Options, those that differ from the defaults first; versions; what was read."""
    usual = {name: str(_plain(value)) for name, value in DEFAULTS.items()}
    rows = [[name, _plain(value)] for name, value in run.settings.items()]
    given = [row for row in rows if str(row[1]) != usual.get(str(row[0]), "none")]
    rest = [row for row in rows if row not in given]
    yield "<h2>Settings</h2><h3>Given</h3>" + table(["", ""], given)
    yield f"<h3>Defaults</h3><p>{', '.join(f'{text(n)} {text(v)}' for n, v in rest)}</p>"
    yield "<h2>Versions and inputs</h2>"
    versions = list(run.facts.get("versions", {}).items())
    yield table(["", ""], versions)
    yield table(["input", "SHA-256"], list(run.facts.get("inputs", {}).items()))


def _plain(value: Any) -> Any:
    """An option as a person would say it; as the result's JSON has it."""
    if isinstance(value, list | tuple):
        return ", ".join(str(_plain(item)) for item in value)
    if isinstance(value, float):
        return f"{value:g}"
    return "none" if value is None or value == "" else value
