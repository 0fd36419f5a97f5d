"""The depth camera against planes by hand, and against the lidar through our own reader."""

from __future__ import annotations

from math import inf, radians
from typing import Any

import numpy as np
import pytest

from formats import log_messages as ros
from formats.decoding import decoder_of
from formats.depth.scans import depth_scan
from formats.frame import Pose
from formats.log import Topic
from replay.simulator.camera import Camera, depths, picture
from replay.simulator.casting import cast
from replay.simulator.sensors import QUIET, Noise
from replay.simulator.site import Site
from tests.depth_worlds import camera_at
from tests.replay.simulator.test_casting import room

SMALL = Camera(width=64, height_px=48, focal=52.5, max_range=8.0, noise=QUIET)


def wall_ahead(distance: float = 3.0) -> Site:
    """A wall across x at a distance from the origin, endless to the sides."""
    solid = np.zeros((400, 40), dtype=bool)
    solid[:, -1] = True
    return Site.of(solid, 0.1, distance - 3.9, -20.0)


def test_a_wall_the_floor_and_the_ceiling_by_hand() -> None:
    found = depths(SMALL, wall_ahead(3.0), Pose(0.0, 0.0, 0.0))
    v = np.arange(48) - 23.5
    floor = np.divide(0.6 * 52.5, v, out=np.full(48, inf), where=v > 0)
    ceiling = np.divide(1.9 * 52.5, -v, out=np.full(48, inf), where=v < 0)
    expected = np.minimum(3.0, np.minimum(floor, ceiling))
    # A depth is along the optical axis: over a wall square to it, it is the same in every column.
    assert found == pytest.approx(np.repeat(expected[:, None], 64, axis=1))


def test_looking_down_by_hand() -> None:
    down = Camera(width=3, height_px=3, focal=1.0, pitch=radians(30.0), noise=QUIET, max_range=9.0)
    found = depths(down, wall_ahead(3.0), Pose(0.0, 0.0, 0.0))
    # The middle ray falls by 30 degrees: from 0.6 m it meets the floor after 1.2 m.
    assert found[1, 1] == pytest.approx(1.2)
    # The upper one rises by 15 degrees and meets the wall, 3 m off: its depth along the axis.
    assert found[0, 1] == pytest.approx(3.0 / (np.cos(radians(15)) * 2**0.5))


def test_turned_and_beside_by_hand() -> None:
    found = depths(SMALL, wall_ahead(3.0), Pose(1.0, 5.0, radians(45.0)))
    column = 31.5 / 52.5  # tangent of the last column's angle, to the right
    assert found[23, 63] == pytest.approx(2.0 * 2**0.5 / (1 + column))
    assert found[23, 31] == pytest.approx(2.0 * 2**0.5 / (1 + 0.5 / 52.5 * -1), rel=0.02)


def test_a_picture_is_in_mm_and_0_where_there_is_nothing() -> None:
    near = Camera(width=8, height_px=6, focal=6.0, min_range=1.0, max_range=2.5, noise=QUIET)
    found = picture(near, wall_ahead(2.0), Pose(0.0, 0.0, 0.0), np.random.default_rng(0))
    assert found.dtype == np.uint16
    assert (found[2] == 2000).all()
    assert set(
        np.unique(picture(near, wall_ahead(3.0), Pose(0, 0, 0), np.random.default_rng(0)))
    ) <= {
        0,
        *range(1000, 2501),
    }
    assert (picture(near, wall_ahead(0.9), Pose(0, 0, 0), np.random.default_rng(0)) == 0).all()


def test_noise_grows_with_the_square_of_the_depth_and_drops_out() -> None:
    noisy = Camera(width=300, height_px=2, focal=300.0, noise=Noise(0.0, 2e-3, 0.1, 0.0))
    rng = np.random.default_rng(2)
    for distance in (1.0, 3.0):
        many = [picture(noisy, wall_ahead(distance), Pose(0, 0, 0), rng) for _ in range(100)]
        found = np.array(many).astype(float)
        assert (found == 0).mean() == pytest.approx(0.1, abs=0.01)
        spread = found[found > 0].std()
        assert spread == pytest.approx(
            (4.0 * distance**4 + 1 / 12) ** 0.5, rel=0.03
        )  # and whole mm


def test_neighbours_err_alike() -> None:
    blocks = Camera(width=90, height_px=90, focal=900.0, noise=Noise(0.0, 2e-3, 0.0, 0.0, 9))
    found = picture(blocks, wall_ahead(3.0), Pose(0, 0, 0), np.random.default_rng(2))
    tiles = found.reshape(10, 9, 10, 9).transpose(0, 2, 1, 3).reshape(100, 81)
    assert (tiles == tiles[:, :1]).all()
    assert tiles[:, 0].std() == pytest.approx(18.0, rel=0.25)


def decoded(kind: str, data: bytes) -> Any:
    """By our own reader."""
    decode = decoder_of(Topic("/x", kind, "cdr"))
    assert decode is not None
    return decode(data)


@pytest.mark.parametrize("pitch", [0.0, 0.15])
def test_what_our_reader_makes_of_it_is_what_a_lidar_sees(pitch: float) -> None:
    pose = Pose(1.0, 4.0, 0.4)
    camera = Camera(160, 120, 131.25, max_range=12.0, pitch=pitch, noise=QUIET)
    rng = np.random.default_rng(0)
    pixels = picture(camera, room(), pose, rng)
    image = decoded(ros.IMAGE, ros.depth_image(0, "camera", pixels))
    lens = camera.focal, camera.centre
    info = decoded(ros.CAMERA_INFO, ros.camera_info(0, "camera", (160, 120), *lens))
    scan = depth_scan(image, info, camera_at(camera.height, pitch=pitch))
    seen = np.isfinite(scan.ranges)
    assert seen.mean() > 0.9
    expected = cast(room(), pose, scan.bearings[seen], 12.0)
    # A beam is one column wide, up to 0.4 degrees: at a slant its points differ by 2 %.
    assert np.abs(scan.ranges[seen] - expected).max() < 0.03 + 0.02 * expected.max()
    assert np.median(scan.ranges[seen] - expected) == pytest.approx(0.0, abs=0.02)
