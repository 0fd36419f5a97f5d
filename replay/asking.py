"""What a run is asked for: options, inputs and outputs, checked before its log is opened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from os.path import realpath
from pathlib import Path
from typing import Any, NamedTuple

from formats.errors import Notes, UsageError
from formats.output import check_output
from formats.plans.edits import PlanEdits, read_plan_edits
from formats.plans.file import open_plan
from formats.plans.plan import Plan
from formats.plans.prior_values import read_prior_values
from replay.options import Options, effective, plan_values
from replay.sensors.models import MODELS

Source = str | PathLike[str]


class Asked(NamedTuple):
    """A run that can begin.

    Attributes:
        logs: of one run.
        out: the result file.
        plan: as its file says; None: there is none.
        truth: another plan; None: the plan is the truth.
        edits: by hand, of the plan.
        chosen: every option.
        settings: these, and the inputs by name, for the result.
        inputs: every file that is read and must not be replaced.
        main: the curve that is shown: "none" without a plan.
    """

    logs: list[Path]
    out: Path
    plan: Plan | None
    truth: Plan | None
    edits: PlanEdits | None
    chosen: Options
    settings: dict[str, Any]
    inputs: list[Path]
    main: str


def ask(
    logs: Source | Sequence[Source],
    prior: Source | None,
    options: Mapping[str, Any],
    notes: Notes,
    *,
    truth: Source | None = None,
    output: Source | None = None,
    force: bool = False,
    rrd: Source | None = None,
    align: Source | None = None,
    prior_values: Source | None = None,
) -> Asked:
    """Check what `run` was given, and open its plans; the arguments are those of `run`.

    Raises:
        FormatError: a plan cannot be used, or an output cannot be written.
        UsageError: an option is not possible.
    """
    values = read_prior_values(prior_values).options() if prior_values else {}
    chosen = effective({**values, **options})
    sources = [Path(logs)] if isinstance(logs, str | PathLike) else [Path(log) for log in logs]
    if chosen["sensor"] not in MODELS:
        hint = f"there are {', '.join(MODELS)}"
        raise UsageError(chosen["sensor"], "no such sensor model", hint=hint)
    by_hand = chosen["plan_edits"]
    read = (prior, truth, align, prior_values, by_hand)
    inputs = [*sources, *(Path(path) for path in read if path)]
    out = Path(output) if output else Path(f"{stem(sources[0])}.replay.mcap")
    written = [out, *([Path(rrd)] if rrd else [])]
    for path in written:
        check_output(path, force=force, inputs=inputs)
    if rrd and realpath(rrd) == realpath(out):
        raise UsageError(rrd, "the recording and the result are one file", hint="name another")
    edits = read_plan_edits(by_hand) if by_hand else None
    if edits and not prior:
        raise UsageError(edits.path, "there is no plan to edit", hint="give --prior PLAN")
    plan = open_plan(prior, notes, **plan_values(chosen)) if prior else None
    real = open_plan(truth, notes) if truth else None
    inputs += [Path(path) for plans in (plan, real) if plans for path in plans.inputs]
    for path in written:  # a yaml beside the plan is an input, too
        check_output(path, force=force, inputs=inputs)
    files = {"logs": sources, "prior": prior, "truth": truth, "prior_values": prior_values}
    main = chosen["update"] if prior else "none"
    return Asked(sources, out, plan, real, edits, chosen, {**files, **chosen}, inputs, main)


def stem(log: Path) -> str:
    """The name that a log's results go by: without `.mcap`, `.bag.gz` and the like."""
    name = "stdin" if log == Path("-") else Path(realpath(log)).name
    return name.split(".")[0] or name


def tell_changed(logs: Sequence[Path], before: Mapping[Path, object], notes: Notes) -> None:
    """Warn of logs that are not what they were."""
    for path in logs:
        if states([path]).items() - before.items():
            notes.warn(path, "changed while it was read: give it again when it is whole")


def states(paths: Sequence[Path]) -> dict[Path, tuple[int, int]]:
    """Size and time of change (ns) of files, and of those right in folders."""
    files = [file for path in paths for file in (path.iterdir() if path.is_dir() else [path])]
    stats = {file: file.stat() for file in files if file.is_file()}
    return {file: (stat.st_size, stat.st_mtime_ns) for file, stat in stats.items()}
