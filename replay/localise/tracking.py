"""A filter run over the sightings of a drive: when it is updated, and what comes of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

import numpy as np

from formats.frame import Floats, Pose, Scan
from replay.localise.amcl import Amcl, Parameters
from replay.localise.estimate import Estimate, settled
from replay.localise.field import Field
from replay.localise.likelihood import BeamModel, LikelihoodField, Model, Reading, pick
from replay.localise.motion import Alphas, wrapped
from replay.localise.options import Options
from replay.localise.poses import Times

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
    """

    times_ns: Times
    poses: Floats
    covariances: Floats
    particles: Times

    @property
    def settled(self) -> int:
        """The first update from which the particles agree, k where they never do."""
        agree = (k for k, covariance in enumerate(self.covariances) if settled(covariance))
        return next(agree, len(self.times_ns))


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
    forward.
    """
    model, settings = sensor_model(field, options), parameters(options)
    coarse = sensor_model(field, {**options, "sigma_hit": 2.0 * options["sigma_hit"]})
    ahead = Amcl(field, model, settings, coarse=coarse, start=start, seed=seed)
    used: list[Used] = []
    found: list[Estimate] = []
    particles: list[int] = []
    agreed = start is not None
    for one in gated(sightings, options):
        found.append(ahead.update(one.odometry, one.reading))
        particles.append(len(ahead.particles))
        # Readings are held until the particles agree, since they are needed backwards.
        used.append(one._replace(reading=NOTHING) if agreed else one)
        if not agreed and found[-1].settled:
            agreed = True
            back = Amcl(field, model, settings, start=found[-1], seed=seed + 1)
            back.update(one.odometry, NOTHING)
            for k in range(len(found) - 2, -1, -1):
                pose = back.update(used[k].odometry, used[k].reading).pose
                found[k] = found[k]._replace(pose=pose)
    return Track(
        np.array([one.time_ns for one in used], dtype=np.int64),
        np.array([one.pose for one in found]).reshape(-1, 3),
        np.array([one.covariance for one in found]).reshape(-1, 3, 3),
        np.array(particles, dtype=np.int64),
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
