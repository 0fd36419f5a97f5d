"""The result of a run in one MCAP: other tools read it, and it is re-scored without its log."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError
from formats.errors import Path as AnyPath
from formats.frame import Particles, Pose
from formats.grid import Evidence, Geometry
from formats.mcap.writing import McapWriter
from formats.media import media_type
from formats.output import atomic
from formats.plain_json import now, plain_json
from formats.result import Curve, Step, checked_curves
from formats.results import messages as ros
from formats.results import records
from formats.results.clouds import add_cloud
from formats.results.contents import FORMAT, RECORD
from formats.results.groups import grouped, scored_cells
from formats.results.keyframes import LIMIT, Keyframes, Pictures, percent
from formats.results.particles import add_particles
from formats.results.reading import RunFile, read_result
from formats.results.rosbag2_record import finish_bag
from formats.sensing.ends import Points, end_points

__all__ = ["FORMAT", "ResultWriter", "RunFile", "read_result"]

Stream = tuple[str, str, npt.NDArray[Any]]  # topic, type, a record a frame
HERE = Pose(0.0, 0.0, 0.0)
BLOCK = 4096  # frames encoded at once
IN_MEMORY = 1 << 24  # bytes of frames held before they go to a temporary file


class ResultWriter:
    """Writes one result file, whole or not at all, as a context manager.

    Frames are held as some 200 bytes each (in a temporary file when they are many) and evidence
    as changes between keyframes, until `finish` writes all in the order of time. Maps show
    P(occupied) of every cell, so the prior's where no reading came; the evidence says where. The
    same run gives the same bytes but for the metadata record "written" and the data section's
    checksum.

    Args:
        path: of the file, by habit "STEM.replay.mcap".
        geometry: of every grid in it.
        curves: name -> how its map is drawn; informative priors must all be the same one.
        main: the curve on /map; /map_without_prior shows the curve "none".
        layers: what re-scoring needs of each cell, by field of replay_msgs/CellLayers.
        settings: every option that had effect.
        map_to_plan: pose of the plan's frame in the frame of the poses.
        covariances: times (m,) ascending, of all frames and maybe others, and covariances
            (m, 3, 3) of x, y, yaw in the plan's frame; None where the poses are taken as exact.
        particles: of a localiser now and then, in the frame of the poses.
        attachments: name -> bytes: plan, truth, parameters.
        facts: what is known of the run before it starts.
        force: replace an existing file.
        inputs: files that are read, none of which may be the output.

    Raises:
        FormatError: on entering, if the file cannot be written.
        ValueError: curves, layers and geometry do not fit together.
    """

    def __init__(
        self,
        path: AnyPath,
        *,
        geometry: Geometry,
        curves: Mapping[str, Curve],
        main: str = "bayes",
        layers: Mapping[str, npt.NDArray[Any]] | None = None,
        settings: Mapping[str, Any] | None = None,
        map_to_plan: Pose = HERE,
        covariances: tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]] | None = None,
        particles: Sequence[Particles] = (),
        attachments: Mapping[str, bytes] | None = None,
        facts: Mapping[str, Any] | None = None,
        force: bool = False,
        inputs: Iterable[AnyPath] = (),
    ) -> None:
        self._path, self._geometry = Path(path), geometry
        self._curves, self._main = checked_curves(curves, main, geometry), main
        self._levels = len(curves[main].p_levels)
        self._layers = ros.checked_layers(layers or {}, geometry)
        priors = [curve.prior.values for curve in curves.values() if curve.prior.values.any()]
        if any(not np.array_equal(prior, priors[0]) for prior in priors):
            raise ValueError("a result holds one informative prior")
        if priors:
            self._layers["prior_log_odds"] = -priors[0]
        self._settings, self._facts = dict(settings or {}), dict(facts or {})
        self._map_to_plan, self._attachments = map_to_plan, dict(attachments or {})
        self._covariances, self._particles = covariances, particles
        self._atomic = atomic(path, force=force, inputs=list(inputs))
        self._keyframes = Keyframes(geometry, self._levels)
        self._scored: list[str] = []
        self._points: dict[int, Points] = {}  # of keyframes, for those who look
        self._frames, self._finished = 0, False
        self._last: Evidence | None = None

    def __enter__(self) -> ResultWriter:
        self._part = self._atomic.__enter__()
        self._held = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._held.close()
        if kind is None and not self._finished:
            error = ValueError("the result was not finished")
            self._atomic.__exit__(ValueError, error, None)
            raise error
        self._atomic.__exit__(kind, error, trace)

    def write(self, step: Step) -> None:
        """Hold one frame; its evidence too, where it is a keyframe.

        Raises:
            FormatError: a time before 1970.
            ValueError: evidence of another shape.
            KeyError: a curve that was scored at the first frame is missing.
        """
        if self._frames == 0:
            self._scored = [name for name in self._curves if name in step.counts]
            self._record = struct.Struct(f"<q3d{8 * len(self._scored)}q")
        time = step.frame.time_ns
        if time < 0:
            raise FormatError(self._path, "a time before 1970 cannot be written", at=f"{time} ns")
        splits = [step.counts[name] for name in self._scored]
        counts = [n for split in splits for part in split for n in part]
        self._held.write(self._record.pack(time, *step.frame.pose, *counts))
        if step.evidence is not None:
            if step.evidence.counts.shape != (self._levels, *self._geometry.shape):
                raise ValueError("evidence, curves and geometry do not fit together")
            if step.keyframe:
                self._points[self._frames] = end_points(step.frame)
                self._keyframes.offer(self._frames, step.evidence)
                if len(self._points) > 2 * LIMIT:
                    self._forget()
            self._last = step.evidence
        self._frames += 1

    def _forget(self) -> None:
        """Points of moments that are no keyframes any longer."""
        kept = [change.frame for change in self._keyframes.kept]
        self._points = {frame: self._points[frame] for frame in kept if frame in self._points}

    def finish(self, facts: Mapping[str, Any] | None = None) -> None:
        """Write the file; `facts` are added to those known before the run.

        Raises:
            FormatError: there were no frames.
        """
        if self._frames == 0:
            raise FormatError(self._path, "the run has no frames: there is no result to write")
        if self._last is not None:
            self._keyframes.close(self._frames - 1, self._last)
        with self._part.open("wb") as file:
            writer = McapWriter(file, "ros2", f"plan-replay/{version('plan-replay')}")
            self._describe({**self._facts, **(facts or {})}, writer)
            self._messages(channels := ros.Channels(writer))
            finish_bag(writer, channels)
        self._finished = True

    def _describe(self, facts: Mapping[str, Any], writer: McapWriter) -> None:
        """Metadata and attachments."""
        g = self._geometry
        curves = {
            name: {
                "prior": "prior" if curve.prior.values.any() else "none",
                "p_levels": curve.p_levels,
                "update": curve.update,
            }
            for name, curve in self._curves.items()
        }
        record = {
            "format": FORMAT,
            "settings": self._settings,
            "facts": facts,
            "geometry": (g.rows, g.cols, g.resolution, g.x, g.y),
            "levels": self._levels,
            "curves": curves,
            "main": self._main,
            "scored": self._scored,
            "map_to_plan": self._map_to_plan,
            "layers": list(self._layers),
            "frames": self._frames,
            "keyframes": len(self._keyframes.kept),
        }
        writer.metadata("written", {"time": now()})
        writer.metadata(RECORD, {key: plain_json(value) for key, value in record.items()})
        for name, data in self._attachments.items():
            writer.attachment(name, media_type(name), data)

    def _messages(self, channels: ros.Channels) -> None:
        """What re-scoring needs; then each frame's small messages and its keyframe's, by time."""
        self._kept(channels)
        kept = {change.frame: change for change in self._keyframes.kept}
        shown = {"/map": self._main, "/map_without_prior": "none"}
        shown = {topic: name for topic, name in shown.items() if name in self._curves}
        drawn = {name: self._curves[name] for name in shown.values()}
        pictures = Pictures(drawn, self._geometry, self._levels)
        for first, times, streams in self._blocks():
            if first == 0:
                self._once(channels, int(times[0]))
            frames, done = channels.block(times, first, streams), 0
            for frame in [frame for frame in kept if first <= frame < first + len(times)]:
                time, behind = int(times[frame - first]), frame - first + 1
                channels.add_frames(frames[done:behind])
                done = behind
                if frame in self._points:
                    add_cloud(channels, time, self._points[frame])
                pictures.add(kept[frame])
                for topic, name in shown.items():
                    self._grid(channels, topic, time, pictures.cells[name])
            channels.add_frames(frames[done:])

    def _blocks(self) -> Iterator[tuple[int, npt.NDArray[np.int64], list[Stream]]]:
        """Index of the first frame, times, and what each topic says, of a block of frames."""
        fields = [("time", "<i8"), ("pose", "<f8", 3), ("counts", "<i8", (len(self._scored), 2, 4))]
        kind, first = np.dtype(fields), 0
        self._held.seek(0)
        while data := self._held.read(BLOCK * kind.itemsize):
            block = np.frombuffer(data, dtype=kind)
            times = block["time"]
            streams = [
                ("/pose", ros.POSE, records.pose_records(times, block["pose"])),
                ("/tf", ros.TF, records.tf_records(times, block["pose"])),
            ]
            if self._covariances is not None:
                at, known = self._covariances
                spread = known[np.minimum(np.searchsorted(at, times), len(at) - 1)]
                sure = records.covariance_records(times, block["pose"], spread)
                streams.append(("/pose_with_covariance", ros.POSE_WITH_COVARIANCE, sure))
            for i, name in enumerate(self._scored):
                metrics = records.metrics_records(times, first, block["counts"][:, i])
                streams.append((f"/metrics/{name}", ros.METRICS, metrics))
            yield first, times, streams
            first += len(block)

    def _kept(self, channels: ros.Channels) -> None:
        """Groups, layers, evidence and particles in chunks of their own: few readers open them.

        Times of chunks overlap, then, which the index of the file accounts for.
        """
        if cells := self._last and scored_cells(self._layers, self._last.counts):
            groups = ros.groups_message(grouped(cells))
            channels.add(ros.GROUPS_TOPIC, ros.GROUPS, self._time(self._frames - 1), groups)
            channels.close_chunk()
        if self._layers:
            layers = ros.cells_message(self._geometry, self._layers)
            channels.add("/cells", ros.CELLS, self._time(0), layers)
            channels.close_chunk()
        for change in self._keyframes.kept:
            time = self._time(change.frame)
            message = ros.evidence_message(time, self._geometry, self._levels, change)
            channels.add("/evidence", ros.EVIDENCE, time, message)
        channels.close_chunk()
        for particles in self._particles:
            add_particles(channels, particles)
        if self._particles:
            channels.close_chunk()

    def _once(self, channels: ros.Channels, time: int) -> None:
        """What holds for the whole run."""
        channels.add("/tf_static", ros.TF, time, ros.static_transform(time, self._map_to_plan))
        if "prior_log_odds" in self._layers:
            prior = percent(-self._layers["prior_log_odds"].reshape(-1))
            self._grid(channels, "/prior", time, prior)

    def _grid(
        self, channels: ros.Channels, topic: str, time: int, cells: npt.NDArray[np.int8]
    ) -> None:
        channels.add(topic, ros.GRID, time, ros.occupancy_grid(time, self._geometry, cells))

    def _time(self, frame: int) -> int:
        """ns, of a frame that is held."""
        self._held.seek(frame * self._record.size)
        (time,) = struct.unpack("<q", self._held.read(8))
        return int(time)
