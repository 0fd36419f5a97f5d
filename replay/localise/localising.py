"""localise(): a drive and a plan in, poses out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, Unpack

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Floats, Pose
from formats.plans.file import Plan
from formats.streaming.drive import Drive
from replay.localise.estimate import Estimate
from replay.localise.field import Field, build_field
from replay.localise.options import DEFAULTS, Options
from replay.localise.poses import Poses, carried, compose, inverse, joined, placed
from replay.localise.slam import fastslam, match_scans
from replay.localise.tracking import Sighting, Track, on_plan, steps


class Localiser(NamedTuple):
    """A way to poses.

    Attributes:
        find: sightings, the field of the plan where there is one, a start, a seed and options ->
            a track.
        needs_plan: it cannot do without a plan.
    """

    find: Callable[[Iterable[Sighting], Field | None, Estimate | None, int, Options], Track]
    needs_plan: bool = False


LOCALISERS = {
    "amcl": Localiser(on_plan, needs_plan=True),
    "match": Localiser(match_scans),
    "fastslam": Localiser(fastslam),
}
"""--poses -> how."""
HERE = Pose(0.0, 0.0, 0.0)


def localise(
    drive: Drive,
    plan: Plan | None,
    *,
    method: str = "amcl",
    start: Pose | None = None,
    covariance: Floats | None = None,
    seed: int = 0,
    notes: Notes | None = None,
    **options: Unpack[Options],
) -> Poses:
    """Find the sensor's poses, from the scans of a drive and its odometry where it has one.

    What needs odometry, where the drive has none, gets that of scan matching. What maps from a
    start on the plan, where none is given, starts where AMCL finds the robot.

    Args:
        drive: its poses are taken as odometry: only the way from one to the next counts.
        plan: its resolution must be known; it need not be placed. None: the map starts empty, in
            the frame of the odometry.
        method: a name in LOCALISERS.
        start: first pose of the body in the frame of the plan's yaml; None: anywhere on the plan.
        covariance: (3, 3) of `start`; nav2_amcl's 0.25 m², 0.25 m², (pi / 12)² where None.
        seed: the same one gives the same bits.
        notes: told how the free space was found, and when the pose was certain.
        options: see Options.

    Raises:
        UsageError: no such method or option, no plan where the method needs one, or the plan's
            resolution is not known.
        FormatError: the plan has no free space; no scan was readable.
    """
    notes = Notes() if notes is None else notes
    if method not in LOCALISERS:
        raise UsageError(method, "no such localiser", hint=f"there are {', '.join(LOCALISERS)}")
    if plan is None and LOCALISERS[method].needs_plan:
        raise UsageError(method, "there is no plan to be on", hint="take match")
    chosen: Options = {**DEFAULTS, **options}
    ground, frame = (build_field(plan, notes), plan.frame) if plan is not None else (None, HERE)
    mount = np.repeat([drive.choice.sensor_pose], len(drive), axis=0)
    odometry: Floats | None = joined(drive.times_ns, compose(drive.poses, inverse(mount)))
    if drive.choice.source.kind == "nothing":
        odometry = None
    begin, found = None, None
    if start is not None:
        spread = np.diag([0.25, 0.25, (np.pi / 12) ** 2]) if covariance is None else covariance
        begin = _turned(frame.inverse(), start, spread)
    lost = ground is not None and begin is None
    if odometry is None and (method != "match" or lost):
        odometry = _body(drive, None, match_scans(_Sightings(drive, None), None, None, 0, chosen))
    if method != "amcl" and lost:
        found = on_plan(_moving(drive, odometry, chosen), ground, None, seed, chosen)
        _tell(drive, notes, "amcl, which finds the start,", found)
        if len(found.times_ns):
            at = min(found.settled, len(found.times_ns) - 1)
            begin = Estimate(Pose(*found.poses[0].tolist()), found.covariances[at])
    track = LOCALISERS[method].find(_moving(drive, odometry, chosen), ground, begin, seed, chosen)
    if found is not None and begin is not None and not found.ever:
        # All of the way is known to itself only.
        track = replace(track, covariances=track.covariances + begin.covariance, doubt=found.doubt)
    body = _body(drive, odometry, track)
    _tell(drive, notes, method, track)
    rows = np.searchsorted(drive.times_ns, track.times_ns)
    m, k = len(drive), track.settled
    sensor = compose(np.repeat([frame], m, axis=0), compose(body, mount))
    last = np.maximum(np.searchsorted(rows, np.arange(m), side="right") - 1, 0)
    spun = np.array([_turned(frame, frame, c).covariance for c in track.covariances])
    row = int(rows[k]) if k < len(rows) else m
    samples = placed(track.samples, frame, drive.choice.sensor_pose)
    return Poses(drive.times_ns, sensor, spun[last], rows, track.particles, row, method, samples)


def _body(drive: Drive, odometry: Floats | None, track: Track) -> Floats:
    """(m, 3) of the body at every frame.

    Raises:
        FormatError: no scan was readable.
    """
    if not track.times_ns.size:
        raise FormatError(drive.log.path, "no scan is readable", topic=drive.choice.scan.name)
    rows = np.searchsorted(drive.times_ns, track.times_ns)
    still = np.zeros((len(drive), 3))
    return carried(drive.times_ns, still if odometry is None else odometry, rows, track.poses)


def _tell(drive: Drive, notes: Notes, method: str, track: Track) -> None:
    path = drive.log.path
    if track.doubt:
        problem = f"{method} cannot tell where it is on this plan: {track.doubt}; it may be another"
        notes.warn(path, f"{problem} building's, or wrongly scaled; the map may be wrong")
    elif track.settled < len(track.times_ns):
        seconds = (int(track.times_ns[track.settled]) - int(drive.times_ns[0])) / 1e9
        notes.info(path, f"poses from {method}, certain after {seconds:.1f} s")
    else:
        notes.warn(path, f"{method} never was certain of the pose; the map may be wrong")


@dataclass(frozen=True, eq=False)
class _Sightings:
    """The drive's scans with the odometry of the body, as often as they are asked for.

    Unreadable scans are left out.
    """

    drive: Drive
    odometry: Floats | None

    def __iter__(self) -> Iterator[Sighting]:
        drive = self.drive
        for frame in drive.frames():
            pose = None
            if self.odometry is not None:
                row = int(np.searchsorted(drive.times_ns, frame.time_ns))
                pose = Pose(*self.odometry[row].tolist())
            yield Sighting(frame.time_ns, pose, frame.scan, drive.choice.sensor_pose)


def _moving(drive: Drive, odometry: Floats | None, options: Options) -> _Sightings:
    """The sightings that a localiser looks at: where odometry says which, no others are decoded."""
    if odometry is None:
        return _Sightings(drive, None)
    taken = steps(odometry, options)
    return _Sightings(drive.only(taken), odometry[taken])


def _turned(by: Pose, pose: Pose, covariance: Floats) -> Estimate:
    """A pose and its covariance in another frame."""
    c, s = np.cos(by.yaw), np.sin(by.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Estimate(by @ pose, turn @ covariance @ turn.T)
