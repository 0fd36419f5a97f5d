"""What a batch is to do: logs with their plans, truths and options, from CSV, YAML or a list."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from formats.errors import FormatError, UsageError
from formats.frame import Pose
from replay.archive.places import is_remote, local
from replay.options import Options

FILES = ("prior", "truth", "align", "prior_values", "plan_edits")  # of a run, besides its logs
SUFFIXES = (".csv", ".yaml", ".yml")
LARGEST = 50_000_000  # bytes of a manifest


@dataclass(frozen=True)
class Job:
    """One run of a batch.

    Attributes:
        logs: one log, or several of one run.
        name: of the result within the archive, without its suffix.
        files: from FILES -> path or address.
        options: of `run`, by name.
    """

    logs: tuple[str, ...]
    name: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)


@cache
def _types() -> dict[str, Any]:
    hints: dict[str, Any] = get_type_hints(Options)
    return hints


def option_of(name: str, value: Any, where: str = "") -> Any:
    """An option's value from text, or from what JSON and YAML have.

    Raises:
        UsageError: there is no such option, or it cannot be one of its values.
    """
    types = _types()
    if name not in types:
        from difflib import get_close_matches

        close = get_close_matches(name, [*types, *FILES], 1)
        hint = f"did you mean {close[0]}?" if close else ""
        raise UsageError(where, f"there is no option {name}", hint=hint)
    if value is None or value == "":
        return None
    kinds = _kinds(types[name])
    parts: Any = value.split(",") if isinstance(value, str) else value
    try:
        if Pose in kinds:
            return Pose(*map(float, [*parts, 0.0][:3]))
        for kind in kinds:
            if isinstance(kind, type) and issubclass(kind, tuple) and kind is not tuple:
                return kind(*map(float, parts))  # type: ignore[arg-type]
        if tuple in [get_origin(kind) for kind in kinds]:
            return tuple(map(float, parts))
        if bool in kinds:
            return str(value).lower() in ("1", "true", "yes", "on")
        if int in kinds and float not in kinds:
            return int(value)
        if float in kinds:
            return float(value)
    except (TypeError, ValueError):
        raise UsageError(where, f"{name} is {value!r}") from None
    return str(value)


def _kinds(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def read_manifest(path: str) -> list[Job]:
    """The jobs of a manifest: a row, or an entry of `logs`, for each; `defaults` for all.

    Columns and keys: log, name, prior (or plan), truth, align, prior_values, plan_edits, and the
    options of `run` by their names. Paths are relative to the manifest.

    Raises:
        FormatError: it cannot be read.
        UsageError: an unknown column, or a value that is not possible.
    """
    place = local(path)
    try:
        if place.stat().st_size > LARGEST:
            raise FormatError(path, "is too large for a manifest")
        text = place.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise FormatError(path, "is not text") from None
    if path.lower().endswith(".csv"):
        rows = [dict(row) for row in csv.DictReader(io.StringIO(text))]
        if rows and None in rows[0]:
            raise FormatError(path, "has rows of more cells than its head")
    else:
        rows = _entries(path, text)
    base = path.rsplit("/", 1)[0] if is_remote(path) else os.fspath(Path(path).parent)
    jobs = [_job(row, base, f"{path}: entry {n}") for n, row in enumerate(rows, 1)]
    if not jobs:
        raise FormatError(path, "names no logs")
    return jobs


def _entries(path: str, text: str) -> list[dict[str, Any]]:
    import yaml

    try:
        value = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        problem = str(error).replace("\n", " ")
        raise FormatError(path, f"is not YAML: {problem}") from None
    defaults = value.get("defaults") or {} if isinstance(value, dict) else {}
    entries = value.get("logs") if isinstance(value, dict) else value
    if not isinstance(entries, list) or not isinstance(defaults, dict):
        raise FormatError(path, "is neither a list of logs nor `logs:` with `defaults:`")
    rows = [entry if isinstance(entry, dict) else {"log": entry} for entry in entries]
    return [{**defaults, **row} for row in rows]


def _job(row: Mapping[str, Any], base: str, where: str) -> Job:
    said = {str(name).strip().replace("-", "_"): value for name, value in row.items()}
    if "plan" in said:
        said["prior"] = said.pop("plan")
    logs = said.pop("log", None) or said.pop("logs", None)
    if not logs:
        raise UsageError(where, "names no log", hint="its column or key is `log`")
    name = str(said.pop("name", None) or "")
    files = {kind: _beside(base, str(said[kind])) for kind in FILES if said.get(kind)}
    options = {
        key: option_of(key, value, where)
        for key, value in said.items()
        if key not in FILES and value not in (None, "")
    }
    named = logs if isinstance(logs, list) else [logs]
    return Job(tuple(_beside(base, str(log)) for log in named), name, files, options)


def _beside(base: str, path: str) -> str:
    if is_remote(path) or Path(path).is_absolute():
        return path
    return f"{base}/{path}" if is_remote(base) else os.path.normpath(Path(base, path))
