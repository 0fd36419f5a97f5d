"""Cut, lying and odd ROS payloads: FAULTS 24 to 27 and 46."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.log import Topic
from formats.messages import LaserScan
from formats.payload import Undecodable, odd_stamp
from formats.ros.decoders import DECODERS, decode, decoder
from tests.ros_messages import (
    ENCODINGS,
    HUMBLE,
    LASER,
    NOETIC,
    plain,
    scan_message,
    whole,
)


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
