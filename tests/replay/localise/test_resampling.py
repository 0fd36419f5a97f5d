from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from replay.localise.resampling import enough, kld_count, systematic


@pytest.mark.parametrize("bins", [3, 10, 100, 1000])
def test_kld_count_is_the_quantile_of_chi_square(bins: int) -> None:
    """Fox 2001, Equation 6: n = chi2(k - 1, 1 - delta) / (2 epsilon)."""
    for delta in (0.01, 0.2):
        exact = chi2.ppf(1.0 - delta, bins - 1) / (2 * 0.05)
        assert kld_count(bins, 0.05, norm.ppf(1.0 - delta)) == pytest.approx(exact, rel=0.02)
    assert kld_count(1, 0.05, 0.99) == 1.0


def test_as_many_particles_as_the_spread_needs() -> None:
    rng = np.random.default_rng(2)
    weights = np.full(4000, 1 / 4000)
    here = np.tile([1.2, 0.7, 0.05], (4000, 1))
    assert enough(here, weights, rng, 100, 5000) == 100
    few = here + np.outer(np.arange(4000) % 40, [1.0, 0.0, 0.0])  # 40 bins
    assert enough(few, weights, rng, 100, 5000) == int(np.ceil(kld_count(40, 0.05, 0.99)))
    wide = rng.uniform(-100, 100, (4000, 3))
    assert enough(wide, weights, rng, 100, 3000) == 3000


def test_weightless_particles_count_for_nothing() -> None:
    rng = np.random.default_rng(2)
    particles = rng.uniform(-100, 100, (4000, 3))
    weights = np.zeros(4000)
    weights[7] = 1.0
    assert enough(particles, weights, rng, 50, 3000) == 50


def test_systematic_draws_by_weight() -> None:
    weights = np.array([0.0, 0.5, 0.0, 0.125, 0.375, 0.0])
    for start in (0.0, 0.3, 0.999999999):
        counts = np.bincount(systematic(weights, 8, start), minlength=6)
        assert counts.tolist() == [0, 4, 0, 1, 3, 0]
    mean = np.mean(
        [
            np.bincount(systematic(weights, 3, u), minlength=6)
            for u in np.linspace(0, 1, 400, endpoint=False)
        ],
        axis=0,
    )
    assert mean == pytest.approx(3 * weights, abs=0.01)
