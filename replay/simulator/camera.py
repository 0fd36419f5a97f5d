"""A depth camera: walls from floor to ceiling, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, inf, radians, sin

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Pose
from formats.jit import njit
from replay.simulator.casting import ray
from replay.simulator.sensors import CENTRE, Noise, disturbed
from replay.simulator.site import Bytes, Site

MILLIMETRES = 1000.0  # a metre in 16UC1 (REP-118)
# Khoshelham and Elberink 2012: sigma = 1.425 mm/m^2 z^2, which is 36 mm at 5 m; a depth is found by
# comparing windows of 9 x 9 pixels, and at edges there is none rather than a mixed one.
KINECT = Noise(sigma=0.0, quadratic=1.425e-3, dropout=0.01, mixed=0.0, block=9)


@dataclass(frozen=True, slots=True)
class Camera:
    """A Kinect (the first one) by its published numbers; parted as (x right, y down, z ahead).

    Attributes:
        width, height_px: pixels.
        focal: pixels.
        min_range, max_range: m along the optical axis.
        rate: pictures a second (30 of the real one; they are large).
        mount: in the base frame, seen from above.
        height: m above the floor; pitch: rad, positive looks down.
        ceiling: m above the floor.
        noise: of each depth.
    """

    width: int = 640
    height_px: int = 480
    focal: float = 525.0
    min_range: float = 0.5
    max_range: float = 5.0
    rate: float = 5.0
    mount: Pose = CENTRE
    height: float = 0.6
    pitch: float = radians(0.0)
    ceiling: float = 2.5
    noise: Noise = KINECT

    @property
    def centre(self) -> tuple[float, float]:
        """The principal point, in pixels."""
        return (self.width - 1) / 2, (self.height_px - 1) / 2


@njit
def _depths(
    clear: Bytes,
    x: float,
    y: float,
    yaw: float,
    step: float,
    camera: tuple[float, float, float, float, float, float, float],
    out: Floats,
) -> None:
    """Depths (rows, cols) m along the optical axis; inf beyond the farthest.

    Args:
        camera: focal, cx, cy (pixels), height (m), pitch (rad), ceiling, farthest (m).
        step: m a pixel of the site.
    """
    focal, cx, cy, height, pitch, ceiling, farthest = camera
    for u in range(out.shape[1]):
        left = -(u - cx) / focal
        before, wall = inf, inf
        for v in range(out.shape[0]):
            down = (v - cy) / focal
            ahead = cos(pitch) - down * sin(pitch)
            up = -sin(pitch) - down * cos(pitch)
            flat = hypot(ahead, left)
            if ahead != before:  # a level camera sees one wall in a whole column
                c, s = cos(yaw), sin(yaw)
                i, j = (c * ahead - s * left) / flat, (s * ahead + c * left) / flat
                wall = ray(clear, x, y, i, j, farthest * flat / step) * step / flat
                before = ahead
            depth = wall
            if up < 0.0:
                depth = min(depth, height / -up)
            elif up > 0.0:
                depth = min(depth, (ceiling - height) / up)
            out[v, u] = depth if depth <= farthest else inf


def depths(camera: Camera, site: Site, pose: Pose) -> Floats:
    """What really stands before each pixel, (rows, cols) m along the optical axis; inf nothing.

    Args:
        pose: of the camera in the site's frame, seen from above.
    """
    out = np.empty((camera.height_px, camera.width))
    numbers = (camera.focal, *camera.centre, camera.height, camera.pitch)
    limits = (camera.ceiling, camera.max_range)
    step = site.geometry.resolution
    _depths(site.clear, *site.place(pose), pose.yaw, step, (*numbers, *limits), out)
    return out


def picture(
    camera: Camera, site: Site, pose: Pose, rng: np.random.Generator
) -> npt.NDArray[np.uint16]:
    """A depth picture as 16UC1 has it: mm, 0 where there is no depth."""
    found = disturbed(depths(camera, site, pose), camera.noise, rng)
    valid = (found >= camera.min_range) & (found <= camera.max_range)
    return np.where(valid, np.rint(np.where(valid, found, 0.0) * MILLIMETRES), 0).astype(np.uint16)
