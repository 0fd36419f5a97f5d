"""Draws one run into a recording: what holds throughout, frames in blocks, maps at keyframes.

Entities lie in metres of the plan's frame, y up. What is sent stays within a budget however long
the run is: scans and scores are thinned, and maps wait for their share.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import rerun as rr

from formats.results.records import ratios
from replay.pictures import CURVE_COLOURS, CURVE_NAMES, WALL_COLOURS, error_kinds
from replay.viewing.panels import METRICS
from replay.viewing.particles import Trail
from replay.viewing.scene import (
    BATCH,
    BUDGET,
    MAP_SHARE,
    Block,
    Keyframe,
    Scene,
    Walls,
    ellipses,
    explored,
    label_corners,
    strides,
)
from replay.viewing.shades import Shades
from replay.viewing.shapes import ERROR_CLASSES, PLAN_CLASSES, classes, greys, placed, segments

SHADES_PACKED, KINDS_PACKED = 6, 16  # times smaller, about, maps are on their way
SCAN, PATH, POSE, SPREAD = (213, 94, 0), (0, 158, 115), (0, 90, 50), (150, 60, 120)
PARTICLES = (204, 121, 167)
THIN, THICK = rr.Radius.ui_points(0.75), rr.Radius.ui_points(1.75)  # seen however large the plan
TAKEN, RUNNER_UP = (0, 114, 178), (230, 159, 0)  # places of the plan
Send = Callable[[Callable[[Any], None]], None]


class Drawing:
    """One run in a recording.

    Args:
        scene: what does not change.
        send: does its argument for every recording stream.
        root: the entity that all of it lies under.
        budget: MB that may be sent, about.
        name: of the run, before the names of its curves.
        colour: of its main curve; None: that of the curve.
    """

    def __init__(
        self,
        scene: Scene,
        send: Send,
        *,
        root: str = "",
        budget: float = BUDGET,
        name: str = "",
        colour: tuple[int, int, int] | None = None,
    ) -> None:
        self._scene, self._send, self._root, self._name = scene, send, root, name
        self._colour = colour
        self._scan_every, self._score_every = strides(scene.frames, budget)
        self._map_bytes, self._sent = budget * 1e6 * MAP_SHARE, 0
        self._start_ns: int | None = None
        shown = {name: scene.curves[name] for name in dict.fromkeys((scene.main, "none"))}
        self._shades = Shades(shown, scene.geometry, scene.levels)
        self._pictures: dict[str, bytes] = {}
        self._moment = (0, 0, 0.0)  # frame, ns, share explored
        self._behind, self._place = False, np.empty((0, 2))  # m, where the path ended so far
        self._trail = Trail(scene.particles)
        self._static()

    def _log(self, entity: str, thing: Any, *, static: bool = False) -> None:
        path = f"{self._root}/{entity}"
        self._send(lambda recording: recording.log(path, thing, static=static))

    def _columns(self, entity: str, times: Any, columns: Any) -> None:
        path = f"{self._root}/{entity}"
        self._send(lambda recording: recording.send_columns(path, times, columns))

    def _static(self) -> None:
        """Everything that holds for the whole run."""
        scene = self._scene
        # Rerun's 2-D y axis points down: one flip here, and everything below is in metres, y up.
        flip = rr.Transform3D(mat3x3=[[1, 0, 0], [0, -1, 0], [0, 0, 1]])
        self._log("plan", flip, static=True)
        for entity in ("drawing", "with_prior", "without_prior", "errors"):
            self._log(f"plan/{entity}", placed(scene.geometry), static=True)
        plan = np.zeros(scene.geometry.shape, dtype=np.uint8)
        for kind, cells in enumerate((scene.walls, scene.doors, scene.windows), 1):
            plan[cells] = kind
        self._log("plan/drawing", classes(PLAN_CLASSES), static=True)
        self._log("plan/drawing/plan", segments(plan, draw_order=-5), static=True)
        self._log("plan/errors", classes(ERROR_CLASSES), static=True)
        look = {"colors": [SCAN], "radii": [0.03]}
        self._log("plan/robot/scan", rr.Points2D.from_fields(**look), static=True)
        self._log("plan/robot/pose", rr.Arrows2D.from_fields(colors=[POSE]), static=True)
        look = {"colors": [SPREAD], "radii": [0.02]}
        self._log("plan/robot/covariance", rr.LineStrips2D.from_fields(**look), static=True)
        look = {"colors": [PARTICLES], "radii": [rr.Radius.ui_points(1.5)]}
        self._log("plan/particles", rr.Points2D.from_fields(**look), static=True)
        self._places()
        self.report(scene.report)
        for curve in self._curves():
            main = self._colour is not None and curve == scene.main
            colour = self._colour if main else CURVE_COLOURS.get(curve, (0, 0, 0))
            label = f"{self._name}: {CURVE_NAMES.get(curve, curve)}".removeprefix(": ")
            for metric in METRICS:
                line = rr.SeriesLines(colors=[colour], names=[label], widths=[2])
                self._log(f"score/{metric}/{curve}", line, static=True)
        line = rr.SeriesLines(
            colors=[self._colour or CURVE_COLOURS["bayes"]],
            names=[f"{self._name}: seen".removeprefix(": ")],
            widths=[2],
        )
        self._log("coverage/seen", line, static=True)

    def _places(self) -> None:
        """Outlines of the plan where it may lie, with their scores; the one taken on top."""
        labelled = label_corners(self._scene.places)
        for number, place in reversed(list(enumerate(self._scene.places))):
            colour, name = (RUNNER_UP, f"runner-up {number}") if number else (TAKEN, "taken")
            wide = THIN if number else THICK
            around = np.concatenate([place.corners, place.corners[:1]])
            outline = rr.LineStrips2D([around], colors=[colour], radii=[wide])
            label = rr.Points2D(
                [labelled[number]],
                colors=[colour],
                radii=[wide],
                labels=[f"{name}: {place.score:.2f}"],
            )
            self._log(f"plan/places/{number}/label", label, static=True)
            self._log(f"plan/places/{number}", outline, static=True)

    def walls(self, walls: Walls) -> None:
        """The plan against the building, in the colours of its walls' states."""
        for state, colour in WALL_COLOURS.items():
            ends = walls.lines.get(state)
            if ends is not None and len(ends):
                lines = rr.LineStrips2D(ends, colors=[colour], radii=[THICK])
                self._log(f"plan/walls/{state.replace(' ', '_')}", lines, static=True)

    def _curves(self) -> list[str]:
        """Those whose scores are drawn: beside other runs, not the paper's rule as well."""
        if not self._name:
            return list(self._scene.curves)
        return list(dict.fromkeys((self._scene.main, "none")))

    def report(self, markdown: str) -> None:
        """The text panel from now on."""
        self._log("report", rr.TextDocument(markdown, media_type="text/markdown"), static=True)

    def block(self, block: Block) -> None:
        """Scores, poses and scans of frames as columns, and the path that they drove."""
        if not len(block.frames):
            return
        if self._start_ns is None:
            self._start_ns = int(block.times_ns[0])
        counts = next(iter(block.counts.values()), None)
        seen = np.zeros(len(block.frames)) if counts is None else explored(counts)
        some = np.arange(len(block.frames))[block.frames % self._score_every == 0]
        if len(some):
            times = self._times(block, some, seen)
            for curve in self._curves():
                if curve in block.counts:
                    values = ratios(block.counts[curve][some].sum(axis=1)).T
                    for metric, column in zip(("precision", "recall", "f2"), values, strict=True):
                        scalars = rr.Scalars.columns(scalars=column)
                        self._columns(f"score/{metric}/{curve}", times, scalars)
            if self._scene.scored.any():
                scalars = rr.Scalars.columns(scalars=seen[some])
                self._columns("coverage/seen", times, scalars)
            poses = block.poses[some]
            heading = 0.4 * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
            arrows = rr.Arrows2D.columns(origins=poses[:, :2], vectors=heading)
            self._columns("plan/robot/pose", times, arrows)
            if self._scene.spread is not None:
                known, spread = self._scene.spread
                at = np.minimum(np.searchsorted(known, block.times_ns[some]), len(known) - 1)
                strips = ellipses(spread[at], poses[:, :2])
                columns = rr.LineStrips2D.columns(strips=strips)
                self._columns("plan/robot/covariance", times, columns)
        self._scans(block, seen)
        self._particles(block, seen)
        for start in range(0, len(some), BATCH):
            self._path(block, some[start : start + BATCH], seen)

    def _path(
        self,
        block: Block,
        some: npt.NDArray[np.integer[Any]],
        seen: npt.NDArray[np.float64],
    ) -> None:
        """A piece of the path driven, from the moment of its first frame on."""
        first = int(some[0])
        self._at(int(block.frames[first]), int(block.times_ns[first]), float(seen[first]))
        places = np.concatenate([self._place, block.poses[some, :2]])
        self._place = places[-1:]
        path = rr.LineStrips2D([places], colors=[PATH], radii=[0.02])
        self._log(f"plan/robot/path/{block.frames[first]}", path)

    def _scans(self, block: Block, seen: npt.NDArray[np.float64]) -> None:
        """Where beams ended, of as many frames as the budget allows and as are known."""
        known = [
            i
            for i, points in enumerate(block.points)
            if points is not None and (block.frames[i] % self._scan_every == 0)
        ]
        if known:
            scans = [block.points[i] for i in known]
            lengths = [len(points) for points in scans if points is not None]
            every = np.concatenate([points for points in scans if points is not None])
            columns = rr.Points2D.columns(positions=every).partition(lengths)
            self._columns("plan/robot/scan", self._times(block, np.array(known), seen), columns)

    def _particles(self, block: Block, seen: npt.NDArray[np.float64]) -> None:
        """Where the robot might be, as far as its localiser tells."""
        if rows := self._trail.rows(block):
            at = np.array([row for row, _ in rows])
            every = np.concatenate([points for _, points in rows])
            columns = rr.Points2D.columns(positions=every)
            columns = columns.partition([len(points) for _, points in rows])
            self._columns("plan/particles", self._times(block, at, seen), columns)

    def _times(
        self,
        block: Block,
        some: npt.NDArray[np.integer[Any]],
        seen: npt.NDArray[np.float64],
    ) -> list[Any]:
        """Every timeline at some frames of a block."""
        since = (block.times_ns[some] - (self._start_ns or 0)) / 1e9
        return [
            rr.TimeColumn("frame", sequence=block.frames[some]),
            rr.TimeColumn("log_time_s", duration=since),
            rr.TimeColumn("stamp", timestamp=block.times_ns[some] / 1e9),
            rr.TimeColumn("explored_permille", sequence=np.rint(1000 * seen[some]).astype(int)),
        ]

    def _at(self, frame: int, time_ns: int, seen: float) -> None:
        """Sets every timeline to a frame."""
        since = (time_ns - (self._start_ns or 0)) / 1e9

        def work(recording: Any) -> None:
            recording.set_time("frame", sequence=frame)
            recording.set_time("log_time_s", duration=since)
            recording.set_time("stamp", timestamp=time_ns / 1e9)
            recording.set_time("explored_permille", sequence=round(1000 * seen))

        self._send(work)

    def keyframe(self, keyframe: Keyframe) -> None:
        """The maps of a moment."""
        change = keyframe.change
        self._shades.add(change)
        self._moment = change.frame, keyframe.time_ns, keyframe.explored
        share = (change.frame + 1) / max(self._scene.frames, change.frame + 1)
        if self._sent > self._map_bytes * max(share, 0.1):
            self._behind = True  # long logs of large buildings: fewer maps
            return
        self._maps()

    def close(self) -> None:
        """The last maps, where they had to wait."""
        if self._behind:
            self._maps()

    def _maps(self) -> None:
        """The maps and the errors; of one size throughout, which the viewer insists on."""
        self._behind = False
        self._at(*self._moment)
        scene, shades = self._scene, self._shades
        shown = {"without_prior": shades.shades["none"]}
        if scene.drawn:
            shown["with_prior"] = shades.shades[scene.main]
        for entity, cells in shown.items():
            if self._new(entity, cells.tobytes(), SHADES_PACKED):
                self._log(f"plan/{entity}/map", greys(cells, draw_order=-10))
        if scene.scored.any():
            kinds = error_kinds(shades.occupied[scene.main], scene.truth, scene.scored)
            if self._new("errors", kinds.tobytes(), KINDS_PACKED):
                self._log("plan/errors/map", segments(kinds, draw_order=-1))

    def _new(self, entity: str, data: bytes, packed: int) -> bool:
        """Whether this differs from what the viewer shows already; it counts, packed, if so."""
        if self._pictures.get(entity) == data:
            return False
        self._pictures[entity] = data
        self._sent += len(data) // packed
        return True
