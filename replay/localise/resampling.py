"""Resampling: how many particles (KLD sampling, Fox 2001), and which (low variance)."""

from __future__ import annotations

from math import ceil, floor, radians, sqrt

import numpy as np
import numpy.typing as npt

from formats.frame import Floats
from formats.jit import njit

BIN_M, BIN_RAD = 0.5, radians(10.0)  # cells of the histogram, nav2_amcl's


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
def bin_key(x: float, y: float, yaw: float) -> int:
    """A number of the bin that a pose lies in, not negative."""
    a, b = floor(x / BIN_M) & 0xFFFFF, floor(y / BIN_M) & 0xFFFFF
    return (a << 32) | (b << 12) | (floor(yaw / BIN_RAD) & 0xFFF)


@njit
def find_slot(slots: npt.NDArray[np.int64], key: int) -> int:
    """Where a key is, or may be put, in a table of 2^k slots that holds -1 where it is empty."""
    mask = slots.size - 1
    slot = ((key ^ (key >> 21)) * 0x9E3779B1 >> 7) & mask
    while slots[slot] != -1 and slots[slot] != key:
        slot = (slot + 1) & mask
    return slot


def table(size: int) -> npt.NDArray[np.int64]:
    """An empty one with room for so many keys."""
    return np.full(1 << ceil(np.log2(4 * size)), -1, dtype=np.int64)


@njit
def _enough(
    particles: Floats,
    sums: Floats,
    draws: Floats,
    least: int,
    pf_err: float,
    pf_z: float,
    slots: npt.NDArray[np.int64],
) -> int:
    """Draw until there are enough for the bins met so far; `slots` is an empty table of -1."""
    met = 0
    for n in range(draws.size):
        i = min(np.searchsorted(sums, draws[n] * sums[-1], side="right"), sums.size - 1)
        key = bin_key(particles[i, 0], particles[i, 1], particles[i, 2])
        slot = find_slot(slots, key)
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
    slots = table(most)
    draws = rng.random(most)
    return _enough(particles, np.cumsum(weights), draws, least, pf_err, pf_z, slots)


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
