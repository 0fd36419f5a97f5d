"""The first pass over a log: transforms, poses, and when which scan was taken."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Any

import numpy as np

from formats.decoding import decoder_of
from formats.depth.cameras import Camera
from formats.errors import Notes
from formats.foxglove import decoders as foxglove
from formats.log import Log, Topic
from formats.messages import PoseMessage, Transforms
from formats.payload import Undecodable, odd_stamp
from formats.ros import decoders as ros
from formats.sensing.scans import SENSORS
from formats.streaming.clock import SECOND, Clock, Stamped
from formats.streaming.frame_names import is_known
from formats.streaming.tf import Tree, plain
from formats.streaming.track import Samples, Track

TF_TYPES = (*ros.TRANSFORMS, *foxglove.TRANSFORMS)
POSE_TYPES = (*ros.POSES, *foxglove.POSES)
LAST_NS = (1 << 63) - 1  # log times are unsigned 64-bit in MCAP
MANY = 1_000_000  # samples of transforms, beyond which those that lead nowhere are dropped


def place_in(table: list[str], word: str) -> int:
    """Where a word stands in a short table; new ones are added, the 256th and later are one."""
    if word in table:
        return table.index(word)
    if len(table) < 256:
        table.append(word)
    return len(table) - 1


@dataclass(eq=False)
class ScanTimes(Stamped):
    """The scans of one topic, in the order of the log: 26 bytes each, views once all are read.

    Attributes:
        sensor: how the topic's type is read.
        names: frames that the scans name.
        limit: m, the longest range of any scan.
        unlimited: how many scans state no longest range.
        faults: why scans cannot be used; `fault` indexes it, 0 is "".
    """

    topic: Topic
    names: list[str] = field(default_factory=list)
    limit: float = 0.0
    unlimited: int = 0
    faults: list[str] = field(default_factory=lambda: [""])
    _sweeps: array[float] = field(default_factory=lambda: array("d"))
    _frames: array[int] = field(default_factory=lambda: array("B"))
    _faults: array[int] = field(default_factory=lambda: array("B"))

    def add(self, reading: Any, log_ns: int) -> None:
        """One more that could be decoded."""
        sensor = SENSORS[self.topic.type]
        fault = sensor.fault(reading)
        if not fault and reading.stamp_ns < 0:
            fault = odd_stamp(reading.stamp_ns)
        self._append(reading.stamp_ns, log_ns, plain(reading.frame), fault, sensor.sweep(reading))
        limit = sensor.limit(reading)
        if not fault and limit > self.limit:
            self.limit = limit
        self.unlimited += limit == inf

    def add_broken(self, fault: str, log_ns: int) -> None:
        """One more that could not be decoded: it keeps its place in the order."""
        name = self.names[-1] if self.names else ""
        self._append(self._stamps[-1] if self._stamps else log_ns, log_ns, name, fault, 0.0)

    def _append(self, stamp_ns: int, log_ns: int, name: str, fault: str, sweep: float) -> None:
        self._stamps.append(stamp_ns)
        self._logs.append(log_ns)
        self._sweeps.append(sweep if isfinite(sweep) else -1.0)
        self._frames.append(place_in(self.names, name))
        self._faults.append(place_in(self.faults, fault))

    @property
    def sweeps_s(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """(n,) s from the first beam to the last; -1 where that is no number."""
        return np.frombuffer(self._sweeps, dtype=np.float64)

    @property
    def frame(self) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """(n,) index into `names`."""
        return np.frombuffer(self._frames, dtype=np.uint8)

    @property
    def fault(self) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """(n,) index into `faults`."""
        return np.frombuffer(self._faults, dtype=np.uint8)


@dataclass
class PoseTimes:
    """The poses of one topic: their samples, the frame they are in, what is posed ("" unknown)."""

    topic: Topic
    samples: Samples = field(default_factory=Samples)
    frame: str = ""
    child: str = ""
    _track: tuple[Clock, int, Track] | None = None

    def track(self, clock: Clock, max_gap_ns: int) -> Track:
        """The clean poses by a clock; the last answer is kept."""
        if self._track is None or self._track[0] is not clock or self._track[1] != max_gap_ns:
            made = Track.of(self.samples, clock, max_gap_ns=max_gap_ns)
            self._track = clock, max_gap_ns, made
        return self._track[2]


@dataclass
class Gathered:
    """What the first pass found."""

    log: Log
    notes: Notes
    tree: Tree
    scans: dict[Topic, ScanTimes]
    poses: dict[Topic, PoseTimes]
    cameras: dict[Topic, Camera] = field(default_factory=dict)

    def clock(self, scans: ScanTimes) -> Clock:
        """When messages count: by log times where stamps of scans or of poses are all 0."""
        each = [poses.samples.stamps_ns for poses in self.poses.values() if len(poses.samples)]
        if self.tree.unstamped() or (each and not any(stamps.any() for stamps in each)):
            return Clock(by_log=True)
        return Clock.of(scans.stamps_ns, scans.logs_ns)

    def zero_ns(self, scans: ScanTimes, clock: Clock) -> int:
        """When the log starts, on the clock of these scans."""
        if not len(scans):
            return 0
        first = int(clock.times(scans.stamps_ns[:1], scans.logs_ns[:1])[0])
        late = int(scans.logs_ns[0]) - self.log.container.start_ns
        return first - late if 0 <= late < 86_400 * SECOND else first


def gather(
    log: Log,
    notes: Notes,
    scans: Collection[Topic],
    poses: Collection[Topic],
    cameras: Collection[Topic] = (),
    others: Collection[Topic] = (),
) -> Gathered:
    """Read transforms, poses and the times of scans in one pass.

    Args:
        log: opened.
        notes: where undecodable messages are counted.
        scans: topics of a type in SENSORS.
        poses: topics of a type in POSE_TYPES.
        cameras: topics of a type in CAMERA_TYPES.
        others: topics with transforms that are left out.
    """
    path = log.path
    tree = Tree(path, notes)
    known = [t for t in log.topics() if t.type in TF_TYPES and decoder_of(t) is not None]
    trees = [topic for topic in known if topic not in others]
    made = Gathered(
        log,
        notes,
        tree,
        {topic: ScanTimes(topic) for topic in scans},
        {topic: PoseTimes(topic) for topic in poses},
        {topic: Camera(topic) for topic in cameras},
    )
    wanted = [*trees, *scans, *poses, *cameras]
    readers = {id(topic): _reader(made, topic) for topic in wanted}  # hashing a topic is slow
    start = log.container.start_ns
    count = 0
    for topic, time_ns, data in log.messages(wanted):
        read, take = readers.get(id(topic)) or readers[id(wanted[wanted.index(topic)])]
        log_ns = min(time_ns, LAST_NS)
        try:
            take(read(data), log_ns)
        except Undecodable as error:
            at = f"{(time_ns - start) / SECOND:.2f} s"
            notes.lose(path, f"message not readable: {error.reason}", topic=topic.name, at=at)
            if topic in made.scans:
                made.scans[topic].add_broken("not readable", log_ns)
            continue
        count += 1
        if count % MANY == 0:
            sensors = {name for times in made.scans.values() for name in times.names}
            tree.forget(sensors | {frame for frame in tree.frames if is_known(frame)})
    return made


def _reader(made: Gathered, topic: Topic) -> tuple[Callable[..., Any], Callable[[Any, int], None]]:
    """How a topic's payloads are decoded, and what is done with the noun."""
    read = decoder_of(topic)
    if read is None:
        raise ValueError(f"no decoder for {topic.type}")
    if topic in made.scans:
        return read, _scan_taker(made.scans[topic], made.notes, made.log)
    if topic in made.poses:
        return read, _pose_taker(made.poses[topic], made.notes, made.log)
    if topic in made.cameras:
        camera = made.cameras[topic]
        return read, lambda info, _: camera.add(info, made.notes, made.log.path)
    tree, static = made.tree, topic.name.rstrip("/").endswith("tf_static")

    def take(noun: Transforms, time_ns: int) -> None:
        tree.add(noun.transforms, time_ns, static=static)

    return read, take


def _scan_taker(scans: ScanTimes, notes: Notes, log: Log) -> Callable[[Any, int], None]:
    def take(noun: Any, time_ns: int) -> None:
        if type(noun.stamp_ns) is not int:
            notes.warn(log.path, odd_stamp(noun.stamp_ns), topic=scans.topic.name)
        scans.add(noun, time_ns)

    return take


def _pose_taker(poses: PoseTimes, notes: Notes, log: Log) -> Callable[[PoseMessage, int], None]:
    def take(noun: PoseMessage, time_ns: int) -> None:
        frame = plain(noun.frame)
        if not len(poses.samples):
            poses.frame, poses.child = frame, plain(noun.child)
        elif frame != poses.frame:
            what = f"poses in {frame} among those in {poses.frame} ignored"
            notes.skip(log.path, what, topic=poses.topic.name)
            return
        if type(noun.stamp_ns) is not int:
            notes.warn(log.path, odd_stamp(noun.stamp_ns), topic=poses.topic.name)
        poses.samples.add(noun.stamp_ns, time_ns, noun.numbers)

    return take
