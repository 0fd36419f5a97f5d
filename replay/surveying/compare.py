"""Each wall of a plan against what was seen: confirmed, moved, not there, or unseen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from replay.surveying.segments import Mask, Straight, lookup, straights

State = Literal["confirmed", "moved", "not there", "unseen"]
STATES: tuple[State, ...] = ("confirmed", "moved", "not there", "unseen")
TOLERANCE = 0.1  # m that a wall may lie off and is still confirmed
FARTHEST = 0.5  # m: a wall that lies farther off is another one
PIECE = 0.25  # m along a wall that are judged together
ENOUGH = 1 / 3  # of a piece's samples which must show a face: distant hits are sparse
OPEN = 0.5  # of a piece's samples that are open from face to face, where the wall is not there
BARE = 1 / 3  # of its cells that were seen free, where it has moved and is not just covered
LEAST_MOVED, MOST_OF = 1.0, 0.5  # m, and share of the seen wall, that must have moved together


@dataclass(frozen=True)
class Seen:
    """What was seen of each cell; (rows, cols) masks.

    Attributes:
        occupied: rather occupied than free.
        met: occupied, or readings ended in it often enough that a surface is there.
        free: rather free.
        open: surely free: readings passed again and again, and next to none ended there.
    """

    occupied: Mask
    met: Mask
    free: Mask
    open: Mask


@dataclass(frozen=True)
class Wall:
    """A wall of the plan, or the part of one that has one state.

    Attributes:
        start, end: x, y of the ends of its centre line, m in the plan's frame.
        thickness: m, as drawn.
        state: see STATES.
        moved: m that it lies off, positive to the left of start -> end; nan where it was not seen.
        left, right: the same of each face; nan where that face was not seen.
        hidden: something stands before it, which is why it was not seen; of a moved wall: its
            planned place was not seen free, so that it may as well be covered.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    thickness: float
    state: State
    moved: float
    left: float
    right: float
    hidden: bool

    @property
    def length(self) -> float:
        """m, of the centre line."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))


@dataclass(frozen=True)
class Piece:
    """What was seen of a piece of a wall; offsets in cells, positive to the left."""

    first: int
    last: int
    left: float
    right: float
    open: bool  # readings went right through the planned place
    bare: bool  # some of it was seen free

    @property
    def moved(self) -> float:
        """Mean of the faces that were seen."""
        seen = [offset for offset in (self.left, self.right) if not np.isnan(offset)]
        return float(np.mean(seen)) if seen else float("nan")


def compare(
    wall: Mask,
    seen: Seen,
    resolution: float,
    corner: tuple[float, float],
    tolerance: float = TOLERANCE,
) -> list[Wall]:
    """Every straight wall of a plan, in parts of one state each, in the order of their place.

    A face is where an occupied cell has a free one before it, on the side that the face looks to.
    Of a wall with a face within `tolerance` of the plan that part is confirmed, whatever stands
    before its other face. It has moved where faces agree on another place over 1 m and half of
    what was seen of it; it is not there where its cells were seen free.

    Args:
        wall: (rows, cols) the plan's cells, row 0 lowest.
        seen: what was seen of each cell, without any prior.
        resolution: m, a cell's side.
        corner: x, y in m of cell (0, 0)'s lower left corner.
        tolerance: m.
    """
    found: list[Wall] = []
    for straight in straights(wall, resolution):
        pieces = list(_pieces(straight, wall, seen, resolution, tolerance))
        found += _walls(straight, pieces, resolution, corner, tolerance / resolution)
    return sorted(found, key=lambda w: (w.start[1], w.start[0], w.end))


def _pieces(
    straight: Straight,
    wall: Mask,
    seen: Seen,
    resolution: float,
    tolerance: float,
) -> Iterator[Piece]:
    """What was seen of each piece of PIECE m."""
    reach, near = round(FARTHEST / resolution), tolerance / resolution
    back = straight.thick - 1
    across = np.arange(-back - reach - 2, reach + 3)  # cells; 0 is the left face's, -back the right
    at = straight.at[:, None] + across[:, None] * straight.left
    full, empty = lookup(seen.met, at), lookup(seen.free, at)
    beside = (across > near) | (across < -back - near)
    full &= ~(lookup(wall, at) & beside)  # another wall tells nothing about this one
    inner = (across <= 0) & (across >= -back)
    through = np.asarray(lookup(seen.open, at[:, inner]).all(axis=1))
    left, right = _facing(full, empty, 1), _facing(full, empty, -1)
    count = min(len(at), max(1, round(len(at) * resolution / PIECE)))
    edges = np.linspace(0, len(at), count + 1).round().astype(int).tolist()
    for first, last in pairwise(edges):
        rows = slice(first, last)
        far_side = np.nan if straight.deep else _offset(right[rows], across + back, reach, near)
        near_side = _offset(left[rows], across, reach, near)
        opened = bool(through[rows].mean() >= OPEN)
        bare = bool(empty[rows][:, inner].mean() >= BARE)
        yield Piece(first, last, near_side, far_side, opened, bare)


def _facing(full: Mask, empty: Mask, side: int) -> Mask:
    """Occupied cells with a free one right before them, or one cell farther; side 1 is left."""
    one, two = (np.roll(empty, -side * step, axis=1) for step in (1, 2))
    return full & (one | two)


def _offset(face: Mask, offsets: npt.NDArray[np.int64], reach: int, near: float) -> float:
    """Cells that a face lies off, nan where there is none: the planned place first, then others."""
    share = face.mean(axis=0)
    at_home = np.abs(offsets) <= near
    if face[:, at_home].any(axis=1).mean() >= ENOUGH:
        around = np.abs(offsets) <= near + 1
        return float(np.average(offsets[around], weights=share[around]))
    peak = np.convolve(share, np.ones(3), "same")
    peak[np.abs(offsets) > reach] = 0.0
    best = int(np.argmax(peak))
    if peak[best] < ENOUGH:
        return float("nan")
    around = np.abs(offsets - offsets[best]) <= 1
    return float(np.average(offsets[around], weights=share[around]))


def _walls(
    straight: Straight,
    pieces: list[Piece],
    resolution: float,
    corner: tuple[float, float],
    near: float,
) -> Iterator[Wall]:
    """Pieces of one state joined; what has not moved far enough together is told apart."""
    states = [_state(piece, near) for piece in pieces]
    seen = sum(p.last - p.first for p, s in zip(pieces, states, strict=True) if s != "unseen")
    for first, last in _alike(pieces, states, near):
        if states[first] != "moved":
            continue
        length = pieces[last - 1].last - pieces[first].first
        if length * resolution < LEAST_MOVED or length < MOST_OF * seen:
            for i in range(first, last):
                states[i] = "not there" if pieces[i].open else "unseen"
    for i in range(1, len(states) - 1):  # a piece of 0.25 m alone is noise
        if states[i - 1] == states[i + 1] != states[i] and states[i - 1] != "moved":
            states[i] = states[i - 1]
    for first, last in _alike(pieces, states, near):
        part = pieces[first:last]
        ends = straight.at[[part[0].first, part[-1].last - 1]]
        ends = ends + np.array([-0.5, 0.5])[:, None] * straight.along  # to the cells' edges
        ends = ends - 0.5 * (straight.thick - 1) * straight.left
        (ax, ay), (bx, by) = ((ends + 0.5) * resolution + corner).tolist()
        shown = states[first] in ("confirmed", "moved")
        left, right, moved = (
            _mean([getattr(p, name) for p in part]) * resolution if shown else float("nan")
            for name in ("left", "right", "moved")
        )
        yield Wall(
            (ax, ay),
            (bx, by),
            straight.thick * resolution,
            states[first],
            _nearest(left, right) if states[first] == "confirmed" else moved,
            left,
            right,
            _hidden(states[first], part),
        )


def _state(piece: Piece, near: float) -> State:
    offsets = [offset for offset in (piece.left, piece.right) if not np.isnan(offset)]
    if any(abs(offset) <= near for offset in offsets):
        return "confirmed"
    if offsets:
        return "moved"
    return "not there" if piece.open else "unseen"


def _alike(pieces: list[Piece], states: list[State], near: float) -> Iterator[tuple[int, int]]:
    """Runs of one state, and of one offset where they moved: first and one past the last."""
    first = 0
    for i in range(1, len(pieces) + 1):
        if (
            i == len(pieces)
            or states[i] != states[i - 1]
            or (states[i] == "moved" and abs(pieces[i].moved - pieces[i - 1].moved) > near)
        ):
            yield first, i
            first = i


def _hidden(state: State, pieces: list[Piece]) -> bool:
    """Whether something stands before the wall's place."""
    if state == "unseen":
        return any(not np.isnan(p.moved) for p in pieces)
    return state == "moved" and not any(p.bare for p in pieces)


def _nearest(left: float, right: float) -> float:
    """Of a confirmed wall: the mean of its faces, or the one at home where the other is not."""
    if np.isnan(left) or np.isnan(right):
        return left if np.isnan(right) else right
    return min(left, right, key=abs) if abs(left - right) > TOLERANCE else (left + right) / 2


def _mean(values: list[float]) -> float:
    """Of those that are numbers; nan where none is."""
    good = [value for value in values if not np.isnan(value)]
    return float(np.mean(good)) if good else float("nan")
