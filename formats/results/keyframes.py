"""Evidence through time as sparse changes between at most about a hundred moments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Counted, Evidence, Floats, Geometry, Grid, probability
from formats.result import Curve

LIMIT = 99  # odd: the pairs that thinning joins then end with the last one


class Change(NamedTuple):
    """Readings added since the moment before.

    Attributes:
        frame: index of the last frame that it holds.
        where: (n,) int64, ascending flat indices into (levels, rows, cols).
        added: (n,) uint32 readings, none of them 0.
    """

    frame: int
    where: npt.NDArray[np.int64]
    added: Counted

    def add_to(self, evidence: Evidence) -> None:
        """Bring evidence of the moment before up to this one."""
        evidence.counts.reshape(-1)[self.where] += self.added


def change(frame: int, now: Counted, before: Counted) -> Change:
    """What `now` holds beyond `before`, which is brought up to date; both (levels, rows, cols)."""
    new, old = now.reshape(-1), before.reshape(-1)
    where = np.flatnonzero(new != old)
    added = new[where] - old[where]
    old[where] = new[where]
    return Change(frame, where, added)


def joined(first: Change, second: Change) -> Change:
    """Two changes, one after the other, as one."""
    both = np.concatenate([first.where, second.where])
    both.sort(kind="stable")  # merges the two runs in one go; np.unique takes ten times as long
    where = both[np.diff(both, prepend=-1) != 0]
    added = np.zeros(len(where), dtype=np.uint32)
    for part in (first, second):
        added[np.searchsorted(where, part.where)] += part.added
    return Change(second.frame, where, added)


class Keyframes:
    """Changes between evenly spaced ones of the moments on offer, `limit` at most.

    How many moments will come is not known: whenever the limit is reached every second one is
    joined to its successor, and from then on only every second offer is taken. So between half
    the limit and the limit remain of however many, in memory that does not grow with them.
    """

    def __init__(self, geometry: Geometry, levels: int, limit: int = LIMIT) -> None:
        if limit < 3 or limit % 2 == 0:
            raise ValueError("the limit must be odd and at least 3")
        self.kept: list[Change] = []
        self._before = Evidence.empty(geometry, levels).counts
        self._limit, self._stride, self._offers = limit, 1, 0

    def offer(self, frame: int, evidence: Evidence) -> None:
        """The evidence after a frame; it may go on growing afterwards."""
        if self._offers % self._stride == 0:
            if len(self.kept) == self._limit:
                self._thin()
            if self._offers % self._stride == 0:
                self.kept.append(change(frame, evidence.counts, self._before))
        self._offers += 1

    def close(self, frame: int, evidence: Evidence) -> None:
        """The evidence after the last frame, which is always kept."""
        if self.kept and self.kept[-1].frame == frame:
            return
        self.kept.append(change(frame, evidence.counts, self._before))

    def _thin(self) -> None:
        pairs = zip(self.kept[1::2], self.kept[2::2], strict=True)
        self.kept = [self.kept[0], *(joined(a, b) for a, b in pairs)]
        self._stride *= 2


def percent(log_odds: Floats) -> npt.NDArray[np.int8]:
    """P(occupied) as nav_msgs/OccupancyGrid has it, 0..100, of log-odds of EMPTY."""
    return np.rint(100.0 * probability(-log_odds)).astype(np.int8)


class Pictures:
    """Maps of growing evidence in per cent, drawn anew only where readings came.

    Attributes:
        cells: curve name -> (rows * cols,) int8 P(occupied) 0..100, row 0 lowest.
    """

    def __init__(self, curves: Mapping[str, Curve], geometry: Geometry, levels: int) -> None:
        self._curves = dict(curves)
        self._seen = Evidence.empty(geometry, levels)
        self.cells = {name: percent(c.prior.values).reshape(-1) for name, c in curves.items()}

    def add(self, change: Change) -> None:
        """Bring every map up to a keyframe."""
        for name, cells, now in changed(self._curves, self._seen, change):
            self.cells[name][cells] = percent(now.values[0])


def changed(
    curves: Mapping[str, Curve], evidence: Evidence, change: Change
) -> Iterator[tuple[str, npt.NDArray[np.intp], Grid]]:
    """Bring evidence up to a keyframe; of every curve, the cells that it touched, as they are now.

    Yields:
        name, flat indices (n,), and a map of these cells alone, (1, n).
    """
    change.add_to(evidence)
    counts = evidence.counts.reshape(len(evidence.counts), -1)
    touched = np.zeros(counts.shape[1], dtype=np.bool_)
    touched[change.where % counts.shape[1]] = True
    cells = np.flatnonzero(touched)
    strip = Geometry(1, len(cells), 1.0, 0.0, 0.0)
    part = Evidence(strip, counts[:, None, cells])
    for name, (prior, p_levels, update) in curves.items():
        before = Grid(strip, prior.values.reshape(1, -1)[:, cells])
        yield name, cells, part.on(before, p_levels, update)
