"""The simulated Kinect: its pixels, and how far its map and a laser's agree."""

from __future__ import annotations

from math import atan2, hypot, tan
from pathlib import Path

import numpy as np
import pytest

from scripts import kinect
from scripts.flat import cast


def test_pixels_are_what_a_ray_meets() -> None:
    """Against the flat's own ray casting, one pixel at a time, and the floor by its angle."""
    _, places = kinect.poses(12.0)
    rng = np.random.default_rng(2)
    for pose in places[::90]:
        found = kinect.seen(pose)
        assert found.shape == (480, 640)
        for v, u in zip(rng.integers(0, 480, 150), rng.integers(0, 640, 150), strict=True):
            below = kinect.PITCH + np.arctan((v - 239.5) / 525)
            ahead = float(np.cos(below) / np.cos(below - kinect.PITCH))
            left = (319.5 - u) / 525
            away = hypot(ahead, left)
            angle = float(pose[2]) + atan2(left, ahead)
            at = kinect.sensor_xy(pose)
            wall = float(cast(kinect.boxes(), *at, np.array([angle]), 60.0)[0]) / away
            height = kinect.HEIGHT if below > 0 else kinect.HEIGHT - kinect.ROOM
            depth = min(wall, height / tan(below) / ahead)
            assert found[v, u] == pytest.approx(depth * 1000, abs=0.51)


@pytest.mark.slow
def test_the_maps_of_a_kinect_at_30_hz_and_of_a_laser_agree(tmp_path: Path) -> None:
    exact, near, walls = kinect.agreement(tmp_path, 20.0)
    assert walls > 500
    assert exact > 0.99
    assert near > 0.999
