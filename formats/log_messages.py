"""Messages of a robot's log as CDR, from nouns and arrays; what a simulated robot publishes."""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, sin
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.frame import Pose
from formats.messages import LaserScan, RangeReading
from formats.results.messages import GRID, POSE, TF, encode, header, make, ros_pose, stamp

SCAN = "sensor_msgs/msg/LaserScan"
RANGE = "sensor_msgs/msg/Range"
IMAGE = "sensor_msgs/msg/Image"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
ODOMETRY = "nav_msgs/msg/Odometry"
TEXT = "std_msgs/msg/String"
ULTRASOUND = 0  # sensor_msgs/Range.ULTRASOUND

Quaternion = tuple[float, float, float, float]
Place = tuple[float, float, float]


def about_z(yaw: float) -> Quaternion:
    """x, y, z, w of a turn."""
    return 0.0, 0.0, sin(yaw / 2), cos(yaw / 2)


def laser_scan(scan: LaserScan) -> bytes:
    """sensor_msgs/LaserScan without intensities."""
    n = len(scan.ranges)
    message = make(
        SCAN,
        header=header(scan.stamp_ns, scan.frame),
        angle_min=scan.angle_min,
        angle_max=scan.angle_min + (n - 1) * scan.angle_increment,
        angle_increment=scan.angle_increment,
        time_increment=scan.time_increment,
        scan_time=0.0,
        range_min=scan.range_min,
        range_max=scan.range_max,
        ranges=np.asarray(scan.ranges, dtype=np.float32),
        intensities=np.zeros(0, dtype=np.float32),
    )
    return encode(message)


def range_reading(reading: RangeReading) -> bytes:
    """sensor_msgs/Range of an ultrasound sensor."""
    message = make(
        RANGE,
        header=header(reading.stamp_ns, reading.frame),
        radiation_type=ULTRASOUND,
        field_of_view=reading.field_of_view,
        min_range=reading.range_min,
        max_range=reading.range_max,
        range=reading.range,
    )
    return encode(message)


def depth_image(time_ns: int, frame: str, millimetres: npt.NDArray[np.uint16]) -> bytes:
    """sensor_msgs/Image, 16UC1 (REP-118)."""
    rows, cols = millimetres.shape
    data = np.ascontiguousarray(millimetres, dtype="<u2").view(np.uint8).ravel()
    message = make(
        IMAGE,
        header=header(time_ns, frame),
        height=rows,
        width=cols,
        encoding="16UC1",
        is_bigendian=0,
        step=2 * cols,
        data=data,
    )
    return encode(message)


def camera_info(
    time_ns: int, frame: str, size: tuple[int, int], focal: float, centre: tuple[float, float]
) -> bytes:
    """sensor_msgs/CameraInfo of a camera without distortion; (width, height), pixels."""
    k = np.array([focal, 0.0, centre[0], 0.0, focal, centre[1], 0.0, 0.0, 1.0])
    nothing = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
    message = make(
        CAMERA_INFO,
        header=header(time_ns, frame),
        height=size[1],
        width=size[0],
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=k,
        r=np.eye(3).ravel(),
        p=np.concatenate((k.reshape(3, 3), np.zeros((3, 1))), axis=1).ravel(),
        binning_x=0,
        binning_y=0,
        roi=make("sensor_msgs/msg/RegionOfInterest", do_rectify=False, **nothing),
    )
    return encode(message)


def transform(time_ns: int, parent: str, child: str, place: Place, turn: Quaternion) -> Any:
    """geometry_msgs/TransformStamped, for `transforms`; m."""
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header(time_ns, parent),
        child_frame_id=child,
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=make("geometry_msgs/msg/Vector3", **dict(zip("xyz", place, strict=True))),
            rotation=make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn, strict=True))),
        ),
    )


def planar(time_ns: int, parent: str, child: str, pose: Pose) -> Any:
    """A transform in the plane."""
    return transform(time_ns, parent, child, (pose.x, pose.y, 0.0), about_z(pose.yaw))


def transforms(some: Iterable[Any]) -> bytes:
    """tf2_msgs/TFMessage."""
    return encode(make(TF, transforms=list(some)))


def pose_stamped(time_ns: int, frame: str, pose: Pose) -> bytes:
    """geometry_msgs/PoseStamped."""
    return encode(make(POSE, header=header(time_ns, frame), pose=ros_pose(pose)))


def odometry(
    time_ns: int, frame: str, child: str, pose: Pose, speed: float = 0.0, turning: float = 0.0
) -> bytes:
    """nav_msgs/Odometry; m/s ahead and rad/s. Covariances are not stated."""
    zero = np.zeros(36)
    twist = make(
        "geometry_msgs/msg/Twist",
        linear=make("geometry_msgs/msg/Vector3", x=speed, y=0.0, z=0.0),
        angular=make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=turning),
    )
    message = make(
        ODOMETRY,
        header=header(time_ns, frame),
        child_frame_id=child,
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=ros_pose(pose), covariance=zero),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=zero),
    )
    return encode(message)


def grid(
    time_ns: int, frame: str, resolution: float, origin: Pose, cells: npt.NDArray[np.int8]
) -> bytes:
    """nav_msgs/OccupancyGrid; cells (rows, cols), row 0 lowest, 0..100 or -1; m a cell."""
    info = make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=stamp(time_ns),
        resolution=resolution,
        width=cells.shape[1],
        height=cells.shape[0],
        origin=ros_pose(origin),
    )
    data = np.ascontiguousarray(cells, dtype=np.int8).ravel()
    return encode(make(GRID, header=header(time_ns, frame), info=info, data=data))


def text(words: str) -> bytes:
    """std_msgs/String."""
    return encode(make(TEXT, data=words))
