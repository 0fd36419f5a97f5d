"""Small made-up runs: steps of growing random evidence, and the result files of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from formats.frame import Frame, Pose, Scan
from formats.grid import Evidence, Geometry, Grid, logit
from formats.result import Counts, Curve, Split, Step
from formats.results.file import ResultWriter

GEOMETRY = Geometry(12, 17, 0.05, -0.2, 0.35)
SCAN = Scan(np.zeros(1), np.ones(1), np.ones(1, dtype=np.float32), 0.1, 10.0)
START = 1_664_000_000_123_456_789


def prior() -> Grid:
    """Walls (P(empty) 0.18) around spaces (0.81), nothing known in the first two columns."""
    l0 = np.full(GEOMETRY.shape, logit(0.81))
    l0[0], l0[-1], l0[:, -1] = logit(0.18), logit(0.18), logit(0.18)
    l0[:, :2] = 0.0
    return Grid(GEOMETRY, l0)


def curves() -> dict[str, Curve]:
    """The three curves of a lidar run: hit, miss."""
    nothing = Grid(GEOMETRY, np.zeros(GEOMETRY.shape))
    return {
        "none": Curve(nothing, (0.3, 0.6)),
        "bayes": Curve(prior(), (0.3, 0.6)),
        "paper": Curve(prior(), (0.1, 0.9), "paper"),
    }


def steps(frames: int, seed: int = 0, every: int = 1, start: int = START) -> Iterator[Step]:
    """Frames whose evidence grows by up to 20 readings each; every n-th is a keyframe."""
    random = np.random.default_rng(seed)
    evidence = Evidence.empty(GEOMETRY, 2)
    for i in range(frames):
        where = random.integers(0, evidence.counts.size, random.integers(0, 20))
        np.add.at(evidence.counts.reshape(-1), where, 1)
        counts = {
            name: Split(Counts(*random.integers(0, 9, 4)), Counts(*random.integers(0, 9, 4)))
            for name in curves()
        }
        pose = Pose(*random.uniform(-3.0, 3.0, 3))
        frame = Frame(start + i * 100_000_001, pose, SCAN)
        yield Step(i, frame, {}, counts, i % every == 0 or i == frames - 1, evidence)


def layers() -> dict[str, Any]:
    """Some of what re-scoring needs, and some of it absent."""
    random = np.random.default_rng(7)
    return {
        "wall": random.random(GEOMETRY.shape),
        "outside": random.integers(0, 2, GEOMETRY.shape).astype(np.uint8),
        "truth_wall": random.integers(0, 25, GEOMETRY.shape).astype(np.uint32),
    }


def write_run(path: Path, frames: int = 30, **options: Any) -> Path:
    """A result file of `steps(frames)`."""
    given: dict[str, Any] = {
        "geometry": GEOMETRY,
        "curves": curves(),
        "layers": layers(),
        "settings": {"p-hit": 0.7, "max-range": float("inf"), "prior": Path("plan.png")},
        "map_to_plan": Pose(1.0, 2.0, 0.5),
        "attachments": {"plan.png": b"\x89PNG not really", "plan.yaml": b"resolution: 0.05\n"},
        "facts": {"scans": frames},
    }
    with ResultWriter(path, **{**given, **options}) as writer:
        for step in steps(frames):
            writer.write(step)
        writer.finish({"skipped": 2})
    return path


def forge(
    source: Path,
    out: Path,
    edits: Mapping[str, tuple[str, str]],
    topics: Mapping[str, str] | None = None,
    payloads: Mapping[str, bytes] | None = None,
) -> Path:
    """A copy of a result in which texts of the record "replay", topics or payloads are others."""
    from mcap.reader import make_reader
    from mcap.writer import Writer

    with source.open("rb") as file, out.open("wb") as copy:
        reader, writer = make_reader(file), Writer(copy, enable_data_crcs=True)
        writer.start("ros2")
        for record in reader.iter_metadata():
            data = dict(record.metadata)
            for key in data.keys() & edits.keys():
                assert edits[key][0] in data[key]
                data[key] = data[key].replace(*edits[key])
            writer.add_metadata(record.name, data)
        channels: dict[str, int] = {}
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            topic = (topics or {}).get(channel.topic, channel.topic)
            if topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[topic] = writer.register_channel(topic, "cdr", number)
            data_bytes = (payloads or {}).get(channel.topic, message.data)
            writer.add_message(channels[topic], message.log_time, data_bytes, message.log_time)
        writer.finish()
    return out
