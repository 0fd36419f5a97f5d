"""The paper's simulation (section 4.2): a drawing, a robot that knows its pose, a turning sensor.

The robot is a point that visits the free space; at each place its ultrasound cone looks round. A
cell that a reading shows is told its true share of empty pixels, times 0.9: the paper's inverse
model "multiplies true occupancy values" (PAPER A33). `detected` tells it what the cone measured
instead. Cells are n x n map pixels, and maps are scored by map pixel (A15). What the paper leaves
open (A20: angle, range, path, scale) are the defaults of `Setup`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import ceil, hypot, pi, radians
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.errors import Path as AnyPath
from formats.frame import Frame, Pose
from formats.grid import Counted, Evidence, Geometry, Grid, Update, logit
from replay.cells import GAP, Rule, enclosed
from replay.mapper import Mapper
from replay.prior import used
from replay.sensors.observer import MODELS, Model
from replay.simulator.coverage import Ground as Floor
from replay.simulator.sensors import QUIET, SCANS, Lidar, Noise, Planar, Sonar
from replay.simulator.site import Site
from replay.tuning.cases import KINDS, MIXED, OUTSIDE, WALL, Bools, Floats, Ground, Ints, ground
from replay.tuning.surfaces import Values

Occupancy = Literal["true", "detected"]
ScoredRegion = Literal["footprint", "image", "observed"]
DETECTED = MODELS["eq10"].samples  # a cell's sub-samples along a side, where it is `detected`


@dataclass(frozen=True)
class Setup:
    """How a drawing is explored.

    Attributes:
        cell: map pixels along a cell's side: 3, 5 and 10 in the paper.
        occupancy: what a reading tells of a cell: its true share, or what the sensor detected.
        model: what a reading says, by its name in MODELS; of n x n sub-samples.
        angle, reach: of the cone, rad and m.
        noise: of its range.
        lidar: another sensor than the cone, with its own noise.
        spacing: m between the places that are visited.
        headings: readings at a place, all round.
        readings: of each heading (the paper's experiments take 3 or 1).
        robot: m, radius: how near to walls it comes.
        places: at most; None: until all is explored.
        rule: when a cell of the prior is wall.
        region: where pixels are scored.
        seed: of the noise.
    """

    cell: int = 5
    occupancy: Occupancy = "true"
    model: str = "eq10"
    angle: float = radians(30.0)
    reach: float = 4.0
    noise: Noise = QUIET
    lidar: Lidar | None = None
    spacing: float = 1.0
    headings: int = 12
    readings: int = 1
    robot: float = 0.25
    places: int | None = None
    rule: Rule = "any"
    region: ScoredRegion = "footprint"
    seed: int = 2017


class Explored:
    """A drawing explored by the paper's robot.

    Args:
        name: for the tables.
        truth: (H, W) pixels that are wall in truth, row 0 on top.
        prior: (H, W) pixels that the drawing's reading says are wall.
        resolution: m a pixel.
        setup: how it is explored.
        world: (H, W) what really stands there and stops the cone; None: the truth's walls.
        about: the drawing's file, for errors.

    Attributes:
        geometry: of the cells.
        keyframes: (s, visits or evidence so far) after each place.
    """

    def __init__(
        self,
        name: str,
        truth: Bools,
        prior: Bools,
        resolution: float,
        setup: Setup | None = None,
        *,
        world: Bools | None = None,
        about: AnyPath = "",
    ) -> None:
        self.name, self.setup, self.about = name, setup or Setup(), about
        self.truth, self.prior = truth, prior
        self.world = truth if world is None else world
        n = self.setup.cell
        rows, cols = ceil(truth.shape[0] / n), ceil(truth.shape[1] / n)
        self.pixel = resolution
        self.geometry = Geometry(rows, cols, n * resolution, 0.0, 0.0)
        self.footprint = footprint_of(truth, resolution)

    def cells(self, pixels: Bools) -> Ints:
        """Pixels of a mask (row 0 on top) in each cell (row 0 lowest)."""
        n, (rows, cols) = self.setup.cell, self.geometry.shape
        whole = np.zeros((rows * n, cols * n), dtype=np.int64)
        whole[: pixels.shape[0], : pixels.shape[1]] = pixels[::-1]
        return np.asarray(whole.reshape(rows, n, cols, n).sum(axis=(1, 3)))

    @cached_property
    def model(self) -> Model:
        """The model with a level for each number of pixels, or of sub-samples."""
        side = self.setup.cell if self.setup.occupancy == "true" else DETECTED
        return replace(MODELS[self.setup.model], samples=side)

    @cached_property
    def shares(self) -> Ints:
        """Level of each cell's true empty share, (rows, cols)."""
        whole = self.cells(np.ones_like(self.truth))
        empty = whole - self.cells(self.world)
        top = self.setup.cell**2
        return np.asarray(np.rint(top * empty / np.maximum(whole, 1)), dtype=np.int64)

    def places(self) -> list[tuple[float, float]]:
        """Where the robot stops, in the order of its way, m."""
        site = Site.of(np.ascontiguousarray(self.world[::-1]), self.pixel)
        inside = np.ascontiguousarray(self.footprint[::-1])
        floor = Floor(site, self.setup.robot, inside, self.about)
        corners = floor.cover(floor.start(), self.setup.spacing)
        out = [corners[0]]
        for a, b in pairwise(corners):
            steps = max(1, ceil(hypot(b[0] - a[0], b[1] - a[1]) / self.setup.spacing))
            out += [
                (a[0] + (b[0] - a[0]) * k / steps, a[1] + (b[1] - a[1]) * k / steps)
                for k in range(1, steps + 1)
            ]
        return out[: self.setup.places]

    def evidences(self) -> Iterator[tuple[float, Evidence]]:
        """Seconds (a reading a second) and the evidence after each place: one that grows."""
        s = self.setup
        site = Site.of(np.ascontiguousarray(self.world[::-1]), self.pixel)
        sensor: Planar = s.lidar or Sonar(s.angle, 0.0, s.reach, noise=s.noise)
        look = SCANS[type(sensor)]
        random = np.random.default_rng(s.seed)
        sampled = replace(MODELS[s.model], samples=DETECTED)
        mapper = Mapper(self.geometry, sampled, no_return="clear")
        time = 0.0
        for x, y in self.places():
            for heading in np.arange(s.headings) * 2.0 * pi / s.headings:
                pose = Pose(x, y, float(heading))
                for _ in range(s.readings):
                    scan = look(sensor, site, pose, random)
                    mapper.insert(Frame(round(time * 1e9), pose, scan))
                    time += 1.0
            yield time, self._told(mapper.evidence)

    def _told(self, measured: Evidence) -> Evidence:
        """What the readings say: as they were, or the true shares as often as cells were shown."""
        if self.setup.occupancy == "detected":
            return measured
        counts: Counted = np.zeros((self.model.levels, *self.geometry.shape), dtype=np.uint32)
        np.put_along_axis(counts, self.shares[None], measured.visits()[None].astype("u4"), axis=0)
        return Evidence(self.geometry, counts)

    @cached_property
    def evidence(self) -> Evidence:
        """All of it."""
        *_, (_, last) = self.evidences()
        return last

    @cached_property
    def ground(self) -> Ground:
        """Classes of the prior and pixels of the truth, as the search wants them."""
        whole = self.cells(np.ones_like(self.truth))
        region = np.ones_like(self.truth) if self.setup.region == "image" else self.footprint
        wall = self.cells(self.prior)
        return ground(
            self.name,
            wall / np.maximum(whole, 1),
            (self.cells(self.footprint) == 0) & (wall == 0),
            self.cells(self.truth & region),
            self.cells(region),
            rule=self.setup.rule,
            observed_only=self.setup.region == "observed",
        )

    def values(
        self,
        update: Update = "paper",
        prior_scale: float = 0.9,
        sensor: tuple[float, float] | tuple[()] = (),
    ) -> Values:
        """The model's own probabilities under a rule; `sensor` is another P(occupied) pair."""
        return Values(tuple(self.model.p_levels(*sensor)), update, prior_scale)

    def l0(self, values: Values, p_wall: float, p_space: float) -> Grid:
        """A prior as a grid, for pictures and for evaluation by replay."""
        g = self.ground
        p = dict.fromkeys(KINDS, used(p_space, values.prior_scale))
        p[WALL] = used(p_wall, values.prior_scale)
        p[OUTSIDE] = used(values.p_outside, 1.0)
        out = np.full(self.geometry.rows * self.geometry.cols, logit(p[OUTSIDE]))
        out[g.where] = np.array([logit(p[kind]) for kind in KINDS])[g.kinds]
        mixed = g.kinds == KINDS.index(MIXED)
        shares: Floats = g.shares[mixed]
        both = shares * p[WALL] + (1.0 - shares) * used(p_space, values.prior_scale)
        out[g.where[mixed]] = [logit(value) for value in both.tolist()]
        return Grid(self.geometry, out.reshape(self.geometry.shape))

    def map(self, values: Values, p_wall: float, p_space: float) -> Grid:
        """The last map over a prior."""
        return self.evidence.on(self.l0(values, p_wall, p_space), values.p_levels, values.update)

    def map_without_prior(self, values: Values) -> Grid:
        """The last map over 0.5 everywhere."""
        nothing = Grid(self.geometry, np.zeros(self.geometry.shape))
        return self.evidence.on(nothing, values.p_levels, values.update)


def footprint_of(walls: Bools, resolution: float) -> npt.NDArray[np.bool_]:
    """Pixels of the building, (H, W); the whole picture where its outer walls are not closed."""
    inside = np.ones_like(walls)
    found = enclosed(inside, walls, 0.5 * GAP / resolution)
    return inside if found is None else found
