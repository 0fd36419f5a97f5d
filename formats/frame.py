"""Pose, Scan, Frame: what every algorithm consumes, with shapes and units."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, sin
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


class Pose(NamedTuple):
    """A place and heading in the plane, SE(2) (paper, Equation 8): m, m, rad."""

    x: float
    y: float
    yaw: float

    def __matmul__(self, other: Pose) -> Pose:
        """This pose, then `other` expressed in it; yaw is wrapped to (-pi, pi]."""
        c, s = cos(self.yaw), sin(self.yaw)
        yaw = self.yaw + other.yaw
        return Pose(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            atan2(sin(yaw), cos(yaw)),
        )

    def inverse(self) -> Pose:
        """The pose that undoes this one: `p @ p.inverse()` is the identity."""
        c, s = cos(self.yaw), sin(self.yaw)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)

    def apply(self, points: npt.ArrayLike) -> Floats:
        """Points (n, 2) in m of this pose's frame, expressed in its parent."""
        p = np.asarray(points, dtype=np.float64)
        c, s = cos(self.yaw), sin(self.yaw)
        return p @ np.array([[c, s], [-s, c]]) + np.array([self.x, self.y])


@dataclass(slots=True)
class Scan:
    """One reading of a range sensor in its own plane: the raw view, not cleaned.

    Kernels apply REP-117: nan is no reading, +inf saw nothing, -inf / 0 / below min_range is
    ignored, above max_range saw nothing.

    Attributes:
        bearings: (n,) float64 rad, counter-clockwise from the sensor's x axis, of beam centres.
        widths: (n,) float64 rad, positive: the angle that each beam stands for.
        ranges: (n,) float32 or float64 m.
        min_range, max_range: m.
    """

    bearings: Floats
    widths: Floats
    ranges: npt.NDArray[np.floating]
    min_range: float
    max_range: float


@dataclass(slots=True)
class Frame:
    """A scan with the pose of its sensor in the map frame, at an integer time.

    Attributes:
        time_ns: ns since 1970 (or since the simulation's start).
        pose: of the sensor in the frame of the poses (or of the plan, once placed on it).
        scan: the reading.
    """

    time_ns: int
    pose: Pose
    scan: Scan


class Particles(NamedTuple):
    """Where a localiser thought that the robot may be: a sample of its particles.

    Attributes:
        time_ns: of the scan that they were weighed by.
        poses: (n, 3) x, y, yaw; m, m, rad; each as likely as the others.
    """

    time_ns: int
    poses: Floats
