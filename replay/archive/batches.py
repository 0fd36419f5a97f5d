"""What a batch found and did, and what it tells while it works."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

Watch = Callable[["Event"], object]


@dataclass(frozen=True)
class Event:
    """What has just happened to a log.

    Attributes:
        name: of the result.
        state: "hash", "begun", "running", "done", "failed".
        done, all: logs; of "running", scans.
        said: the error, or "".
        f2: of the main curve of a result.
        seconds: that it took.
    """

    name: str
    state: str
    done: int
    all: int
    said: str = ""
    f2: float | None = None
    seconds: float = 0.0


@dataclass
class Batch:
    """What a batch found and did.

    Attributes:
        archive: where the results are.
        done: name -> facts of the results that were made now.
        kept: name -> facts of those that were there.
        failed: name -> error, now or before.
        same: log -> the name of the result that its content already has.
        lossy: names of results whose logs had lost data.
    """

    archive: str
    done: dict[str, dict[str, Any]] = field(default_factory=dict)
    kept: dict[str, dict[str, Any]] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    same: dict[str, str] = field(default_factory=dict)

    @property
    def lossy(self) -> list[str]:
        """Names of results whose logs had lost data."""
        return [name for name, facts in self.results.items() if facts.get("lost")]

    @property
    def results(self) -> dict[str, dict[str, Any]]:
        """Name -> facts of all results that were asked for, sorted."""
        return dict(sorted({**self.kept, **self.done}.items()))

    def rows(self) -> list[dict[str, Any]]:
        """A row for each log that was asked for, sorted by name."""
        rows = [
            {"result": name, "state": "done", "log": facts.get("log", "")}
            | {f"f2_{curve}": f2 for curve, f2 in facts.get("f2", {}).items()}
            | {"lost": facts.get("lost", 0), "error": ""}
            for name, facts in self.results.items()
        ]
        rows += [
            {"result": name, "state": "failed", "error": error}
            for name, error in self.failed.items()
        ]
        return sorted(rows, key=lambda row: row["result"])

    def frame(self) -> pd.DataFrame:
        """The rows as a DataFrame."""
        from replay.archive.tables import frame

        return frame(self.rows())

    def _repr_html_(self) -> str:
        from replay.archive.tables import html_table

        return html_table(self.rows(), f"{len(self.results)} results, {len(self.failed)} failed")
