"""Errors of a trajectory against the truth: APE and RPE, with evo's definitions and numbers.

Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems" (IROS 2012), and evo (Grupp),
whose rules of pairing and alignment these are.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from formats.streaming.track import Track, Why, breaks, inverse, matrices
from formats.trajectory import Trajectory

Unit = Literal["frames", "m", "rad", "deg"]
Pairs = npt.NDArray[np.intp]


def interpolated(
    reference: Trajectory, times_ns: npt.NDArray[np.int64], max_gap: float = 2.0
) -> tuple[Trajectory, npt.NDArray[np.bool_]]:
    """The reference at other times, never beyond its ends nor across a gap or a teleport.

    Args:
        reference: times strictly ascending.
        times_ns: (n,) wanted.
        max_gap: s.

    Returns:
        the poses (n), meaningless where there is none, and (n,) where there are.
    """
    broken = breaks(reference.times_ns, reference.numbers, round(max_gap * 1e9))
    track = Track(reference.times_ns, reference.numbers, broken, {})
    numbers, why = track.at(times_ns)
    return Trajectory(times_ns, numbers), why == Why.OK


def planar_trajectory(times_ns: npt.NDArray[np.int64], poses: Floats) -> Trajectory:
    """Planar poses (n, 3) x y yaw as a trajectory in space."""
    x, y, yaw = poses.T
    zero = np.zeros_like(x)
    return Trajectory(
        times_ns, np.column_stack([x, y, zero, zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)])
    )


class Alignment(NamedTuple):
    """A similarity: x becomes scale * rotation @ x + shift; (3, 3), (3,), no unit."""

    rotation: Floats
    shift: Floats
    scale: float

    def of(self, trajectory: Trajectory) -> Floats:
        """Its poses (n, 4, 4), aligned; only places are scaled."""
        m = matrices(trajectory.numbers)
        m[:, :3, 3] = self.scale * m[:, :3, 3] @ self.rotation.T + self.shift
        m[:, :3, :3] = self.rotation @ m[:, :3, :3]
        return m


NO_ALIGNMENT = Alignment(np.eye(3), np.zeros(3), 1.0)


def umeyama(reference: Trajectory, estimate: Trajectory, *, scaled: bool = False) -> Alignment:
    """What brings the estimate's places nearest to the reference's, in least squares.

    Umeyama, "Least-squares estimation of transformation parameters between two point patterns"
    (PAMI 1991), Equations 34 to 43.

    Args:
        reference, estimate: associated, of equal length.
        scaled: find the scale, too.

    Raises:
        ValueError: the places do not determine a rotation (fewer than three, or on a line).
    """
    x, y = estimate.numbers[:, :3], reference.numbers[:, :3]
    mean_x, mean_y = x.mean(axis=0), y.mean(axis=0)
    spread = float(np.square(x - mean_x).sum() / len(x))
    u, d, v = np.linalg.svd((y - mean_y).T @ (x - mean_x) / len(x))
    if np.count_nonzero(d > np.finfo(float).eps * max(d[0], 1e-300) * 3) < 2:
        raise ValueError("the trajectory is degenerate: its places do not determine a rotation")
    sign = np.ones(3)
    if np.linalg.det(u) * np.linalg.det(v) < 0.0:
        sign[2] = -1.0
    rotation = (u * sign) @ v
    scale = float(d @ sign) / spread if scaled else 1.0
    return Alignment(rotation, mean_y - scale * rotation @ mean_x, scale)


def ape(reference: Trajectory, estimate: Trajectory, alignment: Alignment = NO_ALIGNMENT) -> Floats:
    """Absolute pose errors (n, 4, 4): what the reference lacks to the estimate, Q^-1 P.

    Args:
        reference, estimate: associated, of equal length.
        alignment: of the estimate, first.
    """
    return np.asarray(inverse(matrices(reference.numbers)) @ alignment.of(estimate))


def rpe(
    reference: Trajectory,
    estimate: Trajectory,
    delta: float = 1,
    unit: Unit = "frames",
    *,
    all_pairs: bool = False,
    tolerance: float = 0.1,
) -> Floats:
    """Relative pose errors (k, 4, 4): (Qi^-1 Qj)^-1 (Pi^-1 Pj) over pairs of poses.

    Args:
        reference, estimate: associated, of equal length.
        delta: how far the poses of a pair are apart along the estimate, in `unit`.
        unit: "frames", "m" of way, "rad" or "deg" of turning.
        all_pairs: of every pose, not only of consecutive ones.
        tolerance: share of delta that all_pairs may be off, not for frames.

    Raises:
        ValueError: there are no such pairs.
    """
    p, q = matrices(estimate.numbers), matrices(reference.numbers)
    i, j = pairs(p, delta, unit, all_pairs=all_pairs, tolerance=tolerance)
    if not i.size:
        raise ValueError(f"no two poses are {delta:g} {unit} apart")
    wanted, found = inverse(q[i]) @ q[j], inverse(p[i]) @ p[j]
    return np.asarray(inverse(wanted) @ found)


def pairs(
    poses: Floats, delta: float, unit: Unit, *, all_pairs: bool = False, tolerance: float = 0.1
) -> tuple[Pairs, Pairs]:
    """Indices of the poses (n, 4, 4) that are `delta` apart; see `rpe`."""
    if unit == "frames":
        step = int(delta)
        i = np.arange(0, len(poses) - step, 1 if all_pairs else step)
        return i, i + step
    delta = float(np.radians(delta)) if unit == "deg" else delta
    if all_pairs:
        found = _by_way if unit == "m" else _by_angle
        return found(poses, delta, delta * tolerance)
    ends, gone = [0], 0.0
    for k, step in enumerate(_steps(poses, unit).tolist(), start=1):
        gone += step
        if gone >= delta:
            ends.append(k)
            gone = 0.0
    return np.array(ends[:-1], dtype=np.intp), np.array(ends[1:], dtype=np.intp)


def _steps(poses: Floats, unit: Unit) -> Floats:
    """(n - 1,) from each pose to the next: m, or rad."""
    if unit == "m":
        return np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return angles(inverse(poses[:-1]) @ poses[1:])


def _by_way(poses: Floats, delta: float, tolerance: float) -> tuple[Pairs, Pairs]:
    """For each pose the one later whose way is nearest to `delta`, within the tolerance."""
    gone = np.concatenate([[0.0], np.cumsum(_steps(poses, "m"))])
    best = [
        i + 1 + int(np.abs(gone[i + 1 :] - gone[i] - delta).argmin()) for i in range(len(gone) - 1)
    ]
    first, second = np.arange(len(gone) - 1), np.array(best, dtype=np.intp)
    near = np.abs(gone[second] - gone[first] - delta) <= tolerance
    return first[near], second[near]


def _by_angle(poses: Floats, delta: float, tolerance: float) -> tuple[Pairs, Pairs]:
    """For each pose all later ones that are turned against it by `delta`."""
    first, second = [], []
    for i in range(len(poses) - 1):
        turned = angles(inverse(poses[i : i + 1]) @ poses[i + 1 :])
        later = np.flatnonzero(np.abs(turned - delta) <= tolerance) + i + 1
        first += [i] * later.size
        second += later.tolist()
    return np.array(first, dtype=np.intp), np.array(second, dtype=np.intp)


def lengths(errors: Floats) -> Floats:
    """(n,) m: the translation part of errors (n, 4, 4)."""
    return np.linalg.norm(errors[:, :3, 3], axis=1)


def angles(errors: Floats) -> Floats:
    """(n,) rad: the angles of the rotations of errors (n, 4, 4), exact for small ones too."""
    r = errors[:, :3, :3]
    axis = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]])
    return np.arctan2(np.linalg.norm(axis, axis=0), np.trace(r, axis1=1, axis2=2) - 1.0)


def degrees(errors: Floats) -> Floats:
    """(n,) the same in degrees."""
    return np.degrees(angles(errors))


class Statistics(NamedTuple):
    """Of errors, as evo prints them; std is that of the population."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    sse: float


def statistics(errors: Floats) -> Statistics:
    """Statistics of (n,) errors.

    Raises:
        ValueError: there are none.
    """
    if not errors.size:
        raise ValueError("no errors to sum up")
    square = np.square(errors)
    found = (
        np.sqrt(square.mean()),
        errors.mean(),
        np.median(errors),
        errors.std(),
        errors.min(),
        errors.max(),
        square.sum(),
    )
    return Statistics(*(float(value) for value in found))
