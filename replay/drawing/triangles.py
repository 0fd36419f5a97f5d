"""Doors as isosceles triangles of corners: SideCheck, AngleCheck, ConnectivityCheck (D2 to D6).

A door is a corner, its apex, with two more of nearly one distance from it, at nearly a right
angle, joined by ink along two of the three sides; the side opposite the apex may be an arc about
it. The size of doors is bounded: this bound belongs to the definition, and lets a k-d tree find
the same doors as all n-choose-3 triples do.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import radians
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from replay.drawing.ink import Bits

Doubles = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
SIDES = 0.08  # by which share of the longer the two equal sides may differ
ANGLES = (radians(72), radians(108))  # at the apex
JOINED = 0.85  # of a side is inked
SAMPLES = 40  # points looked at along a side
MARGIN = 0.06  # of a side at either end that is not looked at: corners lie beside their strokes


class Triangle(NamedTuple):
    """Corners by number: the apex, then the two others in the order of their numbers."""

    apex: int
    first: int
    second: int


def doors_of(corners: Doubles, ink: Bits, low: float, high: float) -> list[Triangle]:
    """Every triple of corners that is a door, by apex and numbers; PossDoors to DoorsShortlist.

    Args:
        corners: (n, 2) px.
        ink: (H, W), a pixel wider than drawn.
        low, high: px, bounds of the equal sides.
    """
    if len(corners) < 3:
        return []
    tree = cKDTree(corners)
    found: list[Triangle] = []
    for apex, near in _neighbours(tree, corners, low, high):
        # two inked sides of three: one of those at the apex is inked, and few are
        legs = legs_inked(corners, ink, apex, near)
        i, j = _pairs_with(np.flatnonzero(legs), len(near))
        passes = side_check(corners, apex, near[i], near[j])
        i, j = i[passes], j[passes]
        passes = angle_check(corners, apex, near[i], near[j])
        first, second = near[i[passes]], near[j[passes]]
        passes = connectivity_check(corners, ink, apex, first, second)
        pairs = zip(first[passes].tolist(), second[passes].tolist(), strict=True)
        found += [Triangle(apex, b, c) for b, c in pairs]
    return found


def _neighbours(
    tree: cKDTree, corners: Doubles, low: float, high: float
) -> Iterator[tuple[int, Whole]]:
    """Each corner with the numbers, ascending, of those within the bounds of a door from it."""
    for apex, point in enumerate(corners):
        near = np.array(sorted(tree.query_ball_point(point, high + 1)), dtype=np.int64)
        near = near[in_bounds(corners, apex, near, low, high)]
        if len(near) > 1:
            yield apex, near


def _pairs_with(chosen: Whole, count: int) -> tuple[Whole, Whole]:
    """All pairs i < j below `count` of which one at least is chosen, each once."""
    one = np.repeat(chosen, count)
    other = np.tile(np.arange(count), len(chosen))
    is_chosen = np.zeros(count, dtype=np.bool_)
    is_chosen[chosen] = True
    once = (one != other) & ~(is_chosen[other] & (other < one))
    one, other = one[once], other[once]
    return np.minimum(one, other), np.maximum(one, other)


def legs_inked(corners: Doubles, ink: Bits, apex: int, other: Whole) -> npt.NDArray[np.bool_]:
    """Whether straight ink joins an apex with other corners."""
    return _inked(ink, *_straight(corners, np.full(len(other), apex), other)) >= JOINED


def in_bounds(
    corners: Doubles, apex: int, other: Whole, low: float, high: float
) -> npt.NDArray[np.bool_]:
    """Whether sides have the length of a door."""
    length = _length(corners, apex, other)
    return np.asarray((length >= low) & (length <= high))


def side_check(corners: Doubles, apex: int, first: Whole, second: Whole) -> npt.NDArray[np.bool_]:
    """SideCheck: the two sides at the apex are of nearly one length (D3)."""
    a, b = _length(corners, apex, first), _length(corners, apex, second)
    return np.asarray(np.abs(a - b) <= SIDES * np.maximum(a, b))


def angle_check(corners: Doubles, apex: int, first: Whole, second: Whole) -> npt.NDArray[np.bool_]:
    """AngleCheck: the angle at the apex is nearly right, whichever way it turns (D4)."""
    turn = np.abs(_turn(corners, apex, first, second))
    return np.asarray((turn >= ANGLES[0]) & (turn <= ANGLES[1]))


def connectivity_check(
    corners: Doubles, ink: Bits, apex: int, first: Whole, second: Whole
) -> npt.NDArray[np.bool_]:
    """ConnectivityCheck: two of the three sides are ink, the base straight or as an arc (D5)."""
    ends, place = np.unique(np.concatenate((first, second)), return_inverse=True)
    leg = legs_inked(corners, ink, apex, ends)
    legs = leg[place[: len(first)]].astype(np.int64) + leg[place[len(first) :]]
    ok = legs == 2
    half = np.flatnonzero(legs == 1)
    base = _inked(ink, *_straight(corners, first[half], second[half])) >= JOINED
    base |= _inked(ink, *_arc(corners, apex, first[half], second[half])) >= JOINED
    ok[half] = base
    return np.asarray(ok)


def _length(corners: Doubles, apex: int, other: Whole) -> Doubles:
    offset = corners[other] - corners[apex]
    return np.hypot(offset[:, 0], offset[:, 1])


def _turn(corners: Doubles, apex: int, first: Whole, second: Whole) -> Doubles:
    """The turn in (-pi, pi] about the apex from the first corner to the second."""
    a, b = corners[first] - corners[apex], corners[second] - corners[apex]
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.asarray(np.arctan2(cross, (a * b).sum(axis=1)))


def _straight(corners: Doubles, start: Whole, stop: Whole) -> tuple[Doubles, Doubles]:
    """Sample points x, y (n, SAMPLES) along straight sides."""
    t = np.linspace(MARGIN, 1 - MARGIN, SAMPLES)
    a, b = corners[start], corners[stop]
    return (
        a[:, :1] + t * (b[:, :1] - a[:, :1]),
        a[:, 1:] + t * (b[:, 1:] - a[:, 1:]),
    )


def _arc(corners: Doubles, apex: int, start: Whole, stop: Whole) -> tuple[Doubles, Doubles]:
    """Sample points along the arc about the apex; its radius glides from one side's length."""
    t = np.linspace(MARGIN, 1 - MARGIN, SAMPLES)
    x, y = corners[apex]
    first = np.arctan2(corners[start, 1] - y, corners[start, 0] - x)
    angle = first[:, None] + t * _turn(corners, apex, start, stop)[:, None]
    a, b = _length(corners, apex, start), _length(corners, apex, stop)
    radius = a[:, None] + t * (b - a)[:, None]
    return x + radius * np.cos(angle), y + radius * np.sin(angle)


def _inked(ink: Bits, x: Doubles, y: Doubles) -> Doubles:
    """Share of the points of each row that are ink."""
    cols = np.clip(np.rint(x).astype(np.int64), 0, ink.shape[1] - 1)
    rows = np.clip(np.rint(y).astype(np.int64), 0, ink.shape[0] - 1)
    return np.asarray(ink[rows, cols].mean(axis=1))
