"""Clouds -> Scan, against a slow oracle."""

from __future__ import annotations

from math import atan2, hypot, inf, nan, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from formats.depth.scans import cloud_scan, levelled
from formats.messages import Cloud
from tests.depth_worlds import LIMITS, SLAB, Floats


def cloud_oracle(points: Floats, transform: Floats, beams: int) -> Floats:
    """Point by point."""
    level = np.array(levelled(transform, 0))
    nearest = np.full(beams, inf)
    for x, y, z in points[np.isfinite(points).all(axis=1)].tolist():
        ahead, left, height = level[:, :3] @ (x, y, z) + (0, 0, level[2, 3])
        r = hypot(ahead, left)
        if SLAB[0] <= height <= SLAB[1] and LIMITS[0] <= r <= LIMITS[1]:
            beam = min(int((atan2(left, ahead) + pi) / (2 * pi) * beams), beams - 1)
            nearest[beam] = min(nearest[beam], r)
    return np.where(nearest == inf, nan, nearest)


@given(
    seed=st.integers(0, 2**32 - 1),
    roll=st.floats(-0.5, 0.5),
    pitch=st.floats(-0.5, 0.5),
    kind=st.sampled_from([np.float32, np.float64]),
    odd=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_clouds_equal_the_oracle(
    seed: int, roll: float, pitch: float, kind: type[Any], odd: bool
) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(0.0, 3.0, (400, 3)).astype(kind)
    points[random.random(points.shape) < 0.02] = nan
    points[random.random(points.shape) < 0.02] = inf
    if odd:  # as decoded: read-only, strided, unaligned
        raw = b"\0" + np.hstack([points, points]).tobytes()
        step = 6 * points.itemsize
        points = np.ndarray(points.shape, kind, raw, 1, (step, points.itemsize))
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("ZYX", [0.4, pitch, roll]).as_matrix()
    transform[2, 3] = 0.7
    scan = cloud_scan(Cloud(0, "lidar", points), transform, SLAB, LIMITS, beams=90)
    expected = cloud_oracle(points.astype(np.float64), transform, 90)
    np.testing.assert_allclose(scan.ranges, expected, rtol=1e-6)


def test_cloud_beams_point_where_their_points_are() -> None:
    points = np.array([[2.0, 0.001, 0.0], [0.0, 3.0, 0.0], [-1.0, -0.001, 0.0]])
    transform = np.eye(4)
    transform[2, 3] = 0.5
    scan = cloud_scan(Cloud(0, "lidar", points), transform, SLAB, LIMITS, beams=720)
    hits = np.flatnonzero(np.isfinite(scan.ranges))
    np.testing.assert_allclose(scan.ranges[hits], [1.0, 2.0, 3.0], rtol=1e-5)
    half = pi / 720
    np.testing.assert_allclose(scan.bearings[hits], [-pi + half, half, pi / 2 + half])
    assert scan.widths.sum() == pytest.approx(2 * pi)


def test_empty_cloud() -> None:
    scan = cloud_scan(Cloud(0, "lidar", np.zeros((0, 3))), np.eye(4))
    assert np.isnan(scan.ranges).all()
