"""Lidar and sonar against geometry by hand; noise by its statistics."""

from __future__ import annotations

from dataclasses import replace
from math import cos, inf, pi, radians

import numpy as np
import pytest

from formats.frame import Pose
from replay.simulator.driving import drive
from replay.simulator.frames import frames
from replay.simulator.sensors import QUIET, Lidar, Noise, Sonar, disturbed, lidar_scan, sonar_scan
from replay.simulator.site import Site


def hall(width: float = 4.0) -> Site:
    """Two walls along x, `width` m apart, y = 0 in the middle; open at both ends (20 m)."""
    solid = np.zeros((round((width + 0.2) / 0.1), 200), dtype=bool)
    solid[0] = solid[-1] = True
    return Site.of(solid, 0.1, -10.0, -width / 2 - 0.1)


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_a_lidar_sees_the_walls_beside_it_and_nothing_along_the_hall() -> None:
    scan = lidar_scan(Lidar(8, noise=QUIET, max_range=5.0), hall(), Pose(0.0, 0.5, 0.0), rng())
    assert scan.bearings == pytest.approx(np.arange(8) * pi / 4 - pi)
    root = 2**0.5
    expected = [inf, 2.5 * root, 2.5, 2.5 * root, inf, 1.5 * root, 1.5, 1.5 * root]
    assert scan.ranges == pytest.approx(expected, abs=1e-9)


def test_beams_over_part_of_a_circle_reach_both_its_ends() -> None:
    lidar = Lidar(5, field_of_view=pi)
    assert lidar.bearings == pytest.approx([-pi / 2, -pi / 4, 0.0, pi / 4, pi / 2])
    assert lidar.step == pytest.approx(pi / 4)
    assert Lidar(1, field_of_view=pi).bearings.size == 1


def test_limits_of_a_sensor() -> None:
    lidar = Lidar(4, noise=QUIET, min_range=0.6, max_range=2.0)
    scan = lidar_scan(lidar, hall(), Pose(0.0, 1.5, 0.0), rng())
    assert np.isnan(scan.ranges[3])  # 0.5 m to the wall on the left
    assert scan.ranges[[0, 1, 2]].tolist() == [inf, inf, inf]  # 3.5 m on the right


def test_a_sonar_gives_the_nearest_thing_in_its_cone() -> None:
    sonar = Sonar(angle=radians(60.0), max_range=9.0, noise=QUIET)
    # Towards the wall: straight ahead. Along it: the edge of the cone, 30 degrees off.
    ahead = sonar_scan(sonar, hall(), Pose(0.0, 0.0, pi / 2), rng())
    assert ahead.ranges.tolist() == [pytest.approx(2.0)]
    along = sonar_scan(sonar, hall(), Pose(0.0, 0.0, 0.0), rng())
    assert along.ranges.tolist() == [pytest.approx(2.0 / cos(radians(60.0)))]
    assert along.widths.tolist() == [pytest.approx(radians(60.0))]
    short = sonar_scan(replace(sonar, max_range=1.5), hall(), Pose(0.0, 0.0, 0.0), rng())
    assert short.ranges.tolist() == [inf]


def test_noise_has_its_spread_and_no_bias() -> None:
    found = disturbed(np.full(200_000, 3.0), Noise(0.02, 0.0, 0.0, 0.0), rng())
    assert found.mean() == pytest.approx(3.0, abs=4 * 0.02 / 200_000**0.5)
    assert found.std() == pytest.approx(0.02, rel=0.01)
    deep = disturbed(np.full(200_000, 4.0), Noise(0.0, 0.0015, 0.0, 0.0), rng())
    assert deep.std() == pytest.approx(0.0015 * 16.0, rel=0.01)


def test_drop_outs_have_their_share() -> None:
    found = disturbed(np.full(100_000, 3.0), Noise(0.0, 0.0, 0.03, 0.0), rng())
    assert np.isinf(found).mean() == pytest.approx(0.03, abs=4 * (0.03 * 0.97 / 1e5) ** 0.5)
    assert (found[np.isfinite(found)] == 3.0).all()


def test_mixed_pixels_lie_between_the_two_sides_of_an_edge() -> None:
    true = np.tile(np.repeat([1.0, 3.0], 5), 10_000)
    found = disturbed(true, Noise(0.0, 0.0, 0.0, 0.25), rng())
    at_edge = np.append(true[1:] != true[:-1], False)
    assert (found[~at_edge] == true[~at_edge]).all()
    between = (found > 1.0) & (found < 3.0)
    assert between[at_edge].mean() == pytest.approx(0.25, abs=0.02)
    assert found[between].mean() == pytest.approx(2.0, abs=0.05)


def test_what_is_not_there_stays_so_and_nothing_is_made_up() -> None:
    found = disturbed(np.array([inf, inf, 2.0]), Noise(0.1, 0.1, 0.0, 1.0), rng())
    assert found[:2].tolist() == [inf, inf]
    assert np.isfinite(found[2])


def test_frames_follow_the_drive_and_repeat_by_their_seed() -> None:
    lidar = Lidar(36, rate=5.0, mount=Pose(0.1, 0.0, pi / 2))
    way = drive([(-2.0, 0.0), (2.0, 0.0)], speed=1.0)
    some = list(frames(hall(), way, lidar, seed=3, start_ns=100))
    assert [frame.time_ns for frame in some[:3]] == [100, 200_000_100, 400_000_100]
    assert len(some) == 21
    assert some[5].pose == pytest.approx((-0.9, 0.0, pi / 2))
    again, other = (list(frames(hall(), way, lidar, seed=seed)) for seed in (3, 4))
    assert all(
        np.array_equal(a.scan.ranges, b.scan.ranges) for a, b in zip(some, again, strict=True)
    )
    assert not np.array_equal(some[0].scan.ranges, other[0].scan.ranges)


def test_several_readings_at_each_pose() -> None:
    way = drive([(-1.0, 0.0), (1.0, 0.0)], speed=1.0)
    some = list(frames(hall(), way, Lidar(12, rate=1.0), readings=3))
    assert len(some) == 9
    assert len({frame.pose for frame in some}) == 3
    assert some[0].time_ns == some[2].time_ns
