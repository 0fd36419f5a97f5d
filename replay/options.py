"""The options of a run: their names, types and defaults, in one place for library and CLI."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf
from os import PathLike
from typing import Any

from formats.depth.scans import SLAB
from formats.frame import Pose
from formats.grid import Update
from formats.plans.paper import Distance
from formats.sensing.echo import Echo
from replay.cells import Rule
from replay.drawn import PlanMethod
from replay.localise import options as localising
from replay.option_ranges import check_options
from replay.sensors.observer import NoReturn
from replay.world import Region


class Options(localising.Options, total=False):
    """What may be said to `run`, by the names of the flags; `replay run --help` explains each."""

    scan: str
    pose: str
    map_frame: str
    base_frame: str
    sensor_pose: Pose | None
    camera_info: str
    scan_height: tuple[float, float]
    echo: Echo
    pose_delay: float
    every: int
    readings_per_pose: int | None
    min_travel: float
    min_turn: float
    start_offset: float
    duration: float
    poses: str
    initial_pose: Pose | None
    initial_cov: tuple[float, float, float] | None
    seed: int
    truth_delay: float
    plan_resolution: float | None
    plan_origin: Pose | None
    plan_page: int
    plan_dpi: float | None
    drawing_scale: float | None
    plan_distance: Distance | None
    plan_edits: str | PathLike[str] | None
    plan_pose: Pose | None
    p_wall: float
    p_space: float
    p_outside: float
    prior_scale: float
    p_door: float | None
    p_window: float | None
    plan_method: PlanMethod
    plan_confidence: bool
    cell_rule: Rule
    region: Region
    sensor: str
    p_hit: float | None
    p_miss: float | None
    update: Update
    resolution: float
    max_range: float
    no_return: NoReturn


READING: Options = {
    "scan": "",
    "pose": "",
    "map_frame": "",
    "base_frame": "",
    "sensor_pose": None,
    "camera_info": "",
    "scan_height": SLAB,
    "echo": "first",
    "pose_delay": 0.0,
    "every": 1,
    "readings_per_pose": None,
    "min_travel": 0.0,
    "min_turn": 0.0,
    "start_offset": 0.0,
    "duration": inf,
}
GATES = ("every", "readings_per_pose", "min_travel", "min_turn")  # of READING: fewer scans
POSING: Options = {
    "poses": "auto",
    "initial_pose": None,  # anywhere on the plan
    "initial_cov": None,  # 0.25 m², 0.25 m², (pi / 12)²
    "seed": 0,
    "truth_delay": 0.0,
    **localising.DEFAULTS,  # type: ignore[typeddict-item]
}
PLAN: Options = {
    "plan_resolution": None,
    "plan_origin": None,
    "plan_page": 1,
    "plan_dpi": None,
    "drawing_scale": None,
    "plan_distance": None,
    "plan_edits": None,
}
WORLD: Options = {
    "plan_pose": None,
    "p_wall": 0.2,
    "p_space": 0.9,
    "p_outside": 0.5,
    "prior_scale": 0.9,
    "p_door": None,  # p_space
    "p_window": None,  # p_wall
    "plan_method": "auto",
    "plan_confidence": False,
    "cell_rule": "any",
    "region": "footprint",
    "sensor": "beam",
    "p_hit": None,  # the sensor model's
    "p_miss": None,
    "update": "bayes",
    "resolution": 0.05,
}
# Walls indoors lie nearer than 25 m, and the grid stays small.
MAPPING: Options = {"max_range": 25.0, "no_return": "near"}
DEFAULTS: Options = {**READING, **POSING, **PLAN, **WORLD, **MAPPING}
# Least and most of each number (s, m, rad, or a share); nan is none of them.
RANGES: dict[str, tuple[float, float]] = {
    "pose_delay": (-1e9, 1e9),
    "every": (1, inf),
    "readings_per_pose": (1, inf),
    "min_travel": (0.0, 1e6),
    "min_turn": (0.0, 1e6),
    "start_offset": (0.0, 1e9),
    "duration": (1e-9, 1e9),
    "plan_resolution": (1e-6, 1e3),
    "plan_page": (1, inf),
    "plan_dpi": (1e-3, 1e6),
    "drawing_scale": (0.1, 1e5),
    "p_wall": (0.0, 1.0),
    "p_space": (0.0, 1.0),
    "p_door": (0.0, 1.0),
    "p_window": (0.0, 1.0),
    "p_outside": (0.0, 1.0),
    "prior_scale": (1e-9, 1.0),
    "p_hit": (0.0, 1.0),
    "p_miss": (0.0, 1.0),
    "resolution": (1e-4, 1e3),
    "max_range": (1e-3, 1e6),
    "seed": (0, 2**63 - 1),
    "truth_delay": (-1e9, 1e9),
    **localising.RANGES,
}
UNLIMITED = ("duration", "max_range")  # may be inf, too


def effective(options: Mapping[str, Any]) -> Options:
    """The options with the defaults of all the others.

    Raises:
        UsageError: there is no such option, or its number is out of range.
    """
    check_options(options, DEFAULTS, RANGES, UNLIMITED)
    return {**DEFAULTS, **options}  # type: ignore[typeddict-item]


def among(options: Options, names: Iterable[str]) -> dict[str, Any]:
    """Those of the options that belong to one part of the work."""
    return {name: options[name] for name in names}  # type: ignore[literal-required]


def plan_values(options: Options) -> dict[str, Any]:
    """What `open_plan` is told of the plan's page, scale and place."""
    return {
        "resolution": options["plan_resolution"],
        "origin": options["plan_origin"],
        "page": options["plan_page"] - 1,
        "dpi": options["plan_dpi"],
        "drawing_scale": options["drawing_scale"],
        "distance": options["plan_distance"],
    }
