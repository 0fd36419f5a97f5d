"""Reads the result of a run back: settings, scores, poses, and evidence through time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.errors import Path as AnyPath
from formats.frame import Particles, Pose
from formats.grid import Evidence, Floats, Geometry, Grid
from formats.result import Curve, Result
from formats.results import messages as ros
from formats.results import records
from formats.results.clouds import cloud_points
from formats.results.contents import Messages, Stream, fitting, opened
from formats.results.keyframes import Change
from formats.results.particles import particle_poses
from formats.sensing.ends import Points

# the rest is for other tools
READ = ("/pose", "/cells", "/evidence", "/metrics/", "/scan_points", "/particle_cloud")
READ_AGAIN = ("/cells", "/evidence")
MAX_COUNTS = 1 << 29  # levels * rows * cols: 2 GiB of counts


@dataclass(slots=True)
class RunFile:
    """A result file, read.

    Attributes:
        path: of the file.
        settings: every option that had effect.
        facts: what the run says of itself.
        geometry: of every grid.
        levels: that a reading may show.
        curves: name -> how its map is drawn, with the prior to the bit.
        main: the curve that is the run's map.
        layers: name -> (rows, cols), what re-scoring needs of each cell.
        map_to_plan: pose of the plan's frame in the frame of the poses.
        times_ns: (frames,) int64.
        poses: (frames, 3) x, y, yaw of the sensor in the plan's frame.
        covariances: (frames, 3, 3) of x, y, yaw likewise; None where the poses are taken as exact.
        particles: of a localiser now and then, of the sensor in the map's frame; none where the
            poses are the log's.
        counts: scored curve -> (frames, 2, 4) int64: observed / unobserved by tp, fp, fn, tn.
        changes: of the evidence, keyframe by keyframe; all of them add up to the whole.
        points: frame -> where its beams ended, (n, 2) m in the plan's frame; of keyframes alone.
        attachments: name -> bytes. A name may be anything: never a path to write to.
        written: when, ISO 8601 UTC.
    """

    path: Path
    settings: dict[str, Any]
    facts: dict[str, Any]
    geometry: Geometry
    levels: int
    curves: dict[str, Curve]
    main: str
    layers: dict[str, npt.NDArray[Any]]
    map_to_plan: Pose
    times_ns: npt.NDArray[np.int64]
    poses: Floats
    covariances: Floats | None
    particles: tuple[Particles, ...]
    counts: dict[str, npt.NDArray[np.int64]]
    changes: list[Change]
    points: dict[int, Points]
    attachments: dict[str, bytes]
    written: str

    def keyframes(self) -> Iterator[tuple[int, int, Evidence]]:
        """Frame index, its time (ns) and all evidence up to it: one object that grows."""
        evidence = Evidence.empty(self.geometry, self.levels)
        for change in self.changes:
            change.add_to(evidence)
            yield change.frame, int(self.times_ns[change.frame]), evidence

    def evidence(self) -> Evidence:
        """All readings of the run."""
        evidence = Evidence.empty(self.geometry, self.levels)
        for change in self.changes:
            change.add_to(evidence)
        return evidence

    def result(self) -> Result:
        """What `run` gave, with each curve's last map drawn anew from the evidence."""
        evidence = self.evidence()
        grids = {name: curve.of(evidence) for name, curve in self.curves.items()}
        return Result(self.settings, self.times_ns, self.counts, grids, self.facts)


def read_result(path: AnyPath, notes: Notes | None = None) -> RunFile:
    """Read a result file whole.

    Args:
        path: of the file.
        notes: takes what was odd.

    Raises:
        FormatError: it is not a result, of a newer format, cut or damaged.
    """
    path = Path(path)
    record, metadata, attachments, messages = opened(path, READ, notes)
    with fitting(path):
        return _run_file(path, record, metadata, attachments, messages)


def read_through_time(
    path: Path, notes: Notes | None = None
) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]], list[tuple[int, Change]], dict[str, bytes]]:
    """The record "replay", layers, changes of the evidence with their times (ns), attachments.

    Raises:
        FormatError: as `read_result`.
    """
    record, _, attachments, messages = opened(path, READ_AGAIN, notes)
    with fitting(path):
        geometry, levels = _lattice(record)
        layers = _layers(geometry, messages.get("/cells", []))
        frames = int(record["frames"])
        changes = [
            (time, _change(geometry, levels, frames, data))
            for time, data in messages.get("/evidence", [])
        ]
        if len(changes) != record["keyframes"]:
            raise ValueError("keyframes are missing")
        return record, layers, changes, attachments


def _run_file(
    path: Path,
    record: dict[str, Any],
    metadata: Mapping[str, Mapping[str, str]],
    attachments: dict[str, bytes],
    messages: Messages,
) -> RunFile:
    """The parts, checked against each other. Raises anything on what does not fit."""
    geometry, levels = _lattice(record)
    frames = int(record["frames"])
    layers = _layers(geometry, messages.get("/cells", []))
    poses = _records(records.POSE_RECORD, messages["/pose"], frames)
    scored = {
        name: _records(records.METRICS_RECORD, messages[f"/metrics/{name}"], frames)
        for name in record["scored"]
    }
    curves = {
        name: _curve(geometry, levels, layers, entry) for name, entry in record["curves"].items()
    }
    changes = [_change(geometry, levels, frames, data) for _, data in messages.get("/evidence", [])]
    spread = None
    if sure := messages.get("/pose_with_covariance"):
        spread = records.covariances(_records(records.COVARIANCE_RECORD, sure, frames))
        if not np.isfinite(spread).all():
            raise ValueError("a covariance that is not finite")
    place = Pose(*map(float, record["map_to_plan"]))
    times = np.array([time for time, _ in messages["/pose"]], dtype=np.int64)
    if not np.isfinite([geometry.x, geometry.y, *place, *poses["pose"].ravel()]).all():
        raise ValueError("a pose that is not finite")
    if len(changes) != record["keyframes"] or record["main"] not in curves:
        raise ValueError("keyframes or curves are missing")
    return RunFile(
        path=path,
        settings=dict(record["settings"]),
        facts=dict(record["facts"]),
        geometry=geometry,
        levels=levels,
        curves=curves,
        main=record["main"],
        layers=layers,
        map_to_plan=place,
        times_ns=times,
        poses=records.poses(poses["pose"]),
        covariances=spread,
        particles=_particles(messages.get("/particle_cloud", [])),
        counts={name: part["counts"].astype(np.int64) for name, part in scored.items()},
        changes=changes,
        points=_points(times, messages.get("/scan_points", [])),
        attachments=attachments,
        written=metadata.get("written", {}).get("time", ""),
    )


def _lattice(record: Mapping[str, Any]) -> tuple[Geometry, int]:
    """The geometry and the number of levels."""
    height, width, resolution, x, y = record["geometry"]
    levels = int(record["levels"])
    if min(height, width, levels) < 1 or levels * height * width > MAX_COUNTS or not resolution > 0:
        raise ValueError(f"a grid of {levels} levels, {height} rows and {width} columns")
    return Geometry(int(height), int(width), float(resolution), float(x), float(y)), levels


def _records(kind: np.dtype[np.void], stream: Stream, frames: int) -> npt.NDArray[Any]:
    """Messages of one fixed size, one a frame."""
    out = np.frombuffer(b"".join(data for _, data in stream), dtype=kind)
    if len(stream) != frames or len(out) != frames:
        raise ValueError(f"{len(stream)} messages for {frames} frames")
    return out


def _layers(geometry: Geometry, stream: Stream) -> dict[str, npt.NDArray[Any]]:
    if not stream:
        return {}
    message = ros.decode(stream[0][1], ros.CELLS)
    found = {name: getattr(message, name) for name in ros.LAYERS}
    return {name: cells.reshape(geometry.shape) for name, cells in found.items() if len(cells)}


def _curve(
    geometry: Geometry, levels: int, layers: Mapping[str, Floats], entry: Mapping[str, Any]
) -> Curve:
    p_levels = tuple(float(p) for p in entry["p_levels"])
    if len(p_levels) != levels or not all(0.0 < p < 1.0 for p in p_levels):
        raise ValueError(f"a curve with levels {p_levels}")
    if entry["update"] not in ("bayes", "paper"):
        raise ValueError(f"a curve with update {entry['update']}")
    prior = np.zeros(geometry.shape)
    if entry["prior"] == "prior":
        prior = 0.0 - layers["prior_log_odds"]
    if not np.isfinite(prior).all():
        raise ValueError("a prior with cells that are not finite")
    return Curve(Grid(geometry, prior), p_levels, entry["update"])


def _points(times_ns: npt.NDArray[np.int64], stream: Stream) -> dict[int, Points]:
    """Clouds by the frame of their time."""
    frames = {int(time): frame for frame, time in enumerate(times_ns)}
    return {frames[time]: cloud_points(data) for time, data in stream}


def _particles(stream: Stream) -> tuple[Particles, ...]:
    return tuple(Particles(time, particle_poses(data)) for time, data in stream)


def _change(geometry: Geometry, levels: int, frames: int, data: bytes) -> Change:
    message = ros.decode(data, ros.EVIDENCE)
    where = np.cumsum(message.steps, dtype=np.int64)
    lattice = (message.levels, message.rows, message.cols)
    if lattice != (levels, *geometry.shape) or message.frame >= frames:
        raise ValueError(f"evidence of frame {message.frame} on another lattice")
    cells = levels * geometry.rows * geometry.cols
    if len(where) != len(message.added) or (len(where) and where[-1] >= cells):
        raise ValueError(f"evidence of frame {message.frame} outside its lattice")
    return Change(int(message.frame), where, message.added)
