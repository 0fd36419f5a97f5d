"""Where the beams of a scan ended: what is drawn of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formats.frame import Frame

Points = npt.NDArray[np.float32]
MOST_POINTS = 270  # of a scan
HORIZON = 1e4  # m, farther than any range sensor sees


def end_points(frame: Frame) -> Points:
    """Where the beams of a frame ended, (n, 2) m in the frame of its pose's parent, thinned."""
    scan, pose = frame.scan, frame.pose
    every = slice(None, None, max(1, -(-len(scan.ranges) // MOST_POINTS)))
    ranges = scan.ranges[every]
    with np.errstate(invalid="ignore"):
        seen = (ranges >= max(scan.min_range, 1e-6)) & (ranges < min(scan.max_range, HORIZON))
    reach, angles = ranges[seen], scan.bearings[every][seen] + pose.yaw
    points = np.empty((len(reach), 2), dtype=np.float32)
    points[:, 0] = pose.x + reach * np.cos(angles)
    points[:, 1] = pose.y + reach * np.sin(angles)
    return points
