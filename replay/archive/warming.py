"""What every run of a batch needs, loaded before the first: libraries, message types, kernels."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np

from formats.errors import Notes
from formats.frame import Frame, Pose, Scan
from formats.plans.plan import Plan
from formats.results.messages import store
from replay.mapper import Mapper
from replay.pipeline import steps
from replay.world import build_world

LIBRARIES = (  # imported on a run's way, where one asks for them
    "replay.running",
    "replay.placing",
    "formats.bag.log",
    "formats.carmen.log",
    "formats.mcap.log",
    "formats.rosbag2.log",
    "cv2",
    "scipy.ndimage",
)


def warm() -> None:
    """Import them and map one reading: a log's own process, forked from here, is the faster."""
    for name in LIBRARIES:
        import_module(name)
    store()
    pixels = np.zeros((40, 40), dtype=np.int8)
    pixels[0] = pixels[-1] = pixels[:, 0] = pixels[:, -1] = 100
    grey = np.where(pixels > 0, 0, 255).astype(np.uint8)
    plan = Plan(Path("room"), grey, pixels, 0.05, Pose(-1.0, -1.0, 0.0), True, {})
    beams = np.linspace(-1.0, 1.0, 8)
    ranges = np.full(8, 0.6, dtype=np.float32)
    frame = Frame(0, Pose(0.0, 0.0, 0.0), Scan(beams, np.full(8, 0.3), ranges, 0.1, 5.0))
    world = build_world(plan, None, (0.0, 0.0, 0.0, 0.0), 1.0, Notes(), plan_method="ink")
    mapper = Mapper(world.geometry, max_range=1.0)
    for _ in steps(iter([frame]), 1, world, mapper):
        pass
