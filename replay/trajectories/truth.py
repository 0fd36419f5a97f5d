"""The poses of a run against the truth: a topic, a TUM file, or a file of relations."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Floats
from formats.relations import read_relations
from formats.stream import survey
from formats.streaming.drive import Drive
from formats.trajectory import Trajectory, read_tum
from replay.trajectories import errors as metrics
from replay.trajectories.relations import relation_errors

FAR = 1.0  # m of way between the two poses of a relative error


class Judged(NamedTuple):
    """What the truth says.

    Attributes:
        line: for people.
        facts: for `--json`, under "pose_errors".
    """

    line: str
    facts: dict[str, Any]


def judge(
    truth: str | PathLike[str],
    drive: Drive,
    notes: Notes,
    *,
    since: int = 0,
    aligned: bool = False,
    delay: float = 0.0,
) -> Judged:
    """Errors of a drive's poses.

    Args:
        truth: a file that ends in .relations; another file: TUM poses of the sensor, as `replay
            export` writes them; else a topic of the log with poses of the robot.
        drive: its poses are judged.
        notes: told of odd lines.
        since: the first frame that counts: when the localiser was certain.
        aligned: move the way onto the truth first, since the two have no common frame.
        delay: s, added to the stamps of the truth.

    Raises:
        UsageError: there is no such file or topic, or no pose counts.
        FormatError: the file cannot be read, or it has no pose at these times.
    """
    estimate = _strict(metrics.planar_trajectory(drive.times_ns, drive.poses))
    path = Path(truth)
    if path.suffix == ".relations":
        return _by_relations(estimate, path)
    if path.is_file():
        reference = _strict(read_tum(path, notes))
        reference = reference._replace(times_ns=reference.times_ns + round(delay * 1e9))
        name = path.name
    else:
        reference, name = _of_topic(drive, str(truth), delay), str(truth)
    first = drive.times_ns[min(since, len(drive) - 1)]
    later = estimate.times_ns >= first
    estimate = Trajectory(estimate.times_ns[later], estimate.numbers[later])
    wanted, known = metrics.interpolated(reference, estimate.times_ns)
    if since >= len(drive) or not known.any():
        never = "the localiser never was certain" if since >= len(drive) else "no pose in time"
        return Judged(f"against {name}: {never}", {"truth": name, "poses": 0})
    wanted = Trajectory(wanted.times_ns[known], wanted.numbers[known])
    estimate = Trajectory(estimate.times_ns[known], estimate.numbers[known])
    how = _alignment(wanted, estimate, name) if aligned else metrics.NO_ALIGNMENT
    return _absolute(wanted, estimate, how, name, aligned)


def _absolute(
    wanted: Trajectory,
    estimate: Trajectory,
    alignment: metrics.Alignment,
    name: str,
    aligned: bool,
) -> Judged:
    whole = metrics.ape(wanted, estimate, alignment)
    metres = metrics.statistics(metrics.lengths(whole))
    turns = metrics.statistics(metrics.degrees(whole))
    count = len(wanted.times_ns)
    line = f"APE {metres.rmse:.3f} m, {turns.rmse:.2f} deg"
    facts: dict[str, Any] = {
        "truth": name,
        "poses": count,
        "aligned": aligned,
        "ape_m": metres._asdict(),
        "ape_deg": turns._asdict(),
    }
    try:
        steps = metrics.rpe(wanted, estimate, FAR, "m")
    except ValueError:  # it did not drive so far
        steps = None
    if steps is not None:
        near = metrics.statistics(metrics.lengths(steps))
        bent = metrics.statistics(metrics.degrees(steps))
        line += f"; RPE {near.rmse:.3f} m, {bent.rmse:.2f} deg a metre"
        facts |= {"rpe_m": near._asdict(), "rpe_deg": bent._asdict()}
    moved = ", aligned" if aligned else ""
    return Judged(f"{line} (rmse of {count} poses against {name}{moved})", facts)


def _by_relations(estimate: Trajectory, path: Path) -> Judged:
    errors = relation_errors(estimate, read_relations(path))
    if not errors.metres.size:
        raise FormatError(path, "no relation is of times that the run reaches")
    metres = metrics.statistics(errors.metres)
    turns = metrics.statistics(np.degrees(errors.radians))
    line = (
        f"{metres.mean:.3f} +- {metres.std:.3f} m, {turns.mean:.2f} +- {turns.std:.2f} deg "
        f"(mean of {errors.metres.size} relations of {path.name}, {errors.missed} beyond the run)"
    )
    facts = {
        "truth": path.name,
        "relations": errors.metres.size,
        "missed": errors.missed,
        "relations_m": metres._asdict(),
        "relations_deg": turns._asdict(),
    }
    return Judged(line, facts)


def _of_topic(drive: Drive, topic: str, delay: float) -> Trajectory:
    """Where the truth has the sensor at the times of the scans."""
    if topic not in {name for t in drive.log.topics() for name in (t.name, t.name.lstrip("/"))}:
        raise UsageError(topic, "there is no such file and no such topic", hint="--truth-poses")
    found = survey(
        drive.log,
        Notes(),
        scan=drive.choice.scan.name,
        pose=topic,
        pose_delay=delay,
        sensor_pose=drive.choice.sensor_pose,
    )
    return _strict(metrics.planar_trajectory(found.times_ns, found.poses))


def _alignment(wanted: Trajectory, estimate: Trajectory, name: str) -> metrics.Alignment:
    try:
        return metrics.umeyama(wanted, estimate)
    except ValueError as error:
        raise UsageError(name, f"cannot be aligned with the poses: {error}") from None


def _strict(trajectory: Trajectory) -> Trajectory:
    """The first pose of each time."""
    keep: Floats = np.concatenate([[True], np.diff(trajectory.times_ns) > 0]).astype(bool)
    return Trajectory(trajectory.times_ns[keep], trajectory.numbers[keep])
