"""What frames are by their names (REP-105: earth > map > odom > base_link > sensors)."""

from __future__ import annotations

MAPS = ("map", "world", "map_frame", "slam_map", "world_frame", "global", "mocap", "vicon", "earth")
BASES = ("base_footprint", "base_link", "base", "base_frame", "robot_base", "chassis")


def last_part(frame: str) -> str:
    """A frame's name without the robot's: "robot1/base_link" is a "base_link"."""
    return frame.strip("/").rsplit("/", 1)[-1].lower()


def is_map(frame: str) -> bool:
    """Whether it is the fixed frame that a plan can lie in."""
    return last_part(frame) in MAPS


def is_odom(frame: str) -> bool:
    """Whether it is a frame that drifts: odom, odom_combined, wheel_odom."""
    return "odom" in last_part(frame)


def is_base(frame: str) -> bool:
    """Whether it is the robot's body."""
    return last_part(frame) in BASES or last_part(frame).startswith(("base_link", "base_footprint"))


def by_name(frames: list[str], names: tuple[str, ...]) -> list[str]:
    """The frames of these names, in the order of the names, then of the frames."""
    found = [f for f in frames if last_part(f) in names]
    return sorted(found, key=lambda f: names.index(last_part(f)))


def is_known(frame: str) -> bool:
    """Whether the name alone says what the frame is."""
    return is_map(frame) or is_odom(frame) or is_base(frame)
