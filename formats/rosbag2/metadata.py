"""metadata.yaml of rosbag2 folders, read without trusting it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from formats.errors import Notes

NAME = "metadata.yaml"
ROOT = "rosbag2_bagfile_information"
LARGEST = 16 << 20  # bytes
DEEPEST = 32
NEWEST = 9  # of the versions that rosbag2 has written
LATCHED = re.compile(r"durability:\s*(?:1\b|transient_local)")
Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass
class Metadata:
    """What is used of it.

    Attributes:
        parts: file names, in the folder.
        counts: messages by file name, where it says so.
        total: messages in all, None where it does not say.
        storage: "sqlite3", "mcap" or what it says.
        compressed: "", "file" or "message".
        latched: (topic, type) kept for late joiners.
    """

    parts: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    total: int | None = None
    storage: str = ""
    compressed: str = ""
    latched: set[tuple[str, str]] = field(default_factory=set)


def read_metadata(path: Path, notes: Notes) -> Metadata | None:
    """Read a metadata.yaml; None, with a note, where it is not there or cannot be used."""
    try:
        with path.open("rb") as file:
            raw = file.read(LARGEST + 1)
    except FileNotFoundError:
        notes.warn(path.parent, f"has no {NAME}; its parts are read without")
        return None
    except OSError as error:
        notes.warn(path, f"cannot be read: {error.strerror}")
        return None
    try:
        if len(raw) > LARGEST:
            raise ValueError(f"is larger than {LARGEST} bytes")
        _refuse(raw)
        found = yaml.load(raw, Loader=Loader)
        found = found.get(ROOT) if isinstance(found, dict) else None
        if not isinstance(found, dict):
            raise ValueError(f"holds no {ROOT}")
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        notes.warn(path, f"not used: {_said(error)}")
        return None
    return _metadata(path, found, notes)


def _refuse(raw: bytes) -> None:
    """Raise ValueError for what rosbag2 does not write and what could harm."""
    depth = 0
    for event in yaml.parse(raw, Loader=Loader):
        at = f"line {event.start_mark.line + 1}" if event.start_mark else "an unknown line"
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"a YAML alias at {at}")
        if isinstance(event, yaml.NodeEvent) and getattr(event, "tag", None):
            raise ValueError(f"a YAML tag at {at}")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise ValueError(f"more than {DEEPEST} levels at {at}")


def _said(error: Exception) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        mark = error.problem_mark
        return f"{error.problem} at line {mark.line + 1}, column {mark.column + 1}"
    return " ".join(str(error).split())


def _metadata(path: Path, found: dict[Any, Any], notes: Notes) -> Metadata:
    meta = Metadata(storage=str(found.get("storage_identifier", "")))
    version = found.get("version")
    if not isinstance(version, int) or not 1 <= version <= NEWEST:
        notes.warn(path, f"is of version {version}; versions 1 to {NEWEST} are known")
    for name in _items(found.get("relative_file_paths")):
        if not isinstance(name, str) or not name:
            notes.warn(path, "names a part that is no text")
            continue
        pure = PurePosixPath(name.replace("\\", "/"))
        # Old recorders wrote "folder/part" relative to the folder's parent.
        inside = len(pure.parts) == 1 or (len(pure.parts) == 2 and pure.parts[0] != "..")
        if pure.is_absolute() or not inside or not pure.name or pure.name == "..":
            notes.warn(path, f"names a part outside of its folder, {name!r}; not opened")
            continue
        meta.parts.append(pure.name)
    for entry in _items(found.get("files")):
        if isinstance(entry, dict) and isinstance(entry.get("message_count"), int):
            name = PurePosixPath(str(entry.get("path", ""))).name
            meta.counts[name] = entry["message_count"]
    total = found.get("message_count")
    meta.total = total if isinstance(total, int) else None
    mode = str(found.get("compression_mode") or "").lower()
    meta.compressed = mode if mode in ("file", "message") else ""
    for entry in _items(found.get("topics_with_message_count")):
        topic = entry.get("topic_metadata") if isinstance(entry, dict) else None
        if isinstance(topic, dict) and latched(topic.get("offered_qos_profiles")):
            meta.latched.add((str(topic.get("name")), str(topic.get("type"))))
    return meta


def latched(profiles: object) -> bool:
    """Whether offered QoS profiles, YAML text or its content, keep messages for late joiners.

    Recorders wrote the numbers of rmw's enumeration first (1 is transient local), then its names.
    """
    if isinstance(profiles, str):
        return LATCHED.search(profiles) is not None
    entries = [entry.get("durability") for entry in _items(profiles) if isinstance(entry, dict)]
    return any(durability in (1, "transient_local") for durability in entries)


def _items(value: object) -> Iterator[Any]:
    yield from value if isinstance(value, list) else ()
