"""paper(): every table and figure of the paper, with its claims checked, as one page."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

from formats.errors import UsageError
from formats.output import check_output, write_bytes, write_text
from replay.reproduction import course, drawings, floor, maps, optimising, real, stale, tables
from replay.reproduction.claims import Section
from replay.reproduction.page import page
from replay.reproduction.studies import Study

Files = str | PathLike[str]
TITLE = "Informative Bayesian map priors: the paper reproduced"


class Rows:
    """The rows by their ids; what several share is made once."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self._runs: course.Runs | None = None

    @property
    def runs(self) -> course.Runs:
        """The simulated course."""
        if self._runs is None:
            self._runs = course.Runs.made()
        return self._runs


# Row -> how it is made, in the order of the page.
ROWS: dict[str, Callable[[Rows], Section]] = {
    "X8": lambda rows: drawings.x8(rows.study),
    "G2": lambda rows: drawings.g2(),
    "G3": lambda rows: optimising.g3(rows.study),
    "G4": lambda rows: optimising.g4(rows.study),
    "T1": lambda rows: tables.t1(rows.study),
    "T2": lambda rows: tables.t2(rows.study),
    "X6": lambda rows: optimising.x6(rows.study),
    "G5": lambda rows: maps.g5(),
    "X3": lambda rows: maps.x3(rows.study),
    "G6": lambda rows: maps.g6(rows.study),
    "X5": lambda rows: maps.x5(rows.study),
    "X4": lambda rows: stale.x4(rows.study),
    "X7": lambda rows: maps.x7(rows.study),
    "G7": lambda rows: course.g7(rows.runs),
    "X1": lambda rows: course.x12("X1", rows.runs),
    "X2": lambda rows: course.x12("X2", rows.runs),
    "G8": lambda rows: floor.g8(),
}
REAL = ("G7", "X1", "X2", "G8")  # what recorded logs have a say in


def paper(
    output: Files = "paper",
    *,
    rows: Sequence[str] | None = None,
    logs: Files | None = None,
    study: Study | None = None,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Reproduce the paper.

    Args:
        output: a folder, made where it is not there: report.html, claims.csv, and the figures.
        rows: ids of ROWS; None: all of them.
        logs: the folder of recorded logs; None: $REPLAY_SHARED_DATA or ../shared/data, if there.
        study: drawings and cell sizes; None: all five at 3, 5 and 10 pixels.
        force: replace what is there.
        progress: is told (done, all) rows.

    Returns:
        what `--json` prints: the claims with their verdicts.

    Raises:
        UsageError: there is no such row.
        FormatError: the output cannot be written.
    """
    wanted = list(ROWS) if rows is None else list(dict.fromkeys(rows))
    for row in wanted:
        if row not in ROWS:
            raise UsageError("", f"there is no row {row!r}", hint=f"there are {', '.join(ROWS)}")
    folder = Path(output)
    if folder.is_file():
        raise UsageError(folder, "is a file, not a folder")
    folder.mkdir(parents=True, exist_ok=True)
    check_output(folder / "report.html", force=force)
    made, seconds, shared = {}, {}, Rows(study or Study())
    for k, row in enumerate(wanted):
        start = perf_counter()
        made[row] = ROWS[row](shared)
        seconds[row] = perf_counter() - start
        if progress:
            progress(k + 1, len(wanted) + 1)
    start = perf_counter()
    if set(REAL) <= set(made):
        real.add_real(made, None if logs is None else Path(logs))
        seconds["recorded logs"] = perf_counter() - start
    if progress:
        progress(len(wanted) + 1, len(wanted) + 1)
    files = outputs(list(made.values()))
    for name in files:
        check_output(folder / name, force=force)
    for name, data in files.items():
        write_bytes(folder / name, data, force=force)
    write_text(folder / "report.html", page(TITLE, list(made.values())), force=force)
    return {
        "claims": [
            {
                "row": row,
                "claim": claim.text,
                "verdict": claim.verdict,
                "numbers": claim.numbers,
                "why": claim.why,
            }
            for row, section in made.items()
            for claim in section.claims
        ],
        "written": [str(folder / name) for name in ("report.html", *files)],
        "seconds": seconds,
    }


def outputs(sections: Sequence[Section]) -> dict[str, bytes]:
    """Claims as a table, and every figure by itself."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["row", "claim", "verdict", "numbers", "why"])
    for section in sections:
        for claim in section.claims:
            table.writerow([section.row, claim.text, claim.verdict, claim.numbers, claim.why])
    files = {"claims.csv": text.getvalue().encode()}
    for section in sections:
        for k, (_, png) in enumerate(section.figures):
            files[f"{section.row}_{k + 1}.png"] = png
    return files


def report(facts: dict[str, Any]) -> str:
    """The claims as lines that a person reads."""
    lines = []
    for claim in facts["claims"]:
        lines.append(f"{claim['row']:<4}{claim['verdict']:<17}{claim['claim']}")
        if claim["numbers"]:
            lines.append(f"{'':<21}{claim['numbers']}")
        if claim["why"] and claim["verdict"] != "holds":
            lines.append(f"{'':<21}because: {claim['why']}")
    verdicts = [claim["verdict"] for claim in facts["claims"]]
    lines.append(
        f"claims  {verdicts.count('holds')} hold, {verdicts.count('does not hold')} do not, "
        f"{verdicts.count('cannot be tested')} cannot be tested"
    )
    lines.append(f"wrote   {facts['written'][0]} and {len(facts['written']) - 1} files beside it")
    return "\n".join(lines)
