"""The lines of CARMEN logs (carmen.sourceforge.net/logger_playback.html) and of CMU's Wean Hall.

A line is a word and its numbers; each kind has one function, which checks every number of it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import pi, radians
from typing import NamedTuple

Words = list[bytes]
LIMIT = 80.0  # m; a SICK LMS says 81.83 or so where it saw nothing
LATEST = 9e9  # s; as ns still a 64-bit integer
CM = 0.01
WEAN = 180
# Readings of a SICK LMS -> start and step in degrees; 180 of them end one step before the left.
SICK = {
    **dict.fromkeys((180, 181), (-90.0, 1.0)),
    **dict.fromkeys((360, 361), (-90.0, 0.5)),
    **dict.fromkeys((720, 721), (-90.0, 0.25)),
    **dict.fromkeys((100, 101), (-50.0, 1.0)),
    **dict.fromkeys((200, 201), (-50.0, 0.5)),
    **dict.fromkeys((400, 401), (-50.0, 0.25)),
}


class Malformed(Exception):  # noqa: N818  (what the line is)
    """A line that cannot be read, with the reason."""


class Place(NamedTuple):
    """x, y, theta as recorded: m, m, rad; perhaps nan."""

    x: float
    y: float
    yaw: float


class Line(NamedTuple):
    """What a line says.

    Attributes:
        stamp: s, when it was measured.
        logged: s, when it was written, on another clock perhaps.
        robot: of the body, None where the line does not say.
        laser: of the laser, likewise.
        ranges: m.
        start, step: rad, of the beams.
        limit: m, the longest range; None where the line does not say.
    """

    stamp: float
    logged: float
    robot: Place | None = None
    laser: Place | None = None
    ranges: list[float] = []  # noqa: RUF012  (of a tuple; never written to)
    start: float = 0.0
    step: float = 0.0
    limit: float | None = None


def numbers(words: Words) -> list[float]:
    """Words as numbers, nan and inf among them.

    Raises:
        Malformed: one of them is none.
    """
    try:
        return list(map(float, words))
    except ValueError:
        raise Malformed("a word that should be a number") from None


def number(word: bytes) -> float:
    """One number."""
    return numbers([word])[0]


def is_number(word: bytes) -> bool:
    """Whether it could be one."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def count(words: Words, at: int) -> int:
    """How many readings follow: never more than there are words.

    Raises:
        Malformed: it is no whole number, or the line is shorter.
    """
    try:
        found = int(words[at])
    except (ValueError, IndexError):
        raise Malformed("no count of readings") from None
    if not 0 <= found <= len(words) - at - 1:
        raise Malformed("cut short, or its count is wrong")
    return found


def length(words: Words, *wanted: int) -> None:
    """A line has all its words and no more.

    Raises:
        Malformed: it has not.
    """
    if len(words) not in wanted:
        raise Malformed("cut short, or its count is wrong")


def moment(word: bytes) -> float:
    """A time in s.

    Raises:
        Malformed: it is no time.
    """
    found = number(word)
    if not abs(found) < LATEST:  # True for nan, too
        raise Malformed("a time that is none")
    return found


def ending(words: Words) -> tuple[float, float]:
    """Stamp and time of writing: `stamp host time` at the end of a line."""
    return moment(words[-3]), moment(words[-1])


def old_laser(words: Words) -> Line:
    """FLASER, RLASER: n ranges, pose of the laser, pose of the robot by odometry."""
    n = count(words, 1)
    length(words, n + 11)
    poses = numbers(words[n + 2 : n + 8])
    ranges = numbers(words[2 : n + 2])
    start, step = fan(n)
    return Line(*ending(words), Place(*poses[3:]), Place(*poses[:3]), ranges, start, step)


def fan(n: int) -> tuple[float, float]:
    """Start and step in rad of n readings that the line says no more of."""
    if n in SICK:
        return radians(SICK[n][0]), radians(SICK[n][1])
    return -pi / 2, pi / max(n - 1, 1)


def new_laser(words: Words) -> Line:
    """ROBOTLASERn: configuration, ranges, remissions, poses of laser and robot, speeds, safety."""
    n = count(words, 8)
    tail = 9 + n
    # The oldest ones have no remissions and no turn_axis; a host keeps them apart from cut ones.
    if len(words) != tail + 13 or is_number(words[-2]):
        m = count(words, tail)
        tail += 1 + m
        length(words, tail + 14)
    ranges, poses = numbers(words[9 : 9 + n]), numbers(words[tail : tail + 6])
    start, step, limit = configuration(words)
    robot, laser = Place(*poses[3:]), Place(*poses[:3])
    return Line(*ending(words), robot, laser, ranges, start, step, limit)


def raw_laser(words: Words) -> Line:
    """RAWLASERn: configuration, ranges, remissions, without poses."""
    n = count(words, 8)
    length(words, 9 + n + 1 + count(words, 9 + n) + 3)
    start, step, limit = configuration(words)
    ranges = numbers(words[9 : 9 + n])
    return Line(*ending(words), None, None, ranges, start, step, limit)


def configuration(words: Words) -> tuple[float, float, float]:
    """Start and step in rad, longest range in m."""
    _, start, _, step, limit, *_ = numbers(words[1:8])
    return start, step, limit


def odometry(words: Words) -> Line:
    """ODOM: pose, speeds and acceleration."""
    length(words, 10)
    x, y, yaw, *_ = numbers(words[1:7])
    return Line(*ending(words), Place(x, y, yaw))


def true_pose(words: Words) -> Line:
    """TRUEPOS of the simulator: the true pose, then odometry."""
    return odometry(words)


def wean_laser(words: Words) -> Line:
    """L: pose of the robot, pose of the laser, ranges, time; in cm."""
    n = len(words) - 8
    if n != WEAN:  # nothing in the line says how many there should be
        raise Malformed("cut short, or not of 180 readings")
    found, time = numbers(words[1:7]), moment(words[-1])
    ranges = [CM * r for r in numbers(words[7:-1])]
    start, step = fan(n)
    return Line(time, time, metres(found[:3]), metres(found[3:]), ranges, start, step)


def wean_odometry(words: Words) -> Line:
    """O: pose of the robot and time; in cm."""
    length(words, 5)
    time = moment(words[4])
    return Line(time, time, metres(numbers(words[1:4])))


def metres(pose: list[float]) -> Place:
    """A pose in cm as one in m."""
    return Place(CM * pose[0], CM * pose[1], pose[2])


LASERS: dict[bytes, Callable[[Words], Line]] = {
    b"FLASER": old_laser,
    **{b"ROBOTLASER%d" % i: new_laser for i in range(1, 6)},
    b"RLASER": old_laser,
    b"L": wean_laser,
    **{b"RAWLASER%d" % i: raw_laser for i in range(1, 6)},
}
LINES: dict[bytes, Callable[[Words], Line]] = {
    **LASERS,
    b"ODOM": odometry,
    b"TRUEPOS": true_pose,
    b"O": wean_odometry,
}


@lru_cache(maxsize=8)  # a line is read once for each topic that it belongs to
def parse(line: bytes) -> Line:
    """One line whose first word is in LINES.

    Raises:
        Malformed: it cannot be read.
    """
    words = line.split()
    return LINES[words[0]](words)
