"""Foxglove's messages, written by an encoder of the test's own and by hand."""

from __future__ import annotations

import json
import struct
from contextlib import suppress
from math import isclose, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.decoding import decoder_of
from formats.foxglove import decoders as foxglove
from formats.log import Topic
from formats.messages import (
    Cloud,
    LaserScan,
    PoseMessage,
    Transform,
    Transforms,
)
from formats.payload import Undecodable, odd_stamp
from formats.ros import decoders as ros
from tests.foxglove_messages import CASES, JSON_POSE, field, number


def check(found: tuple[Any, ...], expected: tuple[Any, ...]) -> None:
    assert type(found) is type(expected)
    for mine, right in zip(found, expected, strict=True):
        if isinstance(right, np.ndarray):
            np.testing.assert_array_equal(mine, right)
        else:
            assert mine == right


@pytest.mark.parametrize("name", foxglove.DECODERS)
def test_protobuf_and_json_give_the_same_noun(name: str) -> None:
    binary, values, expected = CASES[name]
    check(foxglove.decode(Topic("/t", name, "protobuf"), binary), expected)
    check(foxglove.decode(Topic("/t", name, "protobuf"), memoryview(binary)), expected)
    check(foxglove.decode(Topic("/t", name, "json"), json.dumps(values).encode()), expected)


def test_bytes_written_by_hand() -> None:
    """A FrameTransform as the wire format's page spells it out."""
    binary = bytes.fromhex(
        "0a 06 08 c0 84 3d 10 01"  # timestamp { seconds 1000000, nanos 1 }
        "12 01 61 1a 01 62"  # "a", "b"
        "22 09 11 00 00 00 00 00 00 f0 3f"  # translation { y 1.0 }
        "2a 09 21 00 00 00 00 00 00 f0 3f"  # rotation { w 1.0 }
        "58 96 01"  # field 11, unknown: 150
    )
    found = foxglove.decode(Topic("/tf", "foxglove.FrameTransform", "protobuf"), binary)
    moved = Transform(10**15 + 1, "a", "b", (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    assert found == Transforms([moved])


def test_ranges_that_are_not_packed_and_negative_seconds() -> None:
    binary = field(1, "bytes", field(1, "int", -5))
    binary += field(6, "double", 1.5) + field(6, "packed", [2.5, 3.5]) + field(6, "double", 4.5)
    found = foxglove.decode(Topic("/s", "foxglove.LaserScan", "protobuf"), binary)
    assert isinstance(found, LaserScan)
    assert found.ranges.tolist() == [1.5, 2.5, 3.5, 4.5]
    assert found.stamp_ns == -5_000_000_000


def test_absent_transform_is_the_identity() -> None:
    found = foxglove.decode(Topic("/tf", "foxglove.FrameTransform", "protobuf"), b"")
    assert found == Transforms([Transform(0, "", "", (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))])


def test_pose_turns_a_scan_and_may_not_move_it() -> None:
    topic = Topic("/s", "foxglove.LaserScan", "json")
    turn = {"x": 0, "y": 0, "z": 0.5**0.5, "w": 0.5**0.5}
    values = {"pose": {"orientation": turn}, "start_angle": 0, "end_angle": 1, "ranges": [1, 2]}
    found = foxglove.decode(topic, json.dumps(values).encode())
    assert isinstance(found, LaserScan)
    assert isclose(found.angle_min, pi / 2)
    with pytest.raises(Undecodable, match="pose is not that of its frame"):
        foxglove.decode(topic, json.dumps(values | {"pose": JSON_POSE}).encode())


def test_cloud_turned_by_its_pose() -> None:
    """A quarter turn about z takes (1, 2, 3) to (-2, 1, 3)."""
    turn = {"x": 0, "y": 0, "z": 0.5**0.5, "w": 0.5**0.5}
    values = CASES["foxglove.PointCloud"][1] | {"pose": {"orientation": turn}}
    topic = Topic("/c", "foxglove.PointCloud", "json")
    found = foxglove.decode(topic, json.dumps(values).encode())
    assert isinstance(found, Cloud)
    np.testing.assert_allclose(found.points[0], [-2, 1, 3], atol=1e-6)


def test_odd_nanoseconds_are_carried_and_told() -> None:
    values = {"timestamp": {"sec": 1, "nsec": 1_500_000_000}}
    topic = Topic("/p", "foxglove.PoseInFrame", "json")
    found = foxglove.decode(topic, json.dumps(values).encode())
    assert isinstance(found, PoseMessage)
    assert found.stamp_ns == 2_500_000_000
    assert odd_stamp(found.stamp_ns) == "nanoseconds of a second or more, carried"


# Damage.


@pytest.mark.parametrize("name", foxglove.DECODERS)
def test_cuts_and_any_bytes_give_a_noun_or_undecodable(name: str) -> None:
    binary, values, _ = CASES[name]
    cuts = 0
    for size in range(len(binary)):
        try:
            foxglove.decode(Topic("/t", name, "protobuf"), binary[:size])
        except Undecodable:
            cuts += 1
    assert cuts > len(binary) / 2
    text = json.dumps(values).encode()
    for size in range(len(text)):
        with pytest.raises(Undecodable):
            foxglove.decode(Topic("/t", name, "json"), text[:size])


@given(st.sampled_from(sorted(foxglove.DECODERS)), st.integers(0, 300), st.binary(max_size=3))
@settings(max_examples=500, deadline=None)
def test_damaged_bytes_give_a_noun_or_undecodable(name: str, at: int, other: bytes) -> None:
    binary, values, _ = CASES[name]
    for encoding, payload in (("protobuf", binary), ("json", json.dumps(values).encode())):
        at %= len(payload)
        damaged = payload[:at] + other + payload[at + len(other) :]
        with suppress(Undecodable):
            foxglove.decode(Topic("/t", name, encoding), damaged)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=3) | st.integers(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@given(st.sampled_from(sorted(foxglove.DECODERS)), st.data())
@settings(max_examples=500, deadline=None)
def test_values_of_another_kind_give_a_noun_or_undecodable(name: str, data: st.DataObject) -> None:
    values = dict(CASES[name][1])
    values[data.draw(st.sampled_from(sorted(values)))] = data.draw(JSON)
    with suppress(Undecodable):
        foxglove.decode(Topic("/t", name, "json"), json.dumps(values).encode())


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"[" * 100_000, "not JSON"),
        (b"[1, 2]", "not of its schema"),
        (b'{"timestamp": {"sec": 1e300}}', "impossible time"),
        (b'{"timestamp": {"sec": ' + b"9" * 5000 + b"}}", "not JSON"),
        (b"", "not JSON"),
        (b"\xff\xfe", "not JSON"),
    ],
)
def test_hostile_json(payload: bytes, reason: str) -> None:
    with pytest.raises(Undecodable) as caught:
        foxglove.decode(Topic("/p", "foxglove.PoseInFrame", "json"), payload)
    assert caught.value.reason == reason


def test_impossible_lengths_in_protobuf() -> None:
    topic = Topic("/s", "foxglove.LaserScan", "protobuf")
    with pytest.raises(Undecodable, match="impossible number of bytes"):
        foxglove.decode(topic, number(6 << 3 | 2) + number(2**40) + b"1234")
    with pytest.raises(Undecodable, match="not protobuf"):
        foxglove.decode(topic, b"\xff" * 20)
    many = Topic("/tf", "foxglove.FrameTransforms", "protobuf")
    with pytest.raises(Undecodable, match="impossible number of transforms"):
        foxglove.decode(many, b"\x0a\x00" * 300_000)


def test_one_door_for_every_encoding() -> None:
    name, pose_type = "foxglove.PoseInFrame", "geometry_msgs/msg/PoseStamped"
    read = decoder_of(Topic("/p", name, "protobuf"))
    assert read is not None
    assert read(CASES[name][0]) == CASES[name][2]
    assert decoder_of(Topic("/p", pose_type, "json")) is not None
    for kind, encoding in ((pose_type, "protobuf"), (name, "cdr"), (name, "cbor")):
        assert decoder_of(Topic("/p", kind, encoding)) is None
    pose = struct.pack("<IIII", 0, 5, 6, 3) + b"map" + struct.pack("<7d", *range(7))
    ros1 = Topic("/p", pose_type, "ros1")
    read = decoder_of(ros1)
    assert read is not None
    assert read(pose) == ros.decode(ros1, pose)
