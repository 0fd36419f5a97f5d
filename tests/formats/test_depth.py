"""Depth images -> Scan, against a slow oracle and worlds that are known by hand."""

from __future__ import annotations

from math import inf, nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.depth.scans import (
    camera_fault,
    camera_remarks,
    depth_fault,
    depth_scan,
    level_pose,
    levelled,
)
from formats.frame import Pose, Scan
from formats.messages import CameraInfo
from tests.depth_worlds import (
    LIMITS,
    SLAB,
    Floats,
    as_image,
    camera_at,
    camera_info,
    oracle,
    rendered,
)


def by_column(scan: Scan, info: CameraInfo, focal: float) -> dict[int, float]:
    columns = np.round(np.tan(scan.bearings) * focal - info.k[0, 2]).astype(int)
    hits = np.isfinite(scan.ranges)
    return dict(zip(columns[hits].tolist(), scan.ranges[hits].tolist(), strict=True))


def focal_of(scan: Scan) -> float:
    """px: beams are even steps of the tangent."""
    return 1.0 / float(np.diff(np.tan(scan.bearings)).mean())


def check(metres: Floats, info: CameraInfo, transform: Floats, encoding: str) -> Scan:
    scan = depth_scan(as_image(metres, encoding), info, transform, SLAB, LIMITS)
    expected = oracle(metres, info, transform)
    if len(scan.bearings) < 2:
        assert len(expected) <= 1
        return scan
    found = by_column(scan, info, focal_of(scan))
    assert found.keys() == expected.keys()
    for column, distance in expected.items():
        assert found[column] == pytest.approx(distance, rel=1e-6)
    return scan


@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.floats(0.05, 2.0),
    roll=st.floats(-pi, pi),
    pitch=st.floats(-1.2, 1.2),
    yaw=st.floats(-pi, pi),
    encoding=st.sampled_from(["16UC1", "32FC1"]),
)
@settings(max_examples=60, deadline=None)
def test_random_images_equal_the_oracle(
    seed: int, height: float, roll: float, pitch: float, yaw: float, encoding: str
) -> None:
    random = np.random.default_rng(seed)
    metres = np.round(random.uniform(0.0, 12.0, (24, 32)) ** 2 / 12.0, 3)
    metres[random.random(metres.shape) < 0.2] = 0.0
    if encoding == "32FC1":
        metres = metres.astype(np.float32).astype(np.float64)
        metres[random.random(metres.shape) < 0.1] = nan
        metres[random.random(metres.shape) < 0.1] = inf
    check(metres, camera_info(24, 32, 28.0), camera_at(height, roll, pitch, yaw), encoding)


INFO = camera_info(48, 64, 56.0)


def test_wall_ahead() -> None:
    """2 m from the camera: 2 / cos(bearing) in every beam, and a beam for every column."""
    transform = camera_at(0.5)
    metres = rendered(INFO, transform, [(4.0, 0.0, 3.0)])
    scan = depth_scan(as_image(metres, "32FC1"), INFO, transform, SLAB, LIMITS)
    assert len(scan.ranges) == 64
    np.testing.assert_allclose(scan.ranges, 2.0 / np.cos(scan.bearings), rtol=1e-6)
    np.testing.assert_allclose(np.tan(scan.bearings[[0, -1]]), [-31.5 / 56, 31.5 / 56])
    # The beams tile the view: from half a pixel before the first column to half a one behind.
    assert scan.widths.sum() == pytest.approx(2 * np.arctan(32 / 56))
    assert scan.max_range == 10.0


@pytest.mark.parametrize("pitch", [0.0, 0.35, 0.8])
@pytest.mark.parametrize("roll", [0.0, 0.2])
def test_floor_is_left_out_by_geometry(pitch: float, roll: float) -> None:
    transform = camera_at(0.7, roll, pitch)
    metres = rendered(INFO, transform, [])
    assert np.isfinite(metres).sum() > 500
    for encoding in ("16UC1", "32FC1"):
        scan = depth_scan(as_image(metres, encoding), INFO, transform, SLAB, LIMITS)
        assert np.isnan(scan.ranges).all()
    low = depth_scan(as_image(metres), INFO, transform, (-0.05, 1.0), LIMITS)
    assert np.isfinite(low.ranges).any()


@pytest.mark.parametrize("pitch", [-0.2, 0.0, 0.35])
def test_tilted_camera_sees_the_wall_where_it_is(pitch: float) -> None:
    """In the level frame the hits lie on the wall's line, whatever the camera's tilt."""
    transform = camera_at(0.7, 0.1, pitch, 0.3)
    metres = rendered(INFO, transform, [(4.0, 0.0, 3.0)])
    scan = depth_scan(as_image(metres, "32FC1"), INFO, transform, SLAB, LIMITS)
    hits = np.isfinite(scan.ranges)
    assert hits.sum() > 30
    ends = np.stack([np.cos(scan.bearings), np.sin(scan.bearings)], axis=1) * scan.ranges[:, None]
    places = level_pose(transform, 2).apply(ends[hits])
    # A beam is 1 / 56 wide: a hit at its edge is off by half of that, seen aslant.
    np.testing.assert_allclose(places[:, 0], 4.0, atol=0.04)


def test_low_box_hides_the_wall_and_high_shelf_does_not() -> None:
    transform = camera_at(0.7)
    shelf = rendered(INFO, transform, [(4.0, 0.0, 3.0), (3.0, 1.3, 1.4)])
    box = rendered(INFO, transform, [(4.0, 0.0, 3.0), (3.0, 0.0, 0.4)])
    ahead = [
        depth_scan(as_image(metres), INFO, transform, SLAB, LIMITS).ranges[32]
        for metres in (shelf, box)
    ]
    np.testing.assert_allclose(ahead, [2.0, 1.0], rtol=1e-3)


def test_left_is_a_positive_bearing() -> None:
    metres = np.zeros((48, 64))
    metres[24, 5] = 2.0  # column 5 of 64: left of the axis
    scan = depth_scan(as_image(metres), INFO, camera_at(0.5), SLAB, LIMITS)
    (beam,) = np.flatnonzero(np.isfinite(scan.ranges))
    assert np.tan(scan.bearings[beam]) == pytest.approx((31.5 - 5) / 56)
    assert (np.diff(scan.bearings) > 0).all()


def test_invalid_is_not_far() -> None:
    nothing = depth_scan(as_image(np.zeros((48, 64))), INFO, camera_at(0.5), SLAB, LIMITS)
    assert np.isnan(nothing.ranges).all()


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 1, 7])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "32FC1"])
def test_padding_and_byte_order_change_nothing(encoding: str, padding: int, big: bool) -> None:
    random = np.random.default_rng(5)
    metres = np.round(random.uniform(0.5, 4.0, (48, 64)), 3).astype(np.float32)
    plain = depth_scan(as_image(metres.astype(float)), INFO, camera_at(0.6), SLAB, LIMITS)
    image = as_image(metres.astype(float), encoding, big, padding)
    scan = depth_scan(image, INFO, camera_at(0.6), SLAB, LIMITS)
    np.testing.assert_allclose(scan.ranges, plain.ranges, rtol=1e-6)


def test_camera_info_of_another_size_is_scaled() -> None:
    transform = camera_at(0.5)
    full = camera_info(96, 128, 112.0)
    assert "scaled to 64 x 48" in " ".join(camera_remarks(as_image(np.ones((48, 64))), full))
    metres = rendered(INFO, transform, [(4.0, 0.0, 3.0)])
    scan = depth_scan(as_image(metres, "32FC1"), full, transform, SLAB, LIMITS)
    np.testing.assert_allclose(scan.ranges, 2.0 / np.cos(scan.bearings), rtol=1e-6)


def test_part_of_the_picture_and_binning() -> None:
    """The right half of the rows 8 to 40, every second pixel."""
    transform = camera_at(0.5)
    metres = rendered(INFO, transform, [(4.0, 0.0, 3.0)])[8:40:2, 32::2]
    part = INFO._replace(binning=(2, 2), roi=(32, 8, 32, 32))
    image = as_image(metres, "32FC1")
    assert camera_remarks(image, part) == []
    scan = depth_scan(image, part, transform, SLAB, LIMITS)
    np.testing.assert_allclose(scan.ranges, 2.0 / np.cos(scan.bearings), rtol=0.01)
    assert np.tan(scan.bearings.min()) == pytest.approx(-31 / 56, abs=0.5 / 56)
    assert np.tan(scan.bearings.max()) == pytest.approx(-1 / 56, abs=0.5 / 56)


def test_level_frame_follows_the_optical_axis() -> None:
    pose = level_pose(camera_at(0.5, 0.4, 0.6, 1.1), 2)
    assert pose == pytest.approx(Pose(2.0, 3.0, 1.1))
    down = level_pose(camera_at(0.5, 0.0, pi / 2, 1.1), 2)
    assert down == pytest.approx(Pose(2.0, 3.0, 1.1), abs=1e-9)
    level = np.array(levelled(camera_at(0.5, 0.4, 0.6, 1.1), 2))
    exact = camera_at(0.5, 0.4, 0.6, 0.0)[:3]
    exact[:2, 3] = 0.0
    np.testing.assert_allclose(level, exact, atol=0.51e-4)


# What cannot be used: FAULTS 60 to 63.

GOOD = as_image(np.ones((48, 64)))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, ""),
        ({"encoding": "rgb8"}, "'rgb8' is no depth"),
        ({"width": 0}, "without pixels"),
        ({"height": 0}, "without pixels"),
        ({"width": 2**31, "height": 2**31}, "implausible image"),
        ({"step": 127}, "short of 64 pixels"),
        ({"data": GOOD.data[:-1]}, "too few pixels"),
    ],
)
def test_faults_of_images(changes: dict[str, Any], fault: str) -> None:
    image = GOOD._replace(**changes)
    assert fault in depth_fault(image)
    if fault:
        with pytest.raises(ValueError, match=r".+"):
            depth_scan(image, INFO, camera_at(0.5))
    else:
        assert depth_fault(image) == ""


@pytest.mark.parametrize(
    ("k", "fault"),
    [
        (np.zeros((3, 3)), "no focal length"),
        (np.full((3, 3), nan), "not finite"),
        (np.full((3, 3), 1e9), "implausible"),
        (np.array([[500.0, 0, -1e7], [0, 500, 0], [0, 0, 1]]), "implausible"),
    ],
)
def test_faults_of_calibrations(k: Floats, fault: str) -> None:
    assert fault in camera_fault(INFO._replace(k=k))
    with pytest.raises(ValueError, match=fault):
        depth_scan(GOOD, INFO._replace(k=k), camera_at(0.5))


def test_extreme_calibration_needs_no_memory() -> None:
    k = np.array([[1e6, 0, 32.0], [0, 20.0, 24.0], [0, 0, 1]])
    scan = depth_scan(GOOD, INFO._replace(k=k), camera_at(0.5, pi / 2), SLAB, LIMITS)
    assert len(scan.bearings) <= 4 * (48 + 64) + 2


def test_remarks() -> None:
    assert camera_remarks(GOOD, INFO) == []
    odd = INFO._replace(d=np.array([0.1]), frame="other")
    found = " ".join(camera_remarks(GOOD._replace(encoding="mono16"), odd))
    for words in ("mono16", "distortion (plumb_bob) ignored", "'camera', its camera_info in 'ot"):
        assert words in found


# Real images.

SLAMBOOK = CameraInfo(
    0,
    "camera",
    480,
    640,
    "",
    np.zeros(5),
    np.array([[518.0, 0, 325.5], [0, 519, 253.5], [0, 0, 1]]),
)


def real(shared_data: Path, name: str) -> Floats:
    import cv2

    path = shared_data / "depth" / name
    if not path.exists():
        pytest.skip(f"no {path}")
    found: Any = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return np.asarray(found / 1000.0, dtype=np.float64)


def test_real_image_equals_the_oracle(shared_data: Path) -> None:
    metres = real(shared_data, "slambook2_ch5/depth/1.pgm")[::2, ::2]
    info = SLAMBOOK._replace(height=240, width=320, k=SLAMBOOK.k * [[0.5], [0.5], [1]])
    scan = check(metres, info, camera_at(0.9, 0.02, 0.1), "16UC1")
    assert np.isfinite(scan.ranges).sum() > 150


@pytest.mark.slow
@pytest.mark.parametrize("number", range(1, 6))
def test_every_real_image_equals_the_oracle(shared_data: Path, number: int) -> None:
    metres = real(shared_data, f"slambook2_ch5/depth/{number}.pgm")
    check(metres, SLAMBOOK, camera_at(0.9, 0.02, 0.1), "16UC1")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["image", "image_OLD_0", "image_OLD_1"])
def test_every_other_real_image_equals_the_oracle(shared_data: Path, name: str) -> None:
    metres = real(shared_data, f"g2o_frontend/{name}.pgm")
    check(metres, camera_info(480, 640, 525.0), camera_at(0.6), "16UC1")
