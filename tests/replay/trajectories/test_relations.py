"""Kümmerle's errors, by hand."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from formats.relations import Relations
from replay.trajectories.errors import planar_trajectory
from replay.trajectories.relations import relation_errors

# Three poses: at the origin looking along x; at (1, 0) looking along y; at (1, 2) looking back.
POSES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, pi / 2], [1.0, 2.0, pi]])
TIMES = np.array([0, 1_000_000_000, 2_000_000_000])
PATH = planar_trajectory(TIMES, POSES)


def errors(first: int, second: int, *pose: float) -> tuple[float, float]:
    relations = Relations(np.array([first]), np.array([second]), np.array([pose]))
    found = relation_errors(PATH, relations)
    assert found.missed == 0
    return float(found.metres[0]), float(found.radians[0])


def test_what_is_true_has_no_error() -> None:
    assert errors(0, 1_000_000_000, 1.0, 0.0, pi / 2) == pytest.approx((0.0, 0.0), abs=1e-12)
    # From (1, 0) looking along y, (1, 2) lies 2 m ahead.
    assert errors(1_000_000_000, 2_000_000_000, 2.0, 0.0, pi / 2) == pytest.approx(
        (0.0, 0.0), abs=1e-12
    )


def test_times_may_run_backwards() -> None:
    # From (1, 2) looking back along -x, (0, 0) lies 1 m ahead and 2 m to the left.
    found = errors(2_000_000_000, 0, 1.0, 2.0, -pi)
    assert found == pytest.approx((0.0, 0.0), abs=1e-12)


def test_errors_are_lengths_and_absolute_turns() -> None:
    # 3 ahead and 4 to the side beyond what the poses say, turned by 0.1 too little.
    found = errors(1_000_000_000, 2_000_000_000, 5.0, 4.0, pi / 2 - 0.1)
    assert found == pytest.approx((5.0, 0.1))
    assert errors(0, 1_000_000_000, 1.0, 0.0, pi / 2 + 2 * pi) == pytest.approx((0, 0), abs=1e-12)


def test_relations_beyond_the_trajectory_are_counted() -> None:
    relations = Relations(
        np.array([0, 0]), np.array([1_000_000_000, 9_000_000_000]), np.array([[1, 0, 0.0]] * 2)
    )
    found = relation_errors(PATH, relations)
    assert found.missed == 1
    assert found.metres.tolist() == pytest.approx([0.0])
    assert found.radians.tolist() == pytest.approx([pi / 2])
