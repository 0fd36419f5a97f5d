"""A robot with a lidar and bad odometry in a world drawn as text."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin

import numpy as np

from formats.frame import Floats, Pose, Scan
from replay.localise.tracking import Sighting

CELL = 0.25
OFFICE = """
################################
#.......#............#.........#
#.......#............#.........#
#.......#....##......#.........#
#....................#.........#
#.......#............#....######
#.......#....................###
####..#####..#######...........#
#............#.....#...........#
#..................#############
#............#.....#..##.......#
#............#.................#
######.......#.....#...........#
######.......#.....#...........#
################################
"""
"""8 x 3.75 m at 0.25 m a character; no two places look the same."""
TOUR = [(1.0, 2.8), (1.3, 2.5), (3.0, 2.6), (4.2, 3.2), (4.9, 2.4), (5.5, 2.2), (6.6, 2.3)]
WIDE = 0.5  # m a character, for robots that must not touch walls
ROUND = [
    (0.5 * x, 0.5 * y)
    for x, y in (
        (4.5, 10.5),
        (8.5, 10.5),
        (12.0, 10.5),
        (12.0, 5.5),
        (5.0, 5.5),
        (5.0, 9.5),
        (8.5, 10.5),
        (17.0, 10.5),
        (17.0, 8.5),
        (24.0, 8.5),
    )
]
"""Through its doors, once around and on: 25 m."""
MOUNT = Pose(0.1, 0.02, 0.3)
FAR = 12.0


def walls(text: str) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """(rows, cols), row 0 lowest."""
    lines = [line for line in text.splitlines() if line]
    return np.array([[c == "#" for c in line] for line in lines[::-1]])


def ranges(
    wall: np.ndarray[tuple[int, int], np.dtype[np.bool_]],
    pose: Pose,
    bearings: Floats,
    cell: float = CELL,
) -> Floats:
    """Small steps along every ray until it is in a wall: slow and obvious."""
    r = np.arange(0.0, FAR, 0.01)
    angles = pose.yaw + bearings[:, None]
    cols = np.floor((pose.x + r * np.cos(angles)) / cell).astype(int)
    rows = np.floor((pose.y + r * np.sin(angles)) / cell).astype(int)
    inside = (rows >= 0) & (rows < wall.shape[0]) & (cols >= 0) & (cols < wall.shape[1])
    hit = inside & wall[np.where(inside, rows, 0), np.where(inside, cols, 0)]
    return np.where(hit.any(axis=1), r[hit.argmax(axis=1)], np.inf)


def way(corners: list[tuple[float, float]], step: float = 0.1, turn: float = 0.15) -> list[Pose]:
    """Poses along a line with corners, turning on the spot."""
    poses = [Pose(*corners[0], atan2(corners[1][1] - corners[0][1], corners[1][0] - corners[0][0]))]
    for x, y in corners[1:]:
        last = poses[-1]
        heading = atan2(y - last.y, x - last.x)
        off = atan2(sin(heading - last.yaw), cos(heading - last.yaw))
        turns = max(int(np.ceil(abs(off) / turn)), 1)
        poses += [Pose(last.x, last.y, last.yaw + off * k / turns) for k in range(1, turns + 1)]
        length = hypot(x - last.x, y - last.y)
        count = max(int(np.ceil(length / step)), 1)
        poses += [
            Pose(last.x + (x - last.x) * k / count, last.y + (y - last.y) * k / count, heading)
            for k in range(1, count + 1)
        ]
    return poses


def drifting(truth: list[Pose], seed: int = 0, noise: float = 0.1) -> list[Pose]:
    """Odometry from elsewhere: each step off by a share of itself, and always a little left."""
    rng, poses = np.random.default_rng(seed), [Pose(7.0, -3.0, 2.0)]
    for before, after in pairwise(truth):
        x, y, yaw = before.inverse() @ after
        s = noise * rng.standard_normal(3)
        poses.append(poses[-1] @ Pose(x * (1 + s[0]), y * (1 + s[0]), yaw * (1 + s[1]) + 0.02 * x))
    return poses


def drive(
    text: str,
    truth: list[Pose],
    odometry: list[Pose],
    beams: int = 90,
    seed: int = 0,
    cell: float = CELL,
) -> Iterator[Sighting]:
    """What the robot saw: 270 degrees, 2 cm of noise, one beam in ten too short (people)."""
    rng, wall = np.random.default_rng(seed + 100), walls(text)
    bearings = np.linspace(-0.75 * pi, 0.75 * pi, beams)
    widths = np.full(beams, 1.5 * pi / beams)
    for k, (pose, said) in enumerate(zip(truth, odometry, strict=True)):
        found = ranges(wall, pose @ MOUNT, bearings, cell) + 0.02 * rng.standard_normal(beams)
        found = np.where(rng.random(beams) < 0.1, found * rng.random(beams), found)
        scan = Scan(bearings, widths, found.astype(np.float32), 0.05, FAR)
        yield Sighting(k * 100_000_000, said, scan, MOUNT)
