"""Particles of a localiser in a result file, as readers that are not ours see them."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError
from formats.frame import Particles
from formats.results import messages as ros
from formats.results.file import read_result
from formats.results.particles import KIND, particle_poses, pose_array
from tests.runs import START, forge, write_run

SOME = Particles(START + 100_000_001, np.array([[1.5, -2.25, pi / 2], [0.5, 0.125, -pi / 2]]))
MORE = Particles(START + 400_000_004, np.array([[-0.5, 3.0, 0.0]]))


def test_the_message_is_what_rosbags_would_write() -> None:
    message = ros.decode(pose_array(SOME), KIND)
    assert message.header.frame_id == "map"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(SOME.time_ns, 10**9)
    assert [(p.position.x, p.position.y, p.position.z) for p in message.poses] == [
        (1.5, -2.25, 0.0),
        (0.5, 0.125, 0.0),
    ]
    turns = [(p.orientation.z, p.orientation.w) for p in message.poses]
    assert np.allclose(turns, [(0.5**0.5, 0.5**0.5), (-(0.5**0.5), 0.5**0.5)], atol=1e-7)
    assert ros.encode(message) == pose_array(SOME)


def test_readers_of_others_find_them(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    with AnyReader([write_run(tmp_path / "a.mcap", particles=[SOME, MORE])]) as reader:
        (topic,) = [c for c in reader.connections if c.topic == "/particle_cloud"]
        found: list[tuple[int, Any]] = [
            (time, reader.deserialize(data, topic.msgtype))
            for _, time, data in reader.messages([topic])
        ]
        (qos,) = topic.ext.offered_qos_profiles  # type: ignore[union-attr]
    assert topic.msgtype == "geometry_msgs/msg/PoseArray"
    assert [(time, len(message.poses)) for time, message in found] == [
        (SOME.time_ns, 2),
        (MORE.time_ns, 1),
    ]
    # rclcpp::SensorDataQoS, with which nav2 publishes its particle cloud
    profile = qos.history.name, qos.depth, qos.reliability.name, qos.durability.name
    assert profile == ("KEEP_LAST", 5, "BEST_EFFORT", "VOLATILE")


def test_they_come_back(tmp_path: Path) -> None:
    back = read_result(write_run(tmp_path / "a.mcap", particles=[SOME, MORE])).particles
    assert [one.time_ns for one in back] == [SOME.time_ns, MORE.time_ns]
    for one, given in zip(back, (SOME, MORE), strict=True):
        assert np.allclose(one.poses, given.poses, atol=1e-6)
    assert read_result(write_run(tmp_path / "b.mcap")).particles == ()


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        pose_array(SOME)[:-1],
        pose_array(SOME) + bytes(56),
        pose_array(SOME).replace(b"map\0", b"odom"),
        pose_array(Particles(START, np.array([[np.nan, 0.0, 0.0]]))),
        bytes(28),
    ],
    ids=["empty", "cut", "long", "frame", "nan", "none"],
)
def test_a_forged_payload_is_one_line(tmp_path: Path, payload: bytes) -> None:
    whole = write_run(tmp_path / "a.mcap", particles=[SOME])
    forged = forge(whole, tmp_path / "b.mcap", {}, payloads={"/particle_cloud": payload})
    with pytest.raises(FormatError, match="does not fit together"):
        read_result(forged)
    with pytest.raises(ValueError, match="particle"):
        particle_poses(payload)
