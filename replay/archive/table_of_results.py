"""results(): an archive as a DataFrame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from formats.errors import FormatError, Notes
from formats.results.kept import Kept, read_kept
from replay.archive.finding import results_in
from replay.archive.places import Place, local
from replay.archive.rescored import failures

if TYPE_CHECKING:
    import pandas as pd

FACTS = ("log", "scan", "poses", "poses_depend_on", "scans", "skipped", "lost", "log_seconds")
SIMPLE = (str, int, float, bool, type(None))


def results(archives: Place | Iterable[Place], notes: Notes | None = None) -> pd.DataFrame:
    """What every result of archives says of itself, a row each: settings, facts and scores.

    Args:
        archives: as for `rescore`.
        notes: takes what was odd.

    Returns:
        columns: result, error ("" unless it cannot be read or its log failed), FACTS, the metrics
        of each curve (f2_bayes, ...), explored, and every setting by its name.

    Raises:
        FormatError: an archive is not there.
    """
    from replay.archive.tables import frame

    rows: list[dict[str, Any]] = []
    for one in results_in(archives):
        try:
            rows.append(
                {"result": one.name, "error": "", **row_of(read_kept(local(one.place), notes))}
            )
        except FormatError as error:
            rows.append({"result": one.name, "error": error.problem})
    rows += [{"result": name, "error": error} for name, error in failures(archives).items()]
    return frame(rows)


def row_of(kept: Kept) -> dict[str, Any]:
    """A result's facts, scores and settings in simple values."""
    scores = {
        f"{metric}_{curve}": score[metric]
        for curve, score in (kept.facts.get("scores") or {}).items()
        for metric in ("precision", "recall", "f2")
    }
    settings = {
        name: value if isinstance(value, SIMPLE) else str(value)
        for name, value in kept.settings.items()
        if name not in FACTS
    }
    facts = {name: kept.facts.get(name) for name in FACTS}
    return {**facts, **scores, "explored": kept.facts.get("explored"), **settings}
