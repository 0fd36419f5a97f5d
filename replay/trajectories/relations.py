"""Errors of a trajectory by relations between its poses, which ask for no common frame.

Kümmerle et al., "On measuring the accuracy of SLAM algorithms" (Autonomous Robots 2009), Equations
3 and 4 with the weights of translation and rotation apart, as their tables have them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from formats.frame import Floats
from formats.relations import Relations
from formats.trajectory import Trajectory
from replay.trajectories.errors import interpolated


class RelationErrors(NamedTuple):
    """Of the relations whose two times the trajectory reaches.

    Attributes:
        metres: (n,) lengths of the translational errors.
        radians: (n,) absolute rotational errors.
        missed: relations beyond the trajectory or in its gaps.
    """

    metres: Floats
    radians: Floats
    missed: int


def relation_errors(trajectory: Trajectory, relations: Relations) -> RelationErrors:
    """What the poses say of each pair against what is true.

    Args:
        trajectory: of the sensor that the relations are of; times strictly ascending.
        relations: as read.
    """
    first, there = interpolated(trajectory, relations.first_ns)
    second, too = interpolated(trajectory, relations.second_ns)
    known = there & too
    a, b, wanted = first.planar()[known], second.planar()[known], relations.poses[known]
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    off = np.hypot(c * dx + s * dy - wanted[:, 0], c * dy - s * dx - wanted[:, 1])
    turn = b[:, 2] - a[:, 2] - wanted[:, 2]
    radians = np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
    return RelationErrors(off, radians, int((~known).sum()))
