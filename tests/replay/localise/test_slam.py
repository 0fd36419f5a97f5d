"""Scan matching and FastSLAM in a simulated office, with bad odometry and without any."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import Notes
from formats.frame import Floats, Pose, Scan
from formats.plans.file import open_plan
from replay.localise.estimate import Estimate
from replay.localise.field import Field, build_field
from replay.localise.options import DEFAULTS, Options
from replay.localise.slam import fastslam, match_scans
from replay.localise.tracking import Sighting, Track
from tests.localising import OFFICE, ROUND, WIDE, drifting, drive, way
from tests.worlds import world_png

TRUTH = way(ROUND)


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Field:
    path = world_png(tmp_path_factory.mktemp("office") / "office.png", OFFICE)
    return build_field(open_plan(path, Notes(), resolution=WIDE))


def options(**changed: Any) -> Options:
    return {**DEFAULTS, **changed}  # type: ignore[typeddict-item]


def sightings(odometry: bool = True, noise: float = 0.1, seed: int = 0) -> list[Sighting]:
    said = drifting(TRUTH, seed, noise)
    found = list(drive(OFFICE, TRUTH, said, seed=seed, cell=WIDE))
    return found if odometry else [one._replace(odometry=None) for one in found]


def off(track: Track, truth: list[Pose] = TRUTH, *, from_start: bool = True) -> Floats:
    """m at each update; both ways moved so that they start at the same pose, unless on a plan."""
    rows = track.times_ns // 100_000_000
    wanted = [truth[row] for row in rows]
    first = Pose(*track.poses[0].tolist())
    move = wanted[0] @ first.inverse() if from_start else Pose(0, 0, 0)
    found = [move @ Pose(*pose.tolist()) for pose in track.poses]
    return np.array([np.hypot(a.x - b.x, a.y - b.y) for a, b in zip(found, wanted, strict=True)])


def drift() -> float:
    """m that the odometry alone is off at the end."""
    said = drifting(TRUTH)
    end = TRUTH[0] @ said[0].inverse() @ said[-1]
    return float(np.hypot(end.x - TRUTH[-1].x, end.y - TRUTH[-1].y))


def test_matching_takes_out_the_drift_of_the_odometry() -> None:
    error = off(match_scans(sightings(), None, None, 0, options()))
    assert drift() > 2.0
    assert error.max() < 0.15  # over 25 m
    assert np.sqrt(np.mean(error**2)) < 0.08


def test_matching_needs_no_odometry() -> None:
    track = match_scans(sightings(odometry=False), None, None, 0, options())
    assert len(track.times_ns) == len(TRUTH)  # every scan
    assert off(track).max() < 0.25  # 1 % of the way


def test_on_a_plan_a_match_starts_where_it_is_told_and_stays_on_it(office: Field) -> None:
    start = Estimate(TRUTH[0] @ Pose(0.15, -0.1, 0.1), np.diag([0.04, 0.04, 0.02]))
    error = off(match_scans(sightings(), office, start, 0, options()), from_start=False)
    assert error[1:].max() < 0.08
    assert np.sqrt(np.mean(error[1:] ** 2)) < 0.04


def test_walls_that_are_drawn_and_not_there_are_taken_back(tmp_path: Path) -> None:
    """A plan with one wall too many: the way through it is still found."""
    lines = [line for line in OFFICE.splitlines() if line]
    lines[4] = lines[4][:8] + "#" + lines[4][9:]  # shuts the door between the first two rooms
    lines[9] = lines[9][:8] + "##" + lines[9][10:]
    path = world_png(tmp_path / "wrong.png", "\n".join(lines))
    ground = build_field(open_plan(path, Notes(), resolution=WIDE))
    start = Estimate(TRUTH[0], np.diag([0.01, 0.01, 0.005]))
    for found in (match_scans, fastslam):
        track = found(sightings(), ground, start, 0, options(particles=10))
        assert off(track, from_start=False).max() < 0.1


def test_fastslam_follows_the_robot() -> None:
    track = fastslam(sightings(), None, None, 1, options(particles=15))
    error = off(track)
    assert error.max() < 0.12
    assert np.sqrt(np.mean(error**2)) < 0.06
    assert np.all(track.particles == 15)


def test_fastslam_is_better_off_with_a_plan(office: Field) -> None:
    start = Estimate(TRUTH[0], np.diag([0.02, 0.02, 0.01]))
    track = fastslam(sightings(), office, start, 1, options(particles=15))
    error = off(track, from_start=False)
    assert error.max() < 0.12
    assert np.sqrt(np.mean(error**2)) < 0.05


def test_the_same_seed_gives_the_same_bits() -> None:
    some = sightings()[:60]
    a, b, c = (fastslam(some, None, None, seed, options(particles=8)) for seed in (4, 4, 5))
    assert np.array_equal(a.poses, b.poses)
    assert np.array_equal(a.covariances, b.covariances)
    assert not np.array_equal(a.poses, c.poses)


def test_covariances_are_covariances() -> None:
    for found in (match_scans, fastslam):
        track = found(sightings(), None, None, 0, options(particles=8))
        assert np.allclose(track.covariances, track.covariances.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(track.covariances).min() >= -1e-12
        assert np.sqrt(track.covariances[:, 0, 0]).max() < 0.3


def scan(one: Sighting, **changed: Any) -> Sighting:
    return one._replace(scan=replace(one.scan, **changed))


def blind(one: Sighting) -> Sighting:
    """All beams nan."""
    return scan(one, ranges=np.full_like(one.scan.ranges, nan))


def empty(one: Sighting) -> Sighting:
    """No beams at all."""
    none = np.empty(0)
    return one._replace(scan=Scan(none, none, none.astype(np.float32), 0.05, 12.0))


def odd(one: Sighting) -> Sighting:
    """Some beams nan, infinite, negative, zero or beyond the sensor."""
    ranges = one.scan.ranges.copy()
    ranges[::9] = [nan, np.inf, -np.inf, -1.0, 0.0, 1e30, 13.0, nan, 1e-9, np.inf]
    return scan(one, ranges=ranges)


@pytest.mark.parametrize("change", [blind, empty, odd])
@pytest.mark.parametrize("odometry", [True, False])
def test_bad_readings_are_borne(change: Any, odometry: bool) -> None:
    """Every fifth scan is bad, and so is the first where it may be."""
    some = sightings(odometry)
    bad = [change(one) if k % 5 == (0 if odometry else 2) else one for k, one in enumerate(some)]
    found: Iterable[Any] = (match_scans, fastslam) if odometry else (match_scans,)
    for each in found:
        track = each(bad, None, None, 0, options(particles=8))
        assert np.isfinite(track.poses).all()
        assert off(track).max() < 0.25


def test_a_gap_is_bridged_by_odometry() -> None:
    """15 scans are missing, 1.5 m of the way."""
    some = sightings()
    track = match_scans(some[:30] + some[45:], None, None, 0, options())
    assert off(track).max() < 0.15


def test_sureness_is_lost_where_nothing_is_seen() -> None:
    """Variances of steps add up, of which the least is 3 cm: by hand."""
    some = [blind(one) for one in sightings()]
    track = match_scans(some, None, None, 0, options())
    spread = np.sqrt(track.covariances[:, 0, 0])
    assert (np.diff(spread) > 0.0).all()
    assert spread[-1] >= 0.03 * np.sqrt(len(spread) - 1)
    seen = match_scans(sightings(), None, None, 0, options())
    assert np.sqrt(seen.covariances[-1, 0, 0]) < 0.5 * spread[-1]


@pytest.mark.parametrize("found", [match_scans, fastslam])
def test_a_long_way_between_two_scans_makes_no_map_beyond_it(found: Any) -> None:
    """Carried 2 km off: however the heading is off, the place is not by more than the way."""
    some = sightings()[:40]
    far = [
        one._replace(odometry=Pose(2000.0, 0.0, 0.0) @ one.odometry) if k >= 20 else one
        for k, one in enumerate(some)
        if one.odometry is not None
    ]
    track = found(far, None, None, 0, options(particles=4))
    assert np.isfinite(track.poses).all()
    assert np.abs(track.poses).max() < 20_000.0


def test_nothing_in_nothing_out() -> None:
    for found in (match_scans, fastslam):
        assert len(found([], None, None, 0, options(particles=3)).times_ns) == 0
