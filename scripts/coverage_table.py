"""The figures of scripts/coverage: statements and branches by package, and what is below 90 %.

python -m scripts.coverage_table [DATA]
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

from coverage import Coverage

ROOT = Path(__file__).resolve().parent.parent


class Covered(NamedTuple):
    """Statements and branches, how many there are and how many ran."""

    statements: int = 0
    ran: int = 0
    branches: int = 0
    taken: int = 0

    def __add__(self, other: Covered) -> Covered:  # type: ignore[override]
        return Covered(*(a + b for a, b in zip(self, other, strict=True)))

    @property
    def share(self) -> float:
        """Of statements and branches together, as coverage has it; 1 where there is none."""
        every = self.statements + self.branches
        return (self.ran + self.taken) / every if every else 1.0


def modules(data: str) -> dict[str, Covered]:
    """Each module's figures, by its path in the project."""
    measured = Coverage(data_file=data, config_file=str(ROOT / "pyproject.toml"))
    measured.load()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "coverage.json"
        measured.json_report(outfile=str(report))
        files = json.loads(report.read_text())["files"]
    return {
        name: Covered(
            part["num_statements"],
            part["covered_lines"],
            part["num_branches"],
            part["covered_branches"],
        )
        for name, part in ((name, file["summary"]) for name, file in files.items())
    }


def package(name: str) -> str:
    """formats/mcap/log.py is of formats/mcap; formats/grid.py of formats."""
    return str(Path(name).parent)


def line(name: str, part: Covered) -> str:
    """A row of the table."""
    return (
        f"{name:34}{part.ran:7} of {part.statements:6} statements"
        f"{part.taken:7} of {part.branches:6} branches{part.share:8.1%}"
    )


def main() -> None:
    found = modules(sys.argv[1] if len(sys.argv) > 1 else os.environ["COVERAGE_FILE"])
    packages: dict[str, Covered] = defaultdict(Covered)
    for name, part in found.items():
        packages[package(name)] += part
        packages[f"{name.split('/')[0]}/ as a whole"] += part
    for name, part in sorted(packages.items()):
        print(line(name, part))
    print("\nbelow 90 %:")
    for name, part in sorted(found.items(), key=lambda item: item[1].share):
        if part.share < 0.9:
            print(line(name, part))


if __name__ == "__main__":
    main()
