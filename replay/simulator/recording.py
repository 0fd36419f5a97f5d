"""A simulated drive as the messages that a robot would have recorded, with its truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from heapq import merge
from math import cos, inf, sin, sqrt

import numpy as np

from formats import log_messages as ros
from formats.frame import Pose
from formats.log_writing import Recorded
from formats.messages import LaserScan, RangeReading
from formats.results.messages import GRID, POSE, TF
from replay.simulator.camera import Camera, picture
from replay.simulator.driving import Drift, Way, believed, correction
from replay.simulator.frames import SECOND, moments
from replay.simulator.sensors import CENTRE, Lidar, Sonar, measure, ping
from replay.simulator.site import Mask, Site

START_NS = 1_600_000_000 * SECOND
POSE_HZ = 20.0  # of tf, odometry and truth: fine enough to interpolate a turn on the spot
EDGE_S = 0.1  # poses begin and end so long before and after the readings
Sensor = Lidar | Sonar | Camera


@dataclass(frozen=True, slots=True)
class Drive:
    """Everything that a recording is made of.

    Attributes:
        site: what stands there, in the plan's frame.
        drawn: (rows, cols) wall pixels of the plan on the same lattice, row 0 lowest.
        known: (rows, cols) pixels of which the plan says anything.
        way: true poses of the base in the plan's frame.
        sensors: by the name of their frames.
        drift: of the wheels.
        seed: of all noise; each sensor has a sequence of its own.
        origin: of the pictures' lower left corner in the frame of the plan's yaml; its turn is that
            of the site's frame.
        plan_pose: of the yaml's frame in the map frame.
        localised: whether tf leads from the map to the base (a perfect localiser) or odometry only.
        about: JSON, how it was made.
    """

    site: Site
    drawn: Mask
    known: Mask
    way: Way
    sensors: dict[str, Sensor]
    drift: Drift = field(default_factory=Drift)
    seed: int = 2017
    origin: Pose = CENTRE
    plan_pose: Pose = CENTRE
    localised: bool = True
    about: str = "{}"

    @property
    def site_pose(self) -> Pose:
        """Of the site's frame in the map frame."""
        return self.plan_pose @ Pose(0.0, 0.0, self.origin.yaw)


def recorded(drive: Drive) -> Iterator[Recorded]:
    """All messages in the order of their times; the same drive gives the same bytes."""
    streams = [_once(drive), _poses(drive)]
    for number, (frame, sensor) in enumerate(drive.sensors.items()):
        rng = np.random.default_rng([drive.seed, 1 + number])
        streams.append(READINGS[type(sensor)](drive, frame, sensor, rng))
    return merge(*streams, key=lambda message: message.time_ns)


def _once(drive: Drive) -> Iterator[Recorded]:
    """What holds for the whole drive."""
    t = START_NS - round(EDGE_S * SECOND)
    fixed = [ros.planar(t, "map", "plan", drive.plan_pose)]
    fixed += [mounted(t, frame, sensor) for frame, sensor in drive.sensors.items()]
    yield Recorded(t, "/tf_static", TF, ros.transforms(fixed))
    for topic, wall in (("/truth_map", drive.site.solid), ("/plan_map", drive.drawn)):
        cells = np.where(wall, 100, np.where(drive.known, 0, -1)).astype(np.int8)
        step = drive.site.geometry.resolution
        yield Recorded(t, topic, GRID, ros.grid(t, "plan", step, drive.origin, cells))
    yield Recorded(t, "/simulation", ros.TEXT, ros.text(drive.about))


def mounted(time_ns: int, frame: str, sensor: Sensor) -> object:
    """The static transform of a sensor on the base."""
    place = (sensor.mount.x, sensor.mount.y, sensor.height)
    if not isinstance(sensor, Camera):
        return ros.transform(time_ns, "base_link", frame, place, ros.about_z(sensor.mount.yaw))
    return ros.transform(
        time_ns, "base_link", frame, place, optical(sensor.mount.yaw, sensor.pitch)
    )


def optical(yaw: float, pitch: float) -> ros.Quaternion:
    """The turn of an optical frame (x right, y down, z ahead; REP-103), pitch looking down."""
    # About z by yaw, about y by pitch, then from x ahead to z ahead: (-.5, .5, -.5, .5).
    a, b, c, d = cos(yaw / 2), sin(yaw / 2), cos(pitch / 2), sin(pitch / 2)
    x, y, z, w = -b * d, a * d, b * c, a * c
    return (
        0.5 * (-w + x - y - z),
        0.5 * (w + x + y - z),
        0.5 * (-w + x + y + z),
        0.5 * (w + x - y + z),
    )


def _poses(drive: Drive) -> Iterator[Recorded]:
    """Odometry, tf and true poses, POSE_HZ times a second, from before to after the readings."""
    way, edge = drive.way, EDGE_S
    rng = np.random.default_rng([drive.seed, 0])
    long = Way(
        np.concatenate(([0.0], way.times + edge, [way.seconds + 2 * edge])),
        np.concatenate((way.poses[:1], way.poses, way.poses[-1:])),
    )
    belief = believed(long, drive.drift, POSE_HZ, rng)
    to_odom = Pose(*belief.poses[0].tolist()).inverse()  # odometry starts at nought
    true = long.at(belief.times)
    speeds = np.diff(true, axis=0, append=true[-1:]) * POSE_HZ
    for t, row, here, (dx, dy, turning) in zip(
        belief.times.tolist(), belief.poses.tolist(), true.tolist(), speeds.tolist(), strict=True
    ):
        t_ns = START_NS + round((t - edge) * SECOND)
        wheels, real = to_odom @ Pose(*row), drive.site_pose @ Pose(*here)
        links = [ros.planar(t_ns, "odom", "base_link", wheels)]
        if drive.localised:
            links.insert(0, ros.planar(t_ns, "map", "odom", correction(wheels, real)))
        speed = sqrt(dx * dx + dy * dy)
        yield Recorded(t_ns, "/tf", TF, ros.transforms(links))
        said = ros.odometry(t_ns, "odom", "base_link", wheels, speed, turning)
        yield Recorded(t_ns, "/odom", ros.ODOMETRY, said)
        yield Recorded(t_ns, "/ground_truth", POSE, ros.pose_stamped(t_ns, "map", real))


def _times(drive: Drive, sensor: Sensor) -> Iterator[tuple[int, Pose]]:
    """When a sensor reads, and from where in the site's frame."""
    times = moments(drive.way, sensor.rate)
    for t, row in zip(times.tolist(), drive.way.at(times).tolist(), strict=True):
        yield START_NS + round(t * SECOND), Pose(*row) @ sensor.mount


def _scans(drive: Drive, frame: str, lidar: Lidar, rng: np.random.Generator) -> Iterator[Recorded]:
    start, step = float(lidar.bearings[0]), lidar.step
    for t, pose in _times(drive, lidar):
        ranges = measure(lidar, drive.site, pose, rng).astype(np.float32)
        limits = (lidar.min_range, lidar.max_range)
        data = ros.laser_scan(LaserScan(t, frame, start, step, 0.0, *limits, ranges))
        yield Recorded(t, "/scan", ros.SCAN, data)


def _cones(drive: Drive, frame: str, sonar: Sonar, rng: np.random.Generator) -> Iterator[Recorded]:
    for t, pose in _times(drive, sonar):
        r = float(np.nan_to_num(ping(sonar, drive.site, pose, rng)[0], nan=-inf, posinf=inf))
        data = ros.range_reading(
            RangeReading(t, frame, sonar.angle, sonar.min_range, sonar.max_range, r)
        )
        yield Recorded(t, "/range", ros.RANGE, data)


def _pictures(
    drive: Drive, frame: str, camera: Camera, rng: np.random.Generator
) -> Iterator[Recorded]:
    size, name = (camera.width, camera.height_px), "/camera/depth"
    for t, pose in _times(drive, camera):
        info = ros.camera_info(t, frame, size, camera.focal, camera.centre)
        yield Recorded(t, f"{name}/camera_info", ros.CAMERA_INFO, info)
        data = ros.depth_image(t, frame, picture(camera, drive.site, pose, rng))
        yield Recorded(t, f"{name}/image_raw", ros.IMAGE, data)


READINGS: dict[type, Callable[..., Iterator[Recorded]]] = {
    Lidar: _scans,
    Sonar: _cones,
    Camera: _pictures,
}
