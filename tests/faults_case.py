"""One fault: how its files are made, and what must come of `replay run` on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from formats.grid import Evidence

Map = Literal["same", "part", "own"]
"""Of the evidence: equal to the sound log's; nowhere above it, and some; or something of its own.

"part" is what remains when data are missing. "own" is for faults whose readings differ by design,
and must say in `least` how much at least is there.
"""


@dataclass
class Given:
    """What a case made: arguments for the command line.

    Attributes:
        log: the LOG, or several.
        plan: the PLAN, where it is not the sound one.
        options: more arguments.
        like: a sound log whose evidence this one must give, instead of the sound drive's.
        check: looks at the evidence.
    """

    log: Path | str | Sequence[Path | str] | None = None
    plan: Path | str | None = None
    options: Sequence[str | Path] = ()
    like: Path | None = None
    check: Callable[[Evidence], object] | None = None


@dataclass(frozen=True)
class Case:
    """One row of the table of faults, or one of several that a row names.

    Attributes:
        row: of the table.
        name: of the case.
        make: writes the files into a folder.
        says: words, each of which one line on stderr must hold (together with the file's name).
        code: the exit code.
        map: see Map; where the code is 1 or 2 nothing may be written.
        least: share of the sound run's readings that must be there.
        quiet: nothing at all may be said.
    """

    row: int
    name: str
    make: Callable[[Path], Path | Given]
    says: tuple[str, ...]
    code: int
    map: Map
    least: float
    quiet: bool

    def __str__(self) -> str:
        return f"{self.row} {self.name}"


@dataclass
class Table:
    """Cases of a module; used as a decorator of the functions that make their files."""

    cases: list[Case] = field(default_factory=list)

    def __call__(
        self,
        row: int,
        name: str,
        *says: str,
        code: int = 0,
        map: Map = "same",
        least: float = 0.3,
        quiet: bool = False,
    ) -> Callable[[Callable[[Path], Path | Given]], Callable[[Path], Path | Given]]:
        """Add a case; without words, nothing but the outcome is checked."""

        def add(make: Callable[[Path], Path | Given]) -> Callable[[Path], Path | Given]:
            self.cases.append(Case(row, name, make, says, code, map, least, quiet))
            return make

        return add
