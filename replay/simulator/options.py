"""The options of a simulated drive: names, types, defaults and bounds."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, Literal, TypedDict

from formats.errors import UsageError
from formats.frame import Pose
from replay.drawn import PlanMethod
from replay.option_ranges import check_options
from replay.simulator.changes import Line

Kind = Literal["lidar", "sonar", "kinect"]
KINDS = ("lidar", "sonar", "kinect")


class Options(TypedDict, total=False):
    """What may be said to `simulate`, by the names of the flags; None is the sensor's own.

    Attributes:
        plan_resolution, plan_origin, plan_method: as of `run`.
        plan_offset: pose of the plan's frame in the map frame.
        clutter: share of the free floor; remove_walls, collapse_walls: shares of the inner walls.
        remove_wall, collapse_wall: lines in m along the walls that are meant.
        deviation: m (RMS) that walls stand off; plan_speckle: share of pixels of /plan_map.
        start: m, m, rad; None: the widest place, or any place where random_start.
        waypoint: places to drive by, the shortest way; none: everywhere, `laps` times.
        spacing: m between the places that coverage visits.
        metres, seconds: budget of the drive.
        speed: m/s; turn_rate: rad/s; pause: s at each waypoint; robot_radius: m.
        sensor: which ones.
        sensor_pose, sensor_height, pitch: mount on the base, m and rad.
        beams, fov_deg: of the lidar; cone_deg: of the sonar.
        min_range, range: m; rate: Hz.
        range_noise: m; dropout, mixed: shares.
        drift: see driving.Drift; drift_pull: rad/m.
        localised: tf leads from the map to the base.
        seed: of everything that is drawn.
    """

    plan_resolution: float | None
    plan_origin: Pose | None
    plan_method: PlanMethod
    plan_offset: Pose | None
    clutter: float
    remove_walls: float
    collapse_walls: float
    remove_wall: tuple[Line, ...]
    collapse_wall: tuple[Line, ...]
    deviation: float
    plan_speckle: float
    start: Pose | None
    random_start: bool
    waypoint: tuple[Pose, ...]
    laps: int
    spacing: float
    metres: float
    seconds: float
    speed: float
    turn_rate: float
    pause: float
    robot_radius: float
    sensor: tuple[str, ...]
    sensor_pose: Pose | None
    sensor_height: float | None
    pitch: float
    beams: int
    fov_deg: float
    cone_deg: float
    min_range: float | None
    range: float | None
    rate: float | None
    range_noise: float | None
    dropout: float | None
    mixed: float | None
    drift: float
    drift_pull: float
    localised: bool
    seed: int


DEFAULTS: Options = {
    "plan_resolution": None,
    "plan_origin": None,
    "plan_method": "auto",
    "plan_offset": None,
    "clutter": 0.0,
    "remove_walls": 0.0,
    "collapse_walls": 0.0,
    "remove_wall": (),
    "collapse_wall": (),
    "deviation": 0.0,
    "plan_speckle": 0.0,
    "start": None,
    "random_start": False,
    "waypoint": (),
    "laps": 1,
    "spacing": 1.0,
    "metres": inf,
    "seconds": inf,
    "speed": 0.35,
    "turn_rate": 0.9,
    "pause": 0.0,
    "robot_radius": 0.2,
    "sensor": ("lidar",),
    "sensor_pose": None,
    "sensor_height": None,
    "pitch": 0.0,
    "beams": 360,
    "fov_deg": 360.0,
    "cone_deg": 30.0,
    "min_range": None,
    "range": None,
    "rate": None,
    "range_noise": None,
    "dropout": None,
    "mixed": None,
    "drift": 0.01,
    "drift_pull": 0.002,
    "localised": True,
    "seed": 2017,
}
# Least and most; nan is none of them.
RANGES: dict[str, tuple[float, float]] = {
    "plan_resolution": (1e-6, 1e3),
    "clutter": (0.0, 0.5),
    "remove_walls": (0.0, 1.0),
    "collapse_walls": (0.0, 1.0),
    "deviation": (0.0, 10.0),
    "plan_speckle": (0.0, 0.5),
    "laps": (1, 10_000),
    "spacing": (0.1, 1e3),
    "metres": (0.0, 1e7),
    "seconds": (0.0, 1e7),
    "speed": (1e-3, 100.0),
    "turn_rate": (1e-3, 100.0),
    "pause": (0.0, 1e5),
    "robot_radius": (0.0, 100.0),
    "sensor_height": (0.0, 100.0),
    "pitch": (-1.5, 1.5),
    "beams": (1, 100_000),
    "fov_deg": (0.01, 360.0),
    "cone_deg": (0.01, 180.0),
    "min_range": (0.0, 1e3),
    "range": (1e-3, 1e4),
    "rate": (1e-3, 1e4),
    "range_noise": (0.0, 100.0),
    "dropout": (0.0, 1.0),
    "mixed": (0.0, 1.0),
    "drift": (0.0, 10.0),
    "drift_pull": (-10.0, 10.0),
    "seed": (0, 2**63 - 1),
}
UNLIMITED = ("metres", "seconds")


def effective(options: Mapping[str, Any]) -> Options:
    """The options with the defaults of all the others.

    Raises:
        UsageError: there is no such option, a number is out of range, or they exclude each other.
    """
    check_options(options, DEFAULTS, RANGES, UNLIMITED)
    chosen: Options = {**DEFAULTS, **options}  # type: ignore[typeddict-item]
    unknown = [name for name in chosen["sensor"] if name not in KINDS]
    if unknown or not chosen["sensor"]:
        raise UsageError(", ".join(unknown), "no such sensor", hint=f"there are {', '.join(KINDS)}")
    if chosen["start"] and chosen["random_start"]:
        raise UsageError("", "--start and --random-start exclude each other", hint="give one")
    return chosen
