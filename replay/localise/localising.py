"""localise(): a drive with odometry and a plan in, poses on the plan out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Unpack

import numpy as np

from formats.drive import Drive
from formats.errors import FormatError, Notes, UsageError
from formats.frame import Floats, Pose
from formats.plan_file import Plan
from replay.localise.estimate import Estimate
from replay.localise.field import Field, build_field
from replay.localise.options import DEFAULTS, Options
from replay.localise.poses import Poses, carried, compose, inverse
from replay.localise.tracking import Sighting, Track, amcl

Localiser = Callable[[Iterable[Sighting], Field, Estimate | None, int, Options], Track]
LOCALISERS: dict[str, Localiser] = {"amcl": amcl}
"""--poses -> how: sightings on a plan's field to a track."""


def localise(
    drive: Drive,
    plan: Plan,
    *,
    method: str = "amcl",
    start: Pose | None = None,
    covariance: Floats | None = None,
    seed: int = 0,
    notes: Notes | None = None,
    **options: Unpack[Options],
) -> Poses:
    """Find the sensor's poses on a plan, from the odometry and the scans of a drive.

    Args:
        drive: its poses are taken as odometry: only the way from one to the next counts.
        plan: its resolution must be known; it need not be placed.
        method: a name in LOCALISERS.
        start: first pose of the body in the frame of the plan's yaml; None: anywhere on the plan.
        covariance: (3, 3) of `start`; nav2_amcl's 0.25 m², 0.25 m², (pi / 12)² where None.
        seed: the same one gives the same bits.
        notes: told how the free space was found, and when the pose was certain.
        options: see Options.

    Raises:
        UsageError: no such method or option, or the plan's resolution is not known.
        FormatError: the plan has no free space; no scan was readable.
    """
    notes = Notes() if notes is None else notes
    if method not in LOCALISERS:
        raise UsageError(method, "no such localiser", hint=f"there are {', '.join(LOCALISERS)}")
    chosen: Options = {**DEFAULTS, **options}
    field = build_field(plan, notes)
    mount = np.array([drive.choice.sensor_pose])
    odometry = compose(drive.poses, np.repeat(inverse(mount), len(drive), axis=0))
    begin = None
    if start is not None:
        spread = np.diag([0.25, 0.25, (np.pi / 12) ** 2]) if covariance is None else covariance
        begin = _turned(plan.frame.inverse(), start, spread)
    track = LOCALISERS[method](_sightings(drive, odometry), field, begin, seed, chosen)
    if not track.times_ns.size:
        raise FormatError(drive.log.path, "no scan is readable", topic=drive.choice.scan.name)
    rows = np.searchsorted(drive.times_ns, track.times_ns)
    body = carried(drive.times_ns, odometry, rows, track.poses)
    m, turn = len(drive), np.array([plan.frame])
    sensor = compose(np.repeat(turn, m, axis=0), compose(body, np.repeat(mount, m, axis=0)))
    last = np.maximum(np.searchsorted(rows, np.arange(m), side="right") - 1, 0)
    spun = np.array([_turned(plan.frame, plan.frame, c).covariance for c in track.covariances])
    k = track.settled
    row = int(rows[k]) if k < len(rows) else m
    _tell(drive, notes, method, row)
    return Poses(drive.times_ns, sensor, spun[last], rows, track.particles, row, method)


def _tell(drive: Drive, notes: Notes, method: str, row: int) -> None:
    path = drive.log.path
    if row < len(drive):
        seconds = (int(drive.times_ns[row]) - int(drive.times_ns[0])) / 1e9
        notes.info(path, f"poses from {method} on the plan, certain after {seconds:.1f} s")
    else:
        notes.warn(path, f"{method} never was certain of the pose; the map may be wrong")


def _sightings(drive: Drive, odometry: Floats) -> Iterator[Sighting]:
    """The drive's scans with the odometry of the body; unreadable scans are left out."""
    for frame in drive.frames():
        row = int(np.searchsorted(drive.times_ns, frame.time_ns))
        pose = Pose(*odometry[row].tolist())
        yield Sighting(frame.time_ns, pose, frame.scan, drive.choice.sensor_pose)


def _turned(by: Pose, pose: Pose, covariance: Floats) -> Estimate:
    """A pose and its covariance in another frame."""
    c, s = np.cos(by.yaw), np.sin(by.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Estimate(by @ pose, turn @ covariance @ turn.T)
