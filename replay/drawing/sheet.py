"""The sheet that a drawing lies on: its border, its title block, and the part that is drawn on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from replay.drawing.ink import Bits, Gray, binarise, faint, grown, shrunk, upright
from replay.drawing.shapes import Door, Drawing, Mask

LARGE = 36_000_000  # px: larger pictures are worked on at half their size
BORDER = 0.75  # of the picture's sides: what reaches so far may be the sheet's border
BORDER_INK = 0.4  # of all ink: a building has more
RIM = 3  # px, side of the square that takes the border's soft edge with it
MARGIN = 16  # px of paper about what is drawn


@dataclass(frozen=True, slots=True)
class Sheet:
    """A picture's ink where something is drawn, apart from the sheet's own.

    Attributes:
        ink, lines: (h, w) of the part that is drawn on; lines has the faintest ones, too.
        apart: (H, W), the sheet's own ink by name: "frame", "title block".
        corner: (row, col) where the part lies in it.
        shape: (H, W) of the whole picture.
        scale: its px for one here: 2 where it is so large that it is worked on at half its size.
    """

    ink: Bits
    lines: Bits
    apart: dict[str, Bits]
    corner: tuple[int, int]
    shape: tuple[int, int]
    scale: int

    @classmethod
    def of(cls, gray: Gray) -> Sheet:
        """Tell ink from paper and the drawing from its sheet."""
        gray = upright(gray)
        ink = binarise(gray)
        lines = faint(gray, ink)
        scale = 2 if gray.size > LARGE else 1
        if scale > 1:
            ink, lines = shrunk(ink, scale), shrunk(lines, scale)
        border = frame(ink)
        apart: dict[str, Bits] = {}
        if border.any():
            fields = beside_frame(ink, border)
            rim = grown(border, RIM)
            apart = {"frame": lines & rim, "title block": lines & fields & (1 - rim)}
            own = 1 - (rim | fields)
            ink, lines = ink & own, lines & own
        x, y, wide, high = cv2.boundingRect(lines)
        rows = slice(max(0, y - MARGIN), y + high + MARGIN)
        cols = slice(max(0, x - MARGIN), x + wide + MARGIN)
        ink, lines = (np.ascontiguousarray(mask[rows, cols]) for mask in (ink, lines))
        shape = (gray.shape[0], gray.shape[1])
        return cls(ink, lines, apart, (rows.start, cols.start), shape, scale)

    def whole(self, part: Drawing) -> Drawing:
        """What was found on the part that is drawn on, in pixels of the whole picture."""
        layers = {name: self._placed(layer) for name, layer in part.layers.items()}
        layers |= {name: mask.view(np.bool_) for name, mask in self.apart.items()}
        y, x = self.corner
        doors = [
            replace(
                door,
                hinge=(door.hinge[0] + x, door.hinge[1] + y),
                end=(door.end[0] + x, door.end[1] + y),
            )
            for door in part.doors
        ]
        walls, inside = self._placed(part.walls), self._placed(part.outline)
        found = replace(part, walls=walls, doors=doors, outline=inside, layers=layers)
        return found if self.scale == 1 else enlarged(found, self.shape)

    def _placed(self, mask: Mask) -> Mask:
        """A mask of the part as one of the whole."""
        rows, cols = (-(-side // self.scale) for side in self.shape)
        out = np.zeros((rows, cols), dtype=np.bool_)
        row, col = self.corner
        out[row : row + mask.shape[0], col : col + mask.shape[1]] = mask
        return out


def frame(ink: Bits) -> Bits:
    """The sheet's border with the title block that hangs on it: wide around, little ink."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(ink, connectivity=8)
    around = (stats[:, 2] > BORDER * ink.shape[1]) & (stats[:, 3] > BORDER * ink.shape[0])
    around &= stats[:, 4] < BORDER_INK * float(ink.sum())
    around[0] = False
    return around.astype(np.uint8)[labels] if around.any() else np.zeros_like(ink)


def beside_frame(ink: Bits, border: Bits) -> Bits:
    """The fields that the sheet's border cuts off, all but the one that holds most ink."""
    count, labels = cv2.connectedComponents(1 - border, connectivity=4)
    held = np.bincount(np.asarray(labels)[(ink > 0) & (border == 0)], minlength=count)
    other = np.arange(count) != int(held.argmax())
    return other.astype(np.uint8)[labels]


def enlarged(drawing: Drawing, shape: tuple[int, int]) -> Drawing:
    """What was found at half the size, in pixels of the whole picture of `shape`."""
    return replace(
        drawing,
        walls=_doubled(drawing.walls, shape),
        doors=[_twice(door) for door in drawing.doors],
        outline=_doubled(drawing.outline, shape),
        layers={name: _doubled(layer, shape) for name, layer in drawing.layers.items()},
        door_width=2 * drawing.door_width,
    )


def _doubled(mask: Mask, shape: tuple[int, int]) -> Mask:
    """A halved mask at its first size."""
    return np.repeat(np.repeat(mask, 2, axis=0), 2, axis=1)[: shape[0], : shape[1]]


def _twice(door: Door) -> Door:
    """A door of the halved picture in pixels of the whole one."""
    return replace(
        door,
        hinge=(2 * door.hinge[0] + 0.5, 2 * door.hinge[1] + 0.5),
        end=(2 * door.end[0] + 0.5, 2 * door.end[1] + 0.5),
        depth=2 * door.depth,
    )
