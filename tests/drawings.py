"""Small drawings for tests, drawn with exact truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, pi, sin

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.shapes import Door

Gray = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
WALL, THIN = 18, 8  # px: outer walls and partitions of a drawing whose doors are 80 px wide
DOOR = 80


@dataclass
class Sheet:
    """A picture under the pen, and the walls and doors that are true of it."""

    gray: Gray
    walls: Mask
    doors: list[Door] = field(default_factory=list)

    @classmethod
    def of(cls, rows: int, cols: int) -> Sheet:
        """White paper."""
        return cls(np.full((rows, cols), 255, dtype=np.uint8), np.zeros((rows, cols), dtype=bool))

    def wall(self, x0: int, y0: int, x1: int, y1: int, style: str = "filled") -> None:
        """A wall over [x0, x1) x [y0, y1): filled, hollow or hatched."""
        self.walls[y0:y1, x0:x1] = True
        if style == "filled":
            self.gray[y0:y1, x0:x1] = 0
            return
        if style == "hatched":
            patch = self.gray[y0:y1, x0:x1]
            rows, cols = np.indices(patch.shape)
            patch[(rows + cols) % 7 == 0] = 0
        cv2.rectangle(self.gray, (x0, y0), (x1 - 1, y1 - 1), 0, 2)

    def door(self, x: int, y: int, shut: float, swing: float, width: int = DOOR) -> Door:
        """A swing door: hinge, direction of the shut leaf, turn to the open one; walls give way."""
        door = Door((x, y), (x + width * cos(shut), y + width * sin(shut)), swing)
        gap = np.zeros(self.gray.shape, dtype=np.uint8)
        across = np.array([-sin(shut), cos(shut)]) * WALL
        a, b = np.array(door.hinge), np.array(door.end)
        cv2.fillPoly(
            gap, [np.rint([a - across, b - across, b + across, a + across]).astype(int)], 1
        )
        self.gray[gap > 0] = 255
        self.walls[gap > 0] = False
        arc = np.rint(door.sector()[1:]).astype(np.int32)
        cv2.polylines(self.gray, [arc], isClosed=False, color=0, thickness=1)
        leaf = np.rint([door.hinge, door.opened]).astype(int)
        cv2.line(self.gray, leaf[0].tolist(), leaf[1].tolist(), 0, 2)
        self.doors.append(door)
        return door

    def text(self, words: str, x: int, y: int, size: float = 0.9) -> None:
        """Letters, which are no walls."""
        cv2.putText(self.gray, words, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, 0, 2)


def flat(style: str = "filled") -> Sheet:
    """Two rooms and a corridor with three doors, labels, a table and a dimension line."""
    sheet = Sheet.of(760, 1000)
    for box in ((100, 100, 900, 118), (100, 582, 900, 600), (100, 100, 118, 600)):
        sheet.wall(*box, style)
    sheet.wall(882, 100, 900, 600, style)
    sheet.wall(118, 400, 882, 400 + THIN)
    sheet.wall(496, 118, 496 + THIN, 400)
    sheet.door(200, 404, 0.0, -pi / 2)
    sheet.door(760, 404, pi, pi / 2)
    sheet.door(600, 591, 0.0, -pi / 2)
    sheet.text("BEDROOM", 230, 260)
    sheet.text("KITCHEN 12.3", 580, 260)
    sheet.text("Ground floor", 380, 720, 1.4)
    cv2.circle(sheet.gray, (760, 500), 45, 0, 1)
    cv2.rectangle(sheet.gray, (160, 470), (280, 560), 0, 1)
    cv2.line(sheet.gray, (100, 60), (900, 60), 0, 1)
    for x in (100, 500, 900):
        cv2.line(sheet.gray, (x - 8, 68), (x + 8, 52), 0, 1)
    return sheet
