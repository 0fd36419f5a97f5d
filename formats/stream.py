"""The one frame stream: scans of any log, joined with the poses of their sensor.

    for frame in frames("turtlebot.mcap"):
        print(frame.time_ns, frame.pose, frame.scan.ranges)

Two passes: the first reads transforms, poses and when the scans were taken (`survey`); the second
streams the scans. Only poses and transforms are held in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf, isfinite
from os import PathLike
from typing import Literal, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from formats.depth.cameras import calibration, info_topic
from formats.depth.scans import SLAB
from formats.errors import Notes, Path, UsageError
from formats.frame import Frame, Pose
from formats.log import Log, Topic
from formats.opening import READERS, open_log
from formats.sensing.echo import ECHOES, Echo
from formats.sensing.scans import SENSORS
from formats.sensing.sensor import Look
from formats.streaming.candidates import pose_topics, scan_topics
from formats.streaming.choice import Wishes, best_way, no_poses, pick_scan, ways
from formats.streaming.clock import SECOND, Clock, Times
from formats.streaming.drive import Drive
from formats.streaming.explaining import tell_choice, tell_frame, tell_missing, tell_odometry
from formats.streaming.gathering import Gathered, ScanTimes, gather
from formats.streaming.ring import ringed
from formats.streaming.robots import of_others
from formats.streaming.sifting import plausible_sweeps, sift, tell_aim, tell_attitude, tell_clock
from formats.streaming.track import MAX_GAP_NS
from formats.streaming.way import Way, blocks, flat

__all__ = ["READERS", "Drive", "Options", "frames", "open_log", "survey"]

PoseWish = Literal["log", "auto", "odometry"]
Source = Log | str | PathLike[str] | Sequence[str | PathLike[str]]


class Options(TypedDict, total=False):
    """What may be said to `survey` and `frames`, by keyword; None, "" and 0 are as if unsaid.

    Attributes:
        scan: the scan's topic.
        pose: a topic with poses, or "tf"; "none" for none of them.
        poses: "log": those that the log has; "odometry": of the robot's own motion first, and none
            at all will do, since the caller finds the poses; "auto": those of the log, and if they
            are odometry alone the caller says what comes of it.
        map_frame: frame of the poses.
        base_frame: frame of the robot's body.
        sensor_pose: of the sensor on the body, instead of what tf says; heights then count from it.
        camera_info: the topic of a depth camera's calibration.
        scan_height: m above the floor, lowest and highest, of what depth images and clouds show.
        echo: of a scanner with several a beam: first, last or strongest.
        pose_delay: s, added to the stamps of the poses.
        max_gap: s, poses farther apart are not interpolated; 2.
        deskew: re-express scans that take time at the pose of their middle; True.
        start_offset: s after the start of the log.
        duration: s from there.
        every: take every n-th scan.
        min_travel: m to drive before the next scan is taken.
        min_turn: rad to turn before it.
        readings_per_pose: scans taken before the robot has moved on.
    """

    scan: str | None
    pose: str | None
    poses: PoseWish
    map_frame: str | None
    base_frame: str | None
    sensor_pose: Pose | None
    camera_info: str | None
    scan_height: tuple[float, float] | None
    echo: Echo | None
    pose_delay: float | None
    max_gap: float | None
    deskew: bool
    start_offset: float | None
    duration: float | None
    every: int
    min_travel: float | None
    min_turn: float | None
    readings_per_pose: int | None


def survey(log: Log, notes: Notes, **options: Unpack[Options]) -> Drive:
    """The first pass: choose topics, find the poses of all scans, and count what cannot be used.

    Args:
        log: opened.
        notes: reasons go in as info, oddities as warnings, unusable scans as skipped.
        options: see Options.

    Raises:
        UsageError: several topics fit equally, or an option names what is not there.
        FormatError: no scans, no poses, or no scan that the poses reach.
    """
    wishes = _wishes(options)
    look, camera_info = _look(log, options), options.get("camera_info") or ""
    topics = scan_topics(log, wishes.scan)
    if not wishes.scan:
        log, topics = ringed(log, topics, notes)
    others = of_others(log, topics, notes)
    pictures = [topic for topic in topics if SENSORS[topic.type].forward == 2]
    cameras = {topic: info_topic(log, topic, camera_info) for topic in pictures}
    infos = {topic for topic in cameras.values() if topic is not None}
    posed = [t for t in pose_topics(log, wishes.pose) if wishes.pose or t not in others]
    gathered = gather(log, notes, topics, posed, infos, others)
    scans, clock, way, reason = _chosen(gathered, wishes)
    if way is None:
        raise no_poses(gathered, scans.topic, wishes)
    zero = gathered.zero_ns(scans, clock)
    tell_clock(scans, clock, notes, log.path, zero)
    times = clock.times(scans.stamps_ns, scans.logs_ns)
    window = _window(times - zero, options)
    keep = sift(scans, times, window, zero, notes, log.path)
    if scans.topic in cameras:
        info = cameras[scans.topic]
        camera = None if info is None else gathered.cameras[info]
        look = look._replace(camera=calibration(log, scans.topic, camera))
    tell_missing(gathered, scans, way, keep, times, zero)
    tell_frame(scans, way, notes, log.path)
    keep &= way.valid
    asked = bool(wishes.pose) and way.source.kind != "nothing"
    choice = tell_choice(gathered, scans, way, keep, reason, asked, wishes.odometry)
    if options.get("poses", "log") == "log":
        tell_odometry(choice, notes, log.path)
    rows = np.flatnonzero(keep)
    rows = rows[np.argsort(times[rows], kind="stable")]
    sweeps = np.zeros(len(rows), dtype=np.int64)
    if options.get("deskew", True):
        sweeps = plausible_sweeps(scans, times, keep, notes, log.path)[rows]
    poses = _placed(scans, way, rows, sweeps, notes, log.path)
    drive = Drive(
        log=log,
        notes=notes,
        choice=choice,
        total=len(scans),
        posed=len(rows),
        times_ns=times[rows] + sweeps // 2,
        poses=poses,
        limit=scans.limit,
        zero_ns=zero,
        way=way,
        rows=rows,
        sweeps_ns=sweeps,
        look=look,
    )
    return drive.gated(
        every=options.get("every", 1),
        min_travel=options.get("min_travel") or 0.0,
        min_turn=options.get("min_turn") or 0.0,
        readings_per_pose=options.get("readings_per_pose"),
    )


def _wishes(options: Options) -> Wishes:
    """What the user says of topics, frames and poses."""
    return Wishes(
        scan=options.get("scan") or "",
        pose=options.get("pose") or "",
        map_frame=options.get("map_frame") or "",
        base_frame=options.get("base_frame") or "",
        sensor_pose=options.get("sensor_pose"),
        pose_delay_ns=round((options.get("pose_delay") or 0.0) * SECOND),
        max_gap_ns=round((options.get("max_gap") or MAX_GAP_NS / SECOND) * SECOND),
        odometry=options.get("poses") == "odometry",
    )


def _placed(
    scans: ScanTimes,
    way: Way,
    rows: npt.NDArray[np.intp],
    sweeps: Times,
    notes: Notes,
    path: Path,
) -> npt.NDArray[np.float64]:
    """Poses (n, 3) of the sensor, its attitude noted; sweeps that it cannot be followed in are 0.

    Args:
        scans: of the topic.
        way: where the sensor was.
        rows: (n,) of the scans.
        sweeps: (n,) ns that each took, changed in place.
        notes: where oddities go.
        path: of the log.
    """
    sensor = SENSORS[scans.topic.type]
    poses, upright = np.empty((len(rows), 3)), np.empty(len(rows))
    for part in blocks(len(rows)):
        swept = way.swept(rows[part], sweeps[part])
        sweeps[part], poses[part] = swept.sweeps_ns, flat(swept.matrices, sensor.forward)
        upright[part] = swept.matrices[:, 2, 2]
    if sensor.forward == 2:
        tell_aim(scans, upright, notes, path)
    elif not sensor.solid:
        tell_attitude(scans, upright, notes, path)
    return poses


def frames(
    source: Source, notes: Notes | None = None, **options: Unpack[Options]
) -> Iterator[Frame]:
    """Scans with the poses of their sensor, from a log, a path, or several paths merged by time.

    Raises what open_log and survey raise.
    """
    notes = Notes() if notes is None else notes
    if isinstance(source, str | PathLike | Sequence):
        log = open_log(source, notes)
        try:
            yield from survey(log, notes, **options).frames()
        finally:
            log.close()
    else:
        yield from survey(source, notes, **options).frames()


def _look(log: Log, options: Options) -> Look:
    """What the user says of heights and echoes."""
    low, high = options.get("scan_height") or SLAB
    if not low < high or not isfinite(high - low):
        problem = f"--scan-height {low:g},{high:g} is not from a lower to a higher one"
        raise UsageError(log.path, problem)
    echo = options.get("echo") or "first"
    if echo not in ECHOES:
        raise UsageError(log.path, f"no echo {echo}", hint=f"there are {', '.join(ECHOES)}")
    return Look((low, high), echo)


def _window(since_ns: Times, options: Options) -> npt.NDArray[np.bool_]:
    """Scans that the user asked for, by their time since the start of the log."""
    start, duration = options.get("start_offset") or 0.0, options.get("duration")
    window = np.ones(len(since_ns), dtype=bool)
    if start > 0:
        window &= since_ns >= round(start * SECOND)
    if duration is not None and duration < inf:
        window &= since_ns <= round((start + duration) * SECOND)
    return window


def _chosen(gathered: Gathered, wishes: Wishes) -> tuple[ScanTimes, Clock, Way | None, str]:
    """The scan topic, its clock, its best source of poses, and why this topic."""
    clocks: dict[Topic, Clock] = {}
    found: dict[Topic, list[Way]] = {}
    for topic, scans in gathered.scans.items():
        clocks[topic] = gathered.clock(scans)
        found[topic] = ways(gathered, scans, clocks[topic], wishes) if len(scans) else []
    reach = {t: max((w.share for w in some), default=0.0) for t, some in found.items()}
    standing = [topic for topic, some in found.items() if any(way.registered for way in some)]
    topic, reason = pick_scan(gathered, reach, standing)
    if wishes.scan:
        reason = "as asked for"
    gathered.tree.settle(
        clocks[topic], gathered.zero_ns(gathered.scans[topic], clocks[topic]), wishes.max_gap_ns
    )
    return gathered.scans[topic], clocks[topic], best_way(gathered, found[topic]), reason
