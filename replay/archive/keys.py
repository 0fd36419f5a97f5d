"""What a result depends on, as one hash: log, plan, truth, options and version."""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from formats.errors import FormatError, Notes
from formats.plain_json import plain
from formats.plans.file import open_plan
from formats.plans.grid_in_log import topic_in
from formats.results.contents import FORMAT
from replay.archive.ledger import Ledger
from replay.archive.manifest import Job
from replay.archive.places import is_remote, local, near, remote_version, speaking, walked
from replay.options import effective, plan_values

PIECE = 1 << 20


def digest(place: str, ledger: Ledger) -> str:
    """SHA-256 of a file's content, or of a folder's files and their names.

    Known ones are not read again: same path, size and time of change (or what storage gives).

    Raises:
        FormatError: it cannot be read.
    """
    if is_remote(place):
        with speaking(place) as (system, path):
            info = system.info(path)
        size, state = int(info["size"] or 0), remote_version(info)
        return ledger.digest(place, size, state, lambda: _of_file(local(place)))
    here = Path(place)
    try:
        if not here.is_dir():
            return _cached(here, ledger)
        parts = [(file.relative_to(here).as_posix(), file) for file in walked(here)]
        lines = [f"{name} {_cached(file, ledger)}" for name, file in parts]
        return sha256("\n".join(lines).encode()).hexdigest()
    except OSError as error:
        raise FormatError(place, f"cannot be read: {error.strerror or error}") from None


def _cached(path: Path, ledger: Ledger) -> str:
    state = path.stat()
    if not path.is_file():
        raise FormatError(path, "is not a regular file")
    at = f"{state.st_mtime_ns} {state.st_ino}"
    return ledger.digest(str(path.absolute()), state.st_size, at, lambda: _of_file(path))


def _of_file(path: Path) -> str:
    found = sha256()
    with path.open("rb") as file:
        while block := file.read(PIECE):
            found.update(block)
    return found.hexdigest()


class Keys:
    """Keys of jobs; plans are opened once, for the files that they are made of."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._plans: dict[str, list[str]] = {}

    def of(self, job: Job) -> tuple[str, list[str]]:
        """The key of a job's result, and the hashes of its logs.

        Raises:
            FormatError: a log cannot be read.
            UsageError: an option is not possible.
        """
        options = effective(job.options)
        logs = [digest(log, self._ledger) for log in job.logs]
        files = {}
        for kind, place in job.files.items():
            plan = kind in ("prior", "truth")
            values = plan_values(options) if kind == "prior" else {}
            about = f"{kind} {place} {json.dumps(plain(values))}"
            if about not in self._plans:
                self._plans[about] = self._inputs(place, plan, values)
            files[kind] = self._plans[about]
        known = {
            "logs": sorted(logs),
            "files": files,
            "options": {k: v for k, v in options.items() if k != "plan_edits"},
            "version": [version("plan-replay"), FORMAT],
        }
        text = json.dumps(plain(known), sort_keys=True)
        return sha256(text.encode()).hexdigest(), logs

    def _inputs(self, place: str, plan: bool, values: dict[str, object]) -> list[str]:
        """Hashes of a file and, of a plan, of what it refers to."""
        if not plan:
            return [digest(place, self._ledger)]
        found: dict[str, str] = {}
        try:
            path = place if is_remote(place) else str(Path(place))
            within = None if is_remote(path) else topic_in(Path(path))
            if within is not None:
                return [digest(str(within[0]), self._ledger), within[1]]
            found = open_plan(near(place), Notes(), **values).inputs  # type: ignore[arg-type]
        except FormatError:  # the run will say it of each log
            pass
        return sorted(found.values()) or [_if_any(lambda: digest(place, self._ledger))]


def _if_any(find: Callable[[], str]) -> str:
    try:
        return find()
    except FormatError:
        return "none"
