"""The tasks of a batch on Dask workers; the one place where distributed is used."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

from formats.errors import FormatError, UsageError
from replay.archive.working import Nursery, Outcome, Task, work

PATIENCE = 20  # s for a scheduler to answer
_nursery: list[Nursery] = []  # of this worker process


def _perform(task: Task) -> Outcome:
    """One task in a worker: in a process of its own, as everywhere.

    The nursery is kept for the next one; it ends with the worker, whose pipe it reads.
    """
    nursery = _nursery.pop() if _nursery else Nursery()
    try:
        return work(task, nursery)
    finally:
        _nursery.append(nursery)


def on_cluster(
    tasks: list[Task], jobs: int, address: str | None, begun: Callable[[str], object] | None
) -> Iterator[tuple[str, Outcome]]:
    """Name and outcome of each task as it ends; those of a worker that dies are given to others.

    Args:
        tasks: for `work`; inputs and archive must be reachable from every worker.
        jobs: worker processes of a cluster made here, one log at a time each.
        address: of a running scheduler, instead.
        begun: is told the names of what was handed out.

    Raises:
        UsageError: the extra is not installed.
        FormatError: the scheduler does not answer.
    """
    try:
        from distributed import Client, LocalCluster, as_completed
    except ImportError as error:
        hint = 'install the extra: pip install "plan-replay[cluster]"'
        raise UsageError("", "more than one worker needs Dask", hint=hint) from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        where: Any = address
        if address is None:
            where = stack.enter_context(
                LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    processes=True,
                    memory_limit=0,  # a worker only watches; limits are those of each log
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            )
        try:
            client = stack.enter_context(Client(where, timeout=PATIENCE, set_as_default=False))
        except (OSError, ValueError) as error:
            hint = "is it running? tcp://HOST:8786 is a scheduler's usual address"
            raise FormatError(str(address), "no scheduler answers", hint=hint) from error
        futures = [client.submit(_perform, task, pure=False, retries=2) for task in tasks]
        names = {future.key: task["name"] for future, task in zip(futures, tasks, strict=True)}
        if begun:
            for name in names.values():
                begun(name)
        for future in as_completed(futures, loop=client.loop):
            try:
                outcome = future.result()
            except Exception as error:  # its workers died again and again
                said = f"no worker lived to its end ({type(error).__name__})"
                outcome = {"error": said, "kind": "crash", "seconds": 0.0}
            yield names[future.key], outcome
