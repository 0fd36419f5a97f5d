"""What is drawn: doors, and the drawing taken apart into walls, doors, outline and layers.

Everything is in the drawing's pixels, x to the right and y down.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, cos, hypot, pi, sin
from typing import Literal

import numpy as np
import numpy.typing as npt

Gray = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Polygon = npt.NDArray[np.float64]
DoorKind = Literal["single", "double", "sliding", "pocket", "folding", "unknown"]
STEPS = 16  # chords that stand for a leaf's arc


@dataclass(frozen=True, slots=True)
class Door:
    """One leaf of a door, as a sector: the paper's isosceles triangle with its arc (Fig 2).

    Attributes:
        hinge: (x, y) px, the corner between the two equal sides.
        end: (x, y) px, where the leaf's free end lies when the door is shut.
        swing: rad, from the shut leaf to the open one; positive turns x towards y.
        kind: what the symbol is; each leaf of a double door is a door of kind "double".
        confidence: 0 to 1, the share of the symbol that is inked.
        depth: px, thickness of the opening where a door slides or folds: `swing` is 0 there.
    """

    hinge: tuple[float, float]
    end: tuple[float, float]
    swing: float
    kind: DoorKind = "single"
    confidence: float = 1.0
    depth: float = 0.0

    @property
    def width(self) -> float:
        """Length of the leaf in px."""
        return hypot(self.end[0] - self.hinge[0], self.end[1] - self.hinge[1])

    @property
    def opened(self) -> tuple[float, float]:
        """(x, y) px of the leaf's free end when the door is drawn open."""
        angle = self._shut + self.swing
        return self.hinge[0] + self.width * cos(angle), self.hinge[1] + self.width * sin(angle)

    @property
    def _shut(self) -> float:
        """rad, direction of the shut leaf."""
        return atan2(self.end[1] - self.hinge[1], self.end[0] - self.hinge[0])

    def triangle(self) -> Polygon:
        """hinge, end, open end: (3, 2); of what slides or folds its opening and an apex."""
        if self.depth:
            ends = np.array([self.hinge, self.end])
            return np.vstack((ends, ends.mean(axis=0) + self._across))
        return np.array([self.hinge, self.end, self.opened])

    @property
    def _across(self) -> Polygon:
        """(2,) px: half the depth, square to the opening."""
        x, y = self.end[0] - self.hinge[0], self.end[1] - self.hinge[1]
        return np.array([-y, x]) * (0.5 * self.depth / hypot(x, y))

    def sector(self) -> Polygon:
        """What the leaf sweeps: the hinge and points along the arc, (STEPS + 2, 2).

        Of a door that does not swing: its opening, (4, 2).
        """
        if self.depth:
            a, b, across = np.array(self.hinge), np.array(self.end), self._across
            return np.array([a - across, b - across, b + across, a + across])
        angles = self._shut + np.linspace(0.0, self.swing, STEPS + 1)
        arc = np.column_stack((np.cos(angles), np.sin(angles))) * self.width
        return np.vstack((np.zeros((1, 2)), arc)) + np.array(self.hinge)


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawing taken apart.

    Attributes:
        walls: (H, W), solid: the room between the two lines of a hollow wall is wall.
        doors: one entry for each leaf.
        outline: (H, W), the building's footprint.
        layers: masks (H, W) of the ink by what it was taken for: "doors", "windows", "text",
            "hatching", "lines", ...; no pixel of ink is in two of them.
        door_width: px, the usual width of a leaf here; 0 where no door was found.
        seconds: time that the parts took, by name.
    """

    walls: Mask
    doors: list[Door]
    outline: Mask
    layers: dict[str, Mask]
    door_width: float = 0.0
    seconds: dict[str, float] = field(default_factory=dict)


def turn_between(start: float, stop: float) -> float:
    """rad, the turn from one direction to another by the shorter way, in (-pi, pi]."""
    turn = (stop - start) % (2 * pi)
    return turn - 2 * pi if turn > pi else turn
