"""Which topic is the scan and where the poses come from, by type, rate and reach; with reasons."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from formats.errors import FormatError, UsageError, printable
from formats.frame import Pose
from formats.log import Topic, listing
from formats.sensing.scans import SENSORS
from formats.streaming.candidates import peers
from formats.streaming.clock import Clock
from formats.streaming.gathering import POSE_TYPES, TF_TYPES, Gathered, ScanTimes
from formats.streaming.poses import KINDS, Source, base_of, fixed_frames, kind_of, odom_frames
from formats.streaming.tf import plain
from formats.streaming.track import MAX_GAP_NS
from formats.streaming.way import Way, flat

SAME = 1e-3  # m, rad; poses that differ by less are the same
ENOUGH = 0.5  # a source that reaches this share of the scans is taken before looking further


@dataclass(frozen=True, eq=False)
class Choice:
    """What is read from a log, and why.

    Attributes:
        scan: the topic of the scans.
        source: of the poses.
        sensor_frame: that the scans name.
        sensor_pose: the sensor on the body, at the first scan that has one.
        reasons: lines for people.
    """

    scan: Topic
    source: Source
    sensor_frame: str
    sensor_pose: Pose
    reasons: list[str] = field(default_factory=list)

    @property
    def map_frame(self) -> str:
        """The frame that the poses are in."""
        return self.source.map_frame

    @property
    def base_frame(self) -> str:
        """The robot's body."""
        return self.source.base_frame

    @property
    def in_map(self) -> bool:
        """Whether the poses may be in the plan's frame; False for odometry alone."""
        return self.source.in_map


@dataclass(frozen=True)
class Wishes:
    """What the user said; "" and None leave it to the log.

    Attributes:
        scan: topic.
        pose: topic, or "tf".
        map_frame, base_frame: names.
        sensor_pose: the sensor on the body.
        pose_delay_ns: added to the stamps of the poses.
        max_gap_ns: poses farther apart are not interpolated.
        odometry: comes before poses in the map, and nothing at all will do.
    """

    scan: str = ""
    pose: str = ""
    map_frame: str = ""
    base_frame: str = ""
    sensor_pose: Pose | None = None
    pose_delay_ns: int = 0
    max_gap_ns: int = MAX_GAP_NS
    odometry: bool = False


def sources(gathered: Gathered, scans: ScanTimes, wishes: Wishes) -> list[Source]:
    """Ways to poses in the order of preference."""
    tree, names = gathered.tree, scans.names
    found: list[Source] = []

    def add(source: Source) -> None:
        if wishes.base_frame:
            source = replace(source, base_frame=plain(wishes.base_frame))
        found.append(source)

    if wishes.pose == "none":
        pass
    elif wishes.pose in ("", "tf"):
        odoms = odom_frames(tree, names)
        maps = fixed_frames(tree, names)
        if wishes.map_frame:
            maps, odoms = [plain(wishes.map_frame)], []
        for frame in maps:
            if frame in tree.frames:
                add(Source("tf", None, frame, base_of(tree, names, frame)))
        for frame in odoms:
            add(Source("tf odometry", None, frame, base_of(tree, names, frame)))
    for topic, poses in gathered.poses.items():
        if len(poses.samples):
            frame = poses.frame or plain(wishes.map_frame)
            if wishes.pose == "none":
                continue
            if wishes.pose in ("", "tf") and wishes.map_frame not in ("", frame, "/" + frame):
                continue
            base = base_of(tree, names, child=poses.child)
            add(Source(kind_of(poses), topic, frame, base))
    found.sort(key=lambda source: KINDS.index(source.kind))
    found = [_carried(source, found) for source in found]
    if wishes.odometry:
        found.sort(key=lambda source: source.in_map)
        base = base_of(tree, names) or next((name for name in names if name), "")
        found.append(Source("nothing", None, "", plain(wishes.base_frame) or base))
    return found


def _carried(source: Source, found: list[Source]) -> Source:
    """Poses of amcl come seldom: odometry of the same body carries them."""
    if source.kind != "amcl_pose":
        return source
    carriers = (s for s in found if not s.in_map and s.base_frame == source.base_frame)
    return replace(source, carrier=next(carriers, None))


def ways(gathered: Gathered, scans: ScanTimes, clock: Clock, wishes: Wishes) -> list[Way]:
    """Every source of poses for these scans, up to the first that reaches enough of them."""
    times = clock.times(scans.stamps_ns, scans.logs_ns)
    gathered.tree.settle(clock, gathered.zero_ns(scans, clock), wishes.max_gap_ns)
    found: list[Way] = []
    for source in sources(gathered, scans, wishes):
        if found and found[-1].share >= ENOUGH and found[-1].source.kind != source.kind:
            break
        if source.kind in ("tf", "tf odometry") and (
            gathered.tree.path_between(source.map_frame, source.base_frame) is None
        ):
            continue
        delay = wishes.pose_delay_ns
        found.append(Way(source, gathered, scans, times, wishes.sensor_pose, delay))
    return found


def best_way(gathered: Gathered, found: list[Way]) -> Way | None:
    """The first source that reaches enough of the scans, else the one that reaches most.

    Raises:
        UsageError: several pose topics of one kind fit equally, and do not say the same.
    """
    way = next((w for w in found if w.share >= ENOUGH), None)
    way = way or max(found, key=lambda w: w.share, default=None)
    if way is None or way.source.topic is None:
        return way
    others = [
        w
        for w in found
        if w.source.topic is not None and w.source.kind == way.source.kind and w.share >= ENOUGH
    ]
    rivals = [w.source.topic for w in others if w.source.topic is not None]
    if len(rivals) > 1 and not all(_agree(way, other) for other in others):
        problem = f"{len(rivals)} topics may be the robot's poses: {listing(rivals)}"
        hint = " or ".join(f"--pose {printable(t.name)}" for t in rivals)
        raise UsageError(gathered.log.path, problem, hint=f"choose one with {hint}")
    return way


def _agree(one: Way, other: Way) -> bool:
    """Whether two topics say the same poses: of one SLAM, with and without covariance, say."""
    times = one.times_ns[one.valid & other.valid]
    here, there = flat(one.body(times).matrices), flat(other.body(times).matrices)
    off = here - there
    off[:, 2] = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
    frames = {way.source.map_frame for way in (one, other)}
    return len(frames) == 1 and bool(len(times)) and float(np.abs(off).max()) < SAME


def pick_scan(
    gathered: Gathered, reach: dict[Topic, float], standing: Collection[Topic] = ()
) -> tuple[Topic, str]:
    """The one scan topic that fits, and why.

    Args:
        gathered: of all the topics that fit by type.
        reach: share of each topic's scans that some poses reach.
        standing: topics whose frames do not move with the robot.

    Raises:
        UsageError: several fit equally.
    """
    counts = {t: replace(t, count=len(s)) for t, s in gathered.scans.items() if len(s)}
    real = {counted: t for t, counted in counts.items()}
    topics = peers(list(counts.values()))
    if len(topics) == 1:
        return real[topics[0]], f"the only {topics[0].type.rsplit('/', 1)[-1]}"
    reached = [t for t in topics if reach[real[t]] > 0]
    if len(reached) == 1:
        return real[reached[0]], "the only one that the transforms reach"
    carried = [t for t in reached if real[t] not in standing]
    if len(carried) == 1:
        return real[carried[0]], "the only one in a frame that moves with the robot"
    if not reached:
        if not topics:
            raise FormatError(gathered.log.path, "no scan is readable")
        return real[max(topics, key=lambda t: t.count or 0)], "the one with most messages"
    hint = " or ".join(f"--scan {printable(t.name)}" for t in reached)
    problem = f"{len(reached)} topics may be the scan: {listing(reached)}"
    raise UsageError(gathered.log.path, problem, hint=f"choose one with {hint}")


def no_poses(gathered: Gathered, scan: Topic, wishes: Wishes) -> FormatError:
    """Why nothing says where the robot was."""
    log, tree = gathered.log, gathered.tree
    edges = ", ".join(f"{p} > {c}" for p, c in list(tree.edges)[:6])
    topics = [t for t in log.topics() if t.type in (*POSE_TYPES, *TF_TYPES) and t.count != 0]
    found = "; ".join(filter(None, [listing(topics), edges])) or "none of these"
    for name in filter(None, (wishes.map_frame, wishes.base_frame)):
        if plain(name) not in tree.frames:
            frames = ", ".join(sorted(tree.frames)[:12]) or "none"
            problem = f"no frame {printable(name)} in the transforms"
            return UsageError(log.path, f"{problem}; frames: {printable(frames)}")
    return FormatError(
        log.path,
        "no pose source: looked for tf from a map or odom frame, PoseStamped, "
        f"PoseWithCovarianceStamped and Odometry; found {found}",
        topic=scan.name,
        hint="record /tf or a pose topic, name one with --pose, or try --poses match",
    )


def described(way: Way) -> Choice:
    """The choice of one way, with its reasons still empty."""
    rows = way.valid.nonzero()[0][:1]
    mount = Pose(0.0, 0.0, 0.0)
    if rows.size:
        forward = SENSORS[way.scans.topic.type].forward
        mount = Pose(*flat(way.mount(rows).matrices, forward)[0].tolist())
    name = way.scans.names[int(way.scans.frame[rows[0]])] if rows.size else ""
    return Choice(way.scans.topic, way.source, name, mount)
