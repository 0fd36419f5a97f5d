"""Scans straight from payloads, against decoding and sensing apart."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from formats.frame import Pose
from formats.log import Topic
from formats.payload import Undecodable
from formats.ros.decoders import decoder
from formats.ros.wire import Body
from formats.sensing.scans import SENSORS
from formats.sensing.sensor import Motion
from formats.streaming.scanning import scanner
from tests.ros_messages import ENCODINGS, LASER, NOETIC, plain, scan_message

STILL = Motion(Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0))
MOVING = Motion(Pose(-0.1, 0.0, -0.05), Pose(0.1, 0.0, 0.05))


def rolled(angle: float) -> Any:
    m = np.eye(4)
    m[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    m[2, 3] = 1.0
    return m


def outcome(make: Any, *args: Any) -> Any:
    try:
        scan = make(*args)
    except Undecodable as error:
        return str(error)
    found = scan.bearings, scan.widths, scan.ranges, scan.min_range, scan.max_range
    return plain(found), scan.ranges.dtype.str, scan.ranges.flags.c_contiguous


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("bright", [0, 5])
@given(data=st.data())
@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
def test_equal_to_decoding_and_sensing(encoding: str, bright: int, data: st.DataObject) -> None:
    """Any bytes of the head or tail changed, by any sensor: level, upside down, tilted, moving."""
    kind, store, write = ENCODINGS[encoding]
    first = bytes(write(scan_message(store, bright=bright), LASER))
    topic = Topic("/scan", LASER, kind)
    make = scanner(topic)
    make(first, np.eye(4), None)
    read = decoder(topic)
    places = st.integers(0, len(first) - 1)
    for _ in range(8):
        changed = bytearray(first)
        for at in data.draw(st.lists(places, max_size=3)):
            changed[at] = data.draw(st.integers(0, 255))
        matrix = rolled(data.draw(st.sampled_from([0.0, 0.03, 0.04, 1.0, pi])))
        motion = data.draw(st.sampled_from([None, None, STILL, MOVING]))

        payload = bytes(changed)
        try:
            reading: Any = read(payload)
        except Undecodable:
            with pytest.raises(Undecodable):
                make(payload, matrix, motion)
            continue
        if not SENSORS[LASER].fault(reading):  # others never come so far
            expected = outcome(SENSORS[LASER].scan, reading, matrix, motion)
            assert outcome(make, payload, matrix, motion) == expected


@pytest.mark.parametrize("encoding", ["ros1", "cdr little"])
def test_the_second_scan_is_not_decoded(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, store, write = ENCODINGS[encoding]
    make = scanner(Topic("/scan", LASER, kind))
    m = scan_message(store)
    made = make(write(m, LASER), np.eye(4), None)

    def refuse(*_: object) -> None:
        raise AssertionError("cursor used")

    monkeypatch.setattr(Body, "__init__", refuse)
    m.header.stamp.sec += 1
    m.time_increment = 0.25
    m.ranges = m.ranges[::-1].copy()
    again = make(write(m, LASER), np.eye(4), None)
    np.testing.assert_array_equal(again.ranges, made.ranges[::-1])
    assert again.bearings is made.bearings


@pytest.mark.parametrize("kind", ["ros1", "cdr"])
def test_a_definition_of_its_own_rules(kind: str) -> None:
    """Float64 ranges in the recorded definition: the layout of the standard type is not used."""
    text = b"std_msgs/Header header\nfloat64[] ranges\n"
    form = "ros1msg" if kind == "ros1" else "ros2msg"
    make = scanner(Topic("/scan", LASER, kind, text, form))
    store = NOETIC if kind == "ros1" else ENCODINGS["cdr little"][1]
    payload = ENCODINGS["ros1" if kind == "ros1" else "cdr little"][2](scan_message(store), LASER)
    for _ in range(2):
        with pytest.raises(Undecodable):
            make(payload, np.eye(4), None)


def test_other_types_have_scanners_too() -> None:
    name = "sensor_msgs/msg/Range"
    _, store, write = ENCODINGS["cdr little"]
    m = store.types[name](scan_message(store).header, 0, 0.5, 0.1, 4.0, 2.5)
    for _ in range(2):
        found = scanner(Topic("/sonar", name, "cdr"))(write(m, name), np.eye(4), None)
        assert found.ranges.tolist() == [2.5]
