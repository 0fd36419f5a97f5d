"""Decoded messages as nouns of their own: what a payload says, before any frame is built.

One noun serves every encoding (ROS 1, CDR, protobuf, JSON). Arrays may be read-only views on the
payload. Angles in rad, lengths in m, times in ns since 1970; quaternions as x, y, z, w.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Numbers = tuple[float, float, float, float, float, float, float]


class LaserScan(NamedTuple):
    """sensor_msgs/LaserScan; `ranges` (n,) float32 (float64 from Foxglove), no view on a file."""

    stamp_ns: int
    frame: str
    angle_min: float
    angle_increment: float
    time_increment: float
    range_min: float
    range_max: float
    ranges: npt.NDArray[np.floating]


class MultiEchoLaserScan(NamedTuple):
    """sensor_msgs/MultiEchoLaserScan; `echoes` one (k,) array of m a beam, `intensities` alike."""

    stamp_ns: int
    frame: str
    angle_min: float
    angle_increment: float
    time_increment: float
    range_min: float
    range_max: float
    echoes: list[npt.NDArray[np.float32]]
    intensities: list[npt.NDArray[np.float32]]


class RangeReading(NamedTuple):
    """sensor_msgs/Range: one cone of `field_of_view` rad about the frame's x axis."""

    stamp_ns: int
    frame: str
    field_of_view: float
    range_min: float
    range_max: float
    range: float


class Transform(NamedTuple):
    """A transform from `child` to `parent` coordinates: `numbers` = x y z qx qy qz qw."""

    stamp_ns: int
    parent: str
    child: str
    numbers: Numbers


class Transforms(NamedTuple):
    """tf2_msgs/TFMessage, tf/tfMessage, foxglove.FrameTransform(s)."""

    transforms: list[Transform]


class PoseMessage(NamedTuple):
    """PoseStamped, PoseWithCovarianceStamped, Odometry, PoseInFrame.

    `child` is what is posed ("" where the message does not say); `covariance` (6, 6) or None.
    """

    stamp_ns: int
    frame: str
    child: str
    numbers: Numbers
    covariance: Floats | None = None


class Image(NamedTuple):
    """sensor_msgs/Image; `data` is (height * step,) uint8, not yet interpreted."""

    stamp_ns: int
    frame: str
    height: int
    width: int
    encoding: str
    big_endian: bool
    step: int
    data: npt.NDArray[np.uint8]


class CompressedImage(NamedTuple):
    """sensor_msgs/CompressedImage; `format` as recorded, e.g. "16UC1; compressedDepth"."""

    stamp_ns: int
    frame: str
    format: str
    data: npt.NDArray[np.uint8]


class CameraInfo(NamedTuple):
    """sensor_msgs/CameraInfo; `k` (3, 3), `d` (n,) distortion.

    The picture may be a part of the camera's (`roi`: x, y, width, height in px, all 0 for the
    whole), and thinned (`binning`: px across and down for one of the picture's, 0 means 1).
    """

    stamp_ns: int
    frame: str
    height: int
    width: int
    model: str
    d: Floats
    k: Floats
    binning: tuple[int, int] = (1, 1)
    roi: tuple[int, int, int, int] = (0, 0, 0, 0)


class Cloud(NamedTuple):
    """PointCloud2, PointCloud, foxglove.PointCloud: `points` (n, 3) m, not filtered of nan."""

    stamp_ns: int
    frame: str
    points: npt.NDArray[np.floating]


class OccupancyGrid(NamedTuple):
    """nav_msgs/OccupancyGrid: `cells` (height, width) int8, -1 unknown, 0..100; row 0 lowest."""

    stamp_ns: int
    frame: str
    resolution: float
    origin: Numbers
    cells: npt.NDArray[np.int8]
