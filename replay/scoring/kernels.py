"""The kernel that keeps scores up to date: only touched cells, and of them few, are looked at."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formats.grid import Counted, Floats
from formats.jit import njit

Words = npt.NDArray[np.uint32]
Ints = npt.NDArray[np.int64]

# A cell's word: bit k says that curve k has it occupied; these say what it is.
OBSERVED, SCORED, WALL = 1 << 31, 1 << 30, 1 << 29
MOST_CURVES = 29
# Under `paper` a reading moves a cell by its own log-odds less l0. Where that is more than SURE,
# rounding cannot turn it round: sums of FEW readings are off by less than 1e-7.
SURE, FEW = 1e-6, 1_000_000
BLOCK = 32


@njit
def value(counts: Counted, cell: int, l0: float, paper: bool, sizes: Floats, signs: Ints) -> float:
    """Log-odds of one cell, by the additions of `Evidence.on`, hence to the same bits.

    Args:
        counts: (levels, cells).
        l0: the prior of this cell.
        paper: by the paper's update.
        sizes, signs: (m,) and (m, levels), `formats.grid.terms`.
    """
    total, visits = 0.0, np.int64(0)
    for level in range(counts.shape[0]):
        visits += np.int64(counts[level, cell])
    for m in range(sizes.size):
        net = np.int64(0)
        for level in range(counts.shape[0]):
            net += signs[m, level] * np.int64(counts[level, cell])
        total += sizes[m] * net
    return total - (visits - 1) * l0 if paper else total + l0


@njit
def against(words: Words, rising: int, falling: int) -> bool:
    """Whether a reading could change any of these cells: not yet observed, or against it.

    Args:
        words: a block of cells.
        rising, falling: `bayes` curves that the reading moves towards empty and towards occupied.
    """
    anywhere, everywhere = np.uint32(0), np.uint32(0xFFFFFFFF)
    for i in range(words.size):
        anywhere |= words[i]
        everywhere &= words[i]
    return (anywhere & rising) | (~everywhere & (falling | OBSERVED)) != 0


@njit
def unsteady(words: Words, l0: Floats, bit: int, weight: float, sure: float) -> bool:
    """The same of one curve under `paper`, where a reading counts by what it says beyond l0."""
    found = 0
    for i in range(words.size):
        step = weight - l0[i]
        step = -step if words[i] & bit else step
        found |= int(step < sure)
    return found != 0


@njit
def rescore(
    runs: npt.NDArray[np.int32],
    counts: Counted,
    priors: Floats,
    places: Ints,
    sizes: Floats,
    signs: Ints,
    weights: Floats,
    paper: npt.NDArray[np.bool_],
    sure: float,
    words: Words,
    tally: Ints,
) -> None:
    """Bring the scores up to date after one reading.

    Under `bayes` a cell that is empty stays so when the reading adds to it, and an occupied one
    when it takes away, since rounded sums are monotone; only the others are added up again.
    Blocks of cells where nothing can change are passed over.

    Args:
        runs: (k, 3) first flat index, one after the last, level of the reading.
        counts: (levels, cells).
        priors: (priors, cells) l0; places: (curves,) the prior of each curve.
        sizes, signs: (curves, m), (curves, m, levels) of `formats.grid.terms`, 0 where unused.
        weights: (curves, levels) the log-odds of each level.
        paper: (curves,) by the paper's update.
        sure: a step under `paper` whose direction rounding cannot hide.
        words: (cells,) what each cell was, updated.
        tally: (curves, 2, 4) observed and unobserved: tp, fp, fn, tn; updated.
    """
    for k in range(runs.shape[0]):
        level = runs[k, 2]
        rising, falling = 0, 0
        for c in range(paper.size):
            if not paper[c]:
                rising |= (1 << c) if weights[c, level] > 0.0 else 0
                falling |= (1 << c) if weights[c, level] < 0.0 else 0
        for start in range(runs[k, 0], runs[k, 1], BLOCK):
            end = min(start + BLOCK, runs[k, 1])
            block = words[start:end]
            doubt = against(block, rising, falling)
            for c in range(paper.size):
                if paper[c] and not doubt:
                    l0 = priors[places[c], start:end]
                    doubt = unsteady(block, l0, 1 << c, weights[c, level], sure)
            if not doubt:
                continue
            for cell in range(start, end):
                word = words[cell]
                if not word & SCORED:
                    continue
                seen = word & OBSERVED != 0
                space = 0 if word & WALL else 1
                for c in range(paper.size):
                    l0_here, step = priors[places[c], cell], weights[c, level]
                    was = 0 if word & (1 << c) else 1
                    if paper[c]:
                        step -= l0_here
                        steady = seen and (step >= sure if was else step <= -sure)
                    else:
                        steady = step >= 0.0 if was else step <= 0.0
                    if steady and seen:
                        continue
                    now = was
                    if not steady:
                        log_odds = value(counts, cell, l0_here, paper[c], sizes[c], signs[c])
                        now = 0 if log_odds < 0.0 else 1
                    tally[c, 0 if seen else 1, 2 * was + space] -= 1
                    tally[c, 0, 2 * now + space] += 1
                    word ^= (was ^ now) << c
                words[cell] = word | OBSERVED
