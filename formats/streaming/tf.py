"""The whole log's transforms as arrays, looked up for many times at once (REP-105 trees)."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes, Path
from formats.messages import Numbers, Transform
from formats.payload import odd_stamp
from formats.streaming.clock import Clock, Times
from formats.streaming.track import (
    MAX_GAP_NS,
    STEADY,
    Floats,
    Missing,
    Samples,
    Track,
    Why,
    clean,
    inverse,
    matrices,
    missing_of,
)

Edge = tuple[str, str]  # parent, child
MOST_EDGES = 10_000  # a robot has some hundred; damaged names must not fill the memory


class Lookup(NamedTuple):
    """Transforms for n times: `matrices` (n, 4, 4) hold where `valid` (n,); the rest `missing`."""

    matrices: Floats
    valid: npt.NDArray[np.bool_]
    missing: list[Missing]


def plain(frame: str) -> str:
    """A frame's name without the leading slash of old logs."""
    return frame.lstrip("/")


class Tree:
    """Transforms by (parent, child): about 72 bytes a sample of an edge that moves.

    Static transforms hold at all times, wherever in the log they are. An edge that moves holds
    between its first and its last sample, where these are near enough to interpolate; a single
    sample holds at its own time only. `lookup(..., mounted=True)` is for sensors on a robot: there
    an edge whose samples all agree (a static publisher on /tf, as in ROS 1) is static, too.

    Args:
        path: of the log, for notes.
        notes: what was odd.
    """

    def __init__(self, path: Path, notes: Notes) -> None:
        self.path, self.notes = path, notes
        self.clock, self.zero_ns, self.max_gap_ns = Clock(), 0, MAX_GAP_NS
        self._statics: dict[Edge, Numbers] = {}
        self._samples: dict[Edge, Samples] = {}
        self._counts: dict[Edge, int] = {}
        self._names: dict[Edge, Edge] = {}
        self._parents: dict[str, str] | None = None
        self._tracks: dict[Edge, Track] = {}
        self._odd: dict[Edge, dict[str, int]] = {}  # of static edges; told of those that are used
        self._told: set[Edge] = set()

    def add(self, transforms: Iterable[Transform], log_ns: int, *, static: bool) -> None:
        """Keep the transforms of one message."""
        if self._tracks:
            self._tracks.clear()  # they are views on what grows now
        for stamp_ns, parent, child, numbers in transforms:
            raw = parent, child
            edge = self._names.get(raw) or self._named(raw)
            if edge is None:
                continue
            if type(stamp_ns) is not int:
                self.notes.warn(self.path, odd_stamp(stamp_ns), topic="/tf")
            self._counts[edge] += 1
            if static:
                self._add_static(edge, numbers)
            else:
                self._samples.setdefault(edge, Samples()).add(stamp_ns, log_ns, numbers)

    def _named(self, raw: Edge) -> Edge | None:
        """The edge that a pair of names stands for; None, and a note, where it is none."""
        edge = plain(raw[0]), plain(raw[1])
        problem = ""
        if not (edge[0] and edge[1]):
            problem = "transform of an unnamed frame ignored"
        elif edge[0] == edge[1]:
            problem = "transform of a frame to itself ignored"
        elif edge not in self._counts and len(self._counts) >= MOST_EDGES:
            problem = f"transforms beyond {MOST_EDGES} pairs of frames ignored"
        if problem:
            self.notes.warn(self.path, problem, topic="/tf", at=" > ".join(edge))
            return None
        self._names[raw] = edge
        if edge not in self._counts:
            self._counts[edge] = 0
            self._parents = None
        return edge

    def _add_static(self, edge: Edge, numbers: Numbers) -> None:
        rows, keep, odd = clean(np.array([numbers]))
        before = self._statics.get(edge)
        if keep[0]:
            self._statics[edge] = numbers
            if before is not None and np.abs(rows - clean(np.array([before]))[0]).max() > STEADY:
                odd["another static value (the last one counts)"] = 1
        counts = self._odd.setdefault(edge, {})
        for what in odd:
            counts[what] = counts.get(what, 0) + 1

    def settle(self, clock: Clock, zero_ns: int = 0, max_gap_ns: int = MAX_GAP_NS) -> None:
        """Say how stamps become times; times in notes count from `zero_ns`."""
        self.clock, self.zero_ns, self.max_gap_ns = clock, zero_ns, max_gap_ns
        self._tracks.clear()

    @property
    def edges(self) -> dict[Edge, int]:
        """Every (parent, child) and how many transforms were recorded of it."""
        return dict(self._counts)

    @property
    def frames(self) -> set[str]:
        """Every frame that some transform names."""
        return {frame for edge in self._counts for frame in edge}

    @property
    def parents(self) -> dict[str, str]:
        """Child -> parent; of two parents the one with more transforms counts."""
        if self._parents is None:
            found: dict[str, str] = {}
            for (parent, child), count in self._counts.items():
                rival = found.get(child)
                if rival is not None:
                    pair = " and ".join(sorted((rival, parent)))
                    self.notes.warn(self.path, f"{child} has two parents, {pair}", topic="/tf")
                if rival is None or count >= self._counts[rival, child]:
                    found[child] = parent
            self._parents = found
        return self._parents

    def ancestors(self, frame: str) -> list[str]:
        """The frame, its parent, and so on up to the root.

        Raises:
            FormatError: the transforms form a loop.
        """
        line = [plain(frame)]
        seen = set(line)
        while (parent := self.parents.get(line[-1])) is not None:
            line.append(parent)
            if parent in seen:
                loop = " > ".join(reversed(line[line.index(parent) :]))
                raise FormatError(self.path, f"the transforms form a loop, {loop}", topic="/tf")
            seen.add(parent)
        return line

    def relatives(self, frame: str) -> list[str]:
        """Every frame that is connected to this one, sorted; none where it is in no transform.

        Raises:
            FormatError: the frame itself hangs below a loop.
        """
        root = self.ancestors(frame)[-1]
        found = []
        for other in sorted(self.frames) if plain(frame) in self.frames else []:
            with suppress(FormatError):  # a loop elsewhere harms nobody here
                if self.ancestors(other)[-1] == root:
                    found.append(other)
        return found

    def unstamped(self) -> bool:
        """Whether all that moves is stamped 0: its log times must do."""
        each = [samples.stamps_ns for samples in self._samples.values()]
        return bool(each) and not any(stamps.any() for stamps in each)

    def path_between(self, target: str, source: str) -> tuple[list[Edge], list[Edge]] | None:
        """Edges from the common ancestor down to source, and down to target; None: unconnected."""
        up, down = self.ancestors(source), self.ancestors(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            return None
        return _edges(up, common), _edges(down, common)

    def moves(self, edge: Edge) -> bool:
        """Whether an edge is dynamic and its samples differ."""
        return edge in self._samples and not self.track(edge).steady()

    def track(self, edge: Edge) -> Track:
        """The clean samples of a dynamic edge; what was odd about them is noted once."""
        if edge not in self._tracks:
            track = Track.of(self._samples[edge], self.clock, max_gap_ns=self.max_gap_ns)
            self._tracks[edge] = track
            if edge not in self._told:
                self._told.add(edge)
                track.tell(self.notes, self.path, "/tf", f"{edge[0]} > {edge[1]}", self.zero_ns)
        return self._tracks[edge]

    def samples(self, edge: Edge) -> Samples | None:
        """The samples of a dynamic edge as recorded."""
        return self._samples.get(edge)

    def _at(
        self, edge: Edge, times_ns: Times, mounted: bool
    ) -> tuple[Floats, npt.NDArray[np.uint8] | None]:
        """(n or 1, 4, 4) of one edge, and (n,) of Why where it does not hold for all times."""
        if edge in self._odd:
            for what, count in self._odd.pop(edge).items():
                problem = f"{edge[0]} > {edge[1]}: {what}"
                self.notes.warn(self.path, problem, topic="/tf_static", count=count)
        samples = self._samples.get(edge)
        fixed = edge in self._statics
        if samples is not None and not (fixed and (mounted or self.track(edge).steady())):
            track = self.track(edge)
            if not (mounted and track.steady()):
                numbers, why = track.at(times_ns)
                return matrices(numbers), why
            return matrices(track.numbers[:1]), None
        if not fixed:
            return np.eye(4)[None], np.full(len(times_ns), Why.AFTER, dtype=np.uint8)
        return matrices(clean(np.array([self._statics[edge]]))[0]), None

    def lookup(
        self, target: str, source: str, times_ns: npt.ArrayLike, *, mounted: bool = False
    ) -> Lookup:
        """What takes coordinates of `source` into `target`, at many times.

        Args:
            target: frame of the results.
            source: frame of what is taken there.
            times_ns: (n,) in the times of the tree's clock.
            mounted: edges whose samples all agree hold at all times.

        Raises:
            FormatError: the transforms form a loop, or do not connect the two frames.
        """
        times = np.asarray(times_ns, dtype=np.int64)
        ends = self.path_between(target, source)
        if ends is None:
            raise FormatError(self.path, f"no transform {target} <- {source}", topic="/tf")
        valid = np.ones(len(times), dtype=bool)
        missing: list[Missing] = []
        sides: list[Floats] = []
        for edges in ends:
            side = np.eye(4)[None]
            for edge in edges:
                step, why = self._at(edge, times, mounted)
                side = side @ step
                if why is not None:
                    known = self.track(edge).times_ns if edge in self._samples else times[:0]
                    missing += missing_of(f"transform {edge[0]} > {edge[1]}", known, why, valid)
                    valid &= why == Why.OK
            sides.append(side)
        found = inverse(sides[1]) @ sides[0]
        return Lookup(np.broadcast_to(found, (len(times), 4, 4)), valid, missing)

    def forget(self, wanted: Collection[str]) -> None:
        """Drop the edges that lead to none of the wanted frames: wheels, fingers, markers."""
        keep = {frame for name in wanted for frame in self.ancestors(name)}
        for edge in [edge for edge in self._samples if edge[1] not in keep]:
            del self._samples[edge]


def _edges(line: list[str], top: str) -> list[Edge]:
    """The edges of a line of ancestors, from `top` down to its first frame."""
    frames = line[: line.index(top) + 1][::-1]
    return list(pairwise(frames))
