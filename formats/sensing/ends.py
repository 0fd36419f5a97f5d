"""Where the beams of a scan ended: what is drawn of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Frame, Pose, Scan

Points = npt.NDArray[np.float32]
MOST_POINTS = 270  # of a scan
HORIZON = 1e4  # m, farther than any range sensor sees


class Beams(NamedTuple):
    """Some of a scan's beams.

    Attributes:
        bearings: (n,) rad.
        ranges: (n,) m.
        min_range, max_range: m.
    """

    bearings: Floats
    ranges: npt.NDArray[np.floating]
    min_range: float
    max_range: float


def thinned(scan: Scan) -> Beams:
    """Every so many beams, MOST_POINTS at most; views of the scan's arrays."""
    every = slice(None, None, max(1, -(-len(scan.ranges) // MOST_POINTS)))
    return Beams(scan.bearings[every], scan.ranges[every], scan.min_range, scan.max_range)


def ends_of(beams: Beams, pose: Pose) -> Points:
    """Where beams ended, (n, 2) m in the frame of the pose's parent."""
    with np.errstate(invalid="ignore"):
        seen = beams.ranges >= max(beams.min_range, 1e-6)
        seen &= beams.ranges < min(beams.max_range, HORIZON)
    reach, angles = beams.ranges[seen], beams.bearings[seen] + pose.yaw
    points = np.empty((len(reach), 2), dtype=np.float32)
    points[:, 0] = pose.x + reach * np.cos(angles)
    points[:, 1] = pose.y + reach * np.sin(angles)
    return points


def end_points(frame: Frame) -> Points:
    """Where the beams of a frame ended, (n, 2) m in the frame of its pose's parent, thinned."""
    return ends_of(thinned(frame.scan), frame.pose)
