"""deviation(): a result in; a table, GeoJSON and a picture of the plan against the building out."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import Any

from formats.errors import FormatError, Notes
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.output import check_output, write_image, write_text
from formats.results.file import RunFile, read_result
from replay.exporting import FrameName, stem_of
from replay.surveying.compare import TOLERANCE
from replay.surveying.deviations import Deviations, deviations
from replay.surveying.showing import geojson, picture, wall_facts

HERE = Pose(0.0, 0.0, 0.0)
LISTED = 0.5  # m: shorter walls are left out of the table


def deviation(
    result: AnyPath,
    out: AnyPath | None = None,
    *,
    tolerance: float = TOLERANCE,
    frame: FrameName = "plan",
    force: bool = False,
    notes: Notes | None = None,
) -> dict[str, Any]:
    """Compare the plan of a run with what the run saw; its log is not needed.

    Args:
        result: a result file.
        out: a folder that is there, or the stem of the files' names. None: the result's name, in
            the current folder.
        tolerance: m that a wall may lie off and is still confirmed.
        frame: of the coordinates: the plan's, or that of the log's poses.
        force: replace existing files.
        notes: takes what was odd.

    Returns:
        what `replay deviation --json` prints.

    Raises:
        FormatError: the result cannot be read, or had no plan; a file cannot be written.
    """
    run = read_result(result, notes)
    stem = stem_of(Path(result), out)
    paths = [stem.with_name(stem.name + end) for end in ("_deviation.png", "_deviation.geojson")]
    for path in paths:
        check_output(path, force=force, inputs=[result])
    found = of_run(run, tolerance)
    place = HERE if frame == "plan" else run.map_to_plan
    write_image(paths[0], picture(found), force=force, inputs=[result])
    write_text(paths[1], geojson(found, place), force=force, inputs=[result])
    return {
        "result": str(result),
        "plan": run.facts.get("plan"),
        "frame": frame,
        "tolerance": tolerance,
        **found.facts(),
        **listed(found, place),
        "written": [str(path) for path in paths],
    }


def of_run(run: RunFile, tolerance: float = TOLERANCE) -> Deviations:
    """The deviations of a result that was read.

    Raises:
        FormatError: it had no plan.
    """
    wall = run.layers.get("wall")
    if wall is None or not wall.any():
        hint = "give `replay run` the plan as --prior"
        raise FormatError(run.path, "the run had no plan to compare with", hint=hint)
    levels = run.curves.get("none", run.curves[run.main]).p_levels
    return deviations(run.evidence(), run.layers, levels, tolerance)


def listed(found: Deviations, frame: Pose) -> dict[str, Any]:
    """Every wall and every face that was found, with its ends in a frame."""

    def ends(start: tuple[float, float], end: tuple[float, float]) -> dict[str, Any]:
        placed = frame.apply([start, end]).round(3).tolist()
        return {"from": placed[0], "to": placed[1]}

    walls = [{**wall_facts(n, w), **ends(w.start, w.end)} for n, w in found.numbered()]
    extra = [
        {
            "id": f"F{n}",
            "length": round(e.length, 3),
            "thickness": round(e.thickness, 3),
            "inside": e.inside,
            **ends(e.start, e.end),
        }
        for n, e in enumerate(found.found, 1)
    ]
    return {"walls": walls, "found": extra}


def report(facts: dict[str, Any]) -> str:
    """The same for a person: how much of each state, and every wall that deviates."""
    walls, metres = facts["walls"], facts["metres"]
    seen = sum(metres[state] for state in ("confirmed", "moved", "not there"))
    name = Path(facts["plan"]).name if facts["plan"] else "its plan"
    lines = [f"plan    {name}: {seen:.1f} m of {seen + metres['unseen']:.1f} m of wall seen"]
    lines.append(f"{'':<8}{'state':<12}{'walls':>6}{'m':>8}{'of seen':>9}")
    for state in ("confirmed", "moved", "not there", "unseen"):
        count = sum(wall["state"] == state for wall in walls)
        share = "" if state == "unseen" or not seen else f"{metres[state] / seen:>9.0%}"
        lines.append(f"{'':<8}{state:<12}{count:>6}{metres[state]:>8.1f}{share}")
    inside = [extra for extra in facts["found"] if extra["inside"]]
    lines.append(f"{'':<8}{'found':<12}{len(inside):>6}{metres['found']:>8.1f}   not in the plan")
    deviant = [wall for wall in walls if wall["state"] in ("moved", "not there")]
    rows = [wall for wall in deviant if wall["length"] >= LISTED]
    if rows or inside:
        lines.append(
            f"{'wall':<8}{'state':<12}{'from x':>8}{'y':>8}{'to x':>9}{'y':>8}{'moved':>9}"
        )
    for wall in [*rows, *({**extra, "state": "found"} for extra in inside)]:
        (ax, ay), (bx, by) = wall["from"], wall["to"]
        moved = wall.get("moved")
        off = "" if moved is None or isnan(moved) else f"{moved:>+9.2f}"
        lines.append(
            f"{wall['id']:<8}{wall['state']:<12}{ax:>8.2f}{ay:>8.2f}{bx:>9.2f}{by:>8.2f}{off}"
        )
    if short := len(deviant) - len(rows):
        lines.append(f"{'':<8}and {short} shorter than {LISTED:g} m, in the GeoJSON")
    return "\n".join([*lines, *(f"wrote   {path}" for path in facts["written"])])
