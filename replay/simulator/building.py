"""From a plan and options to everything that a recording is made of."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from math import inf, radians
from typing import Any

import numpy as np

from formats.errors import Notes, UsageError
from formats.frame import Pose
from formats.plans.plan import Plan
from replay.cells import cell_layers
from replay.simulator import changes
from replay.simulator.camera import Camera
from replay.simulator.coverage import Ground
from replay.simulator.driving import Drift, Way, drive
from replay.simulator.options import Options
from replay.simulator.recording import Drive, Sensor
from replay.simulator.sensors import Lidar, Sonar
from replay.simulator.site import Mask, Site

MOST_READINGS = 10_000_000
ROOM = 0.3  # m about the robot at a place that it is sent to


def stream(seed: int, name: str) -> np.random.Generator:
    """A sequence of its own for each thing that is drawn, so that one option moves no other."""
    return np.random.default_rng([seed, *name.encode()])


def changed(site: Site, inside: Mask, options: Options, notes: Notes) -> Site:
    """The building as it really stands; see `changes`.

    Args:
        site: as drawn.
        inside: the building.
        notes: told where a share asks for what is not there.

    Raises:
        UsageError: no wall lies along a given line.
    """
    g, seed = site.geometry, options["seed"]
    solid, step = site.solid, site.geometry.resolution
    gone, fallen = np.zeros_like(solid), np.zeros_like(solid)
    for line in options["remove_wall"]:
        gone |= changes.wall_at(solid, line, g)
    for line in options["collapse_wall"]:
        fallen |= changes.wall_at(solid, line, g)
    if options["remove_walls"] or options["collapse_walls"]:
        found = changes.pieces(solid, inside, step)
        if not found:
            notes.warn("", "no straight piece of inner wall to remove or to collapse")
        some = changes.chosen(found, options["remove_walls"], stream(seed, "remove"))
        gone |= changes.mask_of(some, solid.shape)
        rest = [piece for piece in found if not any(piece is other for other in some)]
        some = changes.chosen(rest, options["collapse_walls"], stream(seed, "collapse"))
        fallen |= changes.mask_of(some, solid.shape)
    solid = solid & ~gone
    if fallen.any():
        solid = changes.collapsed(solid, fallen, inside, step, stream(seed, "rubble"))
    if options["deviation"]:
        solid = changes.displaced(solid, step, options["deviation"], stream(seed, "deviation"))
    if options["clutter"]:
        radius, share = options["robot_radius"], options["clutter"]
        # Not behind walls that stand off inwards, either.
        free = inside & ~site.solid & ~kept(site, options)
        solid = changes.cluttered(solid, free, share, step, radius, stream(seed, "clutter"))
    return site if solid is site.solid else site.with_solid(solid)


def kept(site: Site, options: Options) -> Mask:
    """Where no clutter may stand: about the places that are to be driven to."""
    g, out = site.geometry, np.zeros(site.geometry.shape, dtype=np.bool_)
    x = g.x + (np.arange(g.cols) + 0.5) * g.resolution
    y = g.y + (np.arange(g.rows) + 0.5) * g.resolution
    room = options["robot_radius"] + ROOM
    for pose in (*options["waypoint"], options["start"]):
        if pose is not None:
            out |= np.hypot(x[None, :] - pose.x, y[:, None] - pose.y) < room
    return out


def way_of(
    site: Site, inside: Mask, options: Options, plan: Plan, most: float
) -> tuple[Way, float]:
    """The drive, and the m² of ground that the robot can come to from its start.

    Args:
        most: seconds after which no more laps are planned.

    Raises:
        FormatError: there is no room for it.
        UsageError: a place is not free, or no way leads there.
    """
    ground = Ground(site, options["robot_radius"], inside, plan.path)
    given, rng = options["start"], stream(options["seed"], "start")
    points = [(pose.x, pose.y) for pose in options["waypoint"]]
    if given is None and points:
        start = ground.checked(*points[0])
    elif given is not None:
        start = ground.checked(given.x, given.y)
    elif options["random_start"]:
        free = np.argwhere(ground.parts == ground.largest)
        row, col = free[int(rng.integers(len(free)))]
        start = int(row), int(col)
    else:
        start = ground.start()
    reach = float(np.count_nonzero(ground.parts == ground.parts[start])) * ground.step**2
    metres = min(options["metres"], min(options["seconds"], most) * options["speed"])
    if points:
        goals = [start, *(ground.checked(x, y) for x, y in points)]
        legs = [ground.way(a, b) for a, b in pairwise(goals)]
        track = [legs[0][0], *(point for leg in legs for point in leg[1:])]
    else:
        track, left = [ground.point(*start)], metres
        for _ in range(options["laps"]):
            lap = ground.cover(ground.checked(*track[-1]), options["spacing"], left)
            left -= drive(lap, speed=1.0).metres
            track += lap[1:]
            if left <= 0.0:
                break
    if given is not None:
        track[0] = (given.x, given.y)
    yaw = given.yaw if given is not None else None
    pace = {name: options[name] for name in ("speed", "turn_rate", "pause")}
    way = drive(track, yaw=yaw, **pace)
    return way.within(metres=options["metres"], seconds=options["seconds"]), reach


def sensors_of(options: Options) -> dict[str, Sensor]:
    """The sensors by the names of their frames."""
    mount = options["sensor_pose"] or Pose(0.0, 0.0, 0.0)
    made: dict[str, tuple[str, Sensor]] = {
        "lidar": (
            "laser",
            Lidar(options["beams"], radians(options["fov_deg"]), mount=mount),
        ),
        "sonar": ("ultrasound", Sonar(radians(options["cone_deg"]), mount=mount)),
        "kinect": ("camera_depth_optical_frame", Camera(mount=mount, pitch=options["pitch"])),
    }
    out: dict[str, Sensor] = {}
    for kind in dict.fromkeys(options["sensor"]):
        frame, sensor = made[kind]
        noise = sensor.noise
        if (sigma := options["range_noise"]) is not None:
            noise = replace(noise, sigma=sigma, quadratic=0.0)
        shares: dict[str, Any] = {"dropout": options["dropout"], "mixed": options["mixed"]}
        noise = replace(noise, **{name: v for name, v in shares.items() if v is not None})
        asked: dict[str, Any] = {
            "min_range": options["min_range"],
            "max_range": options["range"],
            "rate": options["rate"],
            "height": options["sensor_height"],
        }
        said = {name: value for name, value in asked.items() if value is not None}
        out[frame] = sensor = replace(sensor, noise=noise, **said)
        if sensor.min_range >= sensor.max_range:
            problem = f"--min-range {sensor.min_range:g} is not below --range {sensor.max_range:g}"
            raise UsageError("", problem)
    return out


def build(plan: Plan, real: Plan | None, options: Options, notes: Notes) -> tuple[Drive, float]:
    """Everything a recording is made of, and the m² that the robot can come to.

    Args:
        plan: as drawn, its drawing taken apart.
        real: what stands there instead, on the plan's own pixels; None: the plan.
        notes: told what was odd.

    Raises:
        FormatError, UsageError: see `changed`, `way_of`, `Site.of_plan`.
    """
    drawn = Site.of_plan(plan)
    inside = cell_layers(plan, drawn.geometry).footprint
    stands = drawn if real is None else drawn.with_solid(np.ascontiguousarray(real.wall[::-1]))
    site = changed(stands, inside, options, notes)
    sensors = sensors_of(options)
    rate = sum(sensor.rate for sensor in sensors.values())
    way, reach = way_of(site, inside, options, plan, 2 * MOST_READINGS / rate)
    if (readings := way.seconds * rate) > MOST_READINGS:
        problem = f"{readings:,.0f} readings are too many"
        raise UsageError("", problem, hint="give --seconds, a lower --rate or fewer --laps")
    seen = drawn.solid
    if options["plan_speckle"]:
        rng = stream(options["seed"], "speckle")
        seen = changes.speckled(seen, options["plan_speckle"], rng)
    plain = {name: v for name, v in options.items() if v not in (None, inf, (), False)}
    made = Drive(
        site,
        seen,
        np.ascontiguousarray(plan.known[::-1]),
        way,
        sensors,
        drift=Drift(options["drift"], options["drift_pull"]),
        seed=options["seed"],
        origin=plan.origin,
        plan_pose=options["plan_offset"] or Pose(0.0, 0.0, 0.0),
        localised=options["localised"],
        about=json.dumps({"plan": plan.path.name, **plain}),
    )
    return made, reach
