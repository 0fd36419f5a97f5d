"""Whether a drive is sound: times, gaps, poses, and what its scans look like."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.log import Container
from formats.streaming.clock import SECOND, Times, strays
from formats.streaming.drive import Drive
from formats.streaming.sifting import LONG_GAP_S, YEAR_S, lag_s, seconds
from formats.streaming.track import Track, Why

UNEVEN = 0.1  # share of steps between scans above twice the usual one that is worth a word
FROZEN = 0.5  # share of scans that repeat the ranges of the one before
BLIND = 0.05  # share of beams with a return, below which a sensor hardly sees anything
NEAREST, FARTHEST = 0.05, 60.0  # m: a usual return indoors lies between


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes:
        name: "gaps".
        ok: False where the user should look.
        text: what was found, in a few words.
        numbers: the same as numbers, for --json.
    """

    name: str
    ok: bool
    text: str
    numbers: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        if not self.ok:
            return f"{self.name}: {self.text}"
        return f"{self.name} ok" + (f" ({self.text})" if self.text else "")


def checks_of(drive: Drive) -> list[Check]:
    """Every check of a surveyed drive; reads its scans once more."""
    times = drive.way.times_ns
    usual = np.sort(times[~strays(times)])
    return [
        order(times),
        stamps(drive),
        gaps(usual, drive.zero_ns),
        rate(usual),
        repeats(drive),
        coverage(drive),
        jumps(drive),
        *seen(drive),
    ]


def order(times_ns: Times) -> Check:
    """Scans recorded in the order in which they were taken."""
    astray = strays(times_ns)
    late = int((np.diff(times_ns[~astray]) < 0).sum())
    lost = int(astray.sum())
    words = [f"{late} out of order"] if late else []
    words += [f"{lost} more than 1 s early"] if lost else []
    return Check("order", not words, ", ".join(words), {"late": late, "strays": lost})


def stamps(drive: Drive) -> Check:
    """Header stamps against log times."""
    scans, clock = drive.way.scans, drive.way.gathered.clock(drive.way.scans)
    if clock.by_log:
        return Check("stamps", False, "all 0, log times count", {"lag": None})
    lag = lag_s(scans.stamps_ns, scans.logs_ns)
    if back := len(clock.after_ns):
        return Check("stamps", False, f"the clock goes back {back} x", {"lag": lag, "back": back})
    text = f"{abs(lag):.2f} s {'before' if lag >= 0 else 'after'} log times"
    if abs(lag) > YEAR_S:
        text = "of another clock than log times"
    return Check("stamps", True, text, {"lag": lag, "back": 0})


def gaps(times_ns: Times, zero_ns: int) -> Check:
    """The longest stretch without scans: 5 s and 20 usual steps are too long."""
    steps = np.diff(times_ns)
    if not steps.size:
        return Check("gaps", True, "one scan", {"longest": None})
    row = int(steps.argmax())
    longest = float(steps[row]) / SECOND
    limit = max(LONG_GAP_S, 20 * float(np.median(steps)) / SECOND)
    text = f"max {longest:.2f} s" + (
        "" if longest <= limit else f" after {seconds(times_ns[row], zero_ns)}"
    )
    return Check("gaps", longest <= limit, text, {"longest": longest})


def rate(times_ns: Times) -> Check:
    """How often scans come, and how evenly."""
    steps = np.diff(times_ns)
    steps = steps[steps > 0]
    if not steps.size:
        return Check("rate", True, "", {"hz": None, "uneven": 0.0})
    usual = float(np.median(steps))
    share = float((steps > 2 * usual).mean())
    text = f"{SECOND / usual:.1f} Hz"
    if share > UNEVEN:
        text += f", but {share:.0%} of the steps are more than twice as long"
    return Check("rate", share <= UNEVEN, text, {"hz": SECOND / usual, "uneven": share})


def repeats(drive: Drive) -> Check:
    """Scans that were recorded more than once: the same stamp and frame."""
    scans, times = drive.way.scans, drive.way.times_ns
    each = np.unique(np.stack([times, scans.frame.astype(np.int64)]), axis=1).shape[1]
    again = len(times) - each
    text = f"{again} of {len(times)} scans have the stamp of another" if again else ""
    return Check("repeats", not again, text, {"repeated": again})


def coverage(drive: Drive) -> Check:
    """How many of the scans have a pose."""
    have, total = int(drive.way.valid.sum()), drive.total
    text = f"{have} of {total} scans"
    return Check("poses", have == total, text, {"scans": total, "posed": have, "used": len(drive)})


def jumps(drive: Drive) -> Check:
    """Teleports of the robot."""
    count = sum(int((track.broken == Why.JUMP).sum()) for track in tracks(drive))
    return Check("jumps", not count, f"{count} in the poses" if count else "", {"jumps": count})


def tracks(drive: Drive) -> Iterator[Track]:
    """What moves between the map frame and the robot's body."""
    tree = drive.way.gathered.tree
    for source in (drive.way.source, drive.way.source.carrier):
        if source is not None and source.topic is not None:
            yield drive.way.gathered.poses[source.topic].track(tree.clock, tree.max_gap_ns)
        elif source is not None:
            for end in tree.path_between(source.map_frame, source.base_frame) or ():
                yield from (tree.track(edge) for edge in end if tree.samples(edge) is not None)


@dataclass
class Seen:
    """What the scans of a drive show, beams counted by what REP-117 makes of them."""

    scans: int = 0
    beams: int = 0
    fewest: int = 1 << 62
    most: int = 0
    returns: int = 0
    nothing: int = 0
    nan: int = 0
    frozen: int = 0
    _last: bytes = b""
    _medians: list[float] = field(default_factory=list)

    def add(self, ranges: npt.NDArray[np.floating], low: float, high: float) -> None:
        """One scan."""
        n = len(ranges)
        good = (ranges >= low) & (ranges <= high) & (ranges > 0) & np.isfinite(ranges)
        hits = int(np.count_nonzero(good))
        self.scans += 1
        self.beams += n
        self.fewest, self.most = min(self.fewest, n), max(self.most, n)
        self.returns += hits
        self.nan += int(np.count_nonzero(np.isnan(ranges)))
        self.nothing += int(np.count_nonzero(ranges > high))
        if hits:
            self._medians.append(float(np.median(ranges[good])))
            now = ranges.tobytes()
            self.frozen += now == self._last
            self._last = now

    @property
    def usual(self) -> float | None:
        """m, the median return."""
        return float(np.median(self._medians)) if self._medians else None


def seen(drive: Drive) -> list[Check]:
    """Beams, ranges, repeated readings and units, of the scans that the mapper would get."""
    found = Seen()
    # De-skewed ranges would hide a sensor that says the same again and again.
    raw = replace(drive, sweeps_ns=np.zeros_like(drive.sweeps_ns), _blocks={})
    for frame in raw.frames():
        scan = frame.scan
        found.add(scan.ranges, scan.min_range, scan.max_range)
    beams = max(found.beams, 1)
    share, usual = found.returns / beams, found.usual
    text = f"{share:.0%} returns, {found.nothing / beams:.0%} saw nothing, "
    text += f"{found.nan / beams:.0%} nan" + ("" if usual is None else f", median {usual:.3g} m")
    far = usual is not None and not NEAREST <= usual <= FARTHEST
    text += ": are these metres?" if far else ""
    numbers = {"returns": share, "nothing": found.nothing / beams, "nan": found.nan / beams}
    ranges = Check("ranges", share >= BLIND and not far, text, {**numbers, "median": usual})
    count = f"{found.most}" if found.fewest == found.most else f"{found.fewest} to {found.most}"
    same = Check("beams", found.fewest == found.most, count, {"most": found.most})
    often = found.frozen > FROZEN * max(found.scans - 1, 1)
    text = f"{found.frozen} of {found.scans} scans have the ranges of the one before"
    frozen = Check("fresh", not often, text if found.frozen else "", {"frozen": found.frozen})
    return [same, ranges, frozen]


def damage(container: Container, notes: Notes) -> Check:
    """Whether all that was recorded could be read."""
    lost = notes.total("lost")
    if container.whole and not lost:
        return Check("damage", True, "", {"lost": 0})
    text = container.state + (f", {lost} lost" if lost else "")
    return Check("damage", False, text, {"lost": lost})
