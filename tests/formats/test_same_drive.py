"""One drive in every container gives the same frames, and the same map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from formats.errors import Notes
from formats.frame import Frame
from formats.grid import Evidence, Geometry
from formats.mcap.writing import McapWriter
from formats.opening import open_log
from formats.stream import frames
from replay.mapper import Mapper

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
GEOMETRY = Geometry(300, 300, 0.1, -15.0, -15.0)


def repacked(source: Path, target: Path, profile: str, compression: str) -> Path:
    """A log's messages, byte for byte, in an MCAP of another profile."""
    log = open_log(source, Notes())
    with target.open("wb") as file:
        writer = McapWriter(file, profile=profile, library="test", compression=compression)
        channels = {}
        for topic in log.topics():
            name, form = topic.type, topic.definition_format
            if topic.encoding == "ros1":
                name, form = name.replace("/msg/", "/"), "ros1msg"
            schema = writer.schema(name, form, topic.definition)
            channels[topic.name] = writer.channel(topic.name, topic.encoding, schema)
        for topic, time_ns, data in log.messages():
            writer.message(channels[topic.name], time_ns, bytes(data), time_ns)
        writer.finish()
    log.close()
    return target


@pytest.fixture(scope="module")
def reference() -> list[Frame]:
    return list(frames(SAMPLES / "turtlebot.mcap", Notes(), every=8))


def mapped(some: list[Frame]) -> Evidence:
    mapper = Mapper(GEOMETRY, max_range=12.0)
    for frame in some:
        mapper.insert(frame)
    return mapper.evidence


@pytest.mark.parametrize(
    ("source", "profile", "compression"),
    [
        ("turtlebot.bag", "ros1", "zstd"),
        ("turtlebot.bag", "ros1", ""),
        ("turtlebot.mcap", "ros2", ""),
        ("turtlebot.mcap", "", "zstd"),
        ("turtlebot.mcap", "somebody's", ""),
        ("turtlebot.bag", None, ""),
    ],
)
def test_the_same_drive_gives_the_same_frames_and_map(
    source: str, profile: str | None, compression: str, tmp_path: Path, reference: list[Frame]
) -> None:
    log = SAMPLES / source
    if profile is not None:
        log = repacked(log, tmp_path / "drive.mcap", profile, compression)
    found = list(frames(log, Notes(), every=8))
    assert len(found) == len(reference) == 101
    for a, b in zip(found, reference, strict=True):
        assert a.time_ns == b.time_ns
        assert a.pose == b.pose
        assert np.array_equal(a.scan.ranges, b.scan.ranges)
        assert np.array_equal(a.scan.bearings, b.scan.bearings)
    assert mapped(found).counts.tobytes() == mapped(reference).counts.tobytes()
