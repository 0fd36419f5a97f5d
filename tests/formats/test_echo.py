"""Scanners with several echoes a beam."""

from __future__ import annotations

import numpy as np
import pytest

from formats.messages import MultiEchoLaserScan
from formats.sensing.echo import Echo, single_echo


def floats(*values: float) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    return np.array(values, dtype=np.float32)


READING = MultiEchoLaserScan(
    7,
    "laser",
    -1.0,
    0.5,
    0.0,
    0.1,
    30.0,
    [floats(1, 2, 3), floats(), floats(4), floats(5, 6), floats(7, 8)],
    [floats(9, 30, 20), floats(), floats(1), floats(2), floats(np.nan, 1)],
)


@pytest.mark.parametrize(
    ("which", "expected"),
    [
        ("first", [1, np.nan, 4, 5, 7]),
        ("last", [3, np.nan, 4, 6, 8]),
        ("strongest", [2, np.nan, 4, 5, 8]),
    ],
)
def test_one_echo_a_beam(which: Echo, expected: list[float]) -> None:
    found = single_echo(READING, which)
    assert found[:7] == READING[:7]
    np.testing.assert_array_equal(found.ranges, floats(*expected))
    assert found.ranges.dtype == np.float32


def test_without_intensities_the_strongest_is_the_first() -> None:
    found = single_echo(READING._replace(intensities=[]), "strongest")
    np.testing.assert_array_equal(found.ranges, single_echo(READING, "first").ranges)
