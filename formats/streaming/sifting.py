"""Which scans of a topic can be used, by their own fields and times; the rest is counted."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes, Path
from formats.sensing.scans import LEVEL
from formats.streaming.clock import SECOND, Clock, Times, strays
from formats.streaming.gathering import ScanTimes
from formats.streaming.track import Floats, Samples

Mask = npt.NDArray[np.bool_]
LONG_GAP_S = 5.0
OFFSET_S = 0.1  # between stamps and log times: worth showing
APART_S = 0.5  # between the clocks of scans and of poses: worth a warning
YEAR_S = 365 * 86_400
STEEP = 0.87  # cosine of 30 degrees: a camera this near the vertical sees no room


def seconds(time_ns: int | np.integer, zero_ns: int) -> str:
    """A place in the log: "12.30 s" from its start."""
    return f"{(int(time_ns) - zero_ns) / SECOND:.2f} s"


def tell_clock(scans: ScanTimes, clock: Clock, notes: Notes, path: Path, zero_ns: int) -> None:
    """Note how stamps were understood: log times instead, jumps, their offset to log times."""
    name = scans.topic.name
    if clock.by_log:
        notes.warn(path, "header stamps are all 0: log times count", topic=name)
        return
    firsts = clock.after_ns[:, 0]
    for last, first, shift in zip(clock.before_ns[:, 0], firsts, clock.shifts_ns[1:], strict=True):
        back = (last - first) / SECOND
        problem = f"clock goes back by {back:.2f} s; what follows is a pass of its own"
        notes.warn(path, problem, topic=name, at=seconds(first + shift, zero_ns))
    if scans.unlimited:
        what = "range_max is 0, inf or unsaid: ranges are not limited"
        notes.warn(path, what, topic=name, count=scans.unlimited)
    lag = lag_s(scans.stamps_ns, scans.logs_ns)
    if abs(lag) > YEAR_S:
        notes.info(path, "stamps are of another clock than log times (simulated time)", topic=name)
    elif abs(lag) >= OFFSET_S:
        what = f"stamps lie {abs(lag):.2f} s {'before' if lag > 0 else 'after'} the log times"
        notes.info(path, what, topic=name)


def lag_s(stamps_ns: Times, logs_ns: Times) -> float:
    """Seconds by which messages are recorded after their stamps (the median)."""
    return float(np.median(logs_ns - stamps_ns)) / SECOND if len(stamps_ns) else 0.0


def apart_s(scans: ScanTimes, samples: Samples | None, delay_ns: int = 0) -> float:
    """What to add to the stamps of poses so that they agree with those of the scans, by log times.

    0 where log times cannot tell; `delay_ns` has been added already.
    """
    if samples is None or len(samples) < 2 or len(scans) < 2:
        return 0.0
    if samples.logs_ns[0] == samples.logs_ns[-1]:
        return 0.0
    if not samples.stamps_ns.any() or not scans.stamps_ns.any():
        return 0.0
    lag = lag_s(samples.stamps_ns, samples.logs_ns) - delay_ns / SECOND
    return lag - lag_s(scans.stamps_ns, scans.logs_ns)


def sift(
    scans: ScanTimes, times_ns: Times, window: Mask, zero_ns: int, notes: Notes, path: Path
) -> Mask:
    """Scans inside a window of time that can be used, each once; the others are counted.

    Args:
        scans: of the chosen topic.
        times_ns: (n,) when they count.
        window: (n,) the ones asked for.
        zero_ns: the start of the log.
        notes: where the others are counted.
        path: of the log.

    Raises:
        FormatError: none can be used.
    """
    name = scans.topic.name
    keep = window.copy()
    # By log times, which hold also where the stamps are what is wrong.
    start_ns = int(scans.logs_ns[0]) - (int(times_ns[0]) - zero_ns) if len(scans) else 0

    def drop(rows: Mask, why: str, *, count: bool = True) -> None:
        rows = rows & keep
        keep[rows] = False
        if count and rows.any():
            at = seconds(scans.logs_ns[rows][0], start_ns)
            notes.skip(path, why, topic=name, at=at, count=int(rows.sum()))

    for index, fault in enumerate(scans.faults[1:], 1):
        drop(scans.fault == index, fault, count=fault != "not readable")
    if not keep.any():
        faults = [fault for k, fault in enumerate(scans.faults) if k and (scans.fault == k).any()]
        problem = f"no scan can be used: {', '.join(faults)}" if faults else "no scans"
        if window.size and not window.any():
            problem = (
                f"no scans between --start-offset and its --duration; the log has {len(scans)}"
            )
        raise FormatError(path, problem, topic=name)
    drop(strays(times_ns), "stamp more than 1 s before an earlier one")
    order = np.lexsort((scans.frame, times_ns))
    again = np.zeros(len(times_ns), dtype=bool)
    same = (np.diff(times_ns[order]) == 0) & (np.diff(scans.frame[order].astype(int)) == 0)
    again[order[1:][same]] = True
    drop(again, "same stamp as the scan before")
    late = int((np.diff(times_ns[keep]) < 0).sum())
    if late:
        notes.warn(path, "scan out of order (sorted)", topic=name, count=late)
    tell_gaps(np.sort(times_ns[keep]), notes, path, name, zero_ns)
    frames = [scans.names[index] for index in np.unique(scans.frame[keep])]
    if len(frames) > 1 and not scans.topic.type.endswith("/Range"):  # a ring has many
        others = int((scans.frame[keep] != scans.frame[keep][0]).sum())
        problem = f"another frame than the first scan: {', '.join(frames)}"
        notes.warn(path, problem, topic=name, count=others)
    if "" in frames:
        notes.warn(path, "scans name no frame: taken as sitting on the body", topic=name)
    return keep


def tell_gaps(times_ns: Times, notes: Notes, path: Path, name: str, zero: int) -> None:
    """Note stretches without scans: longer than 5 s and than 20 usual steps."""
    steps = np.diff(times_ns)
    if steps.size:
        limit = max(LONG_GAP_S * SECOND, 20 * float(np.median(steps)))
        for row in np.flatnonzero(steps > limit)[:20]:
            at = seconds(times_ns[row], zero)
            notes.warn(path, f"no scans for {steps[row] / SECOND:.1f} s", topic=name, at=at)


def tell_attitude(scans: ScanTimes, upright: Floats, notes: Notes, path: Path) -> None:
    """Note a sensor that is upside down or tilted; its readings are mirrored or projected.

    Args:
        scans: of the topic.
        upright: (n,) cosine of the angle between the sensor's z axis and the vertical.
        notes: where it goes.
        path: of the log.
    """
    name = scans.topic.name
    if np.any(upright <= -LEVEL):
        notes.info(path, "sensor is upside down: its scans are mirrored", topic=name)
    tilted = np.abs(upright) < LEVEL
    if tilted.any():
        most = np.degrees(np.arccos(np.abs(upright).min()))
        what = (
            f"sensor is tilted by up to {most:.0f} deg: projected, what leaves its slab is left out"
        )
        notes.warn(path, what, topic=name, count=int(tilted.sum()))


def tell_aim(scans: ScanTimes, steep: Floats, notes: Notes, path: Path) -> None:
    """Note a camera that looks at the floor or the ceiling: its frame may be no optical one.

    Args:
        scans: of the topic.
        steep: (n,) cosine of the angle between the optical axis and the vertical.
        notes: where it goes.
        path: of the log.
    """
    aside = np.abs(steep) > STEEP
    if aside.any():
        what = "camera looks up or down: is its frame an optical one (x right, y down, z forward)?"
        notes.warn(path, what, topic=scans.topic.name, count=int(aside.sum()))


def plausible_sweeps(
    scans: ScanTimes, times_ns: Times, keep: Mask, notes: Notes, path: Path
) -> Times:
    """(n,) ns that each scan took; 0 where time_increment does not fit the time between scans."""
    sweeps = scans.sweeps_s
    steps = np.diff(np.sort(times_ns[keep])) / SECOND
    longest = min(1.1 * float(np.median(steps)), 1.0) if steps.size else 1.0
    good: Mask = keep & (sweeps > 0) & (sweeps <= longest)
    bad = keep & (sweeps != 0) & ~good
    if bad.any():
        what = f"time_increment makes a sweep of {sweeps[bad][0]:.3g} s: not de-skewed"
        notes.warn(path, what, topic=scans.topic.name, count=int(bad.sum()))
    # Whole microseconds: time_increment is a float32.
    return np.rint(np.where(good, sweeps, 0.0) * 1e6).astype(np.int64) * 1000
