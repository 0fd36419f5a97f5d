"""Bent stretches of outlines, all at once, against a slow way that takes one outline at a time."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from replay.drawing.bends import bent_stretches


def slowly(outline: np.ndarray, least: float, most: float, turn: float) -> list[np.ndarray]:
    """The stretches of one outline, point by point."""
    smooth = gaussian_filter1d(outline.astype(float), 3.0, axis=0, mode="wrap")
    n = len(outline)
    angle, length = np.zeros(n), np.zeros(n)
    for k in range(n):
        x, y = smooth[(k + 2) % n] - smooth[(k - 2) % n]
        angle[k], length[k] = np.arctan2(y, x), np.hypot(x, y) / 4 + 1e-9
    bend = np.zeros(n)
    for k in range(n):
        bend[k] = np.angle(np.exp(1j * (angle[(k + 1) % n] - angle[k])))
    bend = gaussian_filter1d(bend, 3.0, mode="wrap") / length
    found = []
    for sign in (-1, 1):
        on = [least < sign * b < most for b in bend]
        starts = [k for k in range(n) if on[k] and not on[k - 1]] or ([0] if all(on) else [])
        for start in starts:
            run = [start]
            while len(run) < n and on[(run[-1] + 1) % n]:
                run.append((run[-1] + 1) % n)
            if sum(abs(bend[k] * length[k]) for k in run) >= turn:
                found.append(outline[run])
    return found


def test_stretches_of_many_outlines_are_those_of_each() -> None:
    rng = np.random.default_rng(3)
    ink = np.zeros((900, 900), dtype=np.uint8)
    for _ in range(30):
        x, y, r = (int(v) for v in rng.integers((50, 50, 15), (850, 850, 70)))
        first, extent = (float(v) for v in rng.uniform((0, 60), (360, 360)))
        cv2.ellipse(ink, (x, y), (r, r), 0, first, first + extent, 1, 2)
        cv2.line(ink, (x, y), (x + r, y + r // 2), 1, 2)
    cv2.circle(ink, (100, 800), 40, 1, 3)  # bends all around
    contours, _ = cv2.findContours(ink, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    outlines = [c[:, 0, :] for c in contours if len(c) > 8]
    bounds = 0.6 / 80, 1.6 / 12, 0.4
    found = [points for points, _ in bent_stretches(outlines, *bounds)]
    wanted = [run for outline in outlines for run in slowly(outline, *bounds)]
    assert len(wanted) > 20

    def sort(runs: list[np.ndarray]) -> list[list[list[float]]]:
        return sorted(sorted(run.tolist()) for run in runs)

    assert sort(found) == sort(wanted)


@pytest.mark.parametrize("radius", [20, 45])
def test_a_circle_turns_all_around(radius: int) -> None:
    ink = np.zeros((120, 120), dtype=np.uint8)
    cv2.circle(ink, (60, 60), radius, 1, -1)
    contours, _ = cv2.findContours(ink, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    ((points, turned),) = bent_stretches([contours[0][:, 0, :]], 0.3 / radius, 3.0 / radius, 1.0)
    assert len(points) == len(contours[0])
    assert turned == pytest.approx(2 * np.pi, rel=0.05)


def test_no_outline_has_no_stretch() -> None:
    assert list(bent_stretches([], 0.01, 0.1, 0.4)) == []
