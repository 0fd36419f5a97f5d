"""Resampling: how many particles (KLD sampling, Fox 2001), and which (low variance)."""

from __future__ import annotations

from math import ceil, floor, sqrt

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from formats.jit import njit

BIN = (0.5, 0.5, np.radians(10.0))  # m, m, rad: cells of the histogram, nav2_amcl's


@njit
def kld_count(bins: int, pf_err: float, pf_z: float) -> float:
    """Particles that keep the error of a histogram of so many occupied bins below pf_err.

    Fox, "KLD-Sampling" (NIPS 2001), Equation 7, by Wilson and Hilferty's approximation.

    Args:
        bins: occupied ones.
        pf_err: Kullback-Leibler distance.
        pf_z: upper quantile of the standard normal distribution.
    """
    if bins < 2:
        return 1.0
    a = 2.0 / (9.0 * (bins - 1))
    b = 1.0 - a + sqrt(a) * pf_z
    return (bins - 1) / (2.0 * pf_err) * b * b * b


@njit
def _enough(
    particles: Floats,
    sums: Floats,
    draws: Floats,
    bins: tuple[float, float, float],
    least: int,
    pf_err: float,
    pf_z: float,
    slots: npt.NDArray[np.int64],
) -> int:
    """Draw until there are enough for the bins met so far; `slots` is an empty table of -1."""
    met, mask = 0, slots.size - 1
    for n in range(draws.size):
        i = min(np.searchsorted(sums, draws[n] * sums[-1], side="right"), sums.size - 1)
        a = floor(particles[i, 0] / bins[0]) & 0xFFFFF
        b = floor(particles[i, 1] / bins[1]) & 0xFFFFF
        c = floor(particles[i, 2] / bins[2]) & 0xFFF
        key = (a << 32) | (b << 12) | c
        slot = ((key ^ (key >> 21)) * 0x9E3779B1 >> 7) & mask
        while slots[slot] != -1 and slots[slot] != key:
            slot = (slot + 1) & mask
        if slots[slot] == -1:
            slots[slot] = key
            met += 1
        if n + 1 >= least and n + 1 >= kld_count(met, pf_err, pf_z):
            return n + 1
    return draws.size


def enough(
    particles: Floats,
    weights: Floats,
    rng: np.random.Generator,
    least: int,
    most: int,
    pf_err: float = 0.05,
    pf_z: float = 0.99,
) -> int:
    """How many particles to draw: KLD sampling's answer, from `least` to `most`."""
    slots = np.full(1 << ceil(np.log2(4 * most)), -1, dtype=np.int64)
    draws = rng.random(most)
    return _enough(particles, np.cumsum(weights), draws, BIN, least, pf_err, pf_z, slots)


def systematic(weights: Floats, count: int, start: float) -> npt.NDArray[np.int64]:
    """(count,) indices drawn by low-variance sampling (Thrun et al. 2005, Table 4.4).

    Args:
        weights: (n,) not negative, some positive.
        count: how many to draw.
        start: 0 to 1, random.
    """
    sums = np.cumsum(weights)
    picks = (np.arange(count) + start) * (sums[-1] / count)
    drawn = np.searchsorted(sums, picks, side="right")
    return np.minimum(drawn, np.flatnonzero(weights)[-1])
