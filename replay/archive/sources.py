"""LOGS... of a batch: files, folders, patterns, lists, manifests and addresses, as jobs."""

from __future__ import annotations

import glob
import mmap
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from formats.compression import wrapper
from formats.errors import FormatError, UsageError
from formats.mcap.log import fits as is_mcap
from formats.mcap.records import METADATA, METADATA_INDEX
from formats.opening import HEAD, reader_of
from formats.output import is_folder, is_there
from formats.results.contents import RECORD
from replay.archive.finding import MAGIC
from replay.archive.manifest import SUFFIXES, Job, read_manifest
from replay.archive.places import RESULT, Place, is_remote, join, listed

LISTS = (".txt", ".lst")
SURE = (".bag", ".mcap", ".db3", ".active")  # damaged ones shall fail, not be passed over
LOGS = (".bag", ".mcap", ".db3", ".log", ".clf", ".gz", ".zst", ".bz2", ".lz4", ".active")


def jobs_of(
    logs: Iterable[Place], files: Mapping[str, str], options: Mapping[str, Any]
) -> list[Job]:
    """The runs that are asked for, in the order in which they were named.

    Args:
        logs: files, rosbag2 folders, folders of logs, patterns, lists, manifests, addresses.
        files, options: for all of them; a manifest's own go before these.

    Raises:
        FormatError: something is not there, or no log is found.
        UsageError: a manifest says what is not possible.
    """
    jobs = [job for place in logs for job in _of_one(os.fspath(place))]
    if not jobs:
        raise FormatError(", ".join(map(str, logs)), "holds no logs")
    return [
        replace(job, files={**files, **job.files}, options={**options, **job.options})
        for job in jobs
    ]


def _of_one(text: str) -> Iterator[Job]:
    suffix = Path(text).suffix.lower()
    if suffix in SUFFIXES:
        for job in read_manifest(text):
            yield replace(job, name=job.name or stem(job.logs[0]))
    elif is_remote(text):
        names = [name for name in listed(text) if _may_be_remote_log(name)]
        if names == [text.rsplit("/", 1)[-1]]:
            yield Job((text,), stem(text))
        else:
            yield from (Job((join(text, name),), stem(name, whole=True)) for name in names)
    elif is_folder(text) and not is_log(Path(text)):
        base = Path(text)
        found = [
            Job((str(path),), stem(path.relative_to(base).as_posix(), whole=True))
            for path in logs_in(base)
        ]
        if not found:
            raise FormatError(text, "holds no logs")
        yield from found
    elif any(letter in text for letter in MAGIC) and not is_there(text):
        hits = sorted(glob.glob(text, recursive=True))  # noqa: PTH207 - it may be absolute
        if not hits:
            raise FormatError(text, "no file fits this pattern")
        for hit in hits:
            if Path(hit).is_dir() or is_log(Path(hit)):
                yield from _of_one(hit)
    elif suffix in LISTS and (lines := _lines(Path(text))):
        base = Path(text).parent
        for line in lines:
            yield from _of_one(line if is_remote(line) else str(base / line))
    elif not is_there(text):
        raise FormatError(text, "no such file")
    else:
        yield Job((text,), stem(text))


def _may_be_remote_log(name: str) -> bool:
    return not name.endswith(RESULT) and name.lower().endswith(LOGS)


def _lines(path: Path) -> list[str]:
    """The entries of a list file; [] where its first is no file or address: it is a log, then."""
    try:
        with path.open(encoding="utf-8") as file:
            lines = [line.strip() for line in file.read(50_000_000).splitlines()]
    except (OSError, UnicodeDecodeError):
        return []
    lines = [line for line in lines if line and not line.startswith("#")]
    known = lines and (is_remote(lines[0]) or is_there(path.parent / lines[0]))
    return lines if known or (lines and any(c in lines[0] for c in MAGIC)) else []


def stem(name: str, *, whole: bool = False) -> str:
    """A log's name without `.mcap`, `.bag.gz` and the like; with its folders if `whole`."""
    folder, _, last = name.rstrip("/").rpartition("/")
    short = last.split(".")[0] or last
    return f"{folder}/{short}" if whole and folder else short


def logs_in(folder: Path) -> Iterator[Path]:
    """Logs under a folder, told by their first bytes; a rosbag2 folder is one log.

    Results, plans and all else are left out; links are followed, each folder once.
    """
    seen: set[tuple[int, int]] = set()

    def walk(here: Path) -> Iterator[Path]:
        try:
            state = here.stat()
            items = sorted(here.iterdir())
        except OSError:
            return
        if (state.st_dev, state.st_ino) in seen:
            return
        seen.add((state.st_dev, state.st_ino))
        for item in items:
            if item.name.startswith("."):
                continue
            if item.is_dir():
                if is_log(item):
                    yield item
                else:
                    yield from walk(item)
            elif item.is_file() and is_log(item):
                yield item

    return walk(folder)


def is_log(path: Path) -> bool:
    """Whether it is a log, by its suffix or its first bytes, and no result of ours."""
    if path.is_dir():
        return (path / "metadata.yaml").exists()
    if path.name.endswith(RESULT):
        return False
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
        if is_mcap(path, head):
            return not _is_result(path)
        suffix = path.suffix.lower()
        if wrapper(head):
            return path.name.lower().removesuffix(suffix).endswith((*SURE, ".log", ".clf", ".txt"))
        return suffix in SURE or reader_of(path, head) is not None
    except (OSError, FormatError):
        return path.suffix.lower() in SURE


def _is_result(path: Path) -> bool:
    """Whether an MCAP has the metadata record that makes it a result, at its start or its end."""
    name = len(RECORD).to_bytes(4, "little") + RECORD.encode()
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        first = data.find(name, 0, 1 << 16)
        last = data.rfind(name, max(0, len(data) - (1 << 20)))
        record = first >= 9 and data[first - 9] == METADATA
        return record or (last >= 25 and data[last - 25] == METADATA_INDEX)


def named(jobs: list[Job]) -> list[Job]:
    """The same jobs with names of their own: longer ones where two would have the same.

    Raises:
        UsageError: two of them have one name all the same.
    """
    names = [job.name for job in jobs]
    for name in {name for name in names if names.count(name) > 1}:
        where = [i for i, job in enumerate(jobs) if job.name == name]
        for way in (_by_file, _by_folder):
            longer = [way(jobs[i]) for i in where]
            if len(set(longer)) == len(where):
                for i, other in zip(where, longer, strict=True):
                    names[i] = other
                break
    for name in names:
        if names.count(name) > 1:
            hint = "give a manifest with the column name"
            raise UsageError(name, "several results would have this name", hint=hint)
    return [replace(job, name=name) for job, name in zip(jobs, names, strict=True)]


def _by_file(job: Job) -> str:
    folder = job.name.rpartition("/")[0]
    last = job.logs[0].rstrip("/").rsplit("/", 1)[-1]
    return f"{folder}/{last}" if folder else last


def _by_folder(job: Job) -> str:
    folder, _, last = job.logs[0].rstrip("/").rpartition("/")
    return f"{folder.rsplit('/', 1)[-1]}/{stem(last)}"
