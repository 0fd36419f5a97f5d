"""Poses against a map that grows: scan matching, and FastSLAM with a map for each particle.

Both start from the plan's walls where there is a plan, and take them back where scans show that
they are not there; without a plan the map starts empty. `match` has one map. `fastslam` is the
Rao-Blackwellised filter of Grisetti, Stachniss and Burgard (T-RO 2007): each particle's pose is
drawn around the best match of the reading with the particle's own map, its weight is the evidence
of the reading, and particles are resampled when they have become unequal (Neff below one half).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import hypot, pi
from typing import Any, NamedTuple

import numpy as np

from formats.frame import Floats, Pose
from replay.localise.estimate import Estimate
from replay.localise.field import Field
from replay.localise.likelihood import Reading, pick
from replay.localise.matching import Match, Matches, match, polish
from replay.localise.motion import Alphas, move_between, spreads
from replay.localise.options import Options
from replay.localise.pool import CELL
from replay.localise.resampling import systematic
from replay.localise.samples import Samples
from replay.localise.tiles import Maps
from replay.localise.tracking import Sighting, Track, moved_on

LEAST_M, LEAST_RAD = 0.03, 0.02  # deviations of a step by odometry, however short
UNKNOWN_M, UNKNOWN_RAD = 0.1, 0.15  # of a step without odometry, from that before
STEADY = 2.0  # standard deviations of the motion that a search reaches, at least
SHARP = 9.0  # times the information of a match: how surely a pose is drawn around it
POOR = 0.8  # of the usual fit, below which a particle searches instead of only polishing
# Of a reading's evidence that weighs. Readings that overlap are not independent: with all of it
# particles are weeded out by noise, and none is left whose map closes when a loop does.
SHARE = 0.1
SLOW = 0.05  # of each reading in the usual fit
ROUNDS = 3  # of smoothing
TIGHT = np.array([0.05, 0.05, 0.02])  # m, m, rad, that a pose is moved to fit the whole map
EXACT = np.full(3, 1e-3)
HERE = Pose(0.0, 0.0, 0.0)


class Looked(NamedTuple):
    """A sighting that is matched.

    Attributes:
        time_ns: of the scan.
        odometry: of the body; None where there is none.
        reading: beams to match.
        whole: all beams that hit something.
    """

    time_ns: int
    odometry: Pose | None
    reading: Reading
    whole: Reading


def match_scans(
    sightings: Iterable[Sighting],
    ground: Field | None,
    start: Estimate | None,
    seed: int,
    options: Options,
) -> Track:
    """Each scan against the map of all before; with odometry as the guess, or without.

    With odometry, scans are matched when the body has moved by update_min_d or update_min_a;
    without it all of them are, and those at such distances go into the map.
    """
    maps, track = maps_on(ground, 1), _Recorded()
    pose, step, last, kept = HERE, HERE, None, None
    covariance: Floats = np.zeros((3, 3))
    for one in looked(sightings, options):
        if last is None:
            pose, deviations = _first(one, ground, start)
        else:
            step = _moved(last, one) or step
            pose, deviations = pose @ step, _deviations(last, one, options)
        guess = np.array(pose)
        found = Match(guess, 0.0, 0.0, np.diag(deviations**-2.0))
        if one.reading.ranges.size and (last is not None or ground is not None):
            window = max(options["match_window"], STEADY * float(deviations[:2].max()))
            angle = max(options["match_angle"], STEADY * float(deviations[2]))
            ends = one.reading.points
            found = match(maps, 0, guess, ends, deviations, min(window, 5.0), min(angle, 3.2))
        now = Pose(*found.pose.tolist())
        step = (pose @ step.inverse()).inverse() @ now if last is not None else HERE
        pose, last = now, one
        if kept is None or one.odometry is not None or moved_on(kept, pose, options):
            kept = pose
            insert(maps, found.pose[None], one.whole)
        covariance = _updated(covariance, deviations, found)
        track.add(one.time_ns, found.pose, covariance, 1)
    return track.finished()


def fastslam(
    sightings: Iterable[Sighting],
    ground: Field | None,
    start: Estimate | None,
    seed: int,
    options: Options,
) -> Track:
    """The Rao-Blackwellised filter; the track of the particle that explains all readings best."""
    rng, count = np.random.default_rng(seed), options["particles"]
    maps, track = maps_on(ground, count), _Recorded()
    weights, whole = np.zeros(count), np.zeros(count)  # logarithms: since resampling, and ever
    poses, usual, last = np.zeros((count, 3)), 0.0, None
    paths: list[Floats] = []
    parents: list[np.ndarray[tuple[int], np.dtype[np.int64]]] = []
    for one in looked(sightings, options):
        if last is None:
            first, deviations = _first(one, ground, start)
            guesses = np.repeat([first], count, axis=0)
        else:
            step = _moved(last, one) or HERE
            guesses = np.array([Pose(*pose.tolist()) @ step for pose in poses])
            deviations = _deviations(last, one, options)
        noise, fits = rng.standard_normal((count, 3)), np.zeros(count)
        if last is None and ground is None:
            poses = guesses
        else:
            found = _proposed(maps, guesses, one.reading, deviations, POOR * usual)
            covariances, fits = np.linalg.inv(found.information), found.fits
            roots = np.linalg.cholesky(covariances / SHARP)
            poses = found.poses + np.einsum("pij,pj->pi", roots, noise)
            gains = found.worths + 0.5 * np.linalg.slogdet(covariances)[1]
            weights += SHARE * gains
            whole += gains
        usual += (SLOW if usual else 1.0) * (float(fits.mean()) - usual)
        insert(maps, poses, one.whole)
        shares = np.exp(weights - weights.max())
        shares /= shares.sum()
        best = int(np.argmax(whole))
        off = poses - poses[best]
        off[:, 2] = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
        track.add(one.time_ns, poses[best], (shares[:, None] * off).T @ off, count)
        track.last = one.time_ns, poses, shares
        track.samples.offer(*track.last)
        paths.append(poses.copy())
        drawn = np.arange(count)
        if 1.0 / np.sum(shares**2) < 0.5 * count:
            drawn = systematic(shares, count, rng.random())
            maps.keep(drawn)
            poses, whole, weights = poses[drawn], whole[drawn], np.zeros(count)
        parents.append(drawn)
        last = one
    if paths:
        p = int(np.argmax(whole))
        for k in range(len(paths) - 1, -1, -1):
            p = int(parents[k][p])
            track.poses[k] = paths[k][p]
    smooth(track.poses, sightings, ground, options)
    return track.finished()


def smooth(
    poses: list[Floats], sightings: Iterable[Sighting], ground: Field | None, options: Options
) -> None:
    """Polish each pose against the map of all of them, which takes out the noise of sampling.

    Args:
        poses: (3,) of each sighting that is looked at; put right in place.
        sightings: the same again, as often as they are asked for.
        ground: of the plan.
        options: as before.
    """
    maps = maps_on(ground, 1)
    for pose, one in zip(poses, looked(sightings, options), strict=True):
        insert(maps, pose[None], one.whole)
    for left in range(ROUNDS, 0, -1):
        better = maps_on(ground, 1)
        for k, one in enumerate(looked(sightings, options)):
            if one.reading.ranges.size:
                poses[k] = match(maps, 0, poses[k], one.reading.points, TIGHT, 0.0, 0.0).pose
            if left > 1:
                insert(better, poses[k][None], one.whole)
        maps = better


def _proposed(
    maps: Maps, guesses: Floats, reading: Reading, deviations: Floats, poor: float
) -> Matches:
    """The best match near each particle's guess; searched for where polishing fits poorly."""
    n, ends = len(guesses), reading.points
    if not ends.size:
        alone = np.repeat([np.diag(deviations**-2.0)], n, axis=0)
        return Matches(guesses, np.zeros(n), np.zeros(n), alone)
    found = polish(maps, guesses, ends, deviations)
    window = min(STEADY * float(deviations[:2].max()), 1.0)
    angle = min(STEADY * float(deviations[2]), 0.5)
    for p in np.flatnonzero(found.fits < poor).tolist():
        searched = match(maps, p, guesses[p], ends[:, ::2], deviations, window, angle)
        again = match(maps, p, searched.pose, ends, deviations, 0.0, 0.0)
        if again.fit > found.fits[p]:
            found.poses[p], found.information[p] = again.pose, again.information
            found.fits[p], found.worths[p] = again.fit, again.worth
    return found


class _Recorded:
    """A track that grows."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.poses: list[Floats] = []
        self.covariances: list[Floats] = []
        self.particles: list[int] = []
        self.samples = Samples()
        self.last: tuple[int, Floats, Floats] | None = None

    def add(self, time_ns: int, pose: Floats, covariance: Any, particles: int) -> None:
        self.times.append(time_ns)
        self.poses.append(pose.copy())
        self.covariances.append(covariance)
        self.particles.append(particles)

    def finished(self) -> Track:
        return Track(
            np.array(self.times, dtype=np.int64),
            np.array(self.poses).reshape(-1, 3),
            np.array(self.covariances).reshape(-1, 3, 3),
            np.array(self.particles, dtype=np.int64),
            samples=self.samples.finished(*self.last) if self.last else (),
        )


def looked(sightings: Iterable[Sighting], options: Options) -> Iterator[Looked]:
    """The sightings that are matched: after the body has moved on, all where nothing tells."""
    last: Pose | None = None
    near, far = options["laser_min_range"], options["laser_max_range"]
    for time_ns, odometry, scan, mount in sightings:
        if last is not None and odometry is not None and not moved_on(last, odometry, options):
            continue
        last = odometry
        few = pick(scan, mount, options["match_beams"], laser_min_range=near, laser_max_range=far)
        size = scan.ranges.size
        whole = pick(scan, mount, size, laser_min_range=near, laser_max_range=far)
        yield Looked(time_ns, odometry, few, whole)


def maps_on(ground: Field | None, particles: int) -> Maps:
    """Empty maps, or with the faces of the plan's walls in them."""
    maps = Maps(particles)
    if ground is not None:
        g = ground.geometry
        half = max(CELL, g.resolution) / 2
        rows, cols = np.nonzero(np.abs(ground.distance) <= half)
        if rows.size:
            at = np.stack([cols, rows]).astype(np.float64) + 0.5
            maps.draw(*(g.resolution * at + np.array([[g.x], [g.y]])))
    return maps


def insert(maps: Maps, poses: Floats, reading: Reading) -> None:
    """One reading into the map of every particle, each from its own pose (n, 3)."""
    if not reading.ranges.size:
        return
    reach = float(reading.ranges.max()) + hypot(reading.origin.x, reading.origin.y)
    maps.cover(poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach)
    maps.insert(poses, reading.points, np.array(reading.origin[:2]))


def _first(one: Looked, ground: Field | None, start: Estimate | None) -> tuple[Pose, Floats]:
    """Where the way starts, and how surely."""
    if start is not None:
        deviations = np.sqrt(np.maximum(np.diag(start.covariance), 1e-6))
        return start.pose, deviations
    return one.odometry or HERE, EXACT


def _moved(last: Looked, one: Looked) -> Pose | None:
    """What odometry says of the way between two sightings."""
    if last.odometry is None or one.odometry is None:
        return None
    return last.odometry.inverse() @ one.odometry


def _updated(covariance: Floats, deviations: Floats, found: Match) -> Floats:
    """As a Kalman filter's: where matches say nothing, sureness is lost with every step."""
    before = np.linalg.inv(covariance + np.diag(deviations**2.0))
    told = found.information - np.diag(deviations**-2.0)
    after = np.linalg.inv(before + told).astype(np.float64)
    return 0.5 * (after + after.T)


def _deviations(last: Looked, one: Looked, options: Options) -> Floats:
    """(3,) of the step between two sightings: m, m, rad; the same along and across."""
    if last.odometry is None or one.odometry is None:
        return np.array([UNKNOWN_M, UNKNOWN_M, UNKNOWN_RAD])
    alphas = Alphas(*(options[f"alpha{i}"] for i in (1, 2, 3, 4)))  # type: ignore[literal-required]
    move = move_between(last.odometry, one.odometry)
    turn, way, after = spreads(move, alphas)
    # However the heading is off, the place is not by more than twice the way.
    place = max(LEAST_M, hypot(way, move.way * min(turn, 2.0)))
    return np.array([place, place, min(max(LEAST_RAD, hypot(turn, after)), pi)])
