"""What `replay batch` shows while it works, and what it says at the end."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from typing import TYPE_CHECKING

import click

from formats.errors import printable

if TYPE_CHECKING:
    from replay.archive.batches import Batch, Event

Watch = Callable[["Event"], object]


@contextmanager
def told(*, quiet: bool, count: list[int]) -> Iterator[Watch]:
    """Takes events: bars on a terminal, else a line for each log that ends; counts in any case.

    Args:
        quiet: only count.
        count: [done, all], kept up to date.
    """

    def counted(event: Event) -> None:
        if event.state in ("done", "failed"):
            count[:] = [event.done, event.all]
        elif event.state == "begun":
            count[1] = event.all

    def lines(event: Event) -> None:
        counted(event)
        if event.state in ("done", "failed"):
            click.echo(ended(event), err=True)

    if quiet:
        yield counted
    elif not sys.stderr.isatty():
        yield lines
    else:
        with bars() as show:

            def both(event: Event) -> None:
                counted(event)
                show(event)

            yield both


def ended(event: Event) -> str:
    """The line of a log that has ended."""
    f2 = f"F2 {event.f2:.2f}, " if event.f2 is not None else ""
    what = event.said if event.state == "failed" else f"{f2}{event.seconds:.1f} s"
    return f"{event.state:<7} {printable(event.name)}: {what} ({event.done} of {event.all})"


@contextmanager
def bars() -> Iterator[Watch]:
    """A bar for the whole, and one for each log that runs."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskID,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True)) as shown:
        whole = shown.add_task("logs", total=None)
        running: dict[str, TaskID] = {}

        def show(event: Event) -> None:
            name = escape(printable(event.name, 40))
            if event.state == "hash":
                shown.update(whole, description="hash", completed=event.done, total=event.all)
            elif event.state == "begun":
                shown.update(whole, description="logs", completed=event.done, total=event.all)
            elif event.state == "running":
                if event.name not in running:
                    running[event.name] = shown.add_task(f"  {name}", total=event.all)
                shown.update(running[event.name], completed=event.done, total=event.all)
            else:
                if event.name in running:
                    shown.remove_task(running.pop(event.name))
                shown.update(whole, completed=event.done, total=event.all)
                if event.state == "failed":
                    shown.console.print(escape(ended(event)), highlight=False)

        yield show


def batch_report(found: Batch) -> str:
    """Lines that a person reads, without the last line break."""
    everything = len(found.results) + len(found.failed)
    parts = [f"{len(found.done)} done", f"{len(found.kept)} there before"]
    if found.lossy:
        parts.append(f"{len(found.lossy)} with data loss")
    if found.failed:
        parts.append(f"{len(found.failed)} failed")
    lines = [f"{everything} log{'s' * (everything != 1)}: {', '.join(parts)}"]
    scores = {
        curve: [facts["f2"][curve] for facts in found.results.values() if curve in facts["f2"]]
        for curve in ("none", "bayes", "paper")
    }
    said = [f"{curve} {median(values):.3f}" for curve, values in scores.items() if values]
    if said:
        lines.append(f"median F2   {', '.join(said)}")
    for log, other in found.same.items():
        lines.append(f"same    {printable(log)} has the content of {printable(other)}")
    for name, error in sorted(found.failed.items()):
        lines.append(f"failed  {printable(name)}: {printable(error, 500)}")
    return "\n".join(lines)
