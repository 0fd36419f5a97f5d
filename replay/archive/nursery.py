"""The process in which the runs of a batch are born: libraries loaded once, a process a log.

It reads tasks as lines of JSON from standard input and says what becomes of each on standard
output. A run that crashes, hangs or eats memory costs its own process alone. Where a process can
be forked the run begins at once; elsewhere the nursery runs one task itself, and ends.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
import traceback
from pathlib import Path
from typing import IO, Any

FORKS = sys.platform == "linux"  # elsewhere the system's own libraries do not survive it
DEATH_SIGNAL = 1  # prctl: PR_SET_PDEATHSIG


def main() -> None:
    """Run tasks until standard input ends."""
    from replay.archive.warming import warm

    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # nothing but answers goes there
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm()
    _say(answers, {"ready": os.getpid()})
    while line := _line():
        if FORKS and _deserted():
            return
        task = json.loads(line)
        if not FORKS:
            _say(answers, {"pid": os.getpid()})
            _say(answers, {"outcome": perform(task, answers)})
            _say(answers, {"ended": 0})
            return
        _fork(task, answers)


def _deserted() -> bool:
    """Whether the batch went while its task lay here: nobody would clear up after the run."""
    stdin = select.poll()
    stdin.register(0, select.POLLHUP)
    return bool(stdin.poll(0))


def _line() -> bytes:
    """The next line of standard input, unbuffered: what follows belongs to the next task."""
    out = b""
    while not out.endswith(b"\n"):
        piece = os.read(0, 1)
        if not piece:
            return b""
        out += piece
    return out


def _say(answers: IO[bytes], value: dict[str, Any]) -> None:
    answers.write(json.dumps(value).encode() + b"\n")


def _fork(task: dict[str, Any], answers: IO[bytes]) -> None:
    """A process for this task; ends with it, or when nobody listens any more."""
    read, write = os.pipe()
    parent = os.getpid()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            os.close(read)
            _die_with(parent)
            with os.fdopen(write, "wb", buffering=0) as out:
                _say(out, {"outcome": perform(task, out)})
            code = 0
        finally:
            os._exit(code)
    os.close(write)
    _say(answers, {"pid": pid})
    try:
        while True:
            ready, _, _ = select.select([read, 0], [], [])
            if 0 in ready:  # nothing is sent while a task runs: the batch has gone
                os.kill(pid, signal.SIGKILL)
                os._exit(1)
            data = os.read(read, 1 << 16)
            if not data:
                break
            answers.write(data)
    except OSError:  # nobody reads the answers: the batch has gone
        os.kill(pid, signal.SIGKILL)
        raise
    finally:
        os.close(read)
        _, status = os.waitpid(pid, 0)
    _say(answers, {"ended": os.waitstatus_to_exitcode(status)})


def _die_with(parent: int) -> None:
    """End when the nursery does, and first of all when memory runs out."""
    import ctypes

    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL)
        Path("/proc/self/oom_score_adj").write_text("1000")
    if os.getppid() != parent:
        os._exit(1)


def perform(task: dict[str, Any], answers: IO[bytes]) -> dict[str, Any]:
    """Run one task and say how it went, in words that fit into JSON."""
    from formats.errors import FormatError, Notes
    from replay.archive.manifest import FILES, option_of
    from replay.running import run

    notes, last = Notes(), [0]

    def progress(done: int, expected: int) -> None:
        if done - last[0] >= max(1, expected // 50):
            last[0] = done
            _say(answers, {"progress": [done, expected]})

    signal.signal(signal.SIGINT, signal.SIG_DFL)
    options = {name: option_of(name, value) for name, value in task["options"].items()}
    files = {name: task["files"].get(name) for name in FILES}
    options |= {"plan_edits": files.pop("plan_edits")} if files.get("plan_edits") else {}
    files.pop("plan_edits", None)
    try:
        result = run(
            task["logs"],
            output=task["output"],
            force=True,
            notes=notes,
            progress=progress,
            archive=task["archive"],
            **files,
            **options,
        )
    except FormatError as error:
        return {"error": str(error), "kind": "failed"}
    except MemoryError:
        return {"error": "ran out of memory", "kind": "memory"}
    except Exception as error:  # a bug costs its own log alone; its traceback is kept
        problem = f"internal error ({type(error).__name__}: {error})"
        return {"error": problem, "kind": "bug", "traceback": traceback.format_exc()}
    from formats.plain_json import plain
    from replay.archive.ledger import facts_of

    main = options.get("update") or "bayes"
    main = main if main in result.counts else "none"
    return {"facts": plain(facts_of(result.facts, main)), "kind": "done"}
