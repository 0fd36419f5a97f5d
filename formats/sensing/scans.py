"""Readings of range sensors -> Scan: mirrored, projected, de-skewed, cut at a slab of heights."""

from __future__ import annotations

from functools import lru_cache
from math import atan2, cos, inf, nan, pi, radians
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.depth import scans as depth
from formats.depth.packed import check_packed
from formats.frame import Pose, Scan
from formats.messages import (
    Cloud,
    CompressedImage,
    Image,
    LaserScan,
    MultiEchoLaserScan,
    RangeReading,
)
from formats.sensing.echo import single_echo
from formats.sensing.sensor import LOOK, Floats, Look, Motion, Sensor

FLOAT32 = np.dtype(np.float32)
LEVEL = cos(radians(2.0))  # a sensor that tilts by less sees what a level one sees, within 1 cm
SLAB = 0.25  # m above and below a tilted sensor in which a return is of the wall it would see level
FLOOR = 0.05  # m; what a tilted sensor sees below is the floor
CLEARED = 5.0  # m; a beam without a return must stay within the slab so far to say anything
LEAST_STEP = 1e-6  # rad between beams
STILL = 5e-4  # m and rad: less motion during a sweep is not worth de-skewing


@lru_cache(maxsize=64)
def beams(start: float, step: float, count: int, mirrored: bool) -> tuple[Floats, Floats, bool]:
    """Ascending bearings and widths (count,) rad; True where the beams come in falling order.

    Shared by many scans: not to be written to. (They are not marked read-only, since kernels would
    then be compiled once more for them.)
    """
    bearings: Floats = start + step * np.arange(count, dtype=np.float64)
    falling = (step < 0) != mirrored
    if mirrored:
        bearings = -bearings
    if falling:
        bearings = bearings[::-1].copy()
    widths = np.full(count, min(abs(step), 2 * pi), dtype=np.float64)
    return bearings, widths, falling


def planar(matrix: Floats) -> Pose:
    """Place and heading of a sensor (4, 4): the direction of its x axis seen from above."""
    return Pose(
        float(matrix[0, 3]), float(matrix[1, 3]), atan2(float(matrix[1, 0]), float(matrix[0, 0]))
    )


def swept(
    reading: LaserScan | MultiEchoLaserScan,
    ranges: npt.NDArray[Any],
    matrix: Floats,
    motion: Motion | None,
) -> Scan:
    """A sweep of beams as seen from above by a sensor that is level, upside down or tilted."""
    near, far = reading.range_min, reading.range_max
    if near == far == 0.0:
        far = inf
    upright = float(matrix[2, 2])
    bearings, widths, falling = beams(
        reading.angle_min, reading.angle_increment, len(ranges), upright < 0
    )
    if falling or ranges.dtype is not FLOAT32:
        with np.errstate(over="ignore", invalid="ignore"):  # 1e300 m is inf
            ranges = np.array(ranges[::-1] if falling else ranges, dtype=FLOAT32)
    scan = Scan(bearings, widths, ranges, near, far)
    if -LEVEL < upright < LEVEL:
        return projected(scan, matrix, upright < 0)
    if motion is None:
        return scan
    return deskewed(scan, *(motion[::-1] if falling else motion))


def deskewed(scan: Scan, first: Pose, last: Pose) -> Scan:
    """A scan taken on the move, re-expressed at the pose of its middle beam.

    Args:
        scan: as measured, beams at equal times.
        first: pose of the sensor at beam 0, in its pose at the middle one.
        last: pose of the sensor at the last beam, likewise.
    """
    if len(scan.ranges) < 2 or max(abs(number) for number in (*first, *last)) < STILL:
        return scan
    from formats.sensing.kernels import deskew

    # A copy may be written to, as other scans: kernels are compiled once more for those that not.
    limits = float(scan.min_range), float(scan.max_range)
    bearings, ranges = deskew(scan.bearings, scan.ranges.copy(), *first, *last, *limits)
    turned = 1.0 + (last.yaw - first.yaw) / float(scan.bearings[-1] - scan.bearings[0])
    widths = scan.widths * max(turned, 0.1)
    return Scan(bearings, widths, ranges, scan.min_range, scan.max_range)


def projected(scan: Scan, matrix: Floats, mirrored: bool = False) -> Scan:
    """A tilted sensor's scan seen from above; what leaves the slab around it is no reading.

    Args:
        scan: its bearings count in the sensor's plane, negated where `mirrored`.
        matrix: (4, 4), the sensor in the map frame.
        mirrored: the sensor's z axis points down.
    """
    angles = -scan.bearings if mirrored else scan.bearings
    x, y, z = matrix[:3, :2] @ np.stack([np.cos(angles), np.sin(angles)])
    heading = planar(matrix).yaw
    bearings = np.unwrap(np.arctan2(y, x)) - heading
    flat = np.hypot(x, y)
    height = float(matrix[2, 3])
    with np.errstate(invalid="ignore"):  # of nan that signals
        r = scan.ranges.astype(np.float64)
    none = ~np.isfinite(r) | (r > scan.max_range)
    rise = np.where(none, CLEARED, r) * z
    off = np.abs(rise) > SLAB
    if height > 2 * FLOOR:
        off |= height + rise < FLOOR
    ranges = np.where(off, nan, np.where(none, r, r * flat)).astype(np.float32)
    order = np.argsort(bearings, kind="stable")
    # min_range and max_range hold along the beam; the least change of them keeps their meaning.
    ranges[~off & (r < scan.min_range)] = nan
    return Scan(bearings[order], scan.widths[order], ranges[order], 0.0, scan.max_range)


def laser_fault(reading: LaserScan | MultiEchoLaserScan) -> str:
    """Why a LaserScan cannot be used."""
    step = reading.angle_increment
    if not LEAST_STEP <= abs(step) <= 2 * pi:
        return f"angle_increment is {step:g}"
    if not abs(reading.angle_min) <= 8 * pi:
        return f"angle_min is {reading.angle_min:g}"
    if not reading.range_min <= reading.range_max:
        return f"range_min {reading.range_min:g} above range_max {reading.range_max:g}"
    ranges = reading.ranges if isinstance(reading, LaserScan) else reading.echoes
    if not len(ranges):
        return "no ranges"
    if isinstance(reading, LaserScan):
        first = reading.ranges[0]
        if first != first and np.isnan(reading.ranges).all():
            return "all ranges are nan"
    return ""


def laser_scan(
    reading: LaserScan, matrix: Floats, motion: Motion | None = None, _look: Look = LOOK
) -> Scan:
    """sensor_msgs/LaserScan."""
    return swept(reading, reading.ranges, matrix, motion)


def multi_echo_scan(
    reading: MultiEchoLaserScan, matrix: Floats, motion: Motion | None = None, look: Look = LOOK
) -> Scan:
    """sensor_msgs/MultiEchoLaserScan: one echo of each beam, nan where there is none."""
    return swept(reading, single_echo(reading, look.echo).ranges, matrix, motion)


def laser_sweep(reading: LaserScan | MultiEchoLaserScan) -> float:
    """Seconds from the first beam to the last."""
    ranges = reading.ranges if isinstance(reading, LaserScan) else reading.echoes
    return reading.time_increment * (len(ranges) - 1)


def laser_limit(reading: LaserScan | MultiEchoLaserScan) -> float:
    """range_max, or unlimited where it is not given."""
    return reading.range_max if reading.range_max > 0 else inf


def cone_fault(reading: RangeReading) -> str:
    """Why a Range cannot be used."""
    if not 0.0 < reading.field_of_view <= 2 * pi:
        return f"field_of_view is {reading.field_of_view:g}"
    if not reading.range_min <= reading.range_max:
        return f"range_min {reading.range_min:g} above range_max {reading.range_max:g}"
    return "range is nan" if reading.range != reading.range else ""


def cone_scan(
    reading: RangeReading, _matrix: Floats, _motion: Motion | None = None, _look: Look = LOOK
) -> Scan:
    """sensor_msgs/Range: one beam as wide as the cone."""
    return Scan(
        np.zeros(1),
        np.array([reading.field_of_view]),
        np.array([reading.range], dtype=np.float32),
        reading.range_min,
        reading.range_max,
    )


def no_sweep(_reading: object) -> float:
    """All at once."""
    return 0.0


def picture_scan(
    image: Image, matrix: Floats, _motion: Motion | None = None, look: Look = LOOK
) -> Scan:
    """A depth image; ValueError without its camera."""
    if look.camera is None:
        raise ValueError("a depth image needs its camera_info")
    return depth.depth_scan(image, look.camera, matrix, look.slab)


def compressed_fault(message: CompressedImage) -> str:
    """Whether there is a whole picture of depth in it, not decoded; Undecodable otherwise."""
    check_packed(message)
    return ""


def cloud_fault(cloud: Cloud) -> str:
    """Why a cloud cannot be used."""
    return "" if len(cloud.points) else "no points"


def cloud_scan(
    cloud: Cloud, matrix: Floats, _motion: Motion | None = None, look: Look = LOOK
) -> Scan:
    """A point cloud."""
    return depth.cloud_scan(cloud, matrix, look.slab)


def depth_limit(_reading: object) -> float:
    """The farthest horizontal distance that counts."""
    return depth.LIMITS[1]


LASER = Sensor(0, laser_fault, laser_scan, laser_sweep, laser_limit)
CAMERA = Sensor(1, depth.depth_fault, picture_scan, no_sweep, depth_limit, 2, solid=True)
PACKED = CAMERA._replace(rank=2, fault=compressed_fault)  # behind the same pictures as they are
CLOUD = Sensor(3, cloud_fault, cloud_scan, no_sweep, depth_limit, solid=True)
SENSORS: dict[str, Sensor] = {
    "sensor_msgs/msg/LaserScan": LASER,
    "foxglove.LaserScan": LASER,
    "sensor_msgs/msg/MultiEchoLaserScan": LASER._replace(scan=multi_echo_scan),
    "sensor_msgs/msg/Image": CAMERA,
    "foxglove.RawImage": CAMERA,
    "sensor_msgs/msg/CompressedImage": PACKED,
    "foxglove.CompressedImage": PACKED,
    "sensor_msgs/msg/PointCloud2": CLOUD,
    "sensor_msgs/msg/PointCloud": CLOUD,
    "foxglove.PointCloud": CLOUD,
    "sensor_msgs/msg/Range": Sensor(4, cone_fault, cone_scan, no_sweep, laser_limit),
}
