"""Where the sensor was at each scan of a topic, by one source of poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from formats.depth.scans import level_pose
from formats.frame import Pose
from formats.log import Topic
from formats.sensing.scans import SENSORS
from formats.streaming.clock import SECOND, Times
from formats.streaming.frame_names import is_base, last_part
from formats.streaming.gathering import Gathered, ScanTimes
from formats.streaming.poses import Source
from formats.streaming.tf import Lookup
from formats.streaming.track import (
    Floats,
    Missing,
    Track,
    Why,
    breaks,
    inverse,
    matrices,
    missing_of,
)

DRIFT_GAP_NS = 60 * SECOND  # odometry is trusted for so long between two poses in the map
BLOCK = 4096  # scans placed at a time, so that memory does not grow with their number
# A camera that looks along its body's x axis: x right, y down, z forward (REP-103).
OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
Rows = npt.NDArray[np.intp]


def blocks(count: int, size: int = BLOCK) -> Iterator[slice]:
    """Slices that cover `count` rows."""
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def matrix(pose: Pose) -> Floats:
    """(4, 4) of a pose in the plane."""
    m = np.eye(4)
    m[:2, :2] = [[np.cos(pose.yaw), -np.sin(pose.yaw)], [np.sin(pose.yaw), np.cos(pose.yaw)]]
    m[:2, 3] = pose.x, pose.y
    return m


def flat(m: Floats, forward: int = 0) -> Floats:
    """(n, 3) x y yaw of (n, 4, 4): the heading is that of an axis (0 is x) seen from above."""
    if forward:
        return np.array([level_pose(each, forward) for each in m]).reshape(-1, 3)
    return np.stack([m[:, 0, 3], m[:, 1, 3], np.arctan2(m[:, 1, 0], m[:, 0, 0])], axis=1)


@dataclass(frozen=True, eq=False)
class Swept:
    """Scans on the move.

    Attributes:
        matrices: (k, 4, 4) of the sensor in the map frame, at the middle of each sweep.
        sweeps_ns: (k,) how long each took; 0 where the poses do not cover it: then the matrix is
            of the stamp.
        motions: (k, 6) x y yaw of the first and of the last beam in the pose of the middle.
        views: (k, 4, 4), what takes points to the body, where the sensor's frame stays where it is
            and `matrices` are of the body.
    """

    matrices: Floats
    sweeps_ns: Times
    motions: Floats
    views: Floats | None = None


@dataclass(eq=False)
class Way:
    """One source of poses for the scans of one topic.

    Attributes:
        source: of poses.
        scans: of the topic.
        times_ns: (n,) when the scans count.
        sensor_pose: the sensor on the body, instead of what tf says.
        delay_ns: added to the stamps of the poses.
        valid: (n,) scans that have a pose.
        missing: what is missing for the others.
    """

    source: Source
    gathered: Gathered
    scans: ScanTimes
    times_ns: Times
    sensor_pose: Pose | None
    delay_ns: int

    def __post_init__(self) -> None:
        self.valid = np.zeros(len(self.times_ns), dtype=bool)
        found: dict[tuple[str, Why, int], list[Rows]] = {}
        for part in blocks(len(self.times_ns)):
            placed = self.sensor(np.arange(part.start, part.stop), self.times_ns[part])
            self.valid[part] = placed.valid
            for gap in placed.missing:
                found.setdefault(gap[:3], []).append(gap.rows + part.start)
        self.missing = [Missing(*key, np.concatenate(rows)) for key, rows in found.items()]

    @property
    def share(self) -> float:
        """How many of the scans have a pose, 0 to 1."""
        return float(self.valid.mean()) if self.valid.size else 0.0

    def sensor(self, rows: Rows, moments_ns: Times) -> Lookup:
        """The sensor in the map frame for some scans, at moments near their stamps.

        Its height counts from the body's frame, whose z = 0 is the floor (REP-105), whatever the
        height of the map; from the map's where the poses are of no base, but of a camera, say.
        """
        body, mount = self.body(moments_ns), self.mount(rows)
        late = [gap._replace(bound_ns=gap.bound_ns + self.delay_ns) for gap in body.missing]
        placed = body.matrices.copy() if self.registered else body.matrices @ mount.matrices
        if is_base(self.source.base_frame):
            placed[:, 2, 3] -= body.matrices[:, 2, 3]
        return Lookup(placed, body.valid & mount.valid, late + mount.missing)

    @cached_property
    def registered(self) -> bool:
        """Whether the scans are clouds in a frame that does not move with the robot.

        Mappers publish such clouds, in the map or where odometry began: seen from the body.
        """
        sensor = SENSORS[self.scans.topic.type]
        clouds = sensor.solid and sensor.forward == 0 and self.sensor_pose is None
        return clouds and any(self.stays(name) for name in self.scans.names)

    def stays(self, frame: str) -> bool:
        """Whether a frame does not move with the robot: its body moves in it."""
        base = self.source.base_frame
        if frame in ("", base) or not base:
            return False
        return frame == self.source.map_frame or frame in self.gathered.tree.ancestors(base)[1:]

    def known(self, frame: str) -> str:
        """The frame that a scan means: transforms may know it with the robot's prefix alone.

        "laser" is "turtle1/laser" where that is the one frame of such a name on the body.
        """
        tree, base = self.gathered.tree, self.source.base_frame
        if not base or frame in ("", base) or frame in tree.frames:
            return frame
        near = (f for f in tree.relatives(base) if last_part(f) == last_part(frame))
        on_body = [f for f in near if base in tree.ancestors(f)[1:]]
        return on_body[0] if len(on_body) == 1 else frame

    def body(self, moments_ns: Times) -> Lookup:
        """The robot's body in the map frame."""
        moments = moments_ns - self.delay_ns
        if self.source.carrier is None:
            return self._body(self.source, moments)
        carried = self._body(self.source.carrier, moments)
        numbers, why = self._correction.at(moments)
        what = f"pose on {self.source.topic.name if self.source.topic else 'tf'}"
        missing = missing_of(what, self._correction.times_ns, why, carried.valid)
        placed = matrices(numbers) @ carried.matrices
        return Lookup(placed, carried.valid & (why == Why.OK), carried.missing + missing)

    def _body(self, source: Source, moments_ns: Times) -> Lookup:
        tree = self.gathered.tree
        if source.kind == "nothing":
            n = len(moments_ns)
            return Lookup(np.broadcast_to(np.eye(4), (n, 4, 4)), np.ones(n, dtype=bool), [])
        if source.topic is None:
            return tree.lookup(source.map_frame, source.base_frame, moments_ns)
        track = self._track(source.topic)
        numbers, why = track.at(moments_ns)
        everywhere = np.ones(len(moments_ns), dtype=bool)
        missing = missing_of(f"pose on {source.topic.name}", track.times_ns, why, everywhere)
        return Lookup(matrices(numbers), why == Why.OK, missing)

    def _track(self, topic: Topic) -> Track:
        tree = self.gathered.tree
        return self.gathered.poses[topic].track(tree.clock, tree.max_gap_ns)

    @cached_property
    def _correction(self) -> Track:
        """Where the odometry's origin lies in the map, at each of the seldom poses.

        It changes as slowly as odometry drifts, so that it holds where the robot has driven on.
        """
        assert self.source.topic is not None
        assert self.source.carrier is not None
        track = self._track(self.source.topic)
        carried = self._body(self.source.carrier, track.times_ns)
        known = carried.valid
        placed = matrices(track.numbers[known]) @ inverse(carried.matrices[known])
        x, y, yaw = flat(placed).T
        zero = np.zeros_like(x)
        numbers = np.stack([x, y, zero, zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)], axis=1)
        times = track.times_ns[known]
        return Track(times, numbers, breaks(times, numbers, DRIFT_GAP_NS), {})

    def mount(self, rows: Rows) -> Lookup:
        """The sensor on the body at each scan, by the frame that the scan names."""
        n, base, tree = len(rows), self.source.base_frame, self.gathered.tree
        if self.sensor_pose is not None:
            mounted = matrix(self.sensor_pose)
            if SENSORS[self.scans.topic.type].forward == 2:
                mounted = mounted @ OPTICAL
            fixed = np.broadcast_to(mounted, (n, 4, 4))
            return Lookup(fixed, np.ones(n, dtype=bool), [])
        found, valid = np.tile(np.eye(4), (n, 1, 1)), np.zeros(n, dtype=bool)
        missing: list[Missing] = []
        frames = self.scans.frame[rows]
        for index in np.unique(frames):
            some = np.flatnonzero(frames == index)
            name = self.known(self.scans.names[index])
            if name in ("", base):  # an unnamed sensor is taken as sitting on the body
                valid[some] = True
            elif self.registered and name == self.source.map_frame:
                part = self.body(self.times_ns[rows[some]])
                found[some], valid[some] = inverse(part.matrices), part.valid
            elif not base or tree.path_between(base, name) is None:
                what = f"transform {base or 'base_link'} <- {name}"
                missing.append(Missing(what, Why.AFTER, 0, some))
            else:
                part = tree.lookup(base, name, self.times_ns[rows[some]], mounted=True)
                found[some], valid[some] = part.matrices, part.valid
                missing += [gap._replace(rows=some[gap.rows]) for gap in part.missing]
        return Lookup(found, valid, missing)

    def swept(self, rows: Rows, sweeps_ns: Times) -> Swept:
        """Scans that take time, at the middle of their sweeps; those of 0 ns at their stamps."""
        start = self.times_ns[rows]
        found, motions = self.sensor(rows, start).matrices, np.zeros((len(rows), 6))
        if not sweeps_ns.any():
            views = self.mount(rows).matrices if self.registered else None
            return Swept(found, sweeps_ns, motions, views)
        middle, last = (self.sensor(rows, start + ns) for ns in (sweeps_ns // 2, sweeps_ns))
        good = (sweeps_ns > 0) & middle.valid & last.valid
        back = inverse(middle.matrices[good])
        motions[good, :3] = flat(back @ found[good])
        motions[good, 3:] = flat(back @ last.matrices[good])
        found[good] = middle.matrices[good]
        return Swept(found, np.where(good, sweeps_ns, 0), motions)
