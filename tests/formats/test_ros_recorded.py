"""Definitions that are not the standard ones: vendors' messages, IDL, and hostile text."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from formats.log import Topic
from formats.messages import LaserScan, RangeReading
from formats.payload import Undecodable
from formats.ros.decoders import DECODERS, decode
from formats.ros.idl import idl_fields
from formats.ros.recorded import translator
from formats.ros.standard import STANDARD
from formats.ros.wire import Body

LASER = "sensor_msgs/msg/LaserScan"
RULE = "=" * 80 + "\n"
HEADER = RULE + "MSG: std_msgs/Header\n{seq}{time} stamp\nstring frame_id\n"
VENDOR = (
    """# changed by a vendor
uint8 QUALITY_GOOD=1
std_msgs/Header header
float64[] ranges   # double precision
uint8 quality
string serial "none"
float32 range_max
float32 range_min
float64 angle_increment
float32 angle_min
Extra[2] extras
"""
    + RULE
    + "MSG: sensor_msgs/Extra\nstring name\nint16[] values\n"
)
SEVEN = (-1.5, 0.25, 0.0, 0.125, 30.0)  # angle_min, increment, time_increment, range limits


def vendor_topic(ros1: bool) -> tuple[Topic, bytes]:
    """A vendor's LaserScan, written by rosbags."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    empty = get_typestore(Stores.EMPTY)
    seq, stamp = ("uint32 seq\n", "time") if ros1 else ("", "builtin_interfaces/Time")
    text = VENDOR + HEADER.format(seq=seq, time=stamp)
    clock = {k: store.fielddefs[k] for k in ("builtin_interfaces/msg/Time",)}
    empty.register({**get_types_from_msg(text, LASER), **clock})
    t = empty.types
    now = t["builtin_interfaces/msg/Time"](3, 4)
    header = t["std_msgs/msg/Header"](*([9] if ros1 else []), now, "laser")
    extras = [t["sensor_msgs/msg/Extra"](n, np.arange(3, dtype=np.int16)) for n in ("a", "bcd")]
    ranges = np.array([1.0, 2.5, np.inf, np.nan])
    m = t[LASER](header, ranges, 1, "serial 7", 30.0, 0.125, 0.25, -1.5, extras)
    topic = Topic("/scan", LASER, "ros1" if ros1 else "cdr", text.encode(), "ros1msg")
    return topic, bytes((empty.serialize_ros1 if ros1 else empty.serialize_cdr)(m, LASER))


@pytest.mark.parametrize("ros1", [True, False])
def test_vendor_s_scan_is_read_by_the_names_of_its_fields(ros1: bool) -> None:
    found = decode(*vendor_topic(ros1))
    assert isinstance(found, LaserScan)
    assert found[:-1] == (3_000_000_004, "laser", *SEVEN)
    np.testing.assert_array_equal(found.ranges, np.array([1, 2.5, np.inf, np.nan], np.float32))


@pytest.mark.parametrize("ros1", [True, False])
def test_vendor_s_scan_cut_anywhere(ros1: bool) -> None:
    topic, payload = vendor_topic(ros1)
    for size in range(len(payload)):
        with pytest.raises(Undecodable, match=r"cut short|empty payload"):
            decode(topic, payload[:size])
    with pytest.raises(Undecodable, match="longer than its type"):
        decode(topic, payload + bytes(8))


STORES = [store for store in Stores if store != Stores.EMPTY]


@pytest.mark.parametrize("store", STORES, ids=lambda store: store.name)
def test_every_distribution_s_definitions_are_the_standard_ones(store: Stores) -> None:
    ros1 = store == Stores.ROS1_NOETIC
    types = get_typestore(store)
    seen = 0
    for name in DECODERS.keys() & types.fielddefs.keys():
        text, _ = types.generate_msgdef(name, ros_version=1 if ros1 else 2)
        topic = Topic("/t", name, "ros1" if ros1 else "cdr", text.encode(), "ros2msg")
        assert translator(topic) is None, name
        seen += 1
    assert seen >= 13


def test_standard_table_equals_rosbags_types() -> None:
    """Fields and their order as in Humble, for every type in the table."""
    types = get_typestore(Stores.ROS2_HUMBLE)

    def text(desc: Any) -> str:
        kind, inner = desc
        if kind == Nodetype.BASE:
            return str(inner[0])
        if kind == Nodetype.NAME:
            return str(inner).rpartition("/")[2]
        return text(inner[0]) + (f"[{inner[1]}]" if kind == Nodetype.ARRAY else "[]")

    for name, fields in STANDARD.items():
        full = name.replace("/", "/msg/") if name != "tf/tfMessage" else "tf2_msgs/msg/TFMessage"
        expected = [(text(desc), field) for field, desc in types.fielddefs[full][1]]
        assert [(kind.rpartition("/")[2], field) for kind, field in fields] == expected


def test_variance_of_newer_ranges() -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    t, name = types.types, "sensor_msgs/msg/Range"
    header = t["std_msgs/msg/Header"](t["builtin_interfaces/msg/Time"](1, 2), "sonar")
    payload = bytes(types.serialize_cdr(t[name](header, 0, 0.5, 0.25, 4.0, 1.5, 0.125), name))
    reading = RangeReading(1_000_000_002, "sonar", 0.5, 0.25, 4.0, 1.5)
    assert decode(Topic("/r", name, "cdr"), payload) == reading


def test_definition_without_a_needed_field_costs_the_topic() -> None:
    topic = Topic("/scan", LASER, "cdr", b"float32 angle_min\n", "ros2msg")
    with pytest.raises(Undecodable, match=r"lacks a field \(header of sensor_msgs/LaserScan\)"):
        decode(topic, b"\0\1\0\0" + bytes(4))


def test_field_of_another_kind() -> None:
    text = VENDOR.replace("float32 range_max", "string range_max").split(RULE)[0]
    text = text.replace("Extra[2] extras\n", "").replace("std_msgs/Header header\n", "Header h\n")
    text += "Header header\n"
    topic = Topic("/scan", LASER, "ros1", text.encode(), "ros1msg")
    with pytest.raises(Undecodable, match="another kind"):
        decode(topic, bytes(16 + 4 + 1 + 4 + 4 + 4 + 8 + 4 + 16))


IDL = """
================================================================================
IDL: sensor_msgs/msg/LaserScan
// generated from rosidl_adapter/resource/msg.idl.em
#include "std_msgs/msg/Header.idl"
module sensor_msgs {
  module msg {
    typedef double double__3[3];
    module LaserScan_Constants {
      const uint8 A = 1;
      @verbatim (language="comment", text="a } struct ; in \\"text\\", see http://x.org")
      const string B = "struct X { long y; };";
    };
    @verbatim (language="comment", text=
      "Single scan from a planar laser range-finder" "\\n"
      "see https://www.ros.org/reps/rep-0117.html (REP 117)")
    struct LaserScan {
      std_msgs::msg::Header header;
      @unit (value="rad")
      float angle_min; float angle_max; float angle_increment;
      @default (value=0.0)
      float time_increment;
      float scan_time; float range_min; float range_max;
      sequence<float> ranges;
      sequence<float> intensities;
    };
  };
};
================================================================================
IDL: std_msgs/msg/Header
module std_msgs { module msg { struct Header {
  builtin_interfaces::msg::Time stamp; /* when */ string frame_id; }; }; };
================================================================================
IDL: builtin_interfaces/msg/Time
module builtin_interfaces { module msg {
  struct Time { int32 sec; uint32 nanosec; }; }; };
"""


def test_idl_of_the_standard_scan() -> None:
    topic = Topic("/scan", LASER, "cdr", IDL.encode(), "ros2idl")
    assert translator(topic) is None
    found = idl_fields(IDL)
    assert found["std_msgs/Header"] == [
        ("builtin_interfaces/Time", "stamp"),
        ("string", "frame_id"),
    ]
    assert [name for _, name in found["sensor_msgs/LaserScan"]][-1] == "intensities"
    assert set(found) == {"sensor_msgs/LaserScan", "std_msgs/Header", "builtin_interfaces/Time"}


def test_idl_fields_as_rosbags_reads_them() -> None:
    text = """module a { module msg { typedef double double__3[3]; struct B {
        unsigned long long u; long long l; unsigned short s; boolean b; octet o; char c; double d;
        double__3 fixed; sequence<octet, 5> few; sequence<a::msg::C> many; string<8> name; };
        struct C { string t; long n; }; }; };"""
    expected = {
        "a/B": "uint64 int64 uint16 bool uint8 char float64 float64[3] uint8[] a/C[] string",
        "a/C": "string int32",
    }
    found = idl_fields(text)
    assert {
        name: " ".join(kind for kind, _ in fields) for name, fields in found.items()
    } == expected
    theirs = get_types_from_idl(text)
    assert [n for _, n in found["a/B"]] == [n for n, _ in theirs["a/msg/B"][1]]


def test_idl_of_a_vendor() -> None:
    changed = IDL.replace("float scan_time;", "long long scan_number;")
    types = get_typestore(Stores.ROS2_HUMBLE)
    text, _ = types.generate_msgdef(LASER, ros_version=2)
    empty = get_typestore(Stores.EMPTY)
    empty.register(get_types_from_msg(text.replace("float32 scan_time", "int64 n"), LASER))
    t = empty.types
    header = t["std_msgs/msg/Header"](t["builtin_interfaces/msg/Time"](3, 4), "laser")
    ranges = np.array([1.0, 2.0], dtype=np.float32)
    m = t[LASER](header, -1.5, 0.0, 0.25, 0.0, 77, 0.125, 30.0, ranges, ranges)
    topic = Topic("/scan", LASER, "cdr", changed.encode(), "ros2idl")
    found = decode(topic, bytes(empty.serialize_cdr(m, LASER)))
    assert isinstance(found, LaserScan)
    assert found[:-1] == (3_000_000_004, "laser", *SEVEN)
    assert found.ranges.tolist() == [1.0, 2.0]


# Hostile definitions: FAULTS 39 and 40.

DEEP = "".join(f"{RULE}MSG: sensor_msgs/T{i}\nT{i + 1} x\n" for i in range(3000))
HOSTILE = {
    "recursive": "LaserScan header\n",
    "3000 deep": "T0 header\n" + DEEP,
    "giant array": "float64[999999999] header\n",
    "giant array of structures": "Empty[999999999] header\n" + RULE + "MSG: sensor_msgs/Empty\n",
    "giant sequence of nothing": "Empty[] header\n" + RULE + "MSG: sensor_msgs/Empty\n",
    "doubling": "D0 a\n"
    + "".join(f"{RULE}MSG: sensor_msgs/D{i}\nD{i + 1} a\nD{i + 1} b\n" for i in range(15))
    + f"{RULE}MSG: sensor_msgs/D15\n",
    "code": "float32 x'+__import__('os').system('touch /tmp/owned')+'\n",
    "code as type": "__import__('os') x\n",
    "wide text": "wstring x\n",
    "megabytes": "float32 a\n" * 200_000,
    "one line": "float32 " + "a" * 200_000,
    "binary": "\x00\xff\x01" * 1000,
    "brackets": "float32" + "[" * 100_000 + " x\n",
    "quotes in IDL": '"\\"' * 80_000,
    "comments in IDL": "/*" * 80_000,
    "parentheses in IDL": "module a { const long X = " + "(" * 80_000,
    "annotations in IDL": "@a" * 80_000,
    "sequences in IDL": "module a { struct B {" + "sequence<" * 20_000,
}


@pytest.mark.parametrize("form", ["ros1msg", "ros2msg", "ros2idl"])
@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_definition_costs_its_topic_only(what: str, form: str) -> None:
    topic = Topic("/scan", LASER, "cdr", HOSTILE[what].encode(), form)
    payload = b"\0\1\0\0" + b"\xff\xff\x03\0" + bytes(4_000_000)
    start = time.process_time()
    if form == "ros2idl":  # text without a structure says nothing about the type
        translator(topic) if len(topic.definition) < 2**18 else None
    else:
        with pytest.raises(Undecodable):
            decode(topic, payload)
    assert time.process_time() - start < 2.0


@given(st.text(max_size=200), st.sampled_from(["ros2msg", "ros2idl"]), st.binary(max_size=100))
@settings(max_examples=300, deadline=None)
def test_any_definition_gives_a_noun_or_undecodable(text: str, form: str, raw: bytes) -> None:
    with suppress(Undecodable):
        decode(Topic("/scan", LASER, "cdr", text.encode(), form), b"\0\1\0\0" + raw)


WORDS = "module struct typedef const sequence < > { } [ ] ( ) ; , @ a b 3 string double :: long"


@given(st.lists(st.sampled_from([*WORDS.split(), '"', "\n", "=====", "//", "/*", "*/"])))
@settings(max_examples=300, deadline=None)
@example(["typedef", "[", "]"])
def test_any_idl_is_read_without_an_error(words: list[str]) -> None:
    for fields in idl_fields(" ".join(words)).values():
        assert all(isinstance(kind, str) and isinstance(name, str) for kind, name in fields)


def test_reading_by_recorded_fields_is_not_the_usual_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """A standard definition, as every log of ours has, keeps the fast path."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    text, _ = types.generate_msgdef(LASER, ros_version=2)
    t = types.types
    header = t["std_msgs/msg/Header"](t["builtin_interfaces/msg/Time"](3, 4), "laser")
    none = np.zeros(0, dtype=np.float32)
    m = t[LASER](header, *(0.0,) * 7, np.ones(3, dtype=np.float32), none)
    payload = bytes(types.serialize_cdr(m, LASER))
    topic = Topic("/scan", LASER, "cdr", text.encode(), "ros2msg")
    decode(topic, payload)

    def refuse(*_: object) -> None:
        raise AssertionError("cursor used")

    monkeypatch.setattr(Body, "__init__", refuse)
    found = decode(topic, payload)
    assert isinstance(found, LaserScan)
    assert found.ranges.tolist() == [1.0] * 3
