"""Drives of a simulated robot: waypoints to timed poses, budgets, and what its wheels believe."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, hypot, inf, sin

import numpy as np

from formats.frame import Floats, Pose
from formats.jit import njit

NEAR = 1e-6  # m: waypoints nearer than this are one


@dataclass(frozen=True, slots=True)
class Way:
    """Poses of the base over time.

    Attributes:
        times: (n,) s, ascending from 0.
        poses: (n, 3) m, m, rad; the heading is not wrapped, so that it can be interpolated.
    """

    times: Floats
    poses: Floats

    @property
    def seconds(self) -> float:
        """From the first pose to the last."""
        return float(self.times[-1])

    @property
    def metres(self) -> float:
        """Driven."""
        return float(np.hypot(*np.diff(self.poses[:, :2], axis=0).T).sum())

    def at(self, times: Floats) -> Floats:
        """Poses (k, 3) at times (k,) s, linear in between."""
        columns = [np.interp(times, self.times, self.poses[:, i]) for i in range(3)]
        return np.stack(columns, axis=1)

    def within(self, *, metres: float = inf, seconds: float = inf) -> Way:
        """As much of it as a budget allows."""
        driven = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(self.poses[:, :2], axis=0).T))))
        end = self.seconds
        if metres < driven[-1]:
            k = int(np.searchsorted(driven, metres, side="right"))
            share = (metres - driven[k - 1]) / (driven[k] - driven[k - 1])
            end = float(self.times[k - 1] + share * (self.times[k] - self.times[k - 1]))
        end = min(end, seconds)
        if end >= self.seconds:
            return self
        kept = self.times < end
        times = np.append(self.times[kept], end)
        return Way(times, self.at(times))


def drive(
    waypoints: Iterable[tuple[float, float]],
    *,
    yaw: float | None = None,
    speed: float = 0.35,
    turn_rate: float = 0.9,
    pause: float = 0.0,
) -> Way:
    """Turn on the spot, then straight on, from point to point.

    Args:
        waypoints: m; one is enough, the robot then stands.
        yaw: rad, at the start; None: towards the second.
        speed: m/s; turn_rate: rad/s.
        pause: s at every waypoint.

    Raises:
        ValueError: no waypoint.
    """
    points = [(float(x), float(y)) for x, y in waypoints]
    if not points:
        raise ValueError("a drive needs a waypoint")
    x, y = points[0]
    heading, t = yaw, 0.0
    rows: list[tuple[float, float, float, float]] = []
    for (x, y), (u, v) in pairwise(points):
        way = hypot(u - x, v - y)
        if way < NEAR:
            continue
        goal = atan2(v - y, u - x)
        if heading is None:
            heading = goal
        if not rows:
            rows.append((t, x, y, heading))
        for seconds, to in (
            (pause, (x, y, heading)),
            (abs(turn := _short(goal - heading)) / turn_rate, (x, y, heading + turn)),
            (way / speed, (u, v, heading + turn)),
        ):
            if seconds > 0.0:
                t += seconds
                rows.append((t, *to))
        heading += turn
    if not rows:
        rows.append((0.0, x, y, heading or 0.0))
    if pause > 0.0:
        rows.append((t + pause, *rows[-1][1:]))
    table = np.array(rows)
    return Way(table[:, 0], table[:, 1:])


def _short(angle: float) -> float:
    """The same turn the short way round; half a turn to the left."""
    return atan2(sin(angle), cos(angle))


@dataclass(frozen=True, slots=True)
class Drift:
    """Errors of wheel odometry: a random walk, and a pull to one side.

    Attributes:
        walk: standard deviation after 1 m of the way in m and of the heading in rad, and after
            1 rad of turning, of the heading in rad; it grows with the root of the way.
        pull: rad a metre, to the left.
    """

    walk: float = 0.01
    pull: float = 0.002


def believed(way: Way, drift: Drift, rate: float, rng: np.random.Generator) -> Way:
    """What the wheels say, sampled `rate` times a second, from the true first pose on."""
    times = np.arange(0.0, way.seconds + 0.5 / rate, 1.0 / rate)
    true = way.at(times)
    out = true.copy()
    _integrate(true, drift.walk, drift.pull, rng.standard_normal((len(true), 3)), out)
    return Way(times, out)


@njit
def _integrate(true: Floats, walk: float, pull: float, draws: Floats, out: Floats) -> None:
    for i in range(1, true.shape[0]):
        dx, dy = true[i, 0] - true[i - 1, 0], true[i, 1] - true[i - 1, 1]
        turn = true[i, 2] - true[i - 1, 2]
        # The step in the robot's own axes, so that driving backwards is no half turn.
        c, s = cos(true[i - 1, 2]), sin(true[i - 1, 2])
        ahead, aside = c * dx + s * dy, -s * dx + c * dy
        way = hypot(dx, dy)
        ahead += walk * way**0.5 * draws[i, 0]
        turned = turn + pull * way
        turned += walk * (way**0.5 * draws[i, 1] + abs(turn) ** 0.5 * draws[i, 2])
        c, s = cos(out[i - 1, 2]), sin(out[i - 1, 2])
        out[i, 0] = out[i - 1, 0] + c * ahead - s * aside
        out[i, 1] = out[i - 1, 1] + s * ahead + c * aside
        out[i, 2] = out[i - 1, 2] + turned


def correction(believes: Pose, true: Pose) -> Pose:
    """The pose of the odometry's frame in the map: what a perfect localiser publishes."""
    return true @ believes.inverse()
