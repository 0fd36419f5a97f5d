"""ROS payloads against rosbags' decoder, which is not ours."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from formats import messages
from formats.errors import Notes
from formats.log import Topic
from formats.messages import Cloud, LaserScan, PoseMessage, Transform, Transforms
from formats.opening import open_log
from formats.ros.decoders import DECODERS, Noun, decode, decoder
from formats.ros.recorded import translator
from tests.ros_messages import (
    ENCODINGS,
    HUMBLE,
    LASER,
    NOETIC,
    message,
    plain,
    scan_message,
)

# What a message of rosbags says, in our nouns: the slow, obvious way.

say: Any = messages


def stamp(header: Any) -> int:
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def numbers(position: Any, q: Any) -> tuple[float, ...]:
    return position.x, position.y, position.z, q.x, q.y, q.z, q.w


def head(m: Any) -> Any:
    return stamp(m.header), m.header.frame_id


def scan_start(m: Any) -> Any:
    return m.angle_min, m.angle_increment, m.time_increment, m.range_min, m.range_max


def one_transform(m: Any) -> Noun:
    place = numbers(m.transform.translation, m.transform.rotation)
    return say.Transform(*head(m), m.child_frame_id, place)


def posed(m: Any, pose: Any, child: str = "", covariance: Any = None) -> Noun:
    place = numbers(pose.position, pose.orientation)
    square = None if covariance is None else covariance.reshape(6, 6)
    return say.PoseMessage(*head(m), child, place, square)


def cloud2(m: Any) -> Noun:
    kinds = {7: "f", 8: "d", 4: "H"}
    order = ">" if m.is_bigendian else "<"
    found = []
    for row in range(m.height):
        for column in range(m.width):
            at = row * m.row_step + column * m.point_step
            named = {
                f.name: struct.unpack_from(order + kinds[f.datatype], m.data, at + f.offset)[0]
                for f in m.fields
            }
            found.append([named[axis] for axis in "xyz"])
    return say.Cloud(*head(m), np.array(found).reshape(-1, 3))


def info(m: Any) -> Noun:
    d, k = (m.D, m.K) if hasattr(m, "D") else (m.d, m.k)
    roi = m.roi.x_offset, m.roi.y_offset, m.roi.width, m.roi.height
    size = m.height, m.width
    thin = m.binning_x, m.binning_y
    return say.CameraInfo(*head(m), *size, m.distortion_model, d, k.reshape(3, 3), thin, roi)


def grid(m: Any) -> Noun:
    place = numbers(m.info.origin.position, m.info.origin.orientation)
    cells = m.data.reshape(m.info.height, m.info.width)
    return say.OccupancyGrid(*head(m), m.info.resolution, place, cells)


EXPECTED: dict[str, Callable[[Any], Noun]] = {
    LASER: lambda m: say.LaserScan(*(*head(m), *scan_start(m), m.ranges)),
    "sensor_msgs/msg/MultiEchoLaserScan": lambda m: say.MultiEchoLaserScan(
        *head(m),
        *scan_start(m),
        [e.echoes for e in m.ranges],
        [e.echoes for e in m.intensities],
    ),
    "sensor_msgs/msg/Range": lambda m: say.RangeReading(
        *head(m), m.field_of_view, m.min_range, m.max_range, m.range
    ),
    "tf2_msgs/msg/TFMessage": lambda m: say.Transforms([one_transform(t) for t in m.transforms]),
    "tf/msg/tfMessage": lambda m: say.Transforms([one_transform(t) for t in m.transforms]),
    "geometry_msgs/msg/TransformStamped": lambda m: say.Transforms([one_transform(m)]),
    "geometry_msgs/msg/PoseStamped": lambda m: posed(m, m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: posed(
        m, m.pose.pose, covariance=m.pose.covariance
    ),
    "nav_msgs/msg/Odometry": lambda m: posed(
        m, m.pose.pose, m.child_frame_id, covariance=m.pose.covariance
    ),
    "nav_msgs/msg/OccupancyGrid": grid,
    "sensor_msgs/msg/Image": lambda m: say.Image(
        *head(m), m.height, m.width, m.encoding, bool(m.is_bigendian), m.step, m.data
    ),
    "sensor_msgs/msg/CompressedImage": lambda m: say.CompressedImage(*head(m), m.format, m.data),
    "sensor_msgs/msg/CameraInfo": info,
    "sensor_msgs/msg/PointCloud2": cloud2,
    "sensor_msgs/msg/PointCloud": lambda m: say.Cloud(
        *head(m), np.array([(p.x, p.y, p.z) for p in m.points]).reshape(-1, 3)
    ),
}


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", DECODERS)
@given(data=st.data())
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
def test_equal_to_rosbags(name: str, encoding: str, data: st.DataObject) -> None:
    kind, store, write = ENCODINGS[encoding]
    m = data.draw(message(store, name))
    payload = write(m, name)
    read = store.deserialize_ros1 if kind == "ros1" else store.deserialize_cdr
    found = decode(Topic("/t", name, kind), memoryview(payload))
    assert plain(found) == plain(EXPECTED[name](read(payload, name)))
    assert all(a.dtype.isnative for a in found if isinstance(a, np.ndarray))


def test_every_decoder_has_an_expectation() -> None:
    assert set(DECODERS) == set(EXPECTED)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("length", [*range(10), 254, 255, 256, 257, 70_000])
@pytest.mark.parametrize("bright", [0, 3, 5])
def test_every_alignment_of_a_scan(encoding: str, length: int, bright: int) -> None:
    kind, store, write = ENCODINGS[encoding]
    m = scan_message(store, "f" * length, bright=bright)
    found = decode(Topic("/scan", LASER, kind), write(m, LASER))
    assert plain(found) == plain(EXPECTED[LASER](m))


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("parent", range(9))
@pytest.mark.parametrize("child", range(9))
def test_every_alignment_of_transforms(encoding: str, parent: int, child: int) -> None:
    kind, store, write = ENCODINGS[encoding]
    t = store.types
    many = []
    for i in range(3):
        header = scan_message(store, "p" * ((parent + i) % 9)).header
        way = t["geometry_msgs/msg/Vector3"](1.0 + i, 2.0, 3.0)
        turn = t["geometry_msgs/msg/Quaternion"](0.1, 0.2, 0.3, 0.4)
        both = t["geometry_msgs/msg/Transform"](way, turn)
        many.append(t["geometry_msgs/msg/TransformStamped"](header, "c" * child, both))
    name = "tf2_msgs/msg/TFMessage"
    m = t[name](many)
    assert plain(decode(Topic("/tf", name, kind), write(m, name))) == plain(EXPECTED[name](m))


def test_arrays_are_views_on_the_payload_but_ranges_are_kept() -> None:
    name = "sensor_msgs/msg/Image"
    image = HUMBLE.types[name](scan_message().header, 1, 4, "mono8", 0, 4, np.arange(4, dtype="u1"))
    payload = bytearray(HUMBLE.serialize_cdr(image, name))
    found = decode(Topic("/image", name, "cdr"), memoryview(payload))
    assert isinstance(found, messages.Image)
    payload[-4:] = b"\7\7\7\7"
    assert found.data.tolist() == [7] * 4
    read = decoder(Topic("/scan", LASER, "cdr"))
    payload = bytearray(HUMBLE.serialize_cdr(scan_message(), LASER))
    for _ in range(2):  # once by the cursor, once by its layout
        found = read(memoryview(payload))
        assert isinstance(found, LaserScan)
        before = found.ranges.tolist()
        payload[-4 - 4 * 5 : -4] = np.full(5, 9.0, dtype="<f4").tobytes()
        assert found.ranges.tolist() == before
    assert before == [9.0] * 5


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("datatype", [7, 8, 4])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_cloud_with_padded_rows_and_any_order_of_fields(
    encoding: str, datatype: int, big: bool
) -> None:
    kind, store, write = ENCODINGS[encoding]
    t = store.types
    size = {7: 4, 8: 8, 4: 2}[datatype]
    made = t["sensor_msgs/msg/PointField"]
    fields = [
        made("z", 1, datatype, 1),
        made("x", 1 + size, datatype, 1),
        made("y", 2 + 2 * size, datatype, 1),
    ]
    step, rows, columns = 3 * size + 5, 3, 4
    row_step = columns * step + 7
    content = np.random.default_rng(1).integers(0, 255, rows * row_step, dtype=np.uint8)
    name = "sensor_msgs/msg/PointCloud2"
    header = scan_message(store).header
    m = t[name](header, rows, columns, fields, big, step, row_step, content, True)
    found = decode(Topic("/c", name, kind), write(m, name))
    assert isinstance(found, Cloud)
    assert found.points.shape == (12, 3)
    assert plain(found) == plain(EXPECTED[name](m))


@pytest.mark.parametrize("first", [0, 4])
@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_cloud_of_floats_in_a_row(encoding: str, rows: int, first: int) -> None:
    """As lidars write them: x, y, z and more, rows without padding, at any place in the bytes."""
    kind, store, write = ENCODINGS[encoding]
    t, name = store.types, "sensor_msgs/msg/PointCloud2"
    made = t["sensor_msgs/msg/PointField"]
    fields = [made(axis, first + 4 * i, 7, 1) for i, axis in enumerate("xyz")]
    content = np.random.default_rng(1).integers(0, 255, rows * 5 * 20, dtype=np.uint8)
    m = t[name](scan_message(store).header, rows, 5, fields, False, 20, 100, content, True)
    payload = write(m, name)
    found = decode(Topic("/c", name, kind), payload)
    moved = decode(Topic("/c", name, kind), memoryview(b"." + payload)[1:])
    assert isinstance(found, Cloud)
    assert plain(found) == plain(moved) == plain(EXPECTED[name](m))


def test_plain_cdr2_aligns_to_four_bytes_and_sizes_sequences_of_structures() -> None:
    """OMG DDS-XTypes 1.3, 7.4.3.5: by hand, since rosbags refuses it."""

    def text(raw: bytes) -> bytes:
        return struct.pack("<I", len(raw) + 1) + raw + bytes(1 + -(len(raw) + 1) % 4)

    one = struct.pack("<iI", 5, 6) + text(b"odom") + text(b"base") + struct.pack("<7d", *range(7))
    payload = b"\0\7\0\0" + struct.pack("<II", 4 + len(one), 1) + one
    found = decode(Topic("/tf", "tf2_msgs/msg/TFMessage", "cdr"), payload)
    numbers = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert found == Transforms([Transform(5_000_000_006, "odom", "base", numbers)])

    pose = struct.pack("<iI", 5, 6) + text(b"map") + struct.pack("<7d", *range(7))
    found = decode(Topic("/p", "geometry_msgs/msg/PoseStamped", "cdr"), b"\0\7\0\0" + pose)
    assert found == PoseMessage(5_000_000_006, "map", "", numbers)


@pytest.mark.slow
def test_real_logs_equal_rosbags(shared_data: Path) -> None:
    """Up to 40 messages of every topic of every real log; none has a definition of its own."""
    seen: Counter[str] = Counter()
    for path in sorted(p for p in shared_data.rglob("*") if p.suffix in (".bag", ".mcap", ".db3")):
        if "conformance" in str(path):
            continue
        log = open_log(path, Notes())
        topics = [t for t in log.topics() if t.type in DECODERS and t.encoding in ("ros1", "cdr")]
        assert [t.name for t in topics if translator(t) is not None] == []
        counts: Counter[str] = Counter()
        for topic, _, data in log.messages(topics):
            counts[topic.name] += 1
            if counts[topic.name] > 40:
                continue
            store = NOETIC if topic.encoding == "ros1" else HUMBLE
            read = store.deserialize_ros1 if store is NOETIC else store.deserialize_cdr
            expected = EXPECTED[topic.type](read(data, topic.type))
            assert plain(decode(topic, data)) == plain(expected), (path, topic.name)
            seen[topic.type] += 1
        log.close()
    assert len(seen) >= 9
