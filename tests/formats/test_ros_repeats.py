"""Payloads whose layout is known from earlier ones, against decoders that know of none."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from formats.log import Topic
from formats.messages import LaserScan
from formats.payload import Payload, Undecodable
from formats.ros.decoders import DECODERS, decoder
from formats.ros.repeats import LEARNERS, MOST
from formats.ros.wire import Body
from tests.ros_messages import ENCODINGS, LASER, message, plain, scan_message, whole


def outcome(read: Any, data: Payload) -> Any:
    try:
        noun = read(data)
        stamps = [part.stamp_ns for part in getattr(noun, "transforms", [noun])]
        return plain(noun), [type(stamp) for stamp in stamps]
    except Undecodable as error:
        return str(error)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("name", LEARNERS)
@given(data=st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_what_came_before_changes_nothing(name: str, encoding: str, data: st.DataObject) -> None:
    """Any bytes of a message changed: stamps, numbers, names, counts, the encapsulation."""
    kind, store, write = ENCODINGS[encoding]
    first = bytes(write(data.draw(message(store, name)), name))
    topic = Topic("/t", name, kind)
    read = decoder(topic)
    read(first)
    places = st.integers(0, len(first) - 1)
    for _ in range(8):
        changed = bytearray(first)
        for at in data.draw(st.lists(places, min_size=1, max_size=3)):
            changed[at] = data.draw(st.integers(0, 255))
        assert outcome(read, bytes(changed)) == outcome(decoder(topic), bytes(changed))


@pytest.mark.parametrize("encoding", ["ros1", "cdr little"])
@pytest.mark.parametrize("name", LEARNERS)
def test_the_second_of_two_alike_is_read_by_its_layout(
    name: str, encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    topic, payload = Topic("/t", name, ENCODINGS[encoding][0]), whole(name, encoding)
    expected = plain(decoder(topic)(payload))
    read = decoder(topic)
    read(payload)

    def refuse(*_: object) -> None:
        raise AssertionError("cursor used")

    monkeypatch.setattr(Body, "__init__", refuse)
    assert plain(read(payload)) == expected


def test_only_known_types_have_layouts() -> None:
    assert LEARNERS.keys() <= DECODERS.keys()


def test_a_topic_of_many_layouts_is_read_all_the_same() -> None:
    """Frames of more lengths than layouts are kept, twice, with a count that varies, too."""
    _, store, write = ENCODINGS["cdr little"]
    read = decoder(Topic("/scan", LASER, "cdr"))
    for length in 2 * [*range(0, 4 * MOST, 3)]:
        found = read(write(scan_message(store, "f" * length, beams=length % 5), LASER))
        assert isinstance(found, LaserScan)
        assert (found.frame, len(found.ranges)) == ("f" * length, length % 5)
