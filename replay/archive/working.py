"""One log of a batch, from its fetch to its result's place: timed, bounded, in its own process."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

from formats.errors import FormatError
from replay.archive.finding import FAILED
from replay.archive.places import RESULT, is_remote, join, local, near, put, remove

START = "from replay.archive.nursery import main; main()"
TICK = 0.05  # s between looks at the clock and at the memory
PATIENCE = 120.0  # s for the libraries to load
Task = dict[str, Any]
Outcome = dict[str, Any]
Progress = Callable[[int, int], None]


class Nursery:
    """A process that runs tasks one after another, each in a process of its own."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._rest = b""

    def run(self, task: Task, progress: Progress | None = None) -> Outcome:
        """Run a task; a nursery that ends without a word is begun anew, once."""
        outcome = self._try(task, progress)
        if outcome is None:
            outcome = self._try(task, progress)
        return outcome or {"error": "its process could not be started", "kind": "crash"}

    def _try(self, task: Task, progress: Progress | None) -> Outcome | None:
        try:
            self._begin()
            assert self._process is not None
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps(task).encode() + b"\n")
            self._process.stdin.flush()
            return self._watch(task, progress)
        except (BrokenPipeError, EOFError):
            self.close()
            return None
        except BaseException:
            self.close()
            raise

    def _begin(self) -> None:
        if self._process is not None and self._process.poll() is None:
            return
        self.close()
        self._process = subprocess.Popen(
            [sys.executable, "-c", START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the batch, which ends what it began
        )
        limit = monotonic() + PATIENCE
        while "ready" not in (self._answer() or {}):
            if monotonic() > limit:
                raise EOFError

    def _watch(self, task: Task, progress: Progress | None) -> Outcome:
        """What becomes of the task, by its own word, by its end, or by the limits."""
        timeout, memory = task.get("timeout"), task.get("memory")
        began, pid, outcome = monotonic(), 0, None
        while True:
            answer = self._answer()
            if answer is None:
                if pid and timeout and monotonic() - began > timeout:
                    outcome = {"error": f"took more than {timeout:g} s (--timeout)"}
                    outcome["kind"] = "timeout"
                elif pid and memory and (used := resident(pid)) > memory:
                    outcome = {"error": f"took {used / 1e6:.0f} MB, more than --max-memory"}
                    outcome["kind"] = "memory"
                else:
                    continue
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                timeout = memory = None
            elif "pid" in answer:
                pid, began = answer["pid"], monotonic()
            elif "progress" in answer:
                if progress:
                    progress(*answer["progress"])
            elif "outcome" in answer:
                outcome = outcome or answer["outcome"]
            elif "ended" in answer:
                return outcome or _ended(answer["ended"])

    def _answer(self) -> dict[str, Any] | None:
        """The next answer; None where there is none within a tick.

        Raises:
            EOFError: the nursery has ended.
        """
        assert self._process is not None
        assert self._process.stdout is not None
        pipe = self._process.stdout.fileno()
        while b"\n" not in self._rest:
            if not select.select([pipe], [], [], TICK)[0]:
                return None
            data = os.read(pipe, 1 << 16)
            if not data:
                raise EOFError
            self._rest += data
        line, self._rest = self._rest.split(b"\n", 1)
        found: dict[str, Any] = json.loads(line)
        return found

    def close(self) -> None:
        """End the process and what it runs."""
        process, self._process, self._rest = self._process, None, b""
        if process is None:
            return
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()
        process.wait()


def _ended(code: int) -> Outcome:
    if code < 0:
        name = signal.Signals(-code).name
        hint = " (the system's memory ran out?)" if -code == signal.SIGKILL else ""
        return {"error": f"its process was ended by {name}{hint}", "kind": "crash"}
    return {"error": f"its process ended with code {code}", "kind": "crash"}


def resident(pid: int) -> int:
    """Bytes of memory of its own that a process holds, files that it maps aside; 0: not known."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0
    sizes = [line.split()[1] for line in lines if line.startswith(("RssAnon", "RssShmem"))]
    return 1024 * sum(map(int, sizes))


def work(task: Task, nursery: Nursery, progress: Progress | None = None) -> Outcome:
    """Do a task: fetch what is remote, run, and put result or note of failure into the archive.

    Args:
        task: logs, files, options, archive (what is noted in the result), place (the archive),
            name, timeout (s), memory (bytes).
        nursery: where it runs.
        progress: is told (done, expected) scans.

    Returns:
        kind ("done", "failed", "timeout", "memory", "crash", "bug"), error or facts, seconds.
    """
    began = monotonic()
    target = join(task["place"], task["name"] + RESULT)
    with tempfile.TemporaryDirectory() as folder:
        try:
            here: Task = {
                "logs": [str(local(log)) for log in task["logs"]],
                "files": {kind: str(near(place)) for kind, place in task["files"].items()},
                "output": str(Path(folder, "x" + RESULT)) if is_remote(target) else target,
            }
            if not is_remote(target):
                Path(target).parent.mkdir(parents=True, exist_ok=True)
            outcome = nursery.run({**task, **here}, progress)
            if outcome["kind"] == "done" and is_remote(target):
                put(Path(here["output"]), target)
        except FormatError as error:
            outcome = {"error": str(error), "kind": "failed"}
        except OSError as error:
            outcome = {"error": f"{target}: {error.strerror or error}", "kind": "failed"}
        _note(task, outcome, Path(folder))
    return {**outcome, "seconds": monotonic() - began}


def _note(task: Task, outcome: Outcome, folder: Path) -> None:
    """Leave a small file where a log failed; take it away where it was done."""
    note = join(task["place"], task["name"] + FAILED)
    with contextlib.suppress(FormatError, OSError):  # the outcome says it all the same
        if outcome["kind"] == "done":
            remove(note)
            return
        said = {**task["archive"], "log": task["logs"][0], **outcome}
        text = json.dumps(said, indent=1) + "\n"
        if is_remote(note):
            part = Path(folder, "note.json")
            part.write_text(text, encoding="utf-8")
            put(part, note)
        else:
            from formats.output import write_text

            write_text(note, text, force=True)
