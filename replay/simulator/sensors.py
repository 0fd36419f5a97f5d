"""Range sensors of a simulated robot: what they are, and what they measure of a site."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan, pi, radians

import numpy as np

from formats.frame import Floats, Pose, Scan
from replay.simulator.casting import cast
from replay.simulator.site import Site

RAYS = radians(0.5)  # between the rays of a cone: at 4 m they lie 3.5 cm apart


@dataclass(frozen=True, slots=True)
class Noise:
    """What a reading suffers.

    Attributes:
        sigma: m, standard deviation of a range.
        quadratic: 1/m, of a depth: sigma + quadratic * depth^2 (stereo and structured light).
        dropout: share of the readings that come back as nothing.
        mixed: share of the beams at an edge that give a range between its two sides.
        block: pixels, a side of the squares that err alike, since a depth is matched by windows.
    """

    sigma: float = 0.01
    quadratic: float = 0.0
    dropout: float = 0.001
    mixed: float = 0.0
    block: int = 1


USUAL, QUIET = Noise(), Noise(0.0, 0.0, 0.0, 0.0)
CENTRE = Pose(0.0, 0.0, 0.0)
EDGE = 0.2  # m between neighbouring beams: a step of depth, not a slanting wall


@dataclass(frozen=True, slots=True)
class Lidar:
    """A planar laser scanner; beams counter-clockwise, evenly over the field of view.

    Attributes:
        beams: of one scan.
        field_of_view: rad; at 2 pi the last beam stands one step before the first.
        min_range, max_range: m.
        rate: scans a second.
        mount: in the base frame.
        height: m above the floor.
        noise: of each range.
    """

    beams: int = 360
    field_of_view: float = 2 * pi
    min_range: float = 0.15
    max_range: float = 12.0
    rate: float = 10.0
    mount: Pose = CENTRE
    height: float = 0.2
    noise: Noise = USUAL

    @property
    def step(self) -> float:
        """Rad between two beams."""
        whole = self.field_of_view > 2 * pi - 1e-6
        return self.field_of_view / max(self.beams - (0 if whole else 1), 1)

    @property
    def bearings(self) -> Floats:
        """(beams,) rad from the sensor's x axis."""
        start = -pi if self.field_of_view > 2 * pi - 1e-6 else -self.field_of_view / 2
        return np.asarray(start + self.step * np.arange(self.beams), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Sonar:
    """An ultrasound sensor: the nearest thing in a cone (the paper's phi and r, section 4.2).

    Attributes:
        angle: rad, the whole cone.
        min_range, max_range, rate, mount, height, noise: as of a Lidar.
    """

    angle: float = radians(30.0)
    min_range: float = 0.05
    max_range: float = 4.0
    rate: float = 10.0
    mount: Pose = CENTRE
    height: float = 0.2
    noise: Noise = USUAL


def disturbed(true: Floats, noise: Noise, rng: np.random.Generator) -> Floats:
    """Ranges in m as measured: mixed pixels, noise, drop-outs; inf is and stays nothing.

    Args:
        true: (..., n); neighbours along the last axis may mix.
    """
    found = true.copy()
    if noise.mixed > 0.0:
        chances, blends = rng.random(true.shape), rng.random(true.shape)
        step = np.diff(
            np.where(np.isfinite(true), true, nan), append=np.full_like(true[..., :1], nan)
        )
        edge = (np.abs(step) > EDGE) & (chances < noise.mixed)
        found[edge] += blends[edge] * step[edge]
    spread = noise.sigma + noise.quadratic * np.where(np.isfinite(found), found, 0.0) ** 2
    found += drawn(true.shape, noise.block, rng) * spread
    if noise.dropout > 0.0:
        found[rng.random(true.shape) < noise.dropout] = inf
    return found


def drawn(shape: tuple[int, ...], block: int, rng: np.random.Generator) -> Floats:
    """Normal numbers, alike in squares of `block` along the axes."""
    if block == 1:
        return rng.standard_normal(shape)
    few = rng.standard_normal(tuple(-(-n // block) for n in shape))
    for axis, n in enumerate(shape):
        few = np.repeat(few, block, axis=axis).take(range(n), axis=axis)
    return few


def measure(lidar: Lidar, site: Site, pose: Pose, rng: np.random.Generator) -> Floats:
    """Ranges (beams,) in m as the message has them: inf nothing, nan nearer than it can see."""
    true = cast(site, pose, lidar.bearings, lidar.max_range)
    return limited(disturbed(true, lidar.noise, rng), lidar.min_range, lidar.max_range)


def ping(sonar: Sonar, site: Site, pose: Pose, rng: np.random.Generator) -> Floats:
    """The range of one cone, (1,) in m: inf nothing, nan nearer than it can see."""
    rays = max(3, round(sonar.angle / RAYS) | 1)
    bearings = np.linspace(-sonar.angle / 2, sonar.angle / 2, rays)
    nearest = cast(site, pose, bearings, sonar.max_range).min(keepdims=True)
    return limited(disturbed(nearest, sonar.noise, rng), sonar.min_range, sonar.max_range)


def limited(ranges: Floats, least: float, most: float) -> Floats:
    """What lies beyond the sensor's limits: inf above, nan below (REP-117)."""
    return np.where(ranges < least, nan, np.where(ranges > most, inf, ranges))


def lidar_scan(lidar: Lidar, site: Site, pose: Pose, rng: np.random.Generator) -> Scan:
    """One scan from the sensor's pose in the site's frame."""
    ranges = measure(lidar, site, pose, rng)
    widths = np.full(lidar.beams, lidar.step)
    return Scan(lidar.bearings, widths, ranges, lidar.min_range, lidar.max_range)


def sonar_scan(sonar: Sonar, site: Site, pose: Pose, rng: np.random.Generator) -> Scan:
    """One reading as a scan of a single beam as wide as the cone."""
    ranges = ping(sonar, site, pose, rng)
    return Scan(np.zeros(1), np.array([sonar.angle]), ranges, sonar.min_range, sonar.max_range)


Planar = Lidar | Sonar
SCANS: dict[type, Callable[..., Scan]] = {Lidar: lidar_scan, Sonar: sonar_scan}
"""What a sensor of the plane measures, as a Scan."""
