"""Tracks of poses on the plan: corrections of odometry, interpolated between a filter's updates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Particles, Pose
from formats.streaming.clock import SECOND
from formats.streaming.track import JUMP_M, JUMP_RAD, JUMP_SPEED, JUMP_TURN

Times = npt.NDArray[np.int64]
Rows = npt.NDArray[np.intp]
HERE = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Poses:
    """Where the sensor was at every frame, and how surely.

    Attributes:
        times_ns: (m,) int64, of the frames.
        poses: (m, 3) x y yaw of the sensor, in the frame of the plan's yaml.
        covariances: (m, 3, 3) of the body's x, y, yaw in that frame, of the last update before.
        updates: (k,) rows of the frames at which the filter was updated.
        particles: (k,) how many there were.
        settled: the first row from which the covariance is below 0.3 m and 10 degrees; m if never.
        method: "amcl".
        samples: of the particles now and then, as poses of the sensor like `poses`.
    """

    times_ns: Times
    poses: Floats
    covariances: Floats
    updates: Rows
    particles: npt.NDArray[np.int64]
    settled: int
    method: str
    samples: tuple[Particles, ...] = ()


def compose(a: Floats, b: Floats) -> Floats:
    """Poses (n, 3), each followed by the other one expressed in it; yaw within -pi to pi."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    yaw = a[:, 2] + b[:, 2]
    x = a[:, 0] + c * b[:, 0] - s * b[:, 1]
    y = a[:, 1] + s * b[:, 0] + c * b[:, 1]
    return np.stack([x, y, np.arctan2(np.sin(yaw), np.cos(yaw))], axis=1)


def inverse(a: Floats) -> Floats:
    """The poses (n, 3) that undo these."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x = -c * a[:, 0] - s * a[:, 1]
    return np.stack([x, s * a[:, 0] - c * a[:, 1], -a[:, 2]], axis=1)


def joined(times_ns: Times, odometry: Floats) -> Floats:
    """Odometry whose teleports are taken out: what comes after goes on as before, by another step.

    A counter that was set back, or an origin that was moved, moves no robot. What is a teleport is
    what the log's poses are not interpolated over.

    Args:
        times_ns: (m,) ascending.
        odometry: (m, 3).

    Returns:
        (m, 3), the same array where there are none.
    """
    step, turn = np.diff(odometry, axis=0)[:, :2], np.diff(odometry[:, 2])
    far, turned = np.hypot(step[:, 0], step[:, 1]), np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
    seconds = np.diff(times_ns) / SECOND
    jumped = (far > JUMP_M) & (far > JUMP_SPEED * seconds)
    jumped |= (turned > JUMP_RAD) & (turned > JUMP_TURN * seconds)
    starts = np.flatnonzero(jumped) + 1
    if not starts.size:
        return odometry
    out = odometry.copy()
    for start, end in pairwise([*starts.tolist(), len(out)]):
        last = out[start - 1 : start]
        on = compose(inverse(out[start - 2 : start - 1]), last) if start > 1 else 0.0 * last
        shift = compose(compose(last, on), inverse(odometry[start : start + 1]))
        out[start:end] = compose(np.repeat(shift, end - start, axis=0), odometry[start:end])
    return out


def carried(times_ns: Times, odometry: Floats, updates: Rows, estimates: Floats) -> Floats:
    """Poses between updates: odometry, put right by a share of both neighbours' corrections.

    From update to update odometry is followed from both ends, and the two are blended in
    proportion to time; before the first and after the last there is one end only.

    Args:
        times_ns: (m,) of all poses, ascending.
        odometry: (m, 3).
        updates: (k,) rows with an estimate, ascending, at least one.
        estimates: (k, 3) of those.

    Returns:
        (m, 3).
    """
    after = np.searchsorted(updates, np.arange(len(times_ns)), side="right")
    low, high = np.maximum(after - 1, 0), np.minimum(after, len(updates) - 1)
    start, end = times_ns[updates[low]], times_ns[updates[high]]
    share = np.clip((times_ns - start) / np.maximum(end - start, 1), 0.0, 1.0)
    first = compose(estimates[low], compose(inverse(odometry[updates[low]]), odometry))
    second = compose(estimates[high], compose(inverse(odometry[updates[high]]), odometry))
    turn = second[:, 2] - first[:, 2]
    turn = np.arctan2(np.sin(turn), np.cos(turn))
    out = first + share[:, None] * (second - first)
    yaw = first[:, 2] + share * turn
    out[:, 2] = np.arctan2(np.sin(yaw), np.cos(yaw))
    return out


def placed(samples: Iterable[Particles], frame: Pose, mount: Pose = HERE) -> tuple[Particles, ...]:
    """Particles in another frame, or of what is mounted on the body."""
    out = []
    for time_ns, poses in samples:
        ones = np.ones((len(poses), 1))
        moved = compose(compose(ones * frame, poses), ones * mount)
        out.append(Particles(time_ns, moved))
    return tuple(out)
