"""A filter run over the sightings of a drive: when it is updated, and what comes of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import hypot
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Particles, Pose, Scan
from replay.localise.amcl import Amcl, Parameters
from replay.localise.doubt import STAYED, fit_of, unsure
from replay.localise.estimate import Estimate, settled
from replay.localise.field import Field
from replay.localise.likelihood import UNIT, BeamModel, LikelihoodField, Model, Reading, pick
from replay.localise.motion import Alphas, wrapped
from replay.localise.options import Options
from replay.localise.poses import Times
from replay.localise.samples import Samples

APART = 0.5  # m between two tracks, beyond which they are two answers
BETTER = 0.97  # of the other's misfit, at which the track from the end is taken
NOTHING = Reading(Pose(0.0, 0.0, 0.0), np.empty(0), np.empty(0), 1.0)


class Sighting(NamedTuple):
    """What a localiser consumes: a scan, and where odometry and the mounting have its sensor.

    Attributes:
        time_ns: of the scan.
        odometry: pose of the body in the frame of the odometry; None where there is none.
        scan: the reading.
        mount: pose of the sensor on the body.
    """

    time_ns: int
    odometry: Pose | None
    scan: Scan
    mount: Pose


@dataclass(frozen=True, eq=False)
class Track:
    """A filter's updates.

    Attributes:
        times_ns: (k,) int64 of the sightings that were used, ascending.
        poses: (k, 3) of the body in the plan's own frame.
        covariances: (k, 3, 3).
        particles: (k,) how many there were.
        doubt: what speaks against the plan, "" where nothing does; the covariances are then of
            being anywhere.
        samples: of the particles now and then, of the body in the plan's own frame; of the way that
            the filter went, like the covariances.
    """

    times_ns: Times
    poses: Floats
    covariances: Floats
    particles: Times
    doubt: str = ""
    samples: tuple[Particles, ...] = ()

    @property
    def settled(self) -> int:
        """The first update from which the particles agree, k where they never do."""
        agree = (k for k, covariance in enumerate(self.covariances) if settled(covariance))
        return next(agree, len(self.times_ns))

    @property
    def ever(self) -> bool:
        """Whether the particles ever agree."""
        return self.settled < len(self.times_ns)

    def reversed(self) -> Track:
        """The same updates from the last to the first."""
        return Track(
            self.times_ns[::-1],
            self.poses[::-1],
            self.covariances[::-1],
            self.particles[::-1],
            samples=self.samples[::-1],
        )

    @property
    def stayed(self) -> float:
        """Share of the updates at which the particles agree."""
        return float(np.mean([settled(covariance) for covariance in self.covariances]))


class Used(NamedTuple):
    """A sighting that a filter is updated with."""

    time_ns: int
    odometry: Pose
    reading: Reading


def on_plan(
    sightings: Iterable[Sighting],
    ground: Field | None,
    start: Estimate | None,
    seed: int,
    options: Options,
) -> Track:
    """`amcl` as the table of localisers has it: where there is a plan."""
    if ground is None:
        raise ValueError("AMCL needs a plan")
    return amcl(sightings, ground, start, seed, options)


def amcl(
    sightings: Iterable[Sighting], field: Field, start: Estimate | None, seed: int, options: Options
) -> Track:
    """Adaptive Monte Carlo localisation.

    From a global start, what came before the particles agreed is localised again, backwards from
    there, so that the track is right from its first pose. The covariances stay those of the way
    that the filter went. A corridor that looks the same from both ends is told apart only where
    the robot leaves it, so that the whole drive is also localised from its end; where the two
    tracks lie apart, the one from which the readings fit better is taken.

    Particles gather on any plan: where the readings do not fit the plan from the track, or the
    particles agreed for moments only, the track is doubted.
    """
    used = list(gated(sightings, options))
    if start is not None:
        found = _track(*_followed(used, field, start, seed, options))
    else:
        found = _better(used, field, seed, options)
    doubt = fit_of(field, found.poses, (one.reading for one in used)).doubt
    if start is None and found.ever and found.stayed < STAYED:
        doubt = doubt or f"it was certain at {found.stayed:.0%} of its updates only"
    if not (doubt and found.ever):
        return found
    return replace(found, covariances=unsure(field, found.poses), doubt=doubt)


def _better(used: list[Used], field: Field, seed: int, options: Options) -> Track:
    """From the start or from the end: where they lie apart, the track that the readings fit."""
    ahead = _track(*_followed(used, field, None, seed, options))
    behind = _track(*_followed(used[::-1], field, None, seed + 2, options)).reversed()
    if not behind.ever:
        return ahead
    if ahead.ever and _apart(ahead, behind) < APART:
        return ahead if ahead.stayed >= STAYED else max(ahead, behind, key=lambda one: one.stayed)
    if not ahead.ever or _misfit(behind, used, field, options) < BETTER * _misfit(
        ahead, used, field, options
    ):
        return behind
    return ahead


def _apart(a: Track, b: Track) -> float:
    """Median of the distances between two tracks of the same updates, m."""
    return float(np.median(np.hypot(*(a.poses - b.poses)[:, :2].T)))


def _misfit(track: Track, used: list[Used], field: Field, options: Options) -> float:
    """Mean cost of a beam from the poses of a track, nats."""
    model, costs, beams = sensor_model(field, options), 0, 0
    for pose, one in zip(track.poses, used, strict=True):
        if one.reading.ranges.size:
            costs += int(model.costs(pose[None], one.reading)[0])
            beams += one.reading.ranges.size
    return costs / (UNIT * max(beams, 1))


def _followed(
    sightings: Iterable[Used], field: Field, start: Estimate | None, seed: int, options: Options
) -> tuple[list[int], list[Estimate], list[int], tuple[Particles, ...]]:
    """Times, estimates, numbers and samples of particles of all updates, in their order."""
    model, settings = sensor_model(field, options), parameters(options)
    coarse = sensor_model(field, {**options, "sigma_hit": 2.0 * options["sigma_hit"]})
    ahead = Amcl(field, model, settings, coarse=coarse, start=start, seed=seed)
    used: list[Used] = []
    found: list[Estimate] = []
    particles: list[int] = []
    samples = Samples()
    agreed = start is not None
    for one in sightings:
        found.append(ahead.update(one.odometry, one.reading))
        particles.append(len(ahead.particles))
        samples.offer(one.time_ns, ahead.particles, ahead.weights)
        # Readings are held until the particles agree, since they are needed backwards.
        used.append(one._replace(reading=NOTHING) if agreed else one)
        if not agreed and found[-1].settled:
            agreed = True
            back = Amcl(field, model, settings, start=found[-1], seed=seed + 1)
            back.update(one.odometry, NOTHING)
            for k in range(len(found) - 2, -1, -1):
                pose = back.update(used[k].odometry, used[k].reading).pose
                found[k] = found[k]._replace(pose=pose)
    times = [one.time_ns for one in used]
    shown = samples.finished(times[-1], ahead.particles, ahead.weights) if times else ()
    return times, found, particles, shown


def _track(
    times: list[int], found: list[Estimate], particles: list[int], samples: tuple[Particles, ...]
) -> Track:
    return Track(
        np.array(times, dtype=np.int64),
        np.array([one.pose for one in found]).reshape(-1, 3),
        np.array([one.covariance for one in found]).reshape(-1, 3, 3),
        np.array(particles, dtype=np.int64),
        samples=samples,
    )


def gated(sightings: Iterable[Sighting], options: Options) -> Iterator[Used]:
    """The first sighting, and those after the body has moved by update_min_d or update_min_a."""
    last: Pose | None = None
    for time_ns, odometry, scan, mount in sightings:
        if odometry is None:
            raise ValueError("the motion model needs odometry")
        if last is not None and not moved_on(last, odometry, options):
            continue
        reading = pick(
            scan,
            mount,
            options["max_beams"],
            laser_min_range=options["laser_min_range"],
            laser_max_range=options["laser_max_range"],
        )
        last = odometry
        yield Used(time_ns, odometry, reading)


def moved_on(last: Pose, now: Pose, options: Options) -> bool:
    """Whether it is time for the next update: by update_min_d or by update_min_a."""
    far = hypot(now.x - last.x, now.y - last.y)
    turned = abs(wrapped(now.yaw - last.yaw))
    return far >= options["update_min_d"] or turned >= options["update_min_a"]


def steps(odometry: Floats, options: Options) -> npt.NDArray[np.int64]:
    """Numbers of the first of these poses (m, 3) and of those after the body has moved on."""
    taken: list[int] = []
    last: Pose | None = None
    for k, numbers in enumerate(odometry.tolist()):
        now = Pose(*numbers)
        if last is None or moved_on(last, now, options):
            last = now
            taken.append(k)
    return np.array(taken, dtype=np.int64)


def sensor_model(field: Field, options: Options) -> Model:
    """The sensor model that the options name."""
    if options["laser_model_type"] == "beam":
        return BeamModel(
            field,
            z_hit=options["z_hit"],
            z_short=options["z_short"],
            z_max=options["z_max"],
            z_rand=options["z_rand"],
            sigma_hit=options["sigma_hit"],
            lambda_short=options["lambda_short"],
        )
    return LikelihoodField(
        field,
        z_hit=options["z_hit"],
        z_rand=options["z_rand"],
        sigma_hit=options["sigma_hit"],
        laser_likelihood_max_dist=options["laser_likelihood_max_dist"],
    )


def parameters(options: Options) -> Parameters:
    """Those of the filter."""
    return Parameters(
        alphas=Alphas(options["alpha1"], options["alpha2"], options["alpha3"], options["alpha4"]),
        min_particles=options["min_particles"],
        max_particles=options["max_particles"],
        global_particles=options["global_particles"],
        pf_err=options["pf_err"],
        pf_z=options["pf_z"],
        resample_interval=options["resample_interval"],
        recovery_alpha_slow=options["recovery_alpha_slow"],
        recovery_alpha_fast=options["recovery_alpha_fast"],
        effective_beams=options["effective_beams"],
    )
