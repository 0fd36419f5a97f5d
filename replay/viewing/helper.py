"""A process that draws beside the run, and is given up where it does not keep up."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from typing import Any

START = (
    "import sys; sys.path[:0] = {path!r}; import replay.viewing.no_pandas; "
    "from replay.viewing.worker import main; main()"
)
QUIET = {"RUST_LOG": "off", "RERUN_ANALYTICS": "off"}  # we say what happens, in one line
PATIENCE = 10.0  # s without taking anything, beyond which it is given up
START_PATIENCE = 60.0  # s for it to import what it needs, on a machine that is busy
ROOM = 1 << 20  # bytes on their way, so that the run seldom waits; what Linux allows everybody
END_PATIENCE = 60.0  # s to end after the last step


class Helper:
    """Draws one recording to one place; what it cannot take is lost, never the run.

    Args:
        asked: of `replay.viewing.worker`: path, view, connect, budget.
    """

    def __init__(self, **asked: Any) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", START.format(path=sys.path), json.dumps(asked)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **QUIET},
            start_new_session=True,  # Ctrl-C is for the run, which ends this one
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        self._problem = ""
        self._taken = False
        if sys.platform != "win32":
            os.set_blocking(self._pipe, False)
        if sys.platform == "linux":
            import fcntl

            with contextlib.suppress(OSError):  # a user's pipes may be full: then the usual 64 kB
                fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, ROOM)

    def send(self, data: bytes) -> None:
        """Bytes of a pickle; waits a while for a helper that is busy, once."""
        rest = memoryview(data)
        while rest and not self._problem:
            try:
                rest = rest[os.write(self._pipe, rest) :]
                self._taken = True
            except BlockingIOError:
                patience = PATIENCE if self._taken else START_PATIENCE
                if not select.select([], [self._pipe], [], patience)[1]:
                    self._give_up(f"it took nothing for {patience:g} s")
            except BrokenPipeError:
                self._problem = self._ended()

    def finish(self) -> str:
        """Waits for the end; what went wrong, "" if all is well."""
        if not self._problem:
            with contextlib.suppress(subprocess.TimeoutExpired, ValueError, BrokenPipeError):
                said, _ = self._process.communicate(timeout=END_PATIENCE)
                return str(json.loads(said))
            self._give_up(self._ended())
        self.kill()
        return self._problem

    def kill(self) -> None:
        """End it, if it has not ended by itself."""
        if self._process.poll() is None:
            self._process.kill()
        with contextlib.suppress(BrokenPipeError, ValueError):
            self._process.communicate()

    def _give_up(self, problem: str) -> None:
        self._problem = problem
        if self._process.poll() is None:
            self._process.kill()

    def _ended(self) -> str:
        """Why it says nothing any more."""
        end = time.monotonic() + 1.0  # a pipe breaks a moment before its process is gone
        while self._process.poll() is None and time.monotonic() < end:
            time.sleep(0.01)
        code = self._process.poll()
        return "the process that draws " + (
            "did not answer" if code is None else f"ended with code {code}"
        )
