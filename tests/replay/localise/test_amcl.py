from __future__ import annotations

from itertools import chain
from math import pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import Notes
from formats.frame import Floats, Pose
from formats.plans.file import open_plan
from replay.localise.amcl import Amcl, Parameters
from replay.localise.estimate import Estimate, settled, summary
from replay.localise.field import Field, build_field
from replay.localise.likelihood import LikelihoodField, pick
from replay.localise.options import DEFAULTS, Options
from replay.localise.tracking import NOTHING, Track, amcl, gated
from tests.localising import CELL, MOUNT, OFFICE, TOUR, drifting, drive, way
from tests.worlds import world_png

FINE = 5  # plan pixels along a character


def field_of(folder: Path, text: str) -> Field:
    lines = [line for line in text.splitlines() if line]
    fine = "\n".join("".join(c * FINE for c in line) for line in lines for _ in range(FINE))
    return build_field(
        open_plan(world_png(folder / "p.png", fine), Notes(), resolution=CELL / FINE)
    )


@pytest.fixture
def office(tmp_path: Path) -> Field:
    return field_of(tmp_path, OFFICE)


def options(**changed: Any) -> Options:
    return {**DEFAULTS, **changed}  # type: ignore[typeddict-item]


def errors(track: Track, truth: list[Pose]) -> tuple[Floats, Floats]:
    """m and rad at every update."""
    wanted = np.array([truth[k] for k in track.times_ns // 100_000_000])
    off = track.poses - wanted
    turn = np.abs(np.mod(off[:, 2] + pi, 2 * pi) - pi)
    return np.hypot(off[:, 0], off[:, 1]), turn


@pytest.mark.parametrize("model", ["likelihood_field", "beam"])
def test_from_a_rough_start_bad_odometry_is_put_right(office: Field, model: Any) -> None:
    truth = way(TOUR)
    said = drifting(truth)
    drift = said[0].inverse() @ said[-1], truth[0].inverse() @ truth[-1]
    assert np.hypot(drift[0].x - drift[1].x, drift[0].y - drift[1].y) > 0.25
    first = truth[0] @ Pose(0.2, -0.2, 0.1)
    start = Estimate(first, np.diag([0.09, 0.09, 0.03]))
    track = amcl(drive(OFFICE, truth, said), office, start, 1, options(laser_model_type=model))
    places, turns = errors(track, truth)
    assert places[3:].max() < 0.12
    assert np.sqrt(np.mean(places[3:] ** 2)) < 0.06
    assert turns[3:].max() < radians(4)
    assert track.settled == 0 or track.settled < 4


def test_from_anywhere_the_place_is_found_and_the_way_to_it(office: Field) -> None:
    truth = way(TOUR)
    for seed in range(5):
        track = amcl(
            drive(OFFICE, truth, drifting(truth, seed), seed=seed), office, None, seed, options()
        )
        assert track.settled < len(track.times_ns) / 2
        places, turns = errors(track, truth)
        assert places.max() < 0.3  # before it was certain, too: localised backwards
        assert np.sqrt(np.mean(places[track.settled :] ** 2)) < 0.10  # the goal on real logs
        assert turns[track.settled :].max() < radians(5)


def test_the_same_seed_gives_the_same_bits(office: Field) -> None:
    truth = way(TOUR)[:60]
    runs = [
        amcl(drive(OFFICE, truth, drifting(truth)), office, None, seed, options())
        for seed in (3, 3, 4)
    ]
    assert np.array_equal(runs[0].poses, runs[1].poses)
    assert np.array_equal(runs[0].covariances, runs[1].covariances)
    assert np.array_equal(runs[0].particles, runs[1].particles)
    assert not np.array_equal(runs[0].poses, runs[2].poses)


def test_a_robot_that_was_carried_off_is_found_again(office: Field) -> None:
    """Odometry knows nothing of it: particles are drawn anew from where the reading fits."""
    first, second = way(TOUR[:4]), way(TOUR[-1:3:-1] + TOUR[4:] + TOUR[-2:1:-1])
    truth = first + second
    said = drifting(first)
    onward = drifting(second)
    back = said[-1] @ onward[0].inverse()
    said += [back @ pose for pose in onward]
    start = Estimate(truth[0], np.diag([0.01, 0.01, 0.01]))
    alphas = {"recovery_alpha_slow": 0.001, "recovery_alpha_fast": 0.1}
    track = amcl(drive(OFFICE, truth, said), office, start, 1, options(**alphas))
    places, _ = errors(track, truth)
    carried_off = np.searchsorted(track.times_ns // 100_000_000, len(first))
    assert places[carried_off - 1] < 0.1
    assert places[carried_off] > 1.0
    assert places[-5:].max() < 0.1
    never = amcl(drive(OFFICE, truth, said), office, start, 1, options())
    assert errors(never, truth)[0][-5:].min() > 0.5


TWINS = """
################
#....#..#......#
#..............#
#..............#
#......#..#....#
################
"""


def test_a_building_that_looks_the_same_turned_round_stays_undecided(tmp_path: Path) -> None:
    field = field_of(tmp_path, TWINS)
    truth = way([(0.6, 0.7), (2.0, 0.7), (3.2, 0.8), (2.0, 0.7), (0.8, 0.7)])
    for seed in range(3):
        track = amcl(drive(TWINS, truth, drifting(truth)), field, None, seed, options())
        assert track.settled == len(track.times_ns)


def test_updates_come_when_the_body_has_moved() -> None:
    truth = [Pose(0.1 * k, 0, 0) for k in range(6)] + [Pose(0.5, 0, 0.09 * k) for k in range(1, 6)]
    some = drive("###\n#.#\n###", truth, truth)
    used = [one.time_ns // 100_000_000 for one in gated(some, options())]
    assert used == [0, 3, 8]  # 0.3 m; 0.2 m and 0.27 rad


def test_particles_shrink_as_they_agree_and_never_leave_the_limits(office: Field) -> None:
    truth = way(TOUR)
    wish = options(min_particles=300, max_particles=700, global_particles=5000)
    track = amcl(drive(OFFICE, truth, drifting(truth)), office, None, 0, wish)
    assert track.particles.max() <= 5000
    assert track.particles[: track.settled - 2].min() >= 1250
    assert track.particles[track.settled :].max() <= 700
    assert track.particles.min() == 300


def test_a_reading_without_hits_moves_but_does_not_weigh(office: Field) -> None:
    filtering = Amcl(
        office,
        LikelihoodField(office),
        Parameters(min_particles=2000, max_particles=2000),
        start=Estimate(Pose(2, 2, 0.5), np.diag([0.01, 0.02, 0.001])),
    )
    before = filtering.particles.copy()
    estimate = filtering.update(Pose(0, 0, 0), NOTHING)
    assert np.array_equal(filtering.particles, before)
    assert estimate.pose == pytest.approx((2, 2, 0.5), abs=0.02)
    assert np.sqrt(np.diag(estimate.covariance)) == pytest.approx(
        np.sqrt([0.01, 0.02, 0.001]), rel=0.06
    )


def test_the_summary_is_of_the_heaviest_cluster_and_spreads_over_all() -> None:
    particles = np.array([[1.0, 1.0, pi - 0.1], [1.2, 1.0, 0.1 - pi], [5.0, 1.1, 0.0]])
    estimate = summary(particles, np.array([0.3, 0.3, 0.4]))
    assert estimate.pose[:2] == pytest.approx((5.0, 1.1))  # one bin outweighs each of two
    estimate = summary(particles, np.array([0.4, 0.4, 0.2]))
    assert estimate.pose[:2] == pytest.approx((1.1, 1.0))
    assert abs(estimate.pose.yaw) == pytest.approx(pi)
    assert estimate.covariance[0, 0] == pytest.approx(0.4 * 0.01 * 2 + 0.2 * 3.9**2)
    assert estimate.covariance[2, 2] == pytest.approx(0.4 * 0.01 * 2 + 0.2 * pi**2)
    assert not estimate.settled


def test_settled_is_below_0_3_m_and_10_degrees() -> None:
    place, turn = 0.29**2, radians(9.9) ** 2
    assert settled(np.diag([place, place, turn]))
    assert not settled(np.diag([place, 0.31**2, turn]))
    assert not settled(np.diag([place, place, radians(10.1) ** 2]))
    long = np.array([[0.05, 0.045, 0.0], [0.045, 0.05, 0.0], [0.0, 0.0, turn]])
    assert not settled(long)  # 0.31 m along the diagonal


def test_resampling_now_and_then_keeps_the_weights(office: Field) -> None:
    truth = way(TOUR)[:40]
    model = LikelihoodField(office)
    start = Estimate(truth[0], np.diag([0.04, 0.04, 0.01]))
    filtering = Amcl(office, model, Parameters(resample_interval=2), start=start)
    kept = []
    for sighting in chain(drive(OFFICE, truth, truth)):
        assert sighting.odometry is not None
        filtering.update(sighting.odometry, pick(sighting.scan, MOUNT, 30))
        kept.append(float(np.ptp(filtering.weights)))
    assert all(spread > 0 for spread in kept[::2])
    assert all(spread == 0 for spread in kept[1::2])
