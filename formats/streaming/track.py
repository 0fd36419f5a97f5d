"""Poses of one moving thing over time: cleaned, sorted, interpolated, never extrapolated."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.errors import Notes, Path
from formats.messages import Numbers
from formats.streaming.clock import SECOND, Clock, Stamped, Times

Floats = npt.NDArray[np.float64]
FARTHEST = 1e8  # m; UTM and ECEF coordinates lie below, garbage such as 1e9 above
EXACT = 1e-12  # a norm that is this near to 1 is taken as 1
UNIT = 1e-3  # a quaternion whose norm is off by more is worth a note
# A step is a teleport where it is longer and faster than any robot indoors.
JUMP_M, JUMP_SPEED = 1.0, 10.0
JUMP_RAD, JUMP_TURN = 1.0, 10.0
MAX_GAP_NS = 2 * SECOND
LONGEST_GAP_NS = 10 * SECOND  # also for poses that always come seldom
MANY = 10  # steps that say what is usual
STEADY = 1e-6  # m
STEADY_DOT = 1.0 - 1e-11  # of quaternions 1e-5 rad apart
MOST_TOLD = 20  # teleports


class Why(IntEnum):
    """Why a track has no pose at a time."""

    OK = 0
    BEFORE = 1
    AFTER = 2
    GAP = 3
    JUMP = 4


class Missing(NamedTuple):
    """Times at which something on the way to a pose is not known.

    Attributes:
        what: "transform odom > base_link".
        why: BEFORE, AFTER, GAP or JUMP.
        bound_ns: its first time for BEFORE, its last for AFTER, 0 where it has none.
        rows: (k,) which of the asked times; a row is counted once.
    """

    what: str
    why: Why
    bound_ns: int
    rows: npt.NDArray[np.intp]


def missing_of(
    what: str, known_ns: Times, why: npt.NDArray[np.uint8], wanted: npt.NDArray[np.bool_]
) -> list[Missing]:
    """The wanted rows that are not OK, by the reason; `known_ns` are the times that are known."""
    found = []
    for kind in (Why.BEFORE, Why.AFTER, Why.GAP, Why.JUMP):
        rows = np.flatnonzero((why == kind) & wanted)
        if rows.size:
            ends = {Why.BEFORE: known_ns[:1], Why.AFTER: known_ns[-1:]}.get(kind, known_ns[:0])
            found.append(Missing(what, kind, int(ends[0]) if ends.size else 0, rows))
    return found


@dataclass(eq=False)
class Samples(Stamped):
    """Poses as they come from a log, 72 bytes each: stamp, log time, x y z qx qy qz qw."""

    _numbers: array[float] = field(default_factory=lambda: array("d"), init=False, repr=False)

    def add(self, stamp_ns: int, log_ns: int, numbers: Numbers) -> None:
        """Keep one more."""
        self._stamps.append(stamp_ns)
        self._logs.append(log_ns)
        self._numbers.extend(numbers)

    @property
    def numbers(self) -> Floats:
        """(n, 7) x y z qx qy qz qw."""
        return np.frombuffer(self._numbers, dtype=np.float64).reshape(-1, 7)


@dataclass(frozen=True, eq=False)
class Track:
    """Clean poses in ascending time.

    Attributes:
        times_ns: (n,) strictly ascending.
        numbers: (n, 7) x y z and a unit quaternion qx qy qz qw.
        broken: (n - 1,) of Why: OK, GAP or JUMP between a sample and the next.
        odd: what was wrong with the samples -> how many.
    """

    times_ns: Times
    numbers: Floats
    broken: npt.NDArray[np.uint8]
    odd: dict[str, int]

    @classmethod
    def of(cls, samples: Samples, clock: Clock, *, max_gap_ns: int = MAX_GAP_NS) -> Track:
        """Clean and sort samples.

        Args:
            samples: as recorded.
            clock: gives the times that count.
            max_gap_ns: no interpolation between samples farther apart than this; where they always
                come seldom, than five times their usual distance, at most 10 s.
        """
        numbers, keep, odd = clean(samples.numbers)
        times = clock.times(samples.stamps_ns, samples.logs_ns)
        passes = clock.passes(samples.stamps_ns, samples.logs_ns)
        early = keep & (samples.stamps_ns < 0)
        if early.any() and not clock.by_log:
            odd["stamp before 1970 (dropped)"] = int(early.sum())
            keep &= ~early
        if not np.all(keep):
            times, numbers, passes = times[keep], numbers[keep], passes[keep]
        late = np.diff(times) < 0
        if np.any(late):
            odd["out of order (sorted)"] = int(np.count_nonzero(late))
            order = np.argsort(times, kind="stable")
            times, numbers, passes = times[order], numbers[order], passes[order]
        # Of several samples at one time the first counts, as in tf2.
        again = np.concatenate([[False], np.diff(times) == 0]) if times.size else late
        if np.any(again):
            other = again[1:] & (np.abs(np.diff(numbers, axis=0)) > STEADY).any(axis=1)
            if np.any(other):
                odd["another value at the same time (first one kept)"] = int(other.sum())
            times, numbers, passes = times[~again], numbers[~again], passes[~again]
        broken = breaks(times, numbers, max_gap_ns)
        broken[np.diff(passes) != 0] = Why.JUMP
        return cls(times, numbers, broken, odd)

    def __len__(self) -> int:
        return len(self.times_ns)

    def steady(self) -> bool:
        """Whether all samples agree: a mounting that is published again and again."""
        if not len(self):
            return False
        places, turns = self.numbers[:, :3], self.numbers[:, 3:]
        still = np.all(places.max(axis=0) - places.min(axis=0) <= STEADY)
        return bool(still) and bool(np.all(np.abs(turns @ turns[0]) >= STEADY_DOT))

    def tell(self, notes: Notes, path: Path, topic: str, name: str, zero_ns: int) -> None:
        """Note what was odd, and each teleport with its time from `zero_ns`."""
        for what, count in self.odd.items():
            notes.warn(path, f"{name}: {what}", topic=topic, count=count)
        for step in np.flatnonzero(self.broken == Why.JUMP)[:MOST_TOLD]:
            far = np.linalg.norm(self.numbers[step + 1, :3] - self.numbers[step, :3])
            at = f"{(self.times_ns[step + 1] - zero_ns) / SECOND:.2f} s"
            notes.warn(path, f"{name} jumps by {far:.1f} m; not interpolated", topic=topic, at=at)

    def at(self, times_ns: Times) -> tuple[Floats, npt.NDArray[np.uint8]]:
        """Interpolated poses: x y z linearly, the rotation by slerp.

        Returns:
            (n, 7) numbers, meaningless where there is none, and (n,) of Why.
        """
        n = len(self)
        if n == 0:
            identity = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(times_ns), 1))
            return identity, np.full(len(times_ns), Why.AFTER, dtype=np.uint8)
        i = np.clip(np.searchsorted(self.times_ns, times_ns, side="right") - 1, 0, max(n - 2, 0))
        j = np.minimum(i + 1, n - 1)
        start, end = self.times_ns[i], self.times_ns[j]
        share = np.clip((times_ns - start) / np.maximum(end - start, 1), 0.0, 1.0)
        why = np.zeros(len(times_ns), dtype=np.uint8)
        if n > 1:
            why = np.where((times_ns > start) & (times_ns < end), self.broken[i], why)
        why[times_ns < self.times_ns[0]] = Why.BEFORE
        why[times_ns > self.times_ns[-1]] = Why.AFTER
        return between(self.numbers[i], self.numbers[j], share), why


def clean(numbers: Floats) -> tuple[Floats, npt.NDArray[np.bool_], dict[str, int]]:
    """Unit quaternions, which rows are poses at all, and what was odd with how many.

    Returns the numbers themselves, not a copy, where all are in order: they may be very many.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        norms = np.sqrt(np.einsum("ij,ij->i", numbers[:, 3:], numbers[:, 3:]))
        turned = np.isfinite(norms) & (norms > 1e-6)
        placed = np.ones(len(numbers), dtype=bool)
        for axis in range(3):
            placed &= np.abs(numbers[:, axis]) < FARTHEST  # False for nan, too
        off = np.abs(norms - 1.0)
        scaled = turned & placed & (off > UNIT)
        if np.any(~(off <= EXACT)):
            numbers = np.concatenate([numbers[:, :3], numbers[:, 3:] / norms[:, None]], axis=1)
    counts = {
        "quaternion of zeros or not finite (dropped)": ~turned,
        "place not finite or beyond 1e8 m (dropped)": turned & ~placed,
        "quaternion not of norm 1 (normalised)": scaled,
    }
    odd = {text: int(rows.sum()) for text, rows in counts.items() if rows.any()}
    return numbers, turned & placed, odd


def breaks(times_ns: Times, numbers: Floats, max_gap_ns: int) -> npt.NDArray[np.uint8]:
    """(n - 1,) of Why: where the time to the next sample is a gap, or the step a teleport."""
    dt = np.diff(times_ns)
    broken = np.zeros(dt.size, dtype=np.uint8)
    if not dt.size:
        return broken
    seldom = min(5 * int(np.median(dt)), LONGEST_GAP_NS) if dt.size >= MANY else 0
    broken[dt > max(max_gap_ns, seldom)] = Why.GAP
    seconds = dt / SECOND
    step = np.sqrt(sum(np.square(np.diff(numbers[:, axis])) for axis in range(3)))
    dots = np.abs(np.einsum("ij,ij->i", numbers[:-1, 3:], numbers[1:, 3:]))
    turn = 2.0 * np.arccos(np.minimum(dots, 1.0))
    broken[(step > JUMP_M) & (step > JUMP_SPEED * seconds)] = Why.JUMP
    broken[(turn > JUMP_RAD) & (turn > JUMP_TURN * seconds)] = Why.JUMP
    return broken


def between(first: Floats, second: Floats, share: Floats) -> Floats:
    """Poses at a share of the way, row by row: x y z linear, quaternions by slerp (shorter arc)."""
    p, q = first[:, 3:], second[:, 3:]
    dots = np.einsum("ij,ij->i", p, q)
    angle = np.arccos(np.minimum(np.abs(dots), 1.0))
    sine = np.sin(angle)
    near = sine < 1e-9
    safe = np.where(near, 1.0, sine)
    a = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / safe)
    b = np.where(near, share, np.sin(share * angle) / safe) * np.where(dots < 0, -1.0, 1.0)
    turned = a[:, None] * p + b[:, None] * q
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    moved = first[:, :3] + share[:, None] * (second[:, :3] - first[:, :3])
    return np.concatenate([moved, turned], axis=1)


def matrices(numbers: Floats) -> Floats:
    """(n, 4, 4) of x y z and unit quaternions (n, 7)."""
    x, y, z, w = numbers[:, 3:].T
    m = np.zeros((len(numbers), 4, 4))
    m[:, 0, 0], m[:, 0, 1], m[:, 0, 2] = (
        1 - 2 * (y * y + z * z),
        2 * (x * y - z * w),
        2 * (x * z + y * w),
    )
    m[:, 1, 0], m[:, 1, 1], m[:, 1, 2] = (
        2 * (x * y + z * w),
        1 - 2 * (x * x + z * z),
        2 * (y * z - x * w),
    )
    m[:, 2, 0], m[:, 2, 1], m[:, 2, 2] = (
        2 * (x * z - y * w),
        2 * (y * z + x * w),
        1 - 2 * (x * x + y * y),
    )
    m[:, :3, 3], m[:, 3, 3] = numbers[:, :3], 1.0
    return m


def inverse(m: Floats) -> Floats:
    """The inverses of rigid (n, 4, 4)."""
    back = np.zeros_like(m)
    back[:, :3, :3] = m[:, :3, :3].transpose(0, 2, 1)
    back[:, :3, 3] = -np.einsum("nij,nj->ni", back[:, :3, :3], m[:, :3, 3])
    back[:, 3, 3] = 1.0
    return back
