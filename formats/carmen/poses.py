"""What the poses in a CARMEN log's laser lines are: odometry, or what a mapper made of it."""

from __future__ import annotations

from array import array
from math import pi

import numpy as np
import numpy.typing as npt

from formats.carmen.lines import Line
from formats.frame import Pose

MOST = 100_000  # laser lines that are looked at
FARTHEST = 3.0  # m; a laser that lies farther from its robot is not mounted on it
SAME = 0.02  # m, and of cosines: the mounting is always the same, but for rounding
Floats = npt.NDArray[np.float64]


class Columns:
    """Poses of robot and laser of one kind of line, 48 bytes each."""

    def __init__(self) -> None:
        self._numbers = array("d")
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, line: Line) -> None:
        """One line that has both."""
        self._numbers.extend((*(line.robot or ()), *(line.laser or ())))
        self._count += 1

    def mounted(self) -> Floats:
        """(n, 4) x y cos sin of the laser on the robot, where both are finite."""
        both = np.frombuffer(self._numbers, dtype=np.float64).reshape(-1, 6)
        with np.errstate(invalid="ignore"):
            both = both[(np.abs(both) < 1e8).all(axis=1)]
        x, y = both[:, 3] - both[:, 0], both[:, 4] - both[:, 1]
        c, s = np.cos(both[:, 2]), np.sin(both[:, 2])
        turn = both[:, 5] - both[:, 2]
        return np.stack([c * x + s * y, c * y - s * x, np.cos(turn), np.sin(turn)], axis=1)


def mount_of(columns: Columns) -> Pose | None:
    """The laser on the robot; None where the two poses are not of one frame."""
    found = columns.mounted()
    if not len(found):
        return None
    usual = np.median(found, axis=0)
    near = (np.abs(found - usual) < SAME).all(axis=1)
    if near.mean() < 0.9 or np.hypot(usual[0], usual[1]) > FARTHEST:
        return None
    x, y, c, s = found[near].mean(axis=0).round(6) + 0.0  # no -0.0
    return Pose(float(x), float(y), float(np.arctan2(s, c)))


def mount_by_parameters(parameters: dict[bytes, float], frame: str) -> Pose | None:
    """What PARAM lines say of the front laser, or of the rear one, which looks back."""
    side = {"front_laser": "front", "laser1": "front", "rear_laser": "rear"}.get(frame)
    if side is None:
        return None
    words = ("offset", "side_offset", "angular_offset")
    x, y, yaw = (parameters.get(f"robot_{side}laser_{word}".encode(), 0.0) for word in words)
    if not all(abs(number) < FARTHEST for number in (x, y)) or not abs(yaw) <= 2 * pi:
        return Pose(0.0, 0.0, pi if side == "rear" else 0.0)
    return Pose(x, y, yaw) if side == "front" else Pose(-abs(x), y, pi + yaw)


def corrected(columns: Columns, *, by_mapper: bool, name: str) -> str:
    """Why the poses of the laser lines are not plain odometry, "" where they are.

    Args:
        columns: of robot and laser.
        by_mapper: the log has NEFF lines, which GMapping writes.
        name: of the file.
    """
    if by_mapper:
        return "the log is a mapper's (NEFF lines)"
    if mount_of(columns) is None and len(columns.mounted()):
        return "those of laser and robot differ by more than a mounting"
    if "corrected" in name.lower():
        return "the file's name says so"
    return ""
