"""One way in: a log is known by its first bytes, never by its suffix; several logs become one."""

from __future__ import annotations

import stat
from collections.abc import Sequence
from hashlib import sha256
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import IO, Any, cast

from formats.compression import open_stream, wrapper
from formats.errors import FormatError, Kind, Notes, UsageError, printable
from formats.errors import Path as Name
from formats.log import Log
from formats.merged_log import MergedLog, Unpacked
from formats.standard_input import STDIN, copied

# Container -> module with fits(path, head) and open_file(path, notes, max_chunk). One line each.
READERS = {
    "ROS 1 bag": "formats.bag.log",
    "MCAP": "formats.mcap.log",
    "rosbag2": "formats.rosbag2.log",
    "CARMEN": "formats.carmen.log",
}
HEAD = 4096
MAX_CHUNK = 256 << 20
SIGNATURES: dict[bytes, str] = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"GIF8": "a GIF picture",
    b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture",
    b"P5": "a PGM picture",
    b"P6": "a PPM picture",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive",
    b"\xfd7zXZ": "an xz archive",
    b"7z\xbc\xaf": "a 7z archive",
    b"RRF": "a Rerun recording",
    b"\x7fELF": "a program",
    b"SQLite format 3\0": "an SQLite database that is no rosbag2 storage",
}
LFS = b"version https://git-lfs"


def open_log(
    paths: str | PathLike[str] | Sequence[str | PathLike[str]],
    notes: Notes,
    *,
    max_chunk: int = MAX_CHUNK,
) -> Log:
    """Open a log, or several as one, merged by log time; the same content twice is read once.

    Args:
        paths: files or rosbag2 folders; .zst, .gz, .bz2 and .lz4 of a log are unpacked first;
            "-" is standard input.
        notes: where losses and oddities are counted.
        max_chunk: bytes that one compressed chunk may unpack to.

    Raises:
        FormatError: a file is missing, cannot be read, or is not a log: what it is instead.
    """
    named = [paths] if isinstance(paths, str | PathLike) else list(paths)
    files = [Path(path) for path in named]
    if not files:
        raise FormatError("", "no log given")
    if files.count(STDIN) > 1:
        raise UsageError(STDIN, "standard input is given twice", hint="it can be read once")
    heads = [b"" if path == STDIN else _head(path) for path in files]
    kept = _without_copies([path for path in files if path != STDIN], notes)
    logs: list[Log] = []
    try:
        for path, head in zip(files, heads, strict=True):
            if path == STDIN:
                logs.append(_open_copy(copied(), STDIN, notes, max_chunk))
            elif path in kept:
                kept.remove(path)
                logs.append(_open_one(path, head, notes, max_chunk))
    except BaseException:
        for log in logs:
            log.close()
        raise
    return logs[0] if len(logs) == 1 else MergedLog(logs)


def reader_of(path: Path, head: bytes) -> Any | None:
    """The module of READERS that reads a file, by its first bytes (b"" for a folder)."""
    return next((m for m in map(import_module, READERS.values()) if m.fits(path, head)), None)


def what_it_is(path: Path, head: bytes) -> FormatError:
    """The error for something that is not a log: what it really is."""
    if path.is_dir():
        inside = sorted(item.name for item in path.iterdir())[:5]
        found = f"holds {', '.join(map(printable, inside))}" if inside else "is empty"
        return FormatError(path, f"is a folder without a log: it {found}", hint="give a file")
    if not head:
        return FormatError(path, "is empty")
    if head.startswith(LFS):
        hint = "get the file itself with `git lfs pull`"
        return FormatError(path, "is a Git LFS pointer, not the log", hint=hint)
    if b"rosbag2_bagfile_information" in head:
        return FormatError(path, "is the metadata of a rosbag2 log", hint="give its folder")
    known = next((name for magic, name in SIGNATURES.items() if head.startswith(magic)), None)
    if known is None and head[:256].lstrip()[:1] == b"<":
        known = "HTML or XML text"
    if known is None:
        # The last bytes may cut a character in two.
        text = head[:-4].decode("utf-8", "ignore") if len(head) > 4 else head.decode("latin-1")
        readable = len(text.encode()) >= len(head) - 8 and not set(text) & set("\0\1\2\3\4\5\6")
        known = "text" if readable else f"unknown data (starts with {head[:8].hex(' ')})"
    return FormatError(path, f"is {known}, not a log", hint="logs are .bag, rosbag2, .mcap, CARMEN")


def _head(path: Path) -> bytes:
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return b""
        if not stat.S_ISREG(mode):
            raise FormatError(path, "is not a regular file")
        with path.open("rb") as file:
            return file.read(HEAD)
    except FileNotFoundError:
        raise FormatError(path, "no such file") from None
    except OSError as error:  # no permission, links in a circle, a name too long
        raise FormatError(path, f"cannot be read: {error.strerror}") from None
    except ValueError as error:  # a NUL in the name
        raise FormatError(path, f"cannot be read: {error}") from None


def _open_one(path: Path, head: bytes, notes: Notes, max_chunk: int) -> Log:
    if kind := wrapper(head):
        return _open_wrapped(path, kind, notes, max_chunk)
    module = reader_of(path, head)
    if module is None:
        raise what_it_is(path, head)
    return cast("Log", module.open_file(path, notes, max_chunk))


def _open_wrapped(path: Path, kind: str, notes: Notes, max_chunk: int) -> Log:
    """A log inside .zst, .gz, .bz2 or .lz4: unpacked to a temporary file that closes with it."""
    return _open_copy(open_stream(path, notes), path, notes, max_chunk, kind)


def _open_copy(file: IO[bytes], path: Path, notes: Notes, max_chunk: int, packed: str = "") -> Log:
    """The log in a temporary copy of a `packed` path; what it says, it says of that path."""
    inner = Path(str(file.name))
    renamed = _Renamed(notes, inner, path)
    try:
        size = path.stat().st_size if packed else inner.stat().st_size
        head = file.read(HEAD)
        module = reader_of(inner, head)
        if not packed and (kind := wrapper(head)):
            log = _open_wrapped(inner, kind, renamed, max_chunk)
        elif module is None:
            raise what_it_is(inner, head)
        else:
            log = cast("Log", module.open_file(inner, renamed, max_chunk))
    except FormatError as error:
        file.close()
        problem = error.problem.replace("is ", "holds ", 1) if packed else error.problem
        raise FormatError(path, problem, topic=error.topic, at=error.at, hint=error.hint) from None
    except BaseException:
        file.close()
        raise
    log.path = path
    return Unpacked(log, file.close, size, packed)


class _Renamed(Notes):
    """Notes that speak of the file that the user named, not of its unpacked copy."""

    def __init__(self, notes: Notes, inner: Path, path: Path) -> None:
        super().__init__()
        self._target, self._names = notes, {str(inner): path}

    def add(
        self, kind: Kind, path: Name, problem: str, *, topic: str = "", at: str = "", count: int = 1
    ) -> None:
        """Count it under the user's name for the file."""
        named = self._names.get(str(path), path)
        self._target.add(kind, named, problem, topic=topic, at=at, count=count)

    def total(self, kind: Kind) -> int:
        """How many times a kind was counted in all."""
        return self._target.total(kind)


def _without_copies(files: list[Path], notes: Notes) -> list[Path]:
    """The files without those of the same content as an earlier one."""
    kept: list[Path] = []
    seen: dict[tuple[object, ...], Path] = {}
    sizes = [_size(path) for path in files]
    for path, size in zip(files, sizes, strict=True):
        if sizes.count(size) > 1:
            key = size, _digest(path)
            if key in seen:
                notes.warn(path, f"has the same content as {printable(seen[key])}: read once")
                continue
            seen[key] = path
        kept.append(path)
    return kept


def _files(path: Path) -> list[Path]:
    return sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]


def _size(path: Path) -> int:
    return sum(item.stat().st_size for item in _files(path))


def _digest(path: Path) -> bytes:
    digest = sha256()
    for item in _files(path):
        with item.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    return digest.digest()
