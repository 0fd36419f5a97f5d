"""What stands before the first frame: the plan on its lattice, the prior's curves, the truth."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.grid import Geometry, Grid, Update
from formats.plans.edits import PlanEdits
from formats.plans.file import Extent, Plan, overlap
from formats.result import Curve
from replay.cells import CellLayers, Rule, cell_layers, count_walls, mean_values, truth_cells
from replay.drawn import Openings, PlanMethod, taken_apart
from replay.prior import informative, no_prior
from replay.sensors.observer import MODELS

Region = Literal["footprint", "image", "observed"]
Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]
MOST_CELLS = 32_000_000  # some 40 bytes each: a building of 280 x 280 m at 5 cm
TINY = 1e-3  # m: a robot that stands still still has an extent
PAPER_HIT, PAPER_MISS = 0.9, 0.1  # P(occupied): 0.7 / 0.4 would break the paper's E13


@dataclass(frozen=True, slots=True)
class World:
    """What stands before the first frame: the lattice, the prior's curves and the truth on it.

    Attributes:
        plan: as read; None where the log is mapped without one.
        truth: the truth's plan; the plan itself where no other is given.
        layers: what the plan says by cell; nothing where there is none.
        curves: "none", and with a plan "bayes" and "paper".
        wall, scored: cells that are wall in truth, and cells that count; (rows, cols).
        map_to_plan: pose of the plan's frame in the frame of the poses.
        openings: "door" and "window" -> share of each cell, where a drawing was taken apart.
    """

    plan: Plan | None
    truth: Plan | None
    layers: CellLayers
    curves: dict[str, Curve]
    wall: Bools
    scored: Bools
    map_to_plan: Pose
    openings: dict[str, Floats] = field(default_factory=dict)

    @property
    def geometry(self) -> Geometry:
        """Of every grid of the run."""
        return self.layers.geometry

    @property
    def files(self) -> list[Path]:
        """Plan, truth and their yamls, each once; not the logs that hold one."""
        kept = [plan for plan in (self.plan, self.truth) if plan is not None and not plan.in_log]
        return [Path(name) for name in dict.fromkeys(name for plan in kept for name in plan.inputs)]

    @property
    def inputs(self) -> dict[str, str]:
        """Path -> SHA-256 of those."""
        read = [plan.inputs for plan in (self.plan, self.truth) if plan is not None]
        return {path: digest for inputs in read for path, digest in inputs.items()}

    @property
    def extent(self) -> Extent:
        """What is worth looking at: the plan, else the truth, else the whole lattice; m."""
        ground = self.plan or self.truth
        return ground.extent if ground is not None else self.geometry.extent

    def true_levels(self, levels: int) -> npt.NDArray[np.int32]:
        """The empty share of each cell in truth, as one of so many levels (rows, cols).

        Raises:
            UsageError: there is no truth.
        """
        ground = self.plan or self.truth
        if self.truth is None or ground is None:
            problem = "this sensor model shows the truth, and there is none"
            raise UsageError("", problem, hint="give --truth")
        wall = count_walls(self.truth, self.geometry, ground.frame)
        return np.rint((1.0 - wall) * (levels - 1)).astype(np.int32)

    def kept(self) -> dict[str, npt.NDArray[Any]]:
        """What re-scoring needs of each cell, by field of the result's CellLayers."""
        return {
            "wall": self.layers.wall_fraction,
            "outside": self.layers.outside,
            "truth_wall": self.wall,
            "truth_scored": self.scored,
            **self.openings,
        }


def place(plan: Plan, plan_pose: Pose | None, *, truth: bool = False) -> Pose:
    """The pose of the plan's frame, or of that of a truth without one, in the frame of the poses.

    Raises:
        FormatError: nothing says where it lies.
    """
    if not plan.placed and plan_pose is None:
        what, hint = "truth" if truth else "plan", "a map yaml of its stem beside it"
        hint = f"put {hint}" if truth else f"give --plan-resolution and --plan-origin, or {hint}"
        raise FormatError(plan.path, f"nothing says where the {what} lies", hint=hint)
    return (plan_pose or Pose(0.0, 0.0, 0.0)) @ plan.frame


def lattice(
    ground: Plan | None, bounds: Extent, map_to_plan: Pose, resolution: float, reach: float
) -> Geometry:
    """Cells over the plan, where there is one, and over what the sensor reaches from its poses.

    Raises:
        FormatError: the robot never comes onto the plan; the lattice would be too large.
    """
    a, b, c, d = bounds
    corners = map_to_plan.inverse().apply([(a, b), (a, d), (c, b), (c, d)])
    (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
    box = (left - reach, low - reach, right + reach, high + reach)
    if ground is not None:
        x0, y0, x1, y1 = ground.extent
        if not overlap(ground.extent, (left - TINY, low - TINY, right + TINY, high + TINY)):
            raise FormatError(
                ground.path,
                f"the plan (x {x0:.1f} to {x1:.1f} m, y {y0:.1f} to {y1:.1f} m) and the run "
                f"(x {left:.1f} to {right:.1f} m, y {low:.1f} to {high:.1f} m) do not overlap",
                hint="give --plan-pose X,Y,YAW or --plan-origin",
            )
        box = (min(x0, box[0]), min(y0, box[1]), max(x1, box[2]), max(y1, box[3]))
    cells = (box[2] - box[0]) / resolution * (box[3] - box[1]) / resolution
    if not cells <= MOST_CELLS:
        raise FormatError(
            ground.path if ground is not None else "",
            f"{cells:,.0f} cells of {resolution:g} m are too many",
            hint="give a coarser --resolution or a shorter --max-range",
        )
    return Geometry.covering(*box, resolution)


def curves_of(
    layers: CellLayers,
    prior: Grid | None,
    sensor: str,
    p_hit: float | None,
    p_miss: float | None,
    update: Update,
) -> dict[str, Curve]:
    """No prior and, where there is a plan, its prior under both rules of update.

    The `paper` curve of a `bayes` run takes the paper's own sensor, 0.9 / 0.1, from the same
    counts; where `paper` is the rule of the run, all curves take the run's sensor.
    """
    model = MODELS[sensor]
    if update == "paper":
        p_hit = PAPER_HIT if p_hit is None else p_hit
        p_miss = PAPER_MISS if p_miss is None else p_miss
    levels = tuple(model.p_levels(p_hit, p_miss))
    if prior is None:
        return {"none": Curve(no_prior(layers), levels)}
    paper = levels if update == "paper" else tuple(model.p_levels(PAPER_HIT, PAPER_MISS))
    return {
        "none": Curve(no_prior(layers), levels),
        "bayes": Curve(prior, levels),
        "paper": Curve(prior, paper, "paper"),
    }


def truth_beside(truth: Plan, plan: Plan) -> Plan:
    """A truth without a place of its own lies where the plan does, if it has the plan's size.

    Raises:
        FormatError: it has another size, and nothing says where it lies.
    """
    if truth.placed and truth.resolution is not None:
        return truth
    if truth.occupancy.shape != plan.occupancy.shape:
        raise FormatError(
            truth.path,
            "nothing says where the truth lies, and its size is not the plan's",
            hint="put a map yaml of its stem beside it",
        )
    return replace(truth, resolution=plan.resolution, origin=plan.origin, placed=True)


def build_world(
    plan: Plan | None,
    truth: Plan | None,
    bounds: Extent,
    reach: float,
    notes: Notes,
    *,
    plan_pose: Pose | None = None,
    resolution: float = 0.05,
    sensor: str = "beam",
    p_hit: float | None = None,
    p_miss: float | None = None,
    update: Update = "bayes",
    cell_rule: Rule = "any",
    region: Region = "footprint",
    plan_method: PlanMethod = "auto",
    plan_edits: PlanEdits | None = None,
    plan_confidence: bool = False,
    p_door: float | None = None,
    p_window: float | None = None,
    **prior: float,
) -> World:
    """Plan, truth and prior on one lattice.

    Args:
        plan: None: there is no prior, and no score unless a truth is given.
        truth: None: the plan is taken for it.
        bounds: x0, y0, x1, y1 of the poses, m.
        reach: m that the sensor sees beyond them.
        notes: told how the scored region was found.
        plan_pose: of the plan's own frame in the frame of the poses.
        resolution: m, a cell's side.
        sensor, p_hit, p_miss, update: see `curves_of`.
        cell_rule: when a cell is wall; of the truth "any" unless it is "majority".
        region: the building, the whole picture, or (later) what was observed.
        plan_method: how a drawing becomes a plan, see `taken_apart`.
        plan_edits: by hand, on what was found.
        plan_confidence: scale the prior by how far the extraction is believed.
        p_door, p_window: P(empty) of openings that a drawing shows; None: as space, as wall.
        prior: p_wall, p_space, p_outside, prior_scale.

    Raises:
        FormatError: nothing says where plan or truth lie; they do not overlap the run.
    """
    ground = plan or truth
    map_to_plan = (
        Pose(0.0, 0.0, 0.0) if ground is None else place(ground, plan_pose, truth=plan is None)
    )
    geometry = lattice(ground, bounds, map_to_plan, resolution, reach)
    layers, openings = blank(geometry), dict[str, Floats]()
    if plan is not None:
        plan, found = taken_apart(plan, plan_method, notes, plan_edits)
        layers = cell_layers(plan, geometry, notes=notes)
        if found is not None:
            openings = opening_cells(plan, found, geometry)
            layers = with_regions(layers, plan, found)
            if plan_confidence:
                sure = mean_values(plan, found.confidence, geometry)
                layers = replace(layers, confidence=sure)
    drawn = None
    if plan is not None:
        drawn = informative(
            layers, openings, cell_rule=cell_rule, p_door=p_door, p_window=p_window, **prior
        )
    curves = curves_of(layers, drawn, sensor, p_hit, p_miss, update)
    real = truth_beside(truth, plan) if truth and plan else truth or plan
    if real is None or real is plan:
        wall, scored = layers.walls(cell_rule), layers.footprint
    else:
        frame = ground.frame if ground else None
        wall, scored = truth_cells(real, geometry, cell_rule, frame=frame, notes=notes)
    if region != "footprint" and plan is not None:
        scored = layers.pixels > 0
    return World(plan, real, layers, curves, wall, scored, map_to_plan, openings)


def opening_cells(plan: Plan, found: Openings, geometry: Geometry) -> dict[str, Floats]:
    """Share of each cell that is door, and that is window; a wall beside a door stays wall."""
    masks = {"door": found.doors, "window": found.windows}
    return {name: share(plan, mask, geometry) for name, mask in masks.items()}


def with_regions(layers: CellLayers, plan: Plan, found: Openings) -> CellLayers:
    """The layers with what edits by hand made building, or made none."""
    if not (found.inside.any() or found.outside.any()):
        return layers
    inside, outside = (
        share(plan, mask, layers.geometry) >= 0.5 for mask in (found.inside, found.outside)
    )
    footprint = (layers.footprint | inside) & ~outside | (layers.wall > 0)
    return replace(layers, footprint=footprint)


def share(plan: Plan, mask: Bools, geometry: Geometry) -> Floats:
    """Share of each cell that a mask of the plan's pixels covers."""
    return count_walls(replace(plan, occupancy=np.where(mask, np.int8(100), np.int8(0))), geometry)


def blank(geometry: Geometry) -> CellLayers:
    """What no plan says of any cell."""
    nothing = np.zeros(geometry.shape, dtype=np.uint32)
    return CellLayers(geometry, nothing, nothing, nothing, nothing > 0)
