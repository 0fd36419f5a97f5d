"""Scenes of runs that start and of result files, and what happens in the latter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.frame import Particles, Pose
from formats.grid import Geometry
from formats.plans.plan import Extent
from formats.results.file import RunFile
from replay.facts import markdown
from replay.localise.poses import placed
from replay.pictures import Bools
from replay.surveying.deviations import Deviations
from replay.viewing.scene import Block, Keyframe, Outline, Scene, Walls, explored
from replay.world import World

AT_ONCE = 4096  # frames a block
MARGIN = 1.0  # m around what is worth looking at


def scene_of_world(
    world: World,
    title: str,
    report: str,
    main: str,
    frames: int,
    bounds: Extent,
    *,
    spread: tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]] | None = None,
    places: Sequence[Mapping[str, Any]] = (),
    particles: Sequence[Particles] = (),
) -> Scene:
    """The scene of a run that is about to start.

    Args:
        world: plan and truth on their lattice.
        title, report, main, frames: see Scene.
        bounds: x0, y0, x1, y1 of the poses in their own frame, m.
        spread: see Scene.
        places: of the plan, as `replay.placing.located` tells.
        particles: of a localiser now and then, in the frame of the poses.
    """
    a, b, c, d = bounds
    corners = world.map_to_plan.inverse().apply([(a, b), (a, d), (c, b), (c, d)])
    reach = 5.0  # m around the poses, where no plan says what is worth looking at
    extent = (*(corners.min(axis=0) - reach), *(corners.max(axis=0) + reach))
    if world.plan is not None or world.truth is not None:
        extent = world.extent
    return Scene(
        title=title,
        report=report,
        geometry=world.geometry,
        levels=len(world.curves["none"].p_levels),
        curves=dict(world.curves),
        main=main,
        walls=world.layers.wall_fraction > 0,
        doors=_part(world.openings, "door", world.geometry),
        windows=_part(world.openings, "window", world.geometry),
        truth=world.wall,
        scored=world.scored,
        extent=_padded(extent),
        frames=frames,
        spread=spread,
        places=_outlines(places, world.map_to_plan),
        particles=_on_plan(particles, world.map_to_plan),
    )


def scene_of_file(run: RunFile, name: str) -> Scene:
    """The scene of a result file; `name` tells it from others."""
    layers, geometry = run.layers, run.geometry
    walls = _part(layers, "wall", geometry)
    scored = _part(layers, "truth_scored", geometry)
    shown = walls | scored
    if not shown.any():
        shown = run.evidence().visits() > 0
    return Scene(
        title=name,
        report=markdown(name, run.facts.get("said", {}), run.facts),
        geometry=geometry,
        levels=run.levels,
        curves=run.curves,
        main=run.main,
        walls=walls,
        doors=_part(layers, "door", geometry),
        windows=_part(layers, "window", geometry),
        truth=_part(layers, "truth_wall", geometry) & scored,
        scored=scored,
        extent=_padded(around(shown, geometry)),
        frames=len(run.times_ns),
        spread=None if run.covariances is None else (run.times_ns, run.covariances),
        places=_outlines(run.facts.get("places", ()), run.map_to_plan),
        particles=_on_plan(run.particles, run.map_to_plan),
    )


def walls_of(found: Deviations) -> Walls:
    """What the viewer draws of deviations."""
    lines: dict[str, list[Any]] = {}
    for wall in found.walls:
        lines.setdefault(wall.state, []).append((wall.start, wall.end))
    inside = [(extra.start, extra.end) for extra in found.found if extra.inside]
    if inside:
        lines["found"] = inside
    metres = {name: length for name, (_, length) in found.summary().items()}
    return Walls({name: np.array(ends) for name, ends in lines.items()}, metres)


def _outlines(places: Sequence[Mapping[str, Any]], map_to_plan: Pose) -> tuple[Outline, ...]:
    """Places of the plan, told in the frame of the poses, in the plan's own."""
    back = map_to_plan.inverse()
    return tuple(Outline(float(p["score"]), back.apply(p["corners"])) for p in places)


def _on_plan(samples: Sequence[Particles], map_to_plan: Pose) -> tuple[Particles, ...]:
    """Where they lie in the plan's frame."""
    return placed(samples, map_to_plan.inverse())


def events(run: RunFile) -> Iterator[Block | Keyframe]:
    """A result file's frames in blocks, then its keyframes: the order of sending is free."""
    for start in range(0, len(run.times_ns), AT_ONCE):
        yield _block(run, start, min(start + AT_ONCE, len(run.times_ns)))
    counts = next(iter(run.counts.values()), None)
    share = explored(counts) if counts is not None else np.zeros(len(run.times_ns))
    for change in run.changes:
        time_ns = int(run.times_ns[change.frame])
        yield Keyframe(change, time_ns, float(share[change.frame]))


def _block(run: RunFile, start: int, stop: int) -> Block:
    part = slice(start, stop)
    return Block(
        np.arange(start, stop),
        run.times_ns[part],
        run.poses[part],
        {name: counts[part] for name, counts in run.counts.items()},
        [run.points.get(i) for i in range(start, stop)],
    )


def around(cells: Bools, geometry: Geometry) -> Extent:
    """x0, y0, x1, y1 (m) of the cells that are set; of all where none is."""
    rows, cols = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    if not len(rows):
        return geometry.extent
    window = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)
    return geometry.window(*window).extent


def _padded(extent: Extent) -> Extent:
    x0, y0, x1, y1 = (float(edge) for edge in extent)
    return x0 - MARGIN, y0 - MARGIN, x1 + MARGIN, y1 + MARGIN


def _part(layers: Mapping[str, npt.NDArray[Any]], name: str, geometry: Geometry) -> Bools:
    """The cells that a layer touches; none where it is absent."""
    if name not in layers:
        return np.zeros(geometry.shape, dtype=np.bool_)
    return np.asarray(layers[name] > 0)
