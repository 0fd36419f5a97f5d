"""Samples of particles stay bounded, are spread evenly, and stand for all of them."""

from __future__ import annotations

import numpy as np
import pytest

from replay.localise.samples import MOST, SIZE, Samples, sample


@pytest.mark.parametrize("updates", [1, 2, MOST, MOST + 1, 1234, 5000])
def test_moments_are_spread_evenly_and_end_with_the_last(updates: int) -> None:
    samples = Samples()
    for k in range(updates):
        last = 10 * k, np.full((3, 3), float(k)), np.full(3, 1 / 3)
        samples.offer(*last)
    found = samples.finished(*last)
    times = [one.time_ns for one in found]
    assert len(found) <= MOST + 1
    assert all((one.poses == one.time_ns / 10).all() for one in found)
    assert (times[0], times[-1]) == (0, 10 * (updates - 1))
    assert len(found) >= min(updates, MOST / 2)
    if updates > 2:
        gaps = set(np.diff(times)[:-1].tolist())  # the last one comes when it comes
        assert len(gaps) == 1
        assert gaps.pop() % 10 == 0


def test_a_sample_stands_for_the_weights() -> None:
    """4000 particles at 0 with a quarter of the weight, 1000 at 1 with the rest."""
    particles = np.zeros((5000, 3))
    particles[4000:] = 1.0
    weights = np.r_[np.full(4000, 0.25 / 4000), np.full(1000, 0.75 / 1000)]
    one = sample(0, particles, weights)
    assert len(one.poses) == SIZE == 500
    assert one.poses[:, 0].sum() == 375


def test_few_particles_are_all_there() -> None:
    particles = np.arange(12.0).reshape(4, 3)
    one = sample(7, particles, np.full(4, 0.25))
    assert np.array_equal(one.poses, particles)
    assert one.time_ns == 7
