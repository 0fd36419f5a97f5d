"""Where a map may lie on a plan: correlation over turns, scales and mirror, by FFT.

A map's occupied cells shall lie on walls and its free cells off them: both in one kernel, whose
sum is zero, so that places full of ink gain nothing.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
import scipy.fft

from replay.registration.seen import BINS, Doubles, Mask, Seen, directions, points_of

Floats = npt.NDArray[np.float32]
SPAN = 100.0  # px that the map's longer side takes in the search
PLAN_MOST, PLAN_LEAST = 400, 48  # px that the plan's longer side may take
SOFT = 1.0  # px, how far from a wall a cell still counts
STEP = 2.0  # degrees between turns
ALIKE = 0.35  # of the way from the worst to the best turn by directions: below, it is not tried
PEAKS = 3  # places of one turn and scale
APART = 6  # px between them
BORDER = 4  # px around the plan's ink


@dataclass(frozen=True)
class Candidate:
    """A place: (2, 3) matrix from the map's cells to the plan's pixels, its score and scale."""

    matrix: Doubles
    score: float
    scale: float


def matrix_of(scale: float, turn_deg: float, mirrored: bool, x: float = 0, y: float = 0) -> Doubles:
    """The 2 x 3 similarity: mirrored maps are flipped upside down before they are turned."""
    c, s = scale * np.cos(np.radians(turn_deg)), scale * np.sin(np.radians(turn_deg))
    flip = -1.0 if mirrored else 1.0
    return np.array([[c, -s * flip, x], [s, c * flip, y]])


def likely_turns(seen: Doubles, plan: Doubles, mirrored: bool) -> list[float]:
    """Turns in degrees at which the directions of both pictures agree, of [0, 360)."""
    turned = np.roll(seen[::-1], 1) if mirrored else seen
    spectrum = np.conj(np.fft.rfft(turned)) * np.fft.rfft(plan)
    alike = np.fft.irfft(spectrum, BINS)
    worst, best = float(alike.min()), float(alike.max())
    good = alike >= worst + ALIKE * (best - worst)
    order = np.argsort(-alike, kind="stable")
    chosen: list[float] = []
    for turn in order[good[order]].astype(float):
        if all(abs((turn - t + 90.0) % 180.0 - 90.0) >= STEP for t in chosen):
            chosen.append(turn)
    return sorted(chosen + [t + 180.0 for t in chosen])


def search(seen: Seen, walls: Mask, scales: list[float], mirrors: list[bool]) -> list[Candidate]:
    """Candidates, best first within each scale; all scales and turns that are likely.

    Args:
        seen: the map.
        walls: (H, W) the plan's ink.
        scales: plan pixels a map cell.
        mirrors: which of False and True to try.
    """
    ink = points_of(walls)
    low, high = ink.min(axis=0), ink.max(axis=0)
    side = float((high - low).max()) + 1.0
    points, free = seen.points, points_of(seen.free)
    span = float((points.max(axis=0) - points.min(axis=0)).max()) + 1.0
    plan_directions, map_directions = directions(walls), directions(seen.occupied)
    turns = {m: likely_turns(map_directions, plan_directions, m) for m in mirrors}

    def at_scale(scale: float) -> list[Candidate]:
        unit = float(np.clip(span * scale / SPAN, side / PLAN_MOST, side / PLAN_LEAST))
        cells = _thinned(points, unit / scale), _thinned(free, unit / scale)
        level = Level(_softened(ink - low, unit), *cells, scale, unit, low)
        return [place for m in mirrors for place in _places(level, turns[m], m)]

    with ThreadPoolExecutor(2) as pool:  # in order, so that the outcome is the same at any speed
        return [place for places in pool.map(at_scale, scales) for place in places]


def _thinned(points: Doubles, unit: float) -> Doubles:
    """One point for each square of `unit` that holds any."""
    cells = np.floor(points / unit).astype(np.int64)
    key = cells[:, 0] * (1 << 24) + cells[:, 1]
    _, first = np.unique(key, return_index=True)
    centres: Doubles = (cells[np.sort(first)] + 0.5) * unit
    return centres


def _softened(ink: Doubles, unit: float) -> Floats:
    """Ink at a lower resolution, 1 on it and falling off around it."""
    cells = np.floor(ink / unit).astype(np.int64) + BORDER
    cols, rows = cells.max(axis=0) + 1 + BORDER
    empty = np.ones((rows, cols), np.uint8)
    empty[cells[:, 1], cells[:, 0]] = 0
    far = cv2.distanceTransform(empty, cv2.DIST_L2, cv2.DIST_MASK_5)
    soft: Floats = np.exp(-0.5 * np.square(far / SOFT)).astype(np.float32)
    return soft


@dataclass(frozen=True)
class Level:
    """Map and plan at the resolution that suits one scale.

    Attributes:
        field: the softened ink, with a border.
        occupied, free: (n, 2) cells of the map, thinned.
        scale: plan pixels a map cell.
        unit: plan pixels a pixel of the field.
        low: (2,) the plan's pixel at the field's corner.
    """

    field: Floats
    occupied: Doubles
    free: Doubles
    scale: float
    unit: float
    low: Doubles


def _places(level: Level, turns: list[float], mirrored: bool) -> list[Candidate]:
    """The best shifts of each turn."""
    field, occupied, free = level.field, level.occupied, level.free
    scale, unit, low = level.scale, level.unit, level.low
    middle = (occupied.min(axis=0) + occupied.max(axis=0)) / 2
    reach = int(np.ceil(np.hypot(*(occupied.max(axis=0) - middle)) * scale / unit)) + 2
    reach = max(reach, int(np.ceil(np.abs(free - middle).max() * scale / unit * 1.42)) + 2)
    shape = [scipy.fft.next_fast_len(n + reach, real=True) for n in field.shape]
    plan = scipy.fft.rfft2(field, shape)
    cells = np.concatenate((occupied, free)) - middle
    weights = np.repeat([1.0 / len(occupied), -1.0 / len(free)], [len(occupied), len(free)])
    out: list[Candidate] = []
    for turn in turns:
        turned = matrix_of(scale / unit, turn, mirrored)[:, :2]
        at = np.rint(cells @ turned.T).astype(np.int64)
        index = (at[:, 1] % shape[0]) * shape[1] + at[:, 0] % shape[1]
        kernel = np.bincount(index, weights, shape[0] * shape[1]).astype(np.float32)
        spectrum = np.conj(scipy.fft.rfft2(kernel.reshape(shape)))
        sums = scipy.fft.irfft2(spectrum * plan, shape)
        sums = sums[: field.shape[0], : field.shape[1]]
        for row, col, score in _peaks(sums):
            place = (np.array([col, row]) - BORDER + 0.5) * unit + low
            full = matrix_of(scale, turn, mirrored)
            full[:, 2] = place - full[:, :2] @ middle
            out.append(Candidate(full, score, scale))
    return out


def _peaks(sums: Floats) -> list[tuple[int, int, float]]:
    """The highest places, some way apart."""
    out = []
    for _ in range(PEAKS):
        row, col = divmod(int(sums.argmax()), sums.shape[1])
        out.append((row, col, float(sums[row, col])))
        sums[max(0, row - APART) : row + APART + 1, max(0, col - APART) : col + APART + 1] = -1.0
    return out
