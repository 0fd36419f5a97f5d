"""The white regions that strokes cut out of the paper: what walls are made of between their lines.

The room in a hollow wall, the slits of a hatched one and a cavity are narrow cells; rooms are wide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.ink import Bits, distance

Doubles = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int32]
BESIDE = 0.6  # px crossed for one of the longer one's length: cells that lie side by side
ALIKE = 0.8  # and the shorter is as long as that
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Cells:
    """White regions (4-connected) by label; entry 0 stands for the ink.

    Attributes:
        labels: (H, W).
        area, width, length: px; width is that of the largest disc inside, length area / width.
        angle: rad, direction of the long axis; in (-pi / 2, pi / 2].
        long, short: px, sides of the rectangle with the same moments.
        boxed: share of its upright box that the cell fills.
        outside: whether the cell touches the picture's edge.
    """

    labels: Labels
    area: Doubles
    width: Doubles
    length: Doubles
    angle: Doubles
    long: Doubles
    short: Doubles
    boxed: Doubles
    outside: Flags

    @classmethod
    def of(cls, ink: Bits, largest: float, narrow: float = 0.0) -> Cells:
        """Take the paper apart along the ink.

        Cells of more than `largest` px count as endless, unless their edges tell that they are
        bands of a mean width below `narrow` px: the wall about a whole building is one cell.
        """
        white = 1 - ink
        count, parts, stats, _ = cv2.connectedComponentsWithStats(white, connectivity=4)
        labels: Labels = np.asarray(parts, dtype=np.int32)
        area = stats[:, cv2.CC_STAT_AREA].astype(np.float64)
        looked_at = area <= largest
        if narrow > 0:
            looked_at |= 2 * area < narrow * _edges(labels, count)
        looked_at[0] = False
        flat = np.flatnonzero(looked_at[labels.ravel()])  # rooms and the sheet are most of it
        label = labels.ravel()[flat]
        deep = distance(white).ravel()[flat]
        depth = np.full(count, np.inf, dtype=np.float32)
        depth[looked_at] = 0.0
        np.maximum.at(depth, label, deep)
        y, x = (v.astype(np.float64) for v in np.divmod(flat, labels.shape[1]))
        n = np.maximum(np.bincount(label, minlength=count), 1).astype(np.float64)
        mx, my = np.bincount(label, x, count) / n, np.bincount(label, y, count) / n
        x, y = x - mx[label], y - my[label]
        xx, yy = np.bincount(label, x * x, count) / n, np.bincount(label, y * y, count) / n
        xy = np.bincount(label, x * y, count) / n
        gap = np.sqrt((xx - yy) ** 2 + 4 * xy * xy)
        outside = (stats[:, 0] == 0) | (stats[:, 1] == 0)
        outside |= stats[:, 0] + stats[:, 2] == ink.shape[1]
        outside |= stats[:, 1] + stats[:, 3] == ink.shape[0]
        # the depth is measured to the middle of the ink's first pixel
        width = np.maximum(2.0 * depth.astype(np.float64) - 1, 1.0)
        return cls(
            labels,
            area,
            width,
            area / width,
            0.5 * np.arctan2(2 * xy, xx - yy),
            np.sqrt(6 * (xx + yy + gap)) + 1,
            np.sqrt(np.maximum(6 * (xx + yy - gap), 0.0)) + 1,
            area / np.maximum(stats[:, 2].astype(np.float64) * stats[:, 3], 1.0),
            outside,
        )

    def pick(self, chosen: Flags) -> Bits:
        """The pixels of some cells."""
        return (chosen & (np.arange(len(chosen)) > 0)).astype(np.uint8)[self.labels]

    def edges(self) -> Doubles:
        """Px sides that each cell shares with ink."""
        return _edges(self.labels, len(self.area))

    def bordering(self, values: npt.NDArray[np.generic]) -> Doubles:
        """Mean of a picture's values over the ink pixels that touch each cell; 0 without any."""
        total, weight = np.zeros(len(self.area)), np.zeros(len(self.area))
        for label, value in _touching(self.labels, values):
            total += np.bincount(label, value, len(self.area))
            weight += np.bincount(label, minlength=len(self.area))
        return total / np.maximum(weight, 1)


def stacked(cells: Cells, chosen: Flags, line: int) -> Flags:
    """Of some cells those that lie side by side with another as long: panes, treads, shelves.

    Args:
        cells: of a drawing.
        chosen: which of them are looked at.
        line: px, how thick the lines between them are.
    """
    number = np.where(chosen, np.arange(len(chosen)), 0).astype(np.int32)[cells.labels]
    across = line + 2
    pairs = []
    for one, other in (
        (number[:, :-across], number[:, across:]),
        (number[:-across], number[across:]),
    ):
        both = (one > 0) & (other > 0) & (one != other)
        pairs.append(np.column_stack((one[both], other[both])))
    each = np.sort(np.vstack(pairs), axis=1)
    pair, count = np.unique(each, axis=0, return_counts=True)
    out = np.zeros(len(chosen), dtype=np.bool_)
    if len(pair):
        long = np.maximum(cells.long[pair[:, 0]], cells.long[pair[:, 1]])
        least = np.minimum(cells.long[pair[:, 0]], cells.long[pair[:, 1]])
        side = (count > BESIDE * long) & (least > ALIKE * long)
        out[pair[side].ravel()] = True
    return out


def _edges(labels: Labels, count: int) -> Doubles:
    """Px sides that each cell shares with ink."""
    out = np.zeros(count)
    for white, black in _neighbours(labels):
        out += np.bincount(white[(white > 0) & (black == 0)], minlength=count)
    return out


def _neighbours(labels: Labels) -> Iterator[tuple[Labels, Labels]]:
    """Labels beside each other, in each of four directions."""
    for a, b in ((labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:])):
        yield a, b
        yield b, a


def _touching(labels: Labels, values: npt.NDArray[np.generic]) -> Iterator[tuple[Labels, Doubles]]:
    """Labels of white pixels and the values of the ink beside them, in each of four directions."""
    low, high, every = slice(None, -1), slice(1, None), slice(None)
    for a, b in (((every, low), (every, high)), ((low, every), (high, every))):
        for white, black in ((a, b), (b, a)):
            edge = (labels[white] > 0) & (labels[black] == 0)
            yield labels[white][edge], values[black][edge].astype(np.float64)
