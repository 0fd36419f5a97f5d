"""Which of the posed scans are taken: every n-th, and those taken after the robot moved on."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np
import numpy.typing as npt

from formats.frame import Floats

# Without min_travel and min_turn, readings_per_pose takes a robot that moves by less as standing.
STANDING_M, STANDING_RAD = 0.01, 0.01


def gate(
    poses: Floats,
    *,
    every: int = 1,
    min_travel: float = 0.0,
    min_turn: float = 0.0,
    readings_per_pose: int | None = None,
) -> npt.NDArray[np.intp]:
    """Rows of the poses whose scans are taken, ascending.

    Args:
        poses: (n, 3) x y yaw in the order of time.
        every: take rows 0, n, 2n ... and gate these.
        min_travel: m from the last place where scans were taken; 0 is off.
        min_turn: rad from the last heading; 0 is off. Either of the two opens the gate.
        readings_per_pose: scans taken at each place; by default 1 where a gate is on.

    Raises:
        ValueError: `every` or `readings_per_pose` is below 1, or a gate negative.
    """
    if every < 1 or (readings_per_pose is not None and readings_per_pose < 1):
        raise ValueError("every and readings_per_pose are at least 1")
    if min_travel < 0 or min_turn < 0:
        raise ValueError("min_travel and min_turn are not negative")
    rows = np.arange(0, len(poses), min(every, len(poses) + 1))
    if min_travel == 0 and min_turn == 0:
        if readings_per_pose is None:
            return rows
        min_travel, min_turn = STANDING_M, STANDING_RAD
    most, taken = readings_per_pose or 1, []
    place, count = None, 0
    for row, (x, y, yaw) in zip(rows.tolist(), poses[rows].tolist(), strict=True):
        if place is None or _moved(place, (x, y, yaw), min_travel, min_turn):
            place, count = (x, y, yaw), 0
        if count < most:
            taken.append(row)
            count += 1
    return np.array(taken, dtype=np.intp)


def _moved(
    a: tuple[float, float, float], b: tuple[float, float, float], travel: float, turn: float
) -> bool:
    if travel > 0 and hypot(b[0] - a[0], b[1] - a[1]) >= travel:
        return True
    angle = b[2] - a[2]
    return turn > 0 and abs(atan2(sin(angle), cos(angle))) >= turn
