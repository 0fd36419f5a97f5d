"""Trajectories as the TUM format has them: one pose a line, `t x y z qx qy qz qw`.

Jürgen Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems" (2012): t in s, lengths
in m, the quaternion's scalar last, lines that begin with # are comments. evo, rpg_trajectory
and others read it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from decimal import Decimal, InvalidOperation
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes, printable
from formats.errors import Path as AnyPath
from formats.frame import Floats, Pose
from formats.output import write_text

LONGEST_LINE = 4096
LATEST = 12  # digits before the point of a time in s; ns then fit into 64 bits with room
NORM = 0.01  # how far a quaternion may be from its norm before that is worth a warning
HEADER = "# t [s] x y z [m] qx qy qz qw"


class Trajectory(NamedTuple):
    """Poses in time.

    Attributes:
        times_ns: (n,) int64, not decreasing.
        numbers: (n, 7) x, y, z in m and the unit quaternion qx, qy, qz, qw.
    """

    times_ns: npt.NDArray[np.int64]
    numbers: Floats

    def planar(self) -> Floats:
        """x, y, yaw (n, 3) in m, m, rad."""
        x, y, z, w = self.numbers[:, 3:].T
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.column_stack([self.numbers[:, :2], yaw])


def write_tum(
    path: AnyPath,
    times_ns: Iterable[int],
    poses: Iterable[Pose],
    *,
    comment: str = "",
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> None:
    """Write planar poses, times to the ns, numbers in full.

    Args:
        path: of the file.
        times_ns: of each pose.
        poses: in m, m, rad.
        comment: a first line about them.
        force: replace an existing file.
        inputs: files that are read, never to be replaced.

    Raises:
        FormatError: it cannot be written.
    """
    lines = [f"# {printable(comment)}"] if comment else []
    lines.append(HEADER)
    lines += [_line(int(t), pose) for t, pose in zip(times_ns, poses, strict=True)]
    write_text(path, "\n".join(lines) + "\n", force=force, inputs=inputs)


def _line(time_ns: int, pose: Pose) -> str:
    x, y, yaw = (float(value) for value in pose)
    z, w = np.sin(yaw / 2), np.cos(yaw / 2)
    return f"{seconds(time_ns)} {x!r} {y!r} 0.0 0.0 0.0 {float(z)!r} {float(w)!r}"


def seconds(time_ns: int) -> str:
    """Seconds with 9 decimals: 1664000000.123456789."""
    whole, rest = divmod(abs(time_ns), 10**9)
    return f"{'-' if time_ns < 0 else ''}{whole}.{rest:09d}"


def read_tum(path: AnyPath, notes: Notes | None = None) -> Trajectory:
    """Read a trajectory; lines out of time order are sorted, quaternions normalised.

    Args:
        path: of the file.
        notes: takes what was odd.

    Raises:
        FormatError: a line is not a pose, or there are none; with the line's number.
    """
    notes = notes or Notes()
    times: list[int] = []
    numbers: list[list[float]] = []
    for number, line in _lines(Path(path)):
        time, pose = _pose(path, number, line)
        norm = sum(q * q for q in pose[3:]) ** 0.5
        if norm < 1e-6:
            raise FormatError(path, "a quaternion of zeros", at=f"line {number}")
        if abs(norm - 1.0) > NORM:
            notes.warn(path, "quaternion normalised", at=f"line {number}")
        if times and time < times[-1]:
            notes.warn(path, "line out of time order, sorted", at=f"line {number}")
        times.append(time)
        numbers.append([*pose[:3], *(q / norm for q in pose[3:])])
    if not times:
        raise FormatError(path, "no poses in it", hint="each line is: t x y z qx qy qz qw")
    out = np.array(times, dtype=np.int64)
    order = np.argsort(out, kind="stable")
    return Trajectory(out[order], np.array(numbers)[order])


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of the lines that hold anything."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            number = 0
            while line := file.readline(LONGEST_LINE):
                number += 1
                if len(line) == LONGEST_LINE:
                    raise FormatError(
                        path, "a line of a trajectory is not so long", at=f"line {number}"
                    )
                text = line.strip()
                if text and not text.startswith("#"):
                    yield number, text
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error


def _pose(path: AnyPath, number: int, line: str) -> tuple[int, list[float]]:
    """Time in ns and the seven numbers of a line."""
    words = line.split()
    if len(words) != 8:
        raise FormatError(
            path,
            f"{len(words)} words where t x y z qx qy qz qw are 8",
            at=f"line {number}",
            hint="words stand apart by spaces" if "," in line else "",
        )
    try:
        time = Decimal(words[0])
        values = [float(word) for word in words[1:]]
    except (InvalidOperation, ValueError):
        time, values = Decimal("nan"), []
    if not (
        time.is_finite() and time.adjusted() < LATEST and values and all(map(isfinite, values))
    ):
        raise FormatError(path, f"not a pose: {printable(line, 60)}", at=f"line {number}")
    return int((time * 10**9).to_integral_value()), values
