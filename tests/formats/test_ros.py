"""ROS payloads against rosbags' decoder, which is not ours, and against damage."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from formats import messages
from formats.log import Topic
from formats.messages import Cloud, LaserScan, PoseMessage, Transform, Transforms
from formats.ros import CDR, DECODERS, Noun, Undecodable, decode, decoder, laser_scan, odd_stamp

TFS = "geometry_msgs/TransformStamped[] transforms"
HUMBLE, NOETIC = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
HUMBLE.register(get_types_from_msg(TFS, "tf/msg/tfMessage"))
NOETIC.register(get_types_from_msg(TFS, "tf2_msgs/msg/TFMessage"))
NOETIC.register(get_types_from_msg(TFS, "tf/msg/tfMessage"))

ENCODINGS: dict[str, tuple[str, Any, Callable[[Any, str], bytes]]] = {
    "ros1": ("ros1", NOETIC, lambda m, t: bytes(NOETIC.serialize_ros1(m, t))),
    "cdr little": ("cdr", HUMBLE, lambda m, t: bytes(HUMBLE.serialize_cdr(m, t))),
    "cdr big": (
        "cdr",
        HUMBLE,
        lambda m, t: bytes(HUMBLE.serialize_cdr(m, t, little_endian=False)),
    ),
}
LASER = "sensor_msgs/msg/LaserScan"


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


def plain(value: Any) -> Any:
    """A noun as nested lists whose equality is exact, nan equal to nan."""
    if isinstance(value, np.ndarray):
        return [value.shape, [plain(v) for v in value.ravel().tolist()]]
    if isinstance(value, tuple | list):
        return [type(value).__name__ if hasattr(value, "_fields") else "", *map(plain, value)]
    if isinstance(value, float):
        return "nan" if value != value else value
    return value


# Messages of any type, drawn from its own fields.

TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)
DTYPES = {"byte": "uint8", "char": "uint8", "bool": "bool"}


def base(kind: str) -> st.SearchStrategy[Any]:
    if kind == "string":
        return TEXT
    if kind == "bool":
        return st.booleans()
    if kind.startswith("float"):
        return st.floats(width=32 if kind == "float32" else 64)
    limits = np.iinfo(DTYPES.get(kind, kind))
    return st.integers(int(limits.min), int(limits.max))


def field(store: Any, desc: Any) -> st.SearchStrategy[Any]:
    kind, inner = desc
    if kind == Nodetype.BASE:
        return base(inner[0])
    if kind == Nodetype.NAME:
        return message(store, inner)
    item, length = inner
    sizes = {"min_size": length, "max_size": length} if kind == Nodetype.ARRAY else {"max_size": 4}
    many = st.lists(field(store, item), **sizes)
    if item[0] == Nodetype.BASE:
        dtype = DTYPES.get(item[1][0], item[1][0])
        return many.map(lambda values: np.array(values, dtype=dtype))
    return many


def message(store: Any, name: str) -> st.SearchStrategy[Any]:
    made = store.types[name]
    if name == "builtin_interfaces/msg/Time":
        return st.builds(made, st.integers(0, 2**31 - 1), st.integers(0, 2**32 - 1))
    fields = store.fielddefs[name][1]
    return st.builds(made, *(field(store, desc) for _, desc in fields)).map(consistent)


def consistent(m: Any) -> Any:
    """Sizes that agree with the data, where a type has both."""
    if m.__msgtype__ == "sensor_msgs/msg/Image":
        m.height, m.step = len(m.data) and 1, len(m.data)
    elif m.__msgtype__ == "nav_msgs/msg/OccupancyGrid":
        m.info.width, m.info.height = len(m.data), 1
    elif m.__msgtype__ == "sensor_msgs/msg/PointCloud2":
        m.height = m.width = 0
    return m


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


def scan_message(store: Any = HUMBLE, frame: str = "laser", beams: int = 5, bright: int = 0) -> Any:
    t = store.types
    seq = [7] if store is NOETIC else []
    header = t["std_msgs/msg/Header"](*seq, t["builtin_interfaces/msg/Time"](12, 34), frame)
    ranges = np.arange(beams, dtype=np.float32) / 3
    floats = (-1.5, 1.5, 0.25, 0.5, 0.75, 0.125, 30.0)
    return t[LASER](header, *floats, ranges, np.ones(bright, dtype=np.float32))


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


def test_arrays_are_views_on_the_payload() -> None:
    payload = bytearray(HUMBLE.serialize_cdr(scan_message(), LASER))
    found = decode(Topic("/scan", LASER, "cdr"), memoryview(payload))
    assert isinstance(found, LaserScan)
    payload[-4 - 4 * 5 : -4] = np.full(5, 9.0, dtype="<f4").tobytes()
    assert found.ranges.tolist() == [9.0] * 5


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


# Damage: FAULTS 24 to 27 and 46.


def whole(name: str, encoding: str) -> bytes:
    """A message with something in every field."""
    _, store, write = ENCODINGS[encoding]

    def filled(kind: Any, inner: Any) -> Any:
        if kind == Nodetype.NAME:
            made = store.types[inner]
            return consistent(made(*(filled(*desc) for _, desc in store.fielddefs[inner][1])))
        if kind == Nodetype.BASE:
            return "text" if inner[0] == "string" else 1
        item, length = inner
        many = [filled(*item) for _ in range(length or 2)]
        return np.array(many, dtype=DTYPES.get(item[1][0], item[1][0])) if item[0] == 1 else many

    return write(filled(Nodetype.NAME, name), name)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", DECODERS)
def test_every_cut_is_undecodable(name: str, encoding: str) -> None:
    topic, payload = Topic("/t", name, ENCODINGS[encoding][0]), whole(name, encoding)
    decode(topic, payload)
    for size in range(len(payload)):
        with pytest.raises(Undecodable, match=r"cut short|empty payload"):
            decode(topic, payload[:size])


@pytest.mark.parametrize("name", DECODERS)
def test_padding_of_three_bytes_is_fine_and_eight_are_not(name: str) -> None:
    for encoding in ("cdr little", "cdr big"):
        topic, payload = Topic("/t", name, "cdr"), whole(name, encoding)
        for extra in range(4):
            assert plain(decode(topic, payload + bytes(extra))) == plain(decode(topic, payload))
        with pytest.raises(Undecodable, match="longer than its type"):
            decode(topic, payload + bytes(8))
    topic = Topic("/t", name, "ros1")
    with pytest.raises(Undecodable, match="longer than its type"):
        decode(topic, whole(name, "ros1") + bytes(8))


@pytest.mark.parametrize("count", [2**31, 2**32 - 1])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_impossible_number_of_ranges(encoding: str, count: int) -> None:
    kind, store, write = ENCODINGS[encoding]
    payload = bytearray(write(scan_message(store), LASER))
    at = len(payload) - 4 - 5 * 4 - 4
    struct.pack_into(">I" if encoding == "cdr big" else "<I", payload, at, count)
    with pytest.raises(Undecodable) as caught:
        decode(Topic("/scan", LASER, kind), bytes(payload))
    assert caught.value.reason == "impossible number of ranges"


def test_number_of_ranges_just_too_large_says_how_much_is_there() -> None:
    payload = bytearray(HUMBLE.serialize_cdr(scan_message(), LASER))
    struct.pack_into("<I", payload, len(payload) - 28, 1000)
    with pytest.raises(Undecodable, match=r"^cut short \(after 80 of 4056 bytes\)$") as caught:
        decode(Topic("/scan", LASER, "cdr"), bytes(payload))
    assert caught.value.reason == "cut short"


def test_absurd_number_of_structures_is_refused_before_they_are_made() -> None:
    payload = bytes(4) + struct.pack(">I", 2**20) + bytes(2**22)
    with pytest.raises(Undecodable, match="impossible number of transforms"):
        decode(Topic("/tf", "tf2_msgs/msg/TFMessage", "cdr"), payload)


@pytest.mark.parametrize(
    ("first", "reason"),
    [
        (b"\x00\x09", "unknown encapsulation 0x0009 (XCDR2)"),
        (b"\x00\x03", "unknown encapsulation 0x0003 (PL_CDR)"),
        (b"\x00\xff", "unknown encapsulation 0x00ff"),
        (b"\x01\x01", "unknown encapsulation 0x0101"),
    ],
)
def test_unknown_encapsulation(first: bytes, reason: str) -> None:
    payload = first + bytes(HUMBLE.serialize_cdr(scan_message(), LASER))[2:]
    with pytest.raises(Undecodable) as caught:
        decode(Topic("/scan", LASER, "cdr"), payload)
    assert caught.value.reason == reason


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


@pytest.mark.parametrize(
    ("sec", "nanosec", "expected", "odd"),
    [
        (1, 1_500_000_000, 2_500_000_000, "nanoseconds of a second or more, carried"),
        (-1, 5, -999_999_995, "stamp before 1970"),
        (2**31 - 1, 999_999_999, 2_147_483_647_999_999_999, ""),
        (0, 0, 0, ""),
    ],
)
def test_odd_stamps(sec: int, nanosec: int, expected: int, odd: str) -> None:
    m = scan_message()
    m.header.stamp.sec, m.header.stamp.nanosec = sec, nanosec
    for little in (True, False):
        payload = bytes(HUMBLE.serialize_cdr(m, LASER, little_endian=little))
        found = decode(Topic("/scan", LASER, "cdr"), payload)
        assert isinstance(found, LaserScan)
        assert (found.stamp_ns, odd_stamp(found.stamp_ns)) == (expected, odd)


def test_ros1_time_goes_on_after_2038() -> None:
    payload = bytearray(NOETIC.serialize_ros1(scan_message(NOETIC), LASER))
    struct.pack_into("<I", payload, 4, 2**31 + 1)
    found = decode(Topic("/scan", LASER, "ros1"), bytes(payload))
    assert isinstance(found, LaserScan)
    assert found.stamp_ns == (2**31 + 1) * 10**9 + 34
    assert odd_stamp(found.stamp_ns) == ""


@given(st.binary(max_size=300), st.sampled_from(sorted(DECODERS)), st.sampled_from([0, 1, 7]))
@settings(max_examples=500, deadline=None)
def test_any_bytes_give_a_noun_or_undecodable(raw: bytes, name: str, kind: int) -> None:
    for topic, payload in (
        (Topic("/t", name, "ros1"), raw),
        (Topic("/t", name, "cdr"), bytes([0, kind, 0, 0]) + raw),
    ):
        try:
            decode(topic, payload)
        except Undecodable:
            continue


@given(st.integers(0, 10_000), st.integers(0, 255), st.sampled_from(sorted(DECODERS)))
@settings(max_examples=500, deadline=None)
def test_damaged_bytes_give_a_noun_or_undecodable(at: int, value: int, name: str) -> None:
    for encoding, (kind, _, _) in ENCODINGS.items():
        payload = bytearray(whole(name, encoding))
        payload[at % len(payload)] = value
        try:
            decode(Topic("/t", name, kind), bytes(payload))
        except Undecodable:
            continue


def test_bad_utf8_frames_stay_apart() -> None:
    names = set()
    for byte in (b"\xff", b"\xfe"):
        payload = bytes(HUMBLE.serialize_cdr(scan_message(frame="laseR"), LASER))
        found = decode(Topic("/scan", LASER, "cdr"), payload.replace(b"R", byte))
        assert isinstance(found, LaserScan)
        names.add(found.frame)
    assert names == {r"lase\xff", r"lase\xfe"}


def test_unknown_encoding_costs_the_topic() -> None:
    with pytest.raises(Undecodable, match="unknown encoding cbor"):
        decoder(Topic("/scan", LASER, "cbor"))(b"")


def test_the_usual_scan_takes_the_fast_path(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("cursor used")

    monkeypatch.setattr("formats.ros.unusual_laser_scan", refuse)
    for bright in (0, 5):
        payload = bytes(HUMBLE.serialize_cdr(scan_message(bright=bright), LASER))
        assert len(laser_scan(CDR[1], payload).ranges) == 5
