"""Rows as CSV, Parquet, a DataFrame or HTML; the one place where pandas and pyarrow are used."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formats.errors import Path as AnyPath
from formats.errors import UsageError, printable
from formats.output import atomic, write_text
from replay.exporting import unarmed

if TYPE_CHECKING:
    import pandas as pd

Row = Mapping[str, Any]
SHOWN = 200  # rows of a table in a notebook


def columns(rows: Sequence[Row]) -> list[str]:
    """The names of all columns in the order in which they come up."""
    return list(dict.fromkeys(name for row in rows for name in row))


def frame(rows: Sequence[Row]) -> pd.DataFrame:
    """The rows as a DataFrame."""
    import pandas as pd

    return pd.DataFrame(list(rows), columns=columns(rows))


def csv_text(rows: Sequence[Row]) -> str:
    """CSV with a head; text that a spreadsheet would take for a formula is quoted with '."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    names = columns(rows)
    table.writerow([unarmed(name) for name in names])
    for row in rows:
        table.writerow([_cell(row.get(name)) for name in names])
    return out.getvalue()


def _cell(value: Any) -> Any:
    if value is None:
        return ""
    return unarmed(printable(value, 10_000)) if isinstance(value, str) else value


def write_table(
    path: AnyPath, rows: Sequence[Row], *, force: bool = False, inputs: Sequence[AnyPath] = ()
) -> None:
    """Write rows whole or not at all, as the suffix says: .csv or .parquet.

    Raises:
        UsageError: another suffix.
        FormatError: it cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        write_text(path, csv_text(rows), force=force, inputs=inputs)
    elif suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        names = columns(rows)
        table = pa.table({name: [row.get(name) for row in rows] for name in names})
        with atomic(path, force=force, inputs=inputs) as part:
            pq.write_table(table, str(part), compression="zstd")
    else:
        raise UsageError(path, "tables are written as .csv or .parquet")


def check_table(path: AnyPath) -> None:
    """Refuse a suffix before the work is done.

    Raises:
        UsageError: neither .csv nor .parquet.
    """
    if Path(path).suffix.lower() not in (".csv", ".parquet"):
        raise UsageError(path, "tables are written as .csv or .parquet")


def html_table(rows: Sequence[Row], caption: str = "") -> str:
    """An HTML table of at most 200 rows, all text escaped."""
    names = columns(rows)
    lines = ["<table>"]
    if caption:
        lines.append(f"<caption>{escape(caption)}</caption>")
    lines.append("<tr>" + "".join(f"<th>{escape(str(name))}</th>" for name in names) + "</tr>")
    for row in rows[:SHOWN]:
        cells = (f"<td>{escape(shown(row.get(name)))}</td>" for name in names)
        lines.append("<tr>" + "".join(cells) + "</tr>")
    if len(rows) > SHOWN:
        lines.append(f"<tr><td>... and {len(rows) - SHOWN} more</td></tr>")
    return "\n".join([*lines, "</table>"])


def shown(value: Any) -> str:
    """A value as a person reads it."""
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else printable(value)
