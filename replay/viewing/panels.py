"""Which panels the viewer opens with, and where."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from replay.viewing.scene import Scene

METRICS = {"f2": "F2", "precision": "Precision", "recall": "Recall"}
ERRORS = "Errors: found blue, missed orange, false pink"
WALLS = "Walls: blue kept, orange moved, red not there, green new"
PARTICLES = "Particles"  # tabs are narrow
PLACES = "Plan's place: blue taken, orange runners-up"
PAPER = (245, 245, 245)
WHOLE = rrb.TimeRange(rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite())
ON_TOP = ("plan/drawing", "plan/robot")  # what lies over every map


def blueprint(scenes: Sequence[Scene], roots: Sequence[str]) -> Any:
    """The layout of one run, or of several side by side on one timeline.

    Args:
        scenes: what is shown.
        roots: of each, the entity that all of it lies under; "" for a single run.
    """
    layout = _single(scenes[0]) if len(scenes) == 1 else _several(scenes, roots)
    return rrb.Blueprint(
        layout,
        rrb.TimePanel(timeline="log_time_s", state="collapsed"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _single(scene: Scene) -> Any:
    maps = [_map(scene, "", "with_prior", "Map with prior")] if scene.drawn else []
    maps.append(_map(scene, "", "without_prior", "Map without prior"))
    if scene.scored.any():
        maps.append(_map(scene, "", "errors", ERRORS))
    report = rrb.TextDocumentView(origin="/report", name="Report")
    coverage = _series(["/coverage/**"], "Coverage")
    if scene.walls.any():
        plan = [_map(scene, "", "walls", WALLS), _map(scene, "", "plan", "Plan")]
        if scene.places:
            plan.insert(1, _places(scene))
        if scene.particles:
            plan.insert(1, _map(scene, "", "particles", PARTICLES))
        more = scene.places or scene.particles
        maps.append(rrb.Tabs(*plan, active_tab=0) if more else plan[0])
    elif scene.particles:
        maps.append(_map(scene, "", "particles", PARTICLES))
    if not scene.scored.any():
        return rrb.Horizontal(*maps, report, column_shares=[3] * len(maps) + [1])
    return rrb.Vertical(
        rrb.Horizontal(*maps),
        rrb.Horizontal(
            *(_series([f"/score/{key}/**"], name, room=True) for key, name in METRICS.items()),
            coverage,
            report,
        ),
        row_shares=[3, 2],
    )


def _several(scenes: Sequence[Scene], roots: Sequence[str]) -> Any:
    """A column for each run, their scores below in the same axes."""
    columns = []
    for scene, root in zip(scenes, roots, strict=True):
        entity = "with_prior" if scene.drawn else "without_prior"
        views = [_map(scene, root, entity, scene.title)]
        if scene.scored.any():
            views.append(_map(scene, root, "errors", ERRORS))
        columns.append(rrb.Vertical(*views))
    series = [
        _series([f"{root}/score/{key}/**" for root in roots], name) for key, name in METRICS.items()
    ]
    coverage = _series([f"{root}/coverage/**" for root in roots], "Coverage")
    reports = [
        rrb.TextDocumentView(origin=f"{root}/report", name=scene.title)
        for scene, root in zip(scenes, roots, strict=True)
    ]
    return rrb.Vertical(
        rrb.Horizontal(*columns),
        rrb.Horizontal(*series, coverage, rrb.Tabs(*reports, active_tab=0)),
        row_shares=[3, 1],
    )


def _map(scene: Scene, root: str, entity: str, name: str) -> Any:
    x0, y0, x1, y1 = scene.extent  # what lies beyond it is a scroll away
    own = [f"+ {root}/plan/{entity}/**"] if entity != "plan" else []
    return rrb.Spatial2DView(
        origin="/",  # above the flip: inside it y would point down
        name=name,
        contents=[f"+ {root}/plan", *own, *(f"+ {root}/{part}/**" for part in ON_TOP)],
        visual_bounds=rrb.VisualBounds2D(x_range=(x0, x1), y_range=(-y1, -y0)),
        background=rrb.Background(color=PAPER),
    )


def _places(scene: Scene) -> Any:
    """Wide enough for every place of the plan."""
    corners = np.concatenate([place.corners for place in scene.places])
    room = 0.15 * np.ptp(corners, axis=0).max()  # for labels at the corners
    (x0, y0), (x1, y1) = corners.min(axis=0) - room, corners.max(axis=0) + room
    return rrb.Spatial2DView(
        origin="/",
        name=PLACES,
        contents=["+ /plan", *(f"+ /plan/{part}/**" for part in ("places", "without_prior"))],
        visual_bounds=rrb.VisualBounds2D(x_range=(x0, x1), y_range=(-y1, -y0)),
        background=rrb.Background(color=PAPER),
    )


def _series(entities: Sequence[str], name: str, *, room: bool = False) -> Any:
    """Curves over time; with room below them for a legend of three lines."""
    return rrb.TimeSeriesView(
        origin="/",
        name=name,
        contents=[f"+ {entity}" for entity in entities],
        axis_x=rrb.TimeAxis(view_range=WHOLE),
        axis_y=rrb.ScalarAxis(range=(-0.3 if room else -0.05, 1.05), zoom_lock=True),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightBottom),
    )
