"""Small JSON files of ours: an object that names its format and version."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from formats.errors import FormatError
from formats.errors import Path as AnyPath
from formats.output import write_text

LARGEST = 1_000_000  # bytes: such a file has a few hundred


class Kind(NamedTuple):
    """What such a file is.

    Attributes:
        format, version: as it names them.
        other: what is wrong with a file that is another: "is no placement of a plan".
        hint: where to get one.
    """

    format: str
    version: int
    other: str
    hint: str


def write_small_json(
    path: AnyPath,
    kind: Kind,
    values: Mapping[str, Any],
    *,
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> None:
    """Write values; numbers read back to the same bits.

    Raises:
        FormatError: it cannot be written.
    """
    whole = {"format": kind.format, "version": kind.version, **values}
    write_text(path, json.dumps(whole, indent=1) + "\n", force=force, inputs=inputs)


def read_small_json(path: AnyPath, kind: Kind) -> dict[str, Any]:
    """The object in a file, format and version left out.

    Raises:
        FormatError: not readable, of another kind, or of a later version.
    """
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST:
            raise FormatError(path, f"{kind.other}: too large", hint=kind.hint)
        value = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise FormatError(path, "is not JSON", hint=kind.hint) from None
    if not isinstance(value, dict) or value.get("format") != kind.format:
        raise FormatError(path, kind.other, hint=kind.hint)
    if (found := value.get("version")) != kind.version:
        raise FormatError(path, f"is of version {found!r}; this program reads {kind.version}")
    return {name: item for name, item in value.items() if name not in ("format", "version")}
