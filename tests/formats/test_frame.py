from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.frame import Pose

poses = st.builds(Pose, st.floats(-50, 50), st.floats(-50, 50), st.floats(-pi, pi))


def matrix(pose: Pose) -> np.ndarray:
    c, s = cos(pose.yaw), sin(pose.yaw)
    return np.array([[c, -s, pose.x], [s, c, pose.y], [0, 0, 1]])


def test_composition_by_hand() -> None:
    # One metre ahead of a sensor that looks along y lies one metre further up.
    assert Pose(2, 3, pi / 2) @ Pose(1, 0, pi / 2) == pytest.approx((2, 4, pi))


def test_yaw_is_wrapped() -> None:
    assert (Pose(0, 0, 3.0) @ Pose(0, 0, 3.0)).yaw == pytest.approx(6.0 - 2 * pi)


@given(poses, poses)
def test_composition_is_the_product_of_matrices(a: Pose, b: Pose) -> None:
    assert matrix(a @ b) == pytest.approx(matrix(a) @ matrix(b), abs=1e-9)


@given(poses)
def test_the_inverse_undoes(a: Pose) -> None:
    for none in (a @ a.inverse(), a.inverse() @ a):
        assert none == pytest.approx((0, 0, 0), abs=1e-9)


def test_points_by_hand() -> None:
    assert Pose(10, 20, -pi / 2).apply([[1, 0], [0, 2]]) == pytest.approx(
        np.array([[10, 19], [12, 20]])
    )


@given(poses, poses, st.tuples(st.floats(-9, 9), st.floats(-9, 9)))
def test_points_through_two_frames(a: Pose, b: Pose, point: tuple[float, float]) -> None:
    assert (a @ b).apply([point]) == pytest.approx(a.apply(b.apply([point])), abs=1e-9)
