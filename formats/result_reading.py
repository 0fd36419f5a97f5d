"""Reads the result of a run back: settings, scores, poses, and evidence through time."""

from __future__ import annotations

import json
import mmap
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import numpy.typing as npt

from formats import result_messages as ros
from formats import result_records as records
from formats.errors import FormatError, Notes
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.grid import Evidence, Floats, Geometry, Grid
from formats.keyframes import Change
from formats.mcap_log import open_file
from formats.result import Curve, Result

FORMAT = 1  # of the file; raised when an older reader would misread it
RECORD = "replay"  # the metadata record that makes an MCAP a result
AGAIN = "run `replay run` on its log again"
DATA_END, FOOTER = 13, 37  # bytes that end an MCAP: of the record; of the footer and the magic
READ = ("/pose", "/cells", "/evidence", "/metrics/")  # the rest is there for other programs
MAX_COUNTS = 1 << 29  # levels * rows * cols: 2 GiB of counts

Stream = list[tuple[int, bytes]]  # log time (ns) and payload of each message of a topic
Messages = dict[str, Stream]


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
        counts: scored curve -> (frames, 2, 4) int64: observed / unobserved by tp, fp, fn, tn.
        changes: of the evidence, keyframe by keyframe; all of them add up to the whole.
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
    counts: dict[str, npt.NDArray[np.int64]]
    changes: list[Change]
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
    metadata, attachments, messages = _contents(path, notes or Notes())
    if RECORD not in metadata:
        hint = "`replay run` writes results; `replay info` looks into logs"
        raise FormatError(path, f'not a result of replay: no metadata record "{RECORD}"', hint=hint)
    if not _sound(path):
        raise FormatError(path, "damaged: the checksum of its data does not match", hint=AGAIN)
    record = _record(path, metadata[RECORD])
    try:
        return _run_file(path, record, metadata, attachments, messages)
    except FormatError:
        raise
    except Exception as error:  # a file may say anything; what it says wrong is one line
        problem = f"a result that does not fit together ({type(error).__name__}: {error})"
        raise FormatError(path, problem, hint=AGAIN) from error


def _record(path: Path, fields: Mapping[str, str]) -> dict[str, Any]:
    """The metadata record, decoded, if its format is one that this reader knows."""
    try:
        version = int(fields["format"])
        if version > FORMAT:
            problem = f"a result of format {version}; this replay reads up to {FORMAT}"
            raise FormatError(path, problem, hint="update replay")
        return {key: json.loads(value) for key, value in fields.items()}
    except (ValueError, KeyError, RecursionError) as error:
        problem = f'the metadata record "{RECORD}" is malformed ({type(error).__name__}: {error})'
        raise FormatError(path, problem) from error


def _run_file(
    path: Path,
    record: dict[str, Any],
    metadata: Mapping[str, Mapping[str, str]],
    attachments: dict[str, bytes],
    messages: Messages,
) -> RunFile:
    """The parts, checked against each other. Raises anything on what does not fit."""
    height, width, resolution, x, y = record["geometry"]
    geometry = Geometry(int(height), int(width), float(resolution), float(x), float(y))
    levels, frames = int(record["levels"]), int(record["frames"])
    if min(height, width, levels) < 1 or levels * height * width > MAX_COUNTS or not resolution > 0:
        raise ValueError(f"a grid of {levels} levels, {height} rows and {width} columns")
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
    place = Pose(*map(float, record["map_to_plan"]))
    if not np.isfinite([x, y, *place, *poses["pose"].ravel()]).all():
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
        times_ns=np.array([time for time, _ in messages["/pose"]], dtype=np.int64),
        poses=records.poses(poses["pose"]),
        counts={name: part["counts"].astype(np.int64) for name, part in scored.items()},
        changes=changes,
        attachments=attachments,
        written=metadata.get("written", {}).get("time", ""),
    )


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


def _contents(
    path: Path, notes: Notes
) -> tuple[dict[str, dict[str, str]], dict[str, bytes], Messages]:
    """Metadata, attachments, and messages by topic, of a file that is whole to the last bit."""
    said = Notes()
    log = open_file(path, said)
    try:
        metadata = dict(log.metadata())
        attachments = {name: bytes(data) for name, _, data in log.attachments()}
        messages: Messages = {}
        read = [topic for topic in log.topics() if topic.name.startswith(READ)]
        for topic, time, data in log.messages(read):
            messages.setdefault(topic.name, []).append((time, bytes(data)))
        state = log.container.state if not log.container.whole else ""
    finally:
        log.close()
    lost = [f"{note.problem} at {note.at}" for note in said.of("lost")]
    if state or lost:
        raise FormatError(path, f"damaged: {state or ', '.join(lost)}", hint=AGAIN)
    for note in said:
        notes.add(note.kind, path, note.problem, topic=note.topic, at=note.at, count=note.count)
    return metadata, attachments, messages


def _sound(path: Path) -> bool:
    """Whether the checksum of the data section holds, the only one that covers metadata.

    The footer says where the summary begins; the record DataEnd with the checksum ends there.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        (summary,) = struct.unpack_from("<Q", data, len(data) - FOOTER + 9)
        end = min(summary, len(data)) - DATA_END
        if end < 0 or data[end] != 0x0F:
            return False
        (crc,) = struct.unpack_from("<I", data, end + 9)
        with memoryview(data) as view, view[:end] as checked:
            return crc in (0, crc32(checked))  # 0: whoever copied the file left it out
