"""What a reproduction says: claims with a verdict and its numbers, figures, tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

Verdict = Literal["holds", "does not hold", "cannot be tested"]


@dataclass(frozen=True)
class Claim:
    """One claim of the paper, put to the test.

    Attributes:
        text: what the paper says.
        verdict: what was found.
        numbers: the evidence for it, in a line.
        why: where it does not hold or cannot be tested, the reason; else what is worth knowing.
    """

    text: str
    verdict: Verdict
    numbers: str
    why: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of text or numbers.

    Attributes:
        caption: above it.
        head: of the columns.
        rows: as many cells each.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]


@dataclass
class Section:
    """One row of the paper's experiments.

    Attributes:
        row: its id: G2 to G8, T1, T2, X1 to X8.
        title: what it is.
        setup: how it was made here, in a line or two.
        claims, tables: see there.
        figures: caption and PNG.
    """

    row: str
    title: str
    setup: str = ""
    claims: list[Claim] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    figures: list[tuple[str, bytes]] = field(default_factory=list)

    def claim(self, text: str, holds: bool, numbers: str, why: str = "") -> None:
        """Put a claim to the record."""
        verdict: Verdict = "holds" if holds else "does not hold"
        self.claims.append(Claim(text, verdict, numbers, why))

    def untested(self, text: str, why: str) -> None:
        """A claim that nothing here can test."""
        self.claims.append(Claim(text, "cannot be tested", "", why))

    def table(self, caption: str, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table."""
        self.tables.append(Table(caption, head, rows))

    def figure(self, caption: str, png: bytes) -> None:
        """Add a figure."""
        self.figures.append((caption, png))
