"""report(): results in; one HTML file that needs no network out."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from formats.errors import FormatError, Notes, UsageError
from formats.errors import Path as AnyPath
from formats.output import check_output, write_text
from formats.results.file import RunFile, read_result
from replay.pictures import CURVE_NAMES
from replay.reporting.markup import page, table, text
from replay.reporting.sections import sections

SUFFIX = ".replay.mcap"
MOST_RUNS = 50  # whose sections are in one report; pictures make it large


def report(
    sources: AnyPath | Sequence[AnyPath],
    output: AnyPath | None = None,
    *,
    force: bool = False,
    notes: Notes | None = None,
) -> Path:
    """Write a report of results: summary, maps, errors, curves, deviations, settings, warnings.

    Args:
        sources: result files, and folders that hold some.
        output: the HTML file. None: the first source's name, in the current folder.
        force: replace an existing file.
        notes: takes what was odd.

    Returns:
        the file that was written.

    Raises:
        FormatError: a source cannot be read; the file cannot be written.
        UsageError: there are more than MOST_RUNS.
    """
    notes = Notes() if notes is None else notes
    given = (
        [Path(sources)] if isinstance(sources, str | os.PathLike) else [Path(s) for s in sources]
    )
    paths = [path for source in given for path in _found(source)]
    if len(paths) > MOST_RUNS:
        hint = f"name up to {MOST_RUNS}, or look at `replay rescore`"
        raise UsageError(given[0], f"{len(paths)} results are too many for one report", hint=hint)
    stem = given[0].resolve().name.removesuffix(".mcap").removesuffix(".replay")
    target = Path(output) if output is not None else Path(f"{stem}.report.html")
    check_output(target, force=force, inputs=paths)
    body = list(_overview(stem, paths)) if len(paths) > 1 else []
    for path in paths:
        said = Notes()
        run = read_result(path, said)
        body.append(f'<section id="{_anchor(path, paths)}">')
        body += sections(run, _name(path), said)
        body.append("</section>")
        if notes is not None:
            for n in said:
                notes.add(n.kind, n.path, n.problem, topic=n.topic, at=n.at, count=n.count)
    write_text(target, page(f"{stem}: report", body), force=force, inputs=paths)
    return target


def _overview(title: str, paths: Sequence[Path]) -> Iterator[str]:
    """The scores of all runs in one table."""
    yield f'<h1>{text(title)}</h1><p class="soft">{len(paths)} results</p>'
    rows = []
    for path in paths:
        run = read_result(path)
        scores = run.facts.get("scores", {})
        values = [f"{scores[c]['f2']:.2f}" if c in scores else "" for c in CURVE_NAMES]
        seen = run.facts.get("explored")
        rows.append([_name(path), _settled(run), *values, "" if seen is None else f"{seen:.0%}"])
    head = ["run", "plan", *(f"F2, {name}" for name in CURVE_NAMES.values()), "seen"]
    yield table(head, rows, numbers=4)


def _settled(run: RunFile) -> str:
    return Path(str(run.facts.get("plan") or "")).name


def _anchor(path: Path, paths: Sequence[Path]) -> str:
    return f"run{paths.index(path)}"


def _name(path: Path) -> str:
    return path.name.removesuffix(".mcap").removesuffix(".replay")


def _found(source: Path) -> list[Path]:
    if not source.exists():
        raise FormatError(source, "does not exist")
    if not source.is_dir():
        return [source]
    found = sorted(source.rglob(f"*{SUFFIX}"))
    if not found:
        raise FormatError(source, f"holds no results: no *{SUFFIX}")
    return found
