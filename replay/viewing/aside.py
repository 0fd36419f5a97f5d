"""The sink of a run that is looked at: a process beside it draws, and the run goes on."""

from __future__ import annotations

import os
import pickle
import re
import socket
from array import array
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from types import TracebackType
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Floats, Scan
from formats.grid import Evidence
from formats.output import atomic, check_room
from formats.result import Step
from formats.results.keyframes import change
from formats.sensing.ends import Beams, thinned
from replay.viewing.helper import Helper
from replay.viewing.scene import (
    BATCH,
    BUDGET,
    Block,
    Keyframe,
    Scene,
    Sighted,
    Walls,
    explored,
    strides,
)

ADDRESS = re.compile(r"rerun(\+https?)?://(?P<host>[^/\s]+):(?P<port>\d{1,5})/proxy")
LEAST = 1 << 23  # bytes free, below which a recording is not begun
Sendable = Scene | Sighted | Keyframe | Walls | str | None


class Viewer:
    """A sink for steps; a context manager, which starts before the scene is known.

    Args:
        path: an .rrd to write, whole or not at all.
        view: start the viewer on this machine; only 127.0.0.1 is listened on.
        connect: the address of a viewer that is already there.
        budget: MB that are drawn of the run, about.
        force: overwrite `path`.
        inputs: files that must not be overwritten.
        notes: is told when the recording could not be written.
        say: is told, once and in one line, when the viewer is gone; the run goes on.

    Raises:
        FormatError: on entering, where the output exists or cannot be written.
        UsageError: `connect` is no address.
    """

    def __init__(
        self,
        *,
        path: str | os.PathLike[str] | None = None,
        view: bool = False,
        connect: str | None = None,
        budget: float = BUDGET,
        force: bool = False,
        inputs: Iterable[str | os.PathLike[str]] = (),
        notes: Notes | None = None,
        say: Callable[[str], object] = print,
    ) -> None:
        if connect is not None and not ADDRESS.fullmatch(connect):
            hint = "a viewer's address is like rerun+http://127.0.0.1:9876/proxy"
            raise UsageError(connect, "not the address of a viewer", hint=hint)
        self._path, self._force, self._inputs = path, force, tuple(inputs)
        self._view, self._connect, self._budget = view, connect, budget
        self._file: Helper | None = None
        self._live: Helper | None = None  # apart: a viewer that hangs must not stop the file
        self._notes, self._say = Notes() if notes is None else notes, say
        self._scene: Scene | None = None
        self._last: Step | None = None  # behind the last keyframe
        self._shared: tuple[Floats | None, Floats] = None, np.empty(0)  # bearings, and thinned
        self._empty()
        self.written = False

    def __enter__(self) -> Viewer:
        part = None
        with ExitStack() as stack:  # what fails from here on leaves no half file
            if self._path is not None:
                check_room(self._path, LEAST)
                output = atomic(self._path, force=self._force, inputs=self._inputs)
                part = str(stack.enter_context(output).resolve())
            if self._path is not None:
                self._file = Helper(path=part, view=False, connect=None, budget=self._budget)
            if self._view or (self._connect is not None and self._there(self._connect)):
                self._live = Helper(
                    path=None, view=self._view, connect=self._connect, budget=self._budget
                )
            self._stack = stack.pop_all()
        return self

    def _there(self, address: str) -> bool:
        """Whether anything listens; said where nothing does, instead of waiting for it."""
        found = ADDRESS.fullmatch(address)
        assert found is not None
        try:
            with socket.create_connection((found["host"], int(found["port"])), timeout=2.0):
                return True
        except OSError as error:
            self._gone(error.strerror or str(error))
            return False

    def _gone(self, reason: str) -> None:
        self._say(f"viewer: gone ({reason}); the result is not touched by that")

    def show(self, scene: Scene) -> None:
        """What holds throughout; before the first step."""
        self._scene = scene
        self._before = Evidence.empty(scene.geometry, scene.levels).counts
        self._every, _ = strides(scene.frames, self._budget)
        self._send(scene)

    def report(self, markdown: str) -> None:
        """The text panel from now on."""
        self._flush()
        self._send(markdown)

    def compare(self, walls: Walls) -> None:
        """The plan against the building, when all has been seen."""
        self._flush()
        self._send(walls)

    def write(self, step: Step) -> None:
        """Takes a step; it goes out with its batch, evidence at keyframes."""
        self._index.append(step.index)
        self._times.append(step.frame.time_ns)
        self._poses.extend(step.frame.pose)
        counts = step.counts.values()
        self._counts.extend([n for split in counts for part in split for n in part])
        wanted = step.index % self._every == 0
        self._beams.append(self._kept(step.frame.scan) if wanted else None)
        self._last = step
        if step.keyframe:
            self._change(step)
        elif len(self._index) >= BATCH:
            self._flush()

    def _kept(self, scan: Scan) -> Beams:
        """What is drawn of a scan, for itself: bearings that scans share are kept once."""
        beams = thinned(scan)
        if scan.bearings is not self._shared[0]:
            self._shared = scan.bearings, beams.bearings.copy()
        return beams._replace(bearings=self._shared[1], ranges=beams.ranges.copy())

    def _change(self, step: Step) -> None:
        """A keyframe, behind all frames up to it."""
        self._flush()
        self._last = None
        if step.evidence is not None:
            counts = [(part.observed, part.unobserved) for part in step.counts.values()][:1]
            seen = float(explored(np.array(counts))[0]) if counts else 0.0
            new = change(step.index, step.evidence.counts, self._before)
            self._send(Keyframe(new, step.frame.time_ns, seen))

    def _empty(self) -> None:
        self._index, self._times = array("q"), array("q")
        self._poses, self._counts = array("d"), array("q")
        self._beams: list[Beams | None] = []

    def _flush(self) -> None:
        frames = len(self._index)
        if not frames or self._scene is None:
            return
        names = list(self._scene.curves)
        table = np.array(self._counts, dtype=np.int64).reshape(frames, len(names), 2, 4)
        block = Block(
            np.array(self._index, dtype=np.int64),
            np.array(self._times, dtype=np.int64),
            np.array(self._poses).reshape(frames, 3),
            {name: table[:, i] for i, name in enumerate(names)},
            [],
        )
        sighted = Sighted(block, self._beams)
        self._empty()
        self._send(sighted)

    def _send(self, message: Sendable) -> None:
        """What is lost on the way is said of at the end."""
        data = pickle.dumps(message, protocol=5)
        for helper in (self._file, self._live):
            if helper is not None:
                helper.send(data)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        torn: Any = kind, error, trace
        try:
            if kind is None:
                if self._last is not None:
                    self._change(self._last)  # the end, wherever it came
                self._send(None)
                gone = self._live.finish() if self._live is not None else ""
                if gone:
                    self._gone(gone)
                problem = self._file.finish() if self._file is not None else ""
                if problem:
                    torn = OSError, OSError(problem), None  # the part gets no name
        except BaseException as interruption:
            torn = type(interruption), interruption, None
            raise
        finally:
            for helper in (self._file, self._live):
                if helper is not None:
                    helper.kill()
            self._name(kind is None, *torn)

    def _name(self, ended: bool, *torn: Any) -> None:
        """The recording gets its name, or why it does not is told."""
        problem = ""
        try:
            self._stack.__exit__(*torn)
            self.written = self._path is not None and torn[0] is None
            if torn[0] is not None:
                problem = str(torn[1])
        except (FormatError, OSError) as refused:
            problem = str(torn[1] or refused)
        if problem and ended:
            self._notes.lose(self._path or "", f"not written: {problem}; the result is whole")
