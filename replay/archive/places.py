"""Files here and in object storage: listed, fetched into a bounded cache, put whole."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import shutil
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

from formats.errors import FormatError, printable
from formats.jit import cache_folder

Place = str | PathLike[str]
RESULT = ".replay.mcap"
CACHE_GB = 10.0  # of files from object storage, unless REPLAY_CACHE_GB says otherwise


def is_remote(place: Place) -> bool:
    """Whether it is the address of something fsspec opens, and not a path."""
    text = os.fspath(place)
    return "://" in text and not Path(text).exists()


def join(place: Place, name: str) -> str:
    """A name within a folder or a prefix."""
    text = os.fspath(place)
    return f"{text.rstrip('/')}/{name}" if is_remote(text) else str(Path(text, name))


@contextlib.contextmanager
def speaking(place: Place) -> Iterator[tuple[Any, str]]:
    """The file system of an address and the path there; its errors as one line.

    Raises:
        FormatError: its library is missing, or it cannot be reached, or says no.
    """
    import fsspec

    text = os.fspath(place)
    try:
        system, path = fsspec.core.url_to_fs(text)
        yield system, path
    except FormatError:
        raise
    except ImportError as error:
        extra = 'the extra: pip install "plan-replay[s3]"'
        hint = f"install {extra if text.startswith('s3') else printable(error)}"
        raise FormatError(text, "needs a library that is not installed", hint=hint) from error
    except FileNotFoundError as error:
        raise FormatError(text, "does not exist") from error
    except Exception as error:  # every storage has errors of its own
        if isinstance(error, ValueError) and "rotocol not known" in str(error):
            raise FormatError(text, "an address of an unknown kind") from error
        problem = f"cannot be used ({type(error).__name__}: {error})"
        raise FormatError(text, problem, hint="are address and credentials right?") from error


def listed(place: Place) -> dict[str, tuple[int, str]]:
    """Name within the place -> size and version of every file under it, sorted; {} if none.

    The version changes when the file does: its time of change (ns), or what storage gives for it.
    Links to folders are followed, each folder once.
    """
    if is_remote(place):
        with speaking(place) as (system, path):
            with contextlib.suppress(AttributeError):
                system.invalidate_cache()
            found = system.find(path, detail=True)
            start = path.rstrip("/") + "/"
            return {
                name.removeprefix(start) if name != path else name.rsplit("/", 1)[-1]: (
                    int(info["size"] or 0),
                    remote_version(info),
                )
                for name, info in sorted(found.items())
            }
    base, out = Path(place), {}
    for item in walked(base):
        with contextlib.suppress(OSError):  # gone meanwhile, or a link that leads nowhere
            state = item.stat()
            out[item.relative_to(base).as_posix()] = state.st_size, str(state.st_mtime_ns)
    return out


def remote_version(info: dict[str, Any]) -> str:
    """What changes when a stored object does."""
    for name in ("ETag", "etag", "md5", "LastModified", "mtime", "created"):
        if info.get(name):
            return f"{name} {info[name]}".replace('"', "")
    return ""


def walked(folder: Path) -> Iterator[Path]:
    """The ordinary files under a folder in the order of their names; no folder twice."""
    seen: set[tuple[int, int]] = set()

    def walk(here: Path) -> Iterator[Path]:
        try:
            state = here.stat()
            if (state.st_dev, state.st_ino) in seen:
                return
            seen.add((state.st_dev, state.st_ino))
            items = sorted(here.iterdir())
        except OSError:
            return
        for item in items:
            if item.is_dir():
                yield from walk(item)
            elif item.is_file():
                yield item

    return walk(folder)


def home() -> Path:
    """Our own folder for what may be thrown away.

    Raises:
        FormatError: there is no writable place for one.
    """
    folder = cache_folder()
    if folder is None:
        raise FormatError("", "no folder for temporary copies can be written", hint="set HOME")
    return folder.parent if folder.name == "numba" else folder


def fetch(address: str, limit: int | None = None) -> Path:
    """A local copy of a remote file under its own name; kept until the cache needs the room.

    Args:
        address: of the file.
        limit: bytes that the cache may hold.

    Raises:
        FormatError: it cannot be had.
    """
    if limit is None:
        limit = round(float(os.environ.get("REPLAY_CACHE_GB", CACHE_GB)) * 1e9)
    with speaking(address) as (system, path):
        info = system.info(path)
        key = f"{address} {info['size']} {remote_version(info)}"
        folder = home() / "fetched" / hashlib.sha256(key.encode()).hexdigest()[:24]
        target = folder / path.rsplit("/", 1)[-1]
        if target.exists():
            os.utime(target)
            return target
        folder.mkdir(parents=True, exist_ok=True)
        make_room(folder.parent, limit - int(info["size"]))
        part = folder / f".{secrets.token_hex(4)}.part"
        try:
            system.get_file(path, str(part))
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
        return target


def make_room(folder: Path, limit: int) -> None:
    """Drop the files that were used longest ago until the folder holds `limit` bytes at most."""
    states = []
    for path in walked(folder):
        with contextlib.suppress(OSError):
            state = path.stat()
            states.append((state.st_mtime_ns, state.st_size, path))
    held = sum(size for _, size, _ in states)
    for _, size, path in sorted(states):
        if held <= limit:
            return
        shutil.rmtree(path.parent, ignore_errors=True)  # who reads it still has it open
        held -= size


def local(place: Place) -> Path:
    """The file itself, or a copy of it.

    Raises:
        FormatError: a remote one cannot be had.
    """
    return fetch(os.fspath(place)) if is_remote(place) else Path(place)


def near(place: Place) -> Path:
    """A plan or another small file, or a copy of it with the yaml that lies beside it.

    Raises:
        FormatError: a remote one cannot be had.
    """
    path = local(place)
    if is_remote(place) and not path.name.endswith((".yaml", ".yml")):
        for suffix in (".yaml", ".yml"):
            with contextlib.suppress(FormatError):
                beside = local(os.fspath(place).rpartition(".")[0] + suffix)
                path.with_suffix(suffix).write_bytes(beside.read_bytes())
    return path


def put(source: Path, address: str) -> None:
    """Store a file whole: objects appear when they are complete.

    Raises:
        FormatError: it cannot be stored.
    """
    with speaking(address) as (system, path):
        system.put_file(str(source), path)


def remove(place: Place) -> None:
    """Delete a file that may not be there."""
    if is_remote(place):
        with speaking(place) as (system, path):
            if system.exists(path):
                system.rm_file(path)
    else:
        Path(place).unlink(missing_ok=True)
