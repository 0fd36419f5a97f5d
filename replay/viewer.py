"""The Rerun sink: what a run looked like, saved or live. The only module that imports rerun.

Entities lie in metres of the plan's frame, y up. Maps go out at keyframes, scans, poses and scores
as columns in batches, so that the cost and size of viewing stay bounded.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from formats.errors import FormatError, UsageError, printable
from formats.grid import Geometry
from formats.output import atomic, check_room
from formats.result import Maps, Step
from formats.result_records import ratios
from replay.pictures import (
    CURVE_COLOURS,
    CURVE_NAMES,
    coloured,
    end_points,
    errors,
    gray,
    png,
    thinning,
)
from replay.viewer_process import start_viewer
from replay.world import World

BATCH = 256  # frames a column batch: small enough to look live, large enough to cost little
METRICS = {"precision": "Precision", "recall": "Recall", "f2": "F2"}


class Scene(NamedTuple):
    """What a picture needs besides the steps.

    Attributes:
        title: shown as the recording's name.
        world: plan and truth on their lattice.
        report: markdown for the text panel.
        main: the curve that is the map.
    """

    title: str
    world: World
    report: str
    main: str = "bayes"


def blueprint(scene: Scene) -> Any:
    """Map with prior, map without, errors, the three scores over time, and the report."""
    x0, y0, x1, y1 = scene.world.extent  # what lies beyond it is a scroll away

    def view(name: str, entity: str) -> Any:
        return rrb.Spatial2DView(
            origin="/",  # above the flip: inside it y would point down
            name=name,
            contents=["+ /plan", f"+ /plan/{entity}/**", "+ /plan/robot/**", "+ /plan/drawing/**"],
            visual_bounds=rrb.VisualBounds2D(x_range=(x0, x1), y_range=(-y1, -y0)),
            background=rrb.Background(color=(245, 245, 245)),
        )

    def series(metric: str) -> Any:
        return rrb.TimeSeriesView(
            origin=f"/score/{metric}",
            name=METRICS[metric],
            axis_y=rrb.ScalarAxis(range=(0.0, 1.0), zoom_lock=True),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightBottom),
        )

    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                view("Map with prior", "with_prior"),
                view("Map without prior", "without_prior"),
                view("Errors: found blue, missed orange, false pink", "errors"),
            ),
            rrb.Horizontal(
                series("f2"),
                series("precision"),
                series("recall"),
                rrb.TextDocumentView(origin="/report", name="Report"),
            ),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(timeline="log_time_s", state="collapsed"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


class Viewer:
    """A sink for steps that speaks Rerun; a context manager.

    Args:
        scene: what does not change.
        path: an .rrd to write, whole or not at all.
        view: start the viewer on this machine; only 127.0.0.1 is listened on.
        connect: the address of a viewer that is already there.
        force: overwrite `path`.
        inputs: files that must not be overwritten.
        say: is told, once and in one line, when the viewer is gone; the run goes on.

    Raises:
        FormatError: on entering, where the output exists or cannot be written.
        UsageError: `connect` is no address.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        path: str | os.PathLike[str] | None = None,
        view: bool = False,
        connect: str | None = None,
        force: bool = False,
        inputs: Iterable[str | os.PathLike[str]] = (),
        say: Callable[[str], object] = print,
    ) -> None:
        self._scene, self._say = scene, say
        self._path, self._force, self._inputs = path, force, tuple(inputs)
        self._view, self._connect = view, connect
        self._steps: list[Step] = []
        self._start_ns: int | None = None
        known = scene.world.layers.pixels > 0
        here = [np.flatnonzero(known.any(axis=1 - axis)) for axis in (0, 1)]
        self._span = [[int(at[0]), int(at[-1]) + 1] if len(at) else [0, 1] for at in here]

    def __enter__(self) -> Viewer:
        identity = f"replay-{os.getpid()}-{time.monotonic_ns()}"  # one viewer may show several runs
        self._rec = rr.RecordingStream("replay", recording_id=identity)
        self._rec.set_log_time_enabled(False)
        self._rec.set_log_tick_enabled(False)
        address = start_viewer() if self._view else self._connect
        self._live = address is not None
        try:
            sinks: list[Any] = [rr.GrpcSink(address)] if self._live else []
        except RuntimeError as error:
            raise UsageError(str(address), str(error).splitlines()[0]) from error
        with ExitStack() as stack:  # what fails from here on leaves no half file
            if self._path is not None:
                check_room(self._path, 1 << 23)  # rerun hangs on a disk that is full at once
                output = atomic(self._path, force=self._force, inputs=self._inputs)
                sinks.append(rr.FileSink(str(stack.enter_context(output))))
            self._rec.set_sinks(*sinks, default_blueprint=blueprint(self._scene))
            self._static()
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        failure: Any = kind, error, trace
        try:
            if kind is None:
                if self._steps and not self._steps[-1].keyframe:
                    self._maps(self._steps[-1])  # the end, wherever it came
                self._send()
                self._flush()
        except BaseException as torn:
            failure = type(torn), torn, None  # such a recording gets no name
            raise
        finally:
            self._rec.disconnect()  # writes the file's footer, before the file gets its name
            self._stack.__exit__(*failure)

    def _flush(self) -> None:
        """Waits for what was sent; a viewer that is gone costs a line, not the run."""
        try:
            self._rec.flush(timeout_sec=10)
        except Exception as error:  # rerun's errors share no base of their own
            reason = printable(str(error).splitlines()[0])
            if not self._live:
                problem = f"could not be written: {reason}"
                raise FormatError(
                    self._path or "rerun", problem, hint="is the disk full?"
                ) from error
            self._say(f"viewer: gone ({reason}); the result is not touched by that")

    def _static(self) -> None:
        """Everything that holds for the whole run."""
        rec, scene, geometry = self._rec, self._scene, self._scene.world.geometry
        rec.send_recording_name(scene.title)
        # Rerun's 2-D y axis points down: one flip here, and everything below is in metres, y up.
        flip = rr.Transform3D(mat3x3=[[1, 0, 0], [0, -1, 0], [0, 0, 1]])
        rec.log("plan", flip, static=True)
        rec.log("plan/drawing", _placed(geometry), static=True)
        walls = png(coloured(geometry.shape, [(scene.world.layers.walls(), (60, 60, 60, 90))]))
        rec.log("plan/drawing/walls", _image(walls, draw_order=-5), static=True)
        rec.log("report", rr.TextDocument(scene.report, media_type="text/markdown"), static=True)
        for curve, colour in CURVE_COLOURS.items():
            for metric in METRICS:
                line = rr.SeriesLines(colors=[colour], names=CURVE_NAMES[curve], widths=[2])
                rec.log(f"score/{metric}/{curve}", line, static=True)

    def write(self, step: Step) -> None:
        """Takes a step; what is drawn of it goes out with its batch, maps at keyframes."""
        if self._start_ns is None:
            self._start_ns = step.frame.time_ns
        self._steps.append(step)
        if step.keyframe:
            self._maps(step)
        if len(self._steps) >= BATCH:
            self._send()

    def _now(self, step: Step) -> None:
        """Sets every timeline to a step."""
        time_ns = step.frame.time_ns
        self._rec.set_time("frame", sequence=step.index)
        self._rec.set_time("log_time_s", duration=(time_ns - (self._start_ns or 0)) / 1e9)
        self._rec.set_time("stamp", timestamp=time_ns / 1e9)

    def _maps(self, step: Step) -> None:
        """The maps and the errors at a keyframe, as far as anything is drawn or seen."""
        rec, world = self._rec, self._scene.world
        self._now(step)
        part = self._part(step)
        maps = step.grids
        if isinstance(maps, Maps):
            maps = maps.window(*part)
        main, without = maps[self._scene.main], maps["none"]
        wrong = errors(main.occupied(), world.wall[part], world.scored[part])
        for entity, cells, order in (
            ("with_prior", gray(main), -10),
            ("without_prior", gray(without), -10),
            ("errors", wrong, -1),
        ):
            rec.log(f"plan/{entity}", _placed(main.geometry))
            rec.log(f"plan/{entity}/map", _image(png(cells), draw_order=order))

    def _part(self, step: Step) -> tuple[slice, slice]:
        """Rows and columns that hold the plan and all that was seen; it only grows."""
        if step.evidence is not None:
            seen = np.asarray(step.evidence.counts.any(axis=0))
            for axis, span in enumerate(self._span):
                there = np.flatnonzero(seen.any(axis=1 - axis))
                if len(there):
                    span[0], span[1] = min(span[0], there[0]), max(span[1], there[-1] + 1)
        (r0, r1), (c0, c1) = self._span
        return slice(int(r0), int(r1)), slice(int(c0), int(c1))

    def _send(self) -> None:
        """One batch of scans, poses and scores as columns, and the path that they drove."""
        steps = self._steps
        if not steps:
            return
        stamps = np.array([step.frame.time_ns for step in steps], dtype=np.int64)
        times = [
            rr.TimeColumn("frame", sequence=[step.index for step in steps]),
            rr.TimeColumn("log_time_s", duration=(stamps - (self._start_ns or 0)) / 1e9),
            rr.TimeColumn("stamp", timestamp=stamps / 1e9),
        ]
        send = self._rec.send_columns
        for curve in steps[0].counts:
            counts = np.array([step.counts[curve] for step in steps], dtype=np.int64).sum(axis=1)
            for metric, values in zip(METRICS, ratios(counts).T, strict=True):
                send(f"score/{metric}/{curve}", times, rr.Scalars.columns(scalars=values))
        scans = [end_points(step) for step in steps]
        lengths = [len(points) for points in scans]
        points = rr.Points2D.columns(positions=np.concatenate(scans)).partition(lengths)
        look = rr.Points2D.columns(colors=[(213, 94, 0)] * len(steps), radii=[0.03] * len(steps))
        send("plan/robot/scan", times, [*points, *look])
        poses = np.array([step.frame.pose for step in steps])
        heading = 0.4 * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
        send(
            "plan/robot/pose",
            times,
            rr.Arrows2D.columns(
                origins=poses[:, :2], vectors=heading, colors=[(0, 90, 50)] * len(poses)
            ),
        )
        self._now(steps[0])
        self._rec.log(
            f"plan/robot/path/{steps[0].index // BATCH}",
            rr.LineStrips2D([poses[:, :2]], colors=[(0, 158, 115)], radii=[0.02]),
        )
        steps.clear()


def _placed(geometry: Geometry) -> Any:
    """Cells to metres of the plan's frame."""
    cell = geometry.resolution * thinning(geometry.shape)
    return rr.Transform3D(translation=[geometry.x, geometry.y, 0], scale=cell)


def _image(data: bytes, draw_order: float) -> Any:
    """A PNG as Rerun wants it."""
    return rr.EncodedImage(contents=data, media_type="image/png", draw_order=draw_order)
