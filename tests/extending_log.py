"""A log format as somebody may add it: lines of nanoseconds and ranges in m, half a circle."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from math import pi
from pathlib import Path

from formats.errors import Notes
from formats.log import Container, Message, Topic

MAGIC = b"# ranges\n"
SCAN = Topic("/scan", "sensor_msgs/msg/LaserScan", "json")


def fits(_path: Path, head: bytes) -> bool:
    """Whether it begins as these logs do."""
    return head.startswith(MAGIC)


def open_file(path: Path, notes: Notes, _max_chunk: int) -> Lines:
    """The log."""
    return Lines(path, notes)


class Lines:
    """See formats.log.Log."""

    def __init__(self, path: Path, notes: Notes) -> None:
        self.path, self._notes = path, notes
        self._lines = path.read_text().splitlines()[1:]

    @property
    def container(self) -> Container:
        """What it is."""
        times = [int(line.split()[0]) for line in self._lines]
        size = self.path.stat().st_size
        return Container("ranges", "none", size, times[0], times[-1], True, "complete")

    def topics(self) -> list[Topic]:
        """One."""
        return [SCAN]

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """Each line as ROS has it in JSON."""
        for line in self._lines if topics is None or SCAN in topics else ():
            time, *ranges = line.split()
            stamp = dict(zip(("sec", "nanosec"), divmod(int(time), 10**9), strict=True))
            scan = {
                "header": {"stamp": stamp, "frame_id": "laser"},
                "angle_min": -pi / 2,
                "angle_increment": pi / (len(ranges) - 1),
                "range_min": 0.1,
                "range_max": 10.0,
                "ranges": [float(r) for r in ranges],
                "intensities": [],
            }
            yield Message(SCAN, int(time), json.dumps(scan).encode())

    def close(self) -> None:
        """Nothing to give back."""
