"""ROS messages as JSON give what the same messages give as ROS writes them."""

from __future__ import annotations

import dataclasses
import json
from base64 import b64encode
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from formats.errors import Notes
from formats.log import Topic
from formats.messages import LaserScan
from formats.payload import Undecodable
from formats.ros import decoders as ros
from formats.ros.as_json import decoder
from formats.ros.decoders import DECODERS
from formats.stream import frames
from tests.drives import drive
from tests.ros_logs import build, store
from tests.ros_messages import LASER, NOETIC, message, plain, scan_message


def as_json(value: Any, array: Callable[[Any], Any] = lambda many: many.tolist()) -> Any:
    """A message of rosbags' as JSON has it."""
    if dataclasses.is_dataclass(value):
        fields = [f.name for f in dataclasses.fields(value) if not f.name.startswith("_")]
        return {name: as_json(getattr(value, name), array) for name in fields}
    if isinstance(value, np.ndarray):
        return array(value)
    return [as_json(item, array) for item in value] if isinstance(value, list) else value


def outcome(read: Callable[[bytes], Any], data: bytes) -> Any:
    try:
        return plain(read(data))
    except Undecodable as error:
        return error.reason


def base64(many: Any) -> Any:
    return b64encode(many.tobytes()).decode() if many.dtype == np.uint8 else many.tolist()


@pytest.mark.parametrize("array", [lambda many: many.tolist(), base64])
@pytest.mark.parametrize("name", DECODERS)
@given(data=st.data())
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
def test_equal_to_the_same_message_in_ros(name: str, array: Any, data: st.DataObject) -> None:
    made = data.draw(message(NOETIC, name))
    raw = bytes(NOETIC.serialize_ros1(made, name))
    text = json.dumps(as_json(made, array)).encode()
    found = outcome(decoder(Topic("/t", name, "json")), text)
    assert found == outcome(ros.decoder(Topic("/t", name, "ros1")), raw)


def test_numbers_that_json_has_no_word_for() -> None:
    values = as_json(scan_message())
    values["ranges"] = [1.5, None, "Infinity", "-inf", "NaN"]
    del values["intensities"], values["scan_time"]
    found = decoder(Topic("/scan", LASER, "json"))(json.dumps(values).encode())
    assert isinstance(found, LaserScan)
    np.testing.assert_array_equal(
        found.ranges, np.array([1.5, np.nan, inf, -inf, np.nan], np.float32)
    )


@pytest.mark.parametrize(
    "change",
    [
        {"ranges": "x"},
        {"ranges": {"a": 1}},
        {"ranges": [[1.0]]},
        {"header": 5},
        {"header": {"stamp": {"sec": -1, "nanosec": 0}, "frame_id": ""}},
        {"header": {"stamp": {}, "frame_id": ""}},
        {"angle_min": "left"},
        {"ranges": [1e400, "1e9999x"]},
    ],
)
def test_what_is_not_of_its_schema_is_counted(change: dict[str, Any]) -> None:
    read = decoder(Topic("/scan", LASER, "json"))
    with pytest.raises(Undecodable):
        read(json.dumps(as_json(scan_message()) | change).encode())
    values = as_json(scan_message())
    for missing in ("header", "ranges", "angle_min"):
        with pytest.raises(Undecodable, match="not of its schema"):
            read(json.dumps({k: v for k, v in values.items() if k != missing}).encode())
    for broken in (b"", b"[]", b"{", b"\xff", b"[" * 100_000):
        with pytest.raises(Undecodable):
            read(broken)


@pytest.mark.parametrize("short", [True, False])
def test_a_drive_in_json_gives_the_frames_of_the_same_in_cdr(tmp_path: Path, short: bool) -> None:
    log, types = drive(), store()
    path = tmp_path / "json.mcap"
    with path.open("wb") as file:
        writer, channels = Writer(file), dict[str, int]()
        writer.start()
        for time_ns, topic, name, _, fields in log.happened:
            if topic not in channels:
                called = name.replace("/msg/", "/") if short else name
                schema = writer.register_schema(called, "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            text = json.dumps(as_json(build(types, name, fields))).encode()
            writer.add_message(channels[topic], time_ns, text, time_ns)
        writer.finish()
    notes = Notes()
    found, expected = list(frames(path, notes)), list(frames(log.opened()))
    assert len(found) == len(expected) == 20
    for a, b in zip(found, expected, strict=True):
        assert (a.time_ns, a.pose) == (b.time_ns, b.pose)
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
    assert not notes.of("lost")
