"""The ledger of an archive: a local SQLite index of its results, which can be built anew from them.

The results are the database. The ledger saves reading them and hashing logs again, and its lock
keeps two batches from working on one archive at a time.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import sqlite3
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from formats.errors import FormatError
from formats.results.kept import read_kept
from replay.archive.finding import FAILED
from replay.archive.places import RESULT, home, is_remote, join, listed, local

NAME = ".ledger.sqlite"
LOCK = ".ledger.lock"
VERSION = 1
TABLES = """
CREATE TABLE IF NOT EXISTS hashes (place TEXT PRIMARY KEY, size INTEGER, state TEXT, sha TEXT);
CREATE TABLE IF NOT EXISTS results
    (name TEXT PRIMARY KEY, size INTEGER, state TEXT, key TEXT, facts TEXT);
"""
NETWORKED = ("nfs", "cifs", "smb", "fuse.sshfs", "9p", "lustre", "ceph", "glusterfs", "afs")


class Entry(NamedTuple):
    """What an archive has under a name.

    Attributes:
        key: what it depends on; "" where the file does not say.
        error: why the log failed; "" for a result.
        facts: of a result: scores, lost, log.
    """

    key: str
    error: str
    facts: dict[str, Any]


class Ledger:
    """The ledger of one archive, locked while it is open; a context manager.

    Args:
        archive: a folder, or an address. Of an address, or of a folder on a network file system,
            the ledger lies in the user's cache folder.

    Raises:
        FormatError: another batch has it open.
    """

    def __init__(self, archive: str) -> None:
        self.archive = archive
        self.folder = Path(archive)
        if is_remote(archive) or networked(Path(archive)):
            place = archive if is_remote(archive) else str(Path(archive).absolute())
            self.folder = home() / "ledgers" / sha256(place.encode()).hexdigest()[:24]

    def __enter__(self) -> Ledger:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.folder / LOCK, os.O_CREAT | os.O_RDWR, 0o666)
        except OSError as error:
            problem = f"cannot be written: {error.strerror or error}"
            raise FormatError(self.archive, problem, hint="give another folder") from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._lock)
            hint = "let it end, or give another archive"
            raise FormatError(self.archive, "another batch works on it", hint=hint) from None
        try:
            self._open()
        except BaseException:
            os.close(self._lock)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._data.close()
        os.close(self._lock)

    def _open(self) -> None:
        """The database; one that is damaged, or of another version, is begun anew."""
        path = self.folder / NAME
        for _ in range(2):
            self._data = sqlite3.connect(path, isolation_level=None)
            try:
                self._data.executescript("PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL")
                (version,) = self._data.execute("PRAGMA user_version").fetchone()
                (sound,) = self._data.execute("PRAGMA quick_check").fetchone()
                if version in (0, VERSION) and sound == "ok":
                    self._data.executescript(TABLES)
                    self._data.execute(f"PRAGMA user_version = {VERSION}")
                    return
            except sqlite3.DatabaseError:
                pass
            self._data.close()
            for left in (path, Path(f"{path}-journal"), Path(f"{path}-wal"), Path(f"{path}-shm")):
                left.unlink(missing_ok=True)
        hint = "is the disk full? Else delete it: it can be rebuilt"
        raise FormatError(path, "the ledger cannot be used", hint=hint)

    def _said(self, words: str, values: tuple[object, ...] = ()) -> list[Any]:
        """What the database answers.

        Raises:
            FormatError: it cannot be written: the disk is full, or somebody deleted it.
        """
        try:
            return self._data.execute(words, values).fetchall()
        except sqlite3.Error as error:
            hint = f"free some space, or give another folder; {NAME} can be deleted"
            raise FormatError(
                self.folder / NAME, f"cannot be written ({error})", hint=hint
            ) from None

    def digest(self, place: str, size: int, state: str, find: Callable[[], str]) -> str:
        """A file's hash, found anew only if its size or state has changed."""
        row = self._said(
            "SELECT sha FROM hashes WHERE place = ? AND size = ? AND state = ?",
            (place, size, state),
        )
        if row:
            return str(row[0][0])
        sha = find()
        self._said("REPLACE INTO hashes VALUES (?, ?, ?, ?)", (place, size, state, sha))
        return sha

    def refresh(self) -> dict[str, Entry]:
        """What the archive has, name -> entry, by the files that are there; read where unknown."""
        rows = self._said("SELECT name, size, state, key, facts FROM results")
        known = {name: (size, state, key, facts) for name, size, state, key, facts in rows}
        out: dict[str, Entry] = {}
        there = listed(self.archive) if is_remote(self.archive) or self.folder.exists() else {}
        for file, (size, state) in there.items():
            if not file.endswith((RESULT, FAILED)) or Path(file).name.startswith("."):
                continue
            row = known.pop(file, None)
            if row and row[:2] == (size, state):
                key, facts = row[2], row[3]
            else:
                key, found = _look(join(self.archive, file))
                facts = json.dumps(found)
                self._keep(file, size, state, key, facts)
            name = file.removesuffix(RESULT).removesuffix(FAILED)
            entry = Entry(key, json.loads(facts).pop("error", ""), json.loads(facts))
            if name not in out or not entry.error:  # a result goes before a note of failure
                out[name] = entry
        for file in known:
            self._said("DELETE FROM results WHERE name = ?", (file,))
        return out

    def _keep(self, file: str, size: int, state: str, key: str, facts: str) -> None:
        self._said("REPLACE INTO results VALUES (?, ?, ?, ?, ?)", (file, size, state, key, facts))

    def clean(self) -> None:
        """Remove what was left half-written; nobody else writes while we hold the lock."""
        if is_remote(self.archive):
            return
        for folder, _, names in os.walk(self.archive):
            for name in names:
                if name.startswith(".") and ".part." in name:
                    Path(folder, name).unlink(missing_ok=True)


def _look(place: str) -> tuple[str, dict[str, Any]]:
    """Key and facts of a result or of a note of failure; no key where it is damaged."""
    if place.endswith(FAILED):
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            note = json.loads(local(place).read_text(encoding="utf-8"))
            return str(note["key"]), {"error": str(note["error"])}
        return "", {"error": "failed, and its note cannot be read"}
    try:
        kept = read_kept(local(place))
    except FormatError as error:
        return "", {"damaged": error.problem}
    return str(kept.facts.get("archive", {}).get("key", "")), facts_of(kept.facts, kept.main)


def facts_of(facts: dict[str, Any], main: str) -> dict[str, Any]:
    """What the ledger knows of a result's facts."""
    against = facts.get("plan") or facts.get("truth")
    scores = (facts.get("scores") or {}) if against else {}
    f2 = {name: score.get("f2") for name, score in scores.items()}
    return {"f2": f2, "main": main, "lost": facts.get("lost", 0), "log": facts.get("log", "")}


def networked(folder: Path) -> bool:
    """Whether a folder lies on a network file system, where SQLite's locks do not hold."""
    try:
        real = folder.resolve()
        mounts = Path("/proc/mounts").read_text(encoding="utf-8").splitlines()
    except (OSError, RuntimeError):
        return False
    best, kind = "", ""
    for line in mounts:
        _, at, system, *_ = line.split()
        inside = real == Path(at) or Path(at) in real.parents
        if inside and len(at) >= len(best):
            best, kind = at, system
    return kind.startswith(NETWORKED)
