"""What is compared, and how it came out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from replay.archive.places import Place
from replay.archive.priors import Values
from replay.scoring.intervals import Paired

if TYPE_CHECKING:
    import pandas as pd

Ints = npt.NDArray[np.int64]


class Side(NamedTuple):
    """One of what is compared.

    Attributes:
        label: of it.
        place: its archive.
        values: of its prior; what is not said is as it was.
        curve: "none", "bayes", "paper"; "" for each result's own.
    """

    label: str
    place: Place
    values: Values
    curve: str


@dataclass
class Versus:
    """A side against the first one.

    Attributes:
        label: of the side.
        paired: difference of the metric over all logs together, first taken away, with its 95 %
            interval (logs drawn anew) and p.
        median: of the differences log by log.
        wins, losses, ties: logs in which it is better, worse, equal.
        worst: (name, difference) of the logs that lose most.
    """

    label: str
    paired: Paired
    median: float
    wins: int
    losses: int
    ties: int
    worst: list[tuple[str, float]]


@dataclass
class Comparison:
    """Sides on the logs that all of them have.

    Attributes:
        metric: that is compared.
        sides: the first is what the others are held against.
        names: of the logs, sorted.
        values: (sides, logs) the metric.
        counts: (sides, logs, 4) tp, fp, fn, tn.
        versus: each other side.
        alone: label -> names of logs that not all sides have.
        failed: label -> name -> error.
        found: label -> log -> the result's name in its archive.
    """

    metric: str
    sides: list[Side]
    names: list[str]
    values: npt.NDArray[np.float64]
    counts: Ints
    versus: list[Versus]
    alone: dict[str, list[str]] = field(default_factory=dict)
    failed: dict[str, dict[str, str]] = field(default_factory=dict)
    found: dict[str, dict[str, str]] = field(default_factory=dict)

    def rows(self) -> list[dict[str, Any]]:
        """A row for each log: the metric of every side, and differences to the first."""
        labels = [side.label for side in self.sides]
        rows = []
        for i, name in enumerate(self.names):
            each = dict(zip(labels, self.values[:, i].tolist(), strict=True))
            less = {f"{label} - {labels[0]}": each[label] - each[labels[0]] for label in labels[1:]}
            rows.append({"log": name, **each, **less})
        return rows

    def frame(self) -> pd.DataFrame:
        """The rows as a DataFrame."""
        from replay.archive.tables import frame

        return frame(self.rows())

    def _repr_html_(self) -> str:
        from replay.archive.tables import html_table

        return html_table(self.rows(), f"{self.metric}, {len(self.names)} logs")
