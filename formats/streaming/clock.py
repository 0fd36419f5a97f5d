"""When a message counts: header stamps, or log times, with passes kept apart by their order."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Times = npt.NDArray[np.int64]
SECOND = 1_000_000_000
# Stamps that go back by less are messages out of order, by more a clock that was set back.
JUMP_NS = SECOND
# So many messages must agree that the clock is back; fewer are strays.
LASTING = 5
MOST_JUMPS = 1000
CLOSE_NS = 2 * SECOND  # messages of different topics are recorded out of step by less


@dataclass(eq=False)
class Stamped:
    """When messages were stamped and logged, in the order of the log: 16 bytes each."""

    _stamps: array[int] = field(default_factory=lambda: array("q"), init=False, repr=False)
    _logs: array[int] = field(default_factory=lambda: array("q"), init=False, repr=False)

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def stamps_ns(self) -> Times:
        """(n,) header stamps: a view, so all must have been added."""
        return np.frombuffer(self._stamps, dtype=np.int64)

    @property
    def logs_ns(self) -> Times:
        """(n,) log times, as `stamps_ns`."""
        return np.frombuffer(self._logs, dtype=np.int64)


def none() -> Times:
    """No jumps."""
    return np.empty((0, 2), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Clock:
    """How the stamps of one log become times that only go on.

    Where the stamps jump back (a clock set back, a recording played twice), a new pass begins: its
    stamps are shifted so that they go on from the last one as the log times do, and nothing is
    interpolated from one pass to another.

    Attributes:
        by_log: the header stamps say nothing (all 0): log times count.
        before_ns: (k, 2) the last stamp before each jump and its log time.
        after_ns: (k, 2) the first stamp after it, and its log time.
        shifts_ns: (k + 1,) what is added to the stamps of each pass.
    """

    by_log: bool = False
    before_ns: Times = field(default_factory=none)
    after_ns: Times = field(default_factory=none)
    shifts_ns: Times = field(default_factory=lambda: np.zeros(1, dtype=np.int64))

    @classmethod
    def of(cls, stamps_ns: Times, logs_ns: Times) -> Clock:
        """The clock that the messages of one topic, in their order, speak of."""
        if stamps_ns.size and not stamps_ns.any():
            return cls(by_log=True)
        starts = jumps(stamps_ns)
        if not starts.size:
            return cls()
        both = np.stack([stamps_ns, logs_ns], axis=1)
        before, after = both[starts - 1], both[starts]
        onward = np.maximum(after[:, 1] - before[:, 1], 1)
        shifts = np.concatenate([[0], np.cumsum(before[:, 0] - after[:, 0] + onward)])
        return cls(before_ns=before, after_ns=after, shifts_ns=shifts)

    def passes(self, stamps_ns: Times, logs_ns: Times) -> npt.NDArray[np.intp]:
        """Which pass each message belongs to: by its log time, close to a jump by its lag."""
        found = np.searchsorted(self.after_ns[:, 1], logs_ns, side="right")
        lags = logs_ns - stamps_ns
        for number, (before, after) in enumerate(zip(self.before_ns, self.after_ns, strict=True)):
            close = np.abs(logs_ns - after[1]) < CLOSE_NS
            close &= (found == number) | (found == number + 1)
            old, new = before[1] - before[0], after[1] - after[0]
            later = np.abs(lags - new) < np.abs(lags - old)
            found[close] = number + later[close]
        return found

    def times(self, stamps_ns: Times, logs_ns: Times) -> Times:
        """(n,) ns at which messages count."""
        if self.by_log:
            return logs_ns
        if not len(self.after_ns):
            return stamps_ns
        return stamps_ns + self.shifts_ns[self.passes(stamps_ns, logs_ns)]


def jumps(stamps_ns: Times) -> npt.NDArray[np.intp]:
    """Where stamps jump back by more than a second and stay there; strays are passed over."""
    found: list[int] = []
    steps = np.flatnonzero(np.diff(stamps_ns) < -JUMP_NS) + 1
    for start in steps[:MOST_JUMPS].tolist():
        before = stamps_ns[start - 1]
        if start > 1 and stamps_ns[start] >= stamps_ns[start - 2] - JUMP_NS:
            continue  # it was the one before that strayed, forwards
        if np.all(stamps_ns[start : start + LASTING] < before - JUMP_NS):
            found.append(start)
    return np.array(found, dtype=np.intp)


def strays(times_ns: Times, window_ns: int = JUMP_NS) -> npt.NDArray[np.bool_]:
    """Messages whose time lies more than `window_ns` before one that came earlier."""
    if not times_ns.size:
        return np.zeros(0, dtype=bool)
    # A single time far ahead of all its neighbours must not make strays of all that follow.
    ahead = np.zeros(times_ns.size, dtype=bool)
    ahead[1:-1] = (times_ns[1:-1] > times_ns[2:] + window_ns) & (
        times_ns[1:-1] > times_ns[:-2] + window_ns
    )
    steady = np.where(ahead, np.iinfo(np.int64).min, times_ns)
    return ahead | (times_ns < np.maximum.accumulate(steady) - window_ns)
