"""What a run says of itself: how it chose, what it rests on, and its scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from formats.errors import Notes, printable
from formats.log import Log
from formats.result import Counts, Split
from formats.stream import Drive
from replay.options import Options
from replay.pictures import CURVE_NAMES
from replay.prior import breaks_e13
from replay.scoring.count_metrics import METRICS
from replay.scoring.history import History
from replay.surveying.deviations import Deviations
from replay.world import World

SHOWN = ("precision", "recall", "f2")
WALL_WORDS = {  # for the colours of replay.pictures.WALL_COLOURS
    "confirmed": "blue",
    "moved": "orange",
    "not there": "red",
    "unseen": "grey",
    "found": "green",
}


def said(
    world: World, drive: Drive, notes: Notes, poses: str = "", truth: str = ""
) -> dict[str, list[str]]:
    """Topic of the line -> lines: what was chosen and why.

    Args:
        poses: a line on the poses, where a localiser found them.
        truth: a line on their errors, where they were judged.
    """
    geometry, frame = world.geometry, drive.choice.map_frame or "map"
    size = f"{geometry.cols} x {geometry.rows} cells of {geometry.resolution:g} m"
    lines = [f"none: no prior; {size}"]
    if world.plan is not None:
        rows, cols = world.plan.occupancy.shape
        x, y, yaw = world.map_to_plan
        name = printable(world.plan.path.name)
        lines = [
            f"{name}: {cols} x {rows} px of {world.plan.scale:g} m, {size}",
            *(note.problem for note in notes.of("info") if note.path == str(world.plan.path)),
            f"its frame lies at x {x:.3f} m, y {y:.3f} m, yaw {yaw:.4f} rad in {frame}",
        ]
    log = [printable(reason, 400) for reason in drive.choice.reasons]
    more = {"poses": [poses] if poses else [], "truth": [truth] if truth else []}
    return {"plan": lines, "log": log, **{word: some for word, some in more.items() if some}}


def markdown(
    title: str, lines: Mapping[str, Sequence[str]], found: Mapping[str, Any] | None = None
) -> str:
    """The same for the viewer's text panel, with the scores where the run has ended.

    Args:
        title: of the panel.
        lines: what `said` gives.
        found: what `--json` prints of the run.
    """
    text = [f"# {printable(title)}"]
    if found and found.get("scores"):
        text += ["", f"| {found['against']} | precision | recall | F2 |", "|---|---|---|---|"]
        for name, score in found["scores"].items():
            numbers = " | ".join(f"{score[key]:.2f}" for key in SHOWN)
            text.append(f"| {CURVE_NAMES.get(name, name)} | {numbers} |")
        text += [
            "",
            f"{found['scans']} scans, {found['explored']:.0%} of the scored cells seen",
            "",
        ]
    if found and found.get("walls"):
        text += ["", "| walls of the plan | m | colour |", "|---|---|---|"]
        for state, metres in found["walls"]["metres"].items():
            text.append(f"| {state} | {metres:.1f} | {WALL_WORDS[state]} |")
        text.append("")
    text += [f"- **{word}** {line}" for word, texts in lines.items() for line in texts]
    text += [f"- {printable(note, 400)}" for note in (found or {}).get("notes", [])]
    return "\n".join(text)


def warn(world: World, options: Options, notes: Notes) -> None:
    """What the user should know before believing the scores."""
    about = world.plan.path if world.plan is not None else ""
    levels = world.curves["none"].p_levels
    if levels[0] > levels[-1]:
        notes.warn(about, "--p-hit is below --p-miss: hits make cells empty (both are P(OCCUPIED))")
    if world.plan is not None and options["p_wall"] > options["p_space"]:
        notes.warn(
            about, "--p-wall is above --p-space: walls are expected empty (both are P(EMPTY))"
        )
    if options["update"] == "paper" and world.plan is not None:
        levels = world.curves["paper"].p_levels
        asked = options["p_wall"], options["p_space"], options["prior_scale"]
        broken = breaks_e13(1 - levels[0], 1 - levels[-1], *asked)
        if broken:
            notes.warn(world.plan.path, broken)


def warn_elsewhere(found: Deviations, plan: Path, notes: Notes) -> None:
    """What the walls say against the plan."""
    if found.contradicted:
        problem = (
            "most of its walls that were seen are not there: it is another building's, or lies"
        )
        hint = "look at `replay align`, or give --plan-pose"
        notes.warn(plan, f"{problem} elsewhere, or is no more than a sketch; {hint}")


def origin(world: World, drive: Drive, log: Log) -> dict[str, Any]:
    """What the result rests on: versions, hashes, choices."""
    truth = world.truth
    against = "against nothing: no plan (--prior) and no truth (--truth)"
    if truth is not None:
        name = "the plan" if truth is world.plan else printable(truth.path.name)
        against = f"against {name}"
    return {
        "versions": {name: version(name) for name in ("plan-replay", "numpy", "numba", "rosbags")},
        "log": str(log.path),
        "container": log.container.kind,
        "plan": None if world.plan is None else str(world.plan.path),
        "truth": None if truth is None or truth is world.plan else str(truth.path),
        "against": against,
        "inputs": world.inputs,
        "scan": drive.choice.scan.name,
        "poses": str(drive.choice.source),
        "map_frame": drive.choice.map_frame,
        "base_frame": drive.choice.base_frame,
        "scans_in_log": drive.total,
        "sensor": {name: sensor_of(curve.p_levels) for name, curve in world.curves.items()},
    }


def sensor_of(p_levels: Sequence[float]) -> str:
    """A curve's sensor as P(occupied) of a full hit and a full miss: "0.7 / 0.4"."""
    return f"{round(1 - p_levels[0], 6):g} / {round(1 - p_levels[-1], 6):g}"


def ended(history: History, region: str, notes: Notes) -> dict[str, Any]:
    """The scores after the last frame, and how the run went, as --json has them."""
    return {
        **scores(history, region),
        "scans": len(history),
        "skipped": notes.total("skipped"),
        "lost": notes.total("lost"),
        "log_seconds": history.seconds,
        "notes": [f"{note.kind}: {note}" for note in notes if note.kind != "info"],
    }


def scores(history: History, region: str) -> dict[str, Any]:
    """The last frame's counts as --json has them.

    Args:
        history: of the run.
        region: "observed" scores the observed cells alone.
    """
    last = history.last()
    splits = {name: Split(Counts(*row[:4]), Counts(*row[4:])) for name, row in last.items()}
    whole = {n: s.observed if region == "observed" else s.whole for n, s in splits.items()}
    some = next(iter(splits.values()))
    return {
        "scores": {name: measured(counts) for name, counts in whole.items()},
        "observed": {name: measured(split.observed) for name, split in splits.items()},
        "unobserved": {name: measured(split.unobserved) for name, split in splits.items()},
        "explored": sum(some.observed) / max(sum(some.whole), 1),
    }


def measured(counts: Counts) -> dict[str, Any]:
    """Precision, recall and F2, and what they are made of."""
    return {name: METRICS[name](counts) for name in SHOWN} | counts._asdict()
