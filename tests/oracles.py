"""Slow, obvious versions of what the kernels do: numpy by cell and Python by beam."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import partial
from math import inf, isnan, pi, sin
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.frame import Floats, Pose, Scan
from formats.grid import Geometry
from formats.result import Counts
from tests.oracles_polar import polar

Cells = npt.NDArray[np.int64]
Sector = tuple[float, float, int, int]  # its borders in rad, and the beams that bound it
UNSURE, NOTHING = -2, -1


def cleaned(
    r: float, scan: Scan, max_range: float, no_return: str, margin: float
) -> tuple[float, float | None]:
    """REP-117 for one range: m that are seen empty, and the range of the hit."""
    stated = scan.max_range if scan.max_range > 0 else inf
    if isnan(r) or r <= 0 or r < scan.min_range or r < 1e-3:
        return 0.0, None
    if r >= stated * (1 - 1e-6) or r >= 1e4:
        most = {"near": 5.0, "clear": 1e4, "ignore": 0.0}[no_return]
        return min(most, stated, max_range), None
    if r > max_range:
        return max(min(r - margin, max_range), 0.0), None
    return max(r - margin, 0.0), r


def sectors(scan: Scan, shape: str, widest: float = 0.05, join: float = 0.1) -> list[Sector]:
    """Borders of what each beam stands for: wide beams in equal parts, small gaps closed."""
    found: list[Sector] = []
    beams = [i for i in range(len(scan.ranges)) if np.isfinite(scan.bearings[i])]
    beams = [i for i in beams if np.isfinite(scan.widths[i]) and scan.widths[i] > 0]
    if shape == "polygon":
        beams.sort(key=lambda i: float(scan.bearings[i]))
        for i, j in zip(beams, beams[1:] + beams[:1], strict=True):
            a, b = float(scan.bearings[i]), float(scan.bearings[j])
            b += 2 * pi if j == beams[0] else 0
            if 0 <= b - a <= min((scan.widths[i] + scan.widths[j]) / 2 * (1 + join), 3.0):
                found.append((a, b, i, j))
        return found
    beams.sort(key=lambda i: float(scan.bearings[i]))
    ends: list[tuple[float, float]] = []  # where each beam's last sector ends, and its width
    for i in beams:
        width = min(float(scan.widths[i]), 2 * pi)
        parts = int(np.ceil(width / widest))
        start, step = float(scan.bearings[i]) - width / 2, width / parts
        cut = [(start + k * step, start + (k + 1) * step, i, i) for k in range(parts)]
        if ends and abs(start - ends[-1][0]) <= join * min(width, ends[-1][1]):
            cut = [part for part in cut if part[1] > ends[-1][0]]  # others lie in the overlap
            cut[0] = (ends[-1][0], *cut[0][1:])
        found += cut
        ends.append((start + parts * step, width))
    if len(found) > 1:
        width, (last, other) = min(float(scan.widths[beams[0]]), 2 * pi), ends[-1]
        start = float(scan.bearings[beams[0]]) - width / 2
        if abs(start + 2 * pi - last) <= join * min(width, other):
            while found[0][1] <= last - 2 * pi:
                del found[0]
            found[0] = (last - 2 * pi, *found[0][1:])
    return found


def front(d: Floats, half: float, a: float, b: float) -> Floats:
    """Distance of the straight line between two corners, at a bearing d from their middle."""
    if a == 0 or b == 0:
        return np.zeros_like(d)
    with np.errstate(divide="ignore", invalid="ignore"):
        return a * b * sin(2 * half) / (a * np.sin(half + d) + b * np.sin(half - d))


class Samples:
    """Points of the plane against the sectors of a scan: polar coordinates, sector by sector.

    Args:
        x, y: m, the points.
        slack: (rad, m): points nearer than this to a border are neither in nor out.
    """

    def __init__(
        self, x: Floats, y: Floats, pose: Pose, borders: list[Sector], slack: tuple[float, float]
    ) -> None:
        self.distance = np.hypot(x - pose.x, y - pose.y)
        self.bearing = np.arctan2(y - pose.y, x - pose.x) - pose.yaw
        self.borders, self.slack = borders, slack

    def nearer(self, depth: list[float], sign: float) -> list[npt.NDArray[np.bool_]]:
        """By sector: the points inside and before its front; sign 1 surely, -1 at all."""
        out = []
        for a, b, i, j in self.borders:
            half = (b - a) / 2
            d = (self.bearing - (a + b) / 2 + pi) % (2 * pi) - pi
            inside = np.abs(d) <= half - sign * self.slack[0]
            line = front(np.clip(d, -half, half), half, depth[i], depth[j])
            out.append(inside & (self.distance < line - sign * self.slack[1]))
            if sign < 0 and depth[i] * depth[j] > 0:
                out[-1] |= self.distance < self.slack[1]
        return out


def beam(
    geometry: Geometry,
    pose: Pose,
    scan: Scan,
    *,
    max_range: float = inf,
    no_return: str = "near",
    margin: float = 0.5,
    shape: str = "sectors",
    slack: tuple[float, float] = (1e-9, 1e-7),
) -> Cells:
    """Level of each cell, (rows, cols): 0 hit, 1 miss, NOTHING, or UNSURE at a rounding border."""
    g = geometry
    rows, cols = np.mgrid[: g.rows, : g.cols]
    x, y = g.x + (cols + 0.5) * g.resolution, g.y + (rows + 0.5) * g.resolution
    said = [
        cleaned(float(r), scan, max_range, no_return, margin * g.resolution) for r in scan.ranges
    ]
    samples = Samples(x, y, pose, sectors(scan, shape), slack)
    free = [depth for depth, _ in said]
    out = np.full(g.shape, NOTHING, dtype=np.int64)
    for part in samples.nearer(free, -1.0):
        out[part] = UNSURE
    for part in samples.nearer(free, 1.0):
        out[part] = 1
    for bearing, width, (_, r) in zip(scan.bearings, scan.widths, said, strict=True):
        if r is None or not np.isfinite(bearing) or not (0 < width < inf):
            continue
        px = (pose.x + r * np.cos(pose.yaw + bearing) - g.x) / g.resolution
        py = (pose.y + r * np.sin(pose.yaw + bearing) - g.y) / g.resolution
        near = {
            (int(np.floor(py + v)), int(np.floor(px + u)))
            for u in (-1e-7, 1e-7)
            for v in (-1e-7, 1e-7)
        }
        for row, col in near:
            if 0 <= row < g.rows and 0 <= col < g.cols and out[row, col] != 0:
                out[row, col] = 0 if len(near) == 1 else UNSURE
    return out


def shares(
    geometry: Geometry,
    pose: Pose,
    scan: Scan,
    *,
    samples: int = 5,
    max_range: float = inf,
    no_return: str = "near",
    margin: float = 0.0,
    min_observed: float = 0.5,
    shape: str = "sectors",
    slack: tuple[float, float] = (1e-9, 1e-7),
    shadow: bool = False,
) -> Cells:
    """Level of each cell by the empty share of its observed sub-samples; see `beam`."""
    g, n = geometry, samples
    rows, cols = np.mgrid[: g.rows * n, : g.cols * n]
    x, y = g.x + (cols + 0.5) * g.resolution / n, g.y + (rows + 0.5) * g.resolution / n
    said = [
        cleaned(float(r), scan, max_range, no_return, margin * g.resolution) for r in scan.ranges
    ]
    points = Samples(x, y, pose, sectors(scan, shape), slack)
    free = [depth for depth, _ in said]
    start = [0.0 if r is None else r for _, r in said]
    end = min(scan.max_range if scan.max_range > 0 else 1e4, max_range, 1e4) if shadow else 0.0
    stop = [0.0 if r is None else max(r + g.resolution, end) for _, r in said]
    states = []
    for sign in (1.0, -1.0):
        empty = np.any([*points.nearer(free, sign), np.zeros(x.shape, bool)], axis=0)
        bands = [
            b & ~a
            for a, b in zip(points.nearer(start, -sign), points.nearer(stop, sign), strict=True)
        ]
        occupied = np.any([*bands, np.zeros(x.shape, bool)], axis=0)
        states.append((empty, occupied))
    (empty, occupied), (maybe_empty, maybe_occupied) = states
    unsure = (empty != maybe_empty) | (occupied != maybe_occupied)
    empty &= ~occupied
    out = np.full(g.shape, NOTHING, dtype=np.int64)
    for row in range(g.rows):
        for col in range(g.cols):
            part = np.s_[row * n : row * n + n, col * n : col * n + n]
            e, o = int(empty[part].sum()), int(occupied[part].sum())
            if unsure[part].any():
                out[row, col] = UNSURE
            elif e + o > 0 and e + o >= min_observed * n * n:
                out[row, col] = int(np.floor(n * n * e / (e + o) + 0.5))
    return out


def true_shares(*what: Any, truth: Cells, **options: Any) -> Cells:
    """The cells that `shares` shows, at the level that they really have."""
    seen = shares(*what, **options)
    return np.where(seen >= 0, truth, seen)


# Every entry of replay.sensors.observer.MODELS has its oracle here.
READINGS: dict[str, Callable[..., Any]] = {
    "beam": beam,
    "eq10": shares,
    "eq10-true": true_shares,
    "eq15": shares,
    "eq15-literal": partial(shares, shadow=True),
    "eq15-share": shares,
    "eq15-shadow": partial(shares, shadow=True),
    "gaussian": partial(polar, "gaussian"),
    "cone": partial(polar, "cone"),
}


def exact_f(counts: Counts, beta: int) -> Fraction:
    """Equation 14 in fractions, from precision and recall."""
    pre, rec = exact_precision(counts), exact_recall(counts)
    if pre + rec == 0:
        return Fraction(0)
    return (1 + beta**2) * pre * rec / (beta**2 * pre + rec)


def exact_precision(counts: Counts) -> Fraction:
    """Of what was found, how much is there."""
    return Fraction(counts.tp, counts.tp + counts.fp) if counts.tp + counts.fp else Fraction(0)


def exact_recall(counts: Counts) -> Fraction:
    """Of what is there, how much was found."""
    return Fraction(counts.tp, counts.tp + counts.fn) if counts.tp + counts.fn else Fraction(0)


def exact_iou(counts: Counts) -> Fraction:
    """Of what is found or there, how much is both."""
    whole = counts.tp + counts.fp + counts.fn
    return Fraction(counts.tp, whole) if whole else Fraction(0)


def exact_mcc(counts: Counts) -> Fraction:
    """Pearson's correlation of two yes-or-no variables, to 40 digits."""
    n = sum(counts)
    if not n:
        return Fraction(0)
    found, real = Fraction(counts.tp + counts.fp, n), Fraction(counts.tp + counts.fn, n)
    spread = found * (1 - found) * real * (1 - real)
    if not spread:
        return Fraction(0)
    with localcontext(prec=40):
        root = (Decimal(spread.numerator) / Decimal(spread.denominator)).sqrt()
    return (Fraction(counts.tp, n) - found * real) / Fraction(root)


# Every entry of replay.scoring.count_metrics.METRICS has its oracle here.
SCORES: dict[str, Callable[[Counts], Fraction]] = {
    "precision": exact_precision,
    "recall": exact_recall,
    "f2": lambda counts: exact_f(counts, 2),
    "f1": lambda counts: exact_f(counts, 1),
    "iou": exact_iou,
    "mcc": exact_mcc,
}
