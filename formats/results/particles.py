"""Particles of a localiser in a result file, as nav2 once published them: PoseArray."""

from __future__ import annotations

import struct

import numpy as np

from formats.frame import Floats, Particles
from formats.results import messages as ros
from formats.results.records import MAP, numbers, poses

TOPIC, KIND = "/particle_cloud", "geometry_msgs/msg/PoseArray"
HEAD = struct.Struct("<IIII4sI4x")  # encapsulation, stamp, frame, how many; poses are aligned to 8
POSE = 56  # bytes: x y z qx qy qz qw
LITTLE_ENDIAN = 0x100


def pose_array(particles: Particles) -> bytes:
    """geometry_msgs/PoseArray of the sensor in the map's frame, at least one pose.

    Written as bytes: of 500 poses rosbags makes a thousand objects first. Numbers are rounded to
    single precision, below 0.1 mm in any building, which packs to half the size.
    """
    seconds, rest = divmod(particles.time_ns, 10**9)
    name = MAP.encode() + b"\0"
    head = HEAD.pack(LITTLE_ENDIAN, seconds, rest, len(name), name, len(particles.poses))
    return head + numbers(particles.poses).astype("<f4").astype("<f8").tobytes()


def particle_poses(data: bytes) -> Floats:
    """The inverse of `pose_array`: (n, 3). Raises ValueError on what does not fit."""
    count = (len(data) - HEAD.size) // POSE
    fixed = LITTLE_ENDIAN, len(MAP) + 1, MAP.encode() + b"\0", count
    mark, _, _, *rest = HEAD.unpack_from(data) if count > 0 else (0, 0, 0)
    if (mark, *rest) != fixed or len(data) != HEAD.size + POSE * count:
        raise ValueError("particles that are no poses in the map")
    found = poses(np.frombuffer(data, "<f8", offset=HEAD.size).reshape(-1, 7))
    if not np.isfinite(found).all():
        raise ValueError("a particle that is not finite")
    return found


def add_particles(channels: ros.Channels, particles: Particles) -> None:
    """The particles of a moment on their topic."""
    channels.add(TOPIC, KIND, particles.time_ns, pose_array(particles))
