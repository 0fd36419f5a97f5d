"""batch(): many logs into an archive of results; only what is missing is done."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formats.errors import FormatError, UsageError, printable
from formats.plain_json import plain
from replay.archive.batches import Batch, Event, Watch
from replay.archive.finding import places
from replay.archive.keys import Keys
from replay.archive.ledger import Entry, Ledger
from replay.archive.manifest import FILES, Job
from replay.archive.places import Place, is_remote
from replay.archive.sources import jobs_of, named
from replay.archive.working import Nursery, Outcome, Task, work
from replay.options import effective

if TYPE_CHECKING:
    pass

TIMEOUT = 3600.0  # s a log
SHARE = 0.8  # of the machine's memory that the runs may take together


def batch(
    logs: Place | Iterable[Place],
    archive: Place,
    *,
    prior: Place | None = None,
    truth: Place | None = None,
    align: Place | None = None,
    prior_values: Place | None = None,
    plan_edits: Place | None = None,
    retry: bool = False,
    force: bool = False,
    jobs: int = 1,
    cluster: str | None = None,
    timeout: float | None = TIMEOUT,
    max_memory: float | None = None,
    watch: Watch | None = None,
    **options: Any,
) -> Batch:
    """Run every log that has no result yet; a log that fails costs itself alone.

    Args:
        logs: files, rosbag2 folders, folders of logs, patterns, list files, manifests (CSV, YAML),
            or addresses of object storage. Results of ours among them are left out.
        archive: a folder, made if need be, or an address.
        prior, truth, align, prior_values, plan_edits: as for `run`, for all logs that a manifest
            does not say otherwise of.
        retry: logs that failed before are tried again.
        force: results of other options, logs or versions are replaced.
        jobs: worker processes here; more than one need the extra `cluster`.
        cluster: the address of a Dask scheduler, instead.
        timeout: s that a log may take; None: as long as it likes.
        max_memory: MB that a log's process may hold; None: its share of most of the memory.
        watch: is told what happens.
        options: of `run`.

    Returns:
        what was done, was there, and failed.

    Raises:
        FormatError: there are no logs; another batch works on the archive; it cannot be written.
        UsageError: an option is not possible; results of other options are in the way.
    """
    effective(options)
    if jobs < 1:
        raise UsageError("", "--jobs is at least 1")
    said = {"prior": prior, "truth": truth, "align": align}
    said |= {"prior_values": prior_values, "plan_edits": plan_edits}
    files = {kind: absolute(said[kind]) for kind in FILES if said[kind]}
    place = absolute(archive)
    asked = jobs_of(places(logs), files, options)
    if not is_remote(place):
        _make(Path(place))
    out = Batch(place)
    with Ledger(place) as ledger, ExitStack() as stack:
        stack.callback(ledger.clean)  # after runs that were ended
        ledger.clean()  # after batches that were
        todo = plan_work(asked, ledger, out, retry=retry, force=force, watch=watch)
        memory = max_memory * 1e6 if max_memory else share_of_memory(jobs)
        limits = {"place": place, "timeout": timeout, "memory": memory}
        tasks = [{**limits, **task} for task in todo]
        for number, (name, outcome) in enumerate(performed(tasks, jobs, cluster, watch), 1):
            if outcome["kind"] == "done":
                out.done[name] = outcome["facts"]
            else:
                out.failed[name] = outcome["error"]
            if watch:
                f2 = outcome.get("facts", {})
                shown = f2.get("f2", {}).get(f2.get("main"))
                state = "done" if outcome["kind"] == "done" else "failed"
                error = outcome.get("error", "")
                watch(Event(name, state, number, len(tasks), error, shown, outcome["seconds"]))
        if tasks:
            ledger.refresh()
    return out


def absolute(place: Place | None) -> str:
    """A path that means the same to every process; an address as it is."""
    text = os.fspath(place) if place is not None else ""
    return text if is_remote(text) else str(Path(text).absolute())


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = f"cannot be made: {error.strerror or error}"
        raise FormatError(folder, problem, hint="give another folder") from None


def share_of_memory(jobs: int) -> float | None:
    """Bytes that each of some processes may take so that the machine goes on."""
    try:
        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return None
    return SHARE * whole / jobs


def plan_work(
    asked: list[Job],
    ledger: Ledger,
    out: Batch,
    *,
    retry: bool,
    force: bool,
    watch: Watch | None,
) -> list[Task]:
    """What is to be done; what was done or failed before goes to `out`.

    Raises:
        UsageError: results of other options, logs or versions are in the way.
    """
    keys, seen = Keys(ledger), dict[str, Job]()
    keyed: list[tuple[Job, str, list[str]]] = []
    for number, job in enumerate(asked):
        if watch:
            watch(Event(job.name, "hash", number, len(asked)))
        job = Job(tuple(map(absolute, job.logs)), job.name, job.files, job.options)
        try:
            key, hashes = keys.of(job)
        except UsageError:
            raise
        except FormatError as error:
            keyed.append((job, "", [str(error)]))
            continue
        if key in seen:
            if seen[key].logs != job.logs:
                out.same[job.logs[0]] = seen[key].logs[0]
            continue
        seen[key] = job
        keyed.append((job, key, hashes))
    unique = named([job for job, _, _ in keyed])
    there, todo, stale = ledger.refresh(), [], []
    for job, (_, key, hashes) in zip(unique, keyed, strict=True):
        entry = there.get(job.name)
        if not key:  # it cannot even be read
            out.failed[job.name] = hashes[0]
        elif entry is None or "damaged" in entry.facts or again(entry, key, retry):
            todo.append(task_of(job, key, hashes))
        elif entry.error:
            out.failed[job.name] = entry.error
        elif entry.key == key:
            out.kept[job.name] = entry.facts
        else:
            stale.append((job, key, hashes))
    if stale and not force:
        _refuse(out.archive, [job for job, _, _ in stale])
    return todo + [task_of(*one) for one in stale]


def again(entry: Entry, key: str, retry: bool) -> bool:
    """Whether a log that failed is to be tried again: when asked, or when it is another now."""
    return bool(entry.error) and (retry or entry.key != key)


def _refuse(archive: str, stale: list[Job]) -> None:
    more = f" (and {len(stale) - 1} more)" if len(stale) > 1 else ""
    raise UsageError(
        archive,
        f"its result {printable(stale[0].name)}{more} is of another log, option or version",
        hint="--force replaces such, or give another archive",
    )


def task_of(job: Job, key: str, hashes: list[str]) -> Task:
    """What a worker is told of a job."""
    noted = {"key": key, "name": job.name, "logs": list(job.logs), "sha256": hashes}
    return {
        "name": job.name,
        "logs": list(job.logs),
        "files": dict(job.files),
        "options": plain(dict(job.options)),
        "archive": noted,
    }


def performed(
    tasks: list[Task], jobs: int, cluster: str | None, watch: Watch | None
) -> Iterator[tuple[str, Outcome]]:
    """Name and outcome of each task as it ends."""
    if cluster is not None or (jobs > 1 and tasks):
        from replay.archive.cluster import on_cluster

        yield from on_cluster(tasks, jobs, cluster, _begin(watch, len(tasks)))
        return
    with closing(Nursery()) as nursery:
        for number, task in enumerate(tasks):
            name = task["name"]
            if watch:
                watch(Event(name, "begun", number, len(tasks)))

            def progress(done: int, expected: int, name: str = name) -> None:
                if watch:
                    watch(Event(name, "running", done, expected))

            yield name, work(task, nursery, progress)


def _begin(watch: Watch | None, count: int) -> Callable[[str], object] | None:
    if watch is None:
        return None
    return lambda name: watch(Event(name, "begun", 0, count))
