"""Drawings with exact truth: the door symbols of the paper's Fig 2, and five plans after its Fig 4.

    python -m replay.reproduction.example_plans FOLDER    five plans, their walls, the symbols

Plans (PAPER X8): a with labels, b with furniture, c with stairs, text and walls of varying width,
d of walls and doors alone, e like c with a wall and a door at an angle and a hatched wall.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from math import atan2, cos, hypot, pi, radians, sin
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.shapes import Door

Point = tuple[float, float]
SYMBOLS = (
    "single",
    "thick leaf",
    "double",
    "uneven double",
    "double acting",
    "pivot",
    "sliding",
    "pocket",
    "folding",
    "half open",
)
SUB = 4  # bits of sub-pixel places
PX_PER_M = 60.0


@dataclass
class Plan:
    """A picture under the pen with what is true of it; lengths in px, x right, y down."""

    gray: npt.NDArray[np.uint8]
    walls: npt.NDArray[np.bool_]
    doors: list[Door] = field(default_factory=list)
    stroke: int = 1

    @classmethod
    def blank(cls, rows: int, cols: int, stroke: int = 1) -> Plan:
        """White paper and a pen."""
        return cls(
            np.full((rows, cols), 255, dtype=np.uint8),
            np.zeros((rows, cols), dtype=np.bool_),
            [],
            stroke,
        )

    def line(self, *points: Point, stroke: int = 0, closed: bool = False) -> None:
        """A stroke through points."""
        fixed = np.rint(np.array(points) * (1 << SUB)).astype(np.int32)
        cv2.polylines(self.gray, [fixed], closed, 0, stroke or self.stroke, cv2.LINE_AA, SUB)

    def wall(self, a: Point, b: Point, thick: float, hatched: bool = False) -> None:
        """A straight wall between the middles of its ends."""
        corners = self._band(a, b, thick)
        mask = np.zeros(self.gray.shape, dtype=np.uint8)
        cv2.fillPoly(mask, [corners], 1, shift=SUB)
        inside = mask > 0
        self.walls |= inside
        if hatched:
            rows, cols = np.nonzero(inside)
            self.gray[rows, cols] = np.where((rows + cols) % 8 == 0, 0, self.gray[rows, cols])
            cv2.polylines(self.gray, [corners], True, 0, 2, cv2.LINE_8, SUB)
        else:
            self.gray[inside] = 0

    def opening(self, a: Point, b: Point, thick: float) -> None:
        """Take wall away between two jambs."""
        mask = np.zeros(self.gray.shape, dtype=np.uint8)
        cv2.fillPoly(mask, [self._band(a, b, thick)], 1, shift=SUB)
        self.gray[mask > 0] = 255
        self.walls[mask > 0] = False

    def leaf(self, hinge: Point, end: Point, swing: float, thick: float = 0.0) -> None:
        """A swing leaf: open leaf and arc, and the door that it is."""
        door = Door(hinge, end, swing)
        shut = atan2(end[1] - hinge[1], end[0] - hinge[0])
        turns = shut + np.linspace(0.0, swing, 40)
        self.line(
            *[(hinge[0] + door.width * cos(t), hinge[1] + door.width * sin(t)) for t in turns]
        )
        if thick:
            self.line(*self._corners(hinge, door.opened, thick), closed=True)
        else:
            self.line(hinge, door.opened)
        self.doors.append(door)

    def text(self, words: str, x: float, y: float, size: float = 0.6) -> None:
        """Letters."""
        cv2.putText(self.gray, words, (round(x), round(y)), cv2.FONT_HERSHEY_SIMPLEX, size, 0, 1)

    @staticmethod
    def _corners(a: Point, b: Point, thick: float) -> list[Point]:
        long = hypot(b[0] - a[0], b[1] - a[1])
        u, v = (b[0] - a[0]) / long, (b[1] - a[1]) / long
        dx, dy = -v * thick / 2, u * thick / 2
        return [
            (a[0] + dx, a[1] + dy),
            (b[0] + dx, b[1] + dy),
            (b[0] - dx, b[1] - dy),
            (a[0] - dx, a[1] - dy),
        ]

    @classmethod
    def _band(cls, a: Point, b: Point, thick: float) -> npt.NDArray[np.int32]:
        return np.rint(np.array(cls._corners(a, b, thick)) * (1 << SUB)).astype(np.int32)


def symbol(kind: str, turn_deg: float, width: float, in_wall: bool) -> tuple[Plan, Point]:
    """One door symbol in the middle of a sheet, and the middle of its opening.

    Args:
        kind: one of SYMBOLS.
        turn_deg: turn of the shut door, x towards y.
        width: px, of the opening.
        in_wall: with walls on both sides that run on to the sheet's margin.
    """
    side = round(6 * width)
    plan = Plan.blank(side, side, max(1, round(width / 45)))
    middle, turn, thick = side / 2, radians(turn_deg), max(5.0, 0.14 * width)

    def at(u: float, v: float) -> Point:
        """U widths along the shut door, v widths to the side it opens to."""
        x, y = u * width, -v * width
        return middle + x * cos(turn) - y * sin(turn), middle + x * sin(turn) + y * cos(turn)

    if in_wall:
        plan.wall(at(-2.5, 0), at(2.5, 0), thick)
        plan.opening(at(-0.5, 0), at(0.5, 0), 1.6 * thick)
    a, b, t = at(-0.5, 0), at(0.5, 0), thick / width
    if kind in ("single", "thick leaf"):
        plan.leaf(a, b, -pi / 2, 0.06 * width if kind == "thick leaf" else 0.0)
    elif kind == "half open":
        plan.leaf(a, b, -pi / 3)
    elif kind in ("double", "uneven double"):
        meet = at(0.0 if kind == "double" else 0.15, 0)
        plan.leaf(a, meet, -pi / 2)
        plan.leaf(b, meet, pi / 2)
    elif kind == "double acting":
        plan.leaf(a, b, -pi / 2)
        plan.leaf(a, b, pi / 2)
    elif kind == "pivot":
        plan.leaf(at(-0.3, 0), b, -pi / 2)
        plan.line(at(-0.3, 0), at(-0.3, -0.2))
    elif kind == "sliding":
        plan.line(*Plan._corners(at(-0.5, t / 4), at(0.05, t / 4), 0.05 * width), closed=True)
        plan.line(*Plan._corners(at(-0.05, -t / 4), at(0.5, -t / 4), 0.05 * width), closed=True)
    elif kind == "pocket":
        plan.line(*Plan._corners(at(-1.1, t), at(-0.1, t), 0.05 * width), closed=True)
        plan.line(a, b)
    elif kind == "folding":
        for start, stop in ((-0.5, 0.0), (0.5, 0.0)):
            middle_u = (start + stop) / 2
            plan.line(at(start, 0), at(middle_u, 0.3), at(stop, 0))
    return plan, at(0.0, 0.0)


def _rooms(outer: float, inner: float) -> Plan:
    """The flat that all five plans share: 12 m x 8 m, four rooms about a hall, six doors."""
    m = PX_PER_M
    plan = Plan.blank(round(10.5 * m), round(14 * m))
    x0, y0, x1, y1 = 1.0 * m, 1.0 * m, 13.0 * m, 9.0 * m
    half = outer * m / 2
    for a, b in (((x0 - half, y0), (x1 + half, y0)), ((x0 - half, y1), (x1 + half, y1))):
        plan.wall(a, b, outer * m)
    plan.wall((x0, y0), (x0, y1), outer * m)
    plan.wall((x1, y0), (x1, y1), outer * m)
    for a, b in (
        ((1, 4.2), (13, 4.2)),
        ((1, 5.8), (13, 5.8)),
        ((7, 1), (7, 4.2)),
        ((6, 5.8), (6, 9)),
    ):
        plan.wall((a[0] * m, a[1] * m), (b[0] * m, b[1] * m), inner * m)
    return plan


def _door(plan: Plan, hinge: Point, end: Point, turn: int, thick: float) -> None:
    """A door in m: an opening and a leaf that turns a right angle."""
    m = PX_PER_M
    a, b = (hinge[0] * m, hinge[1] * m), (end[0] * m, end[1] * m)
    plan.opening(a, b, (thick + 0.02) * m)
    plan.leaf(a, b, turn * pi / 2)


def plan(letter: str) -> Plan:
    """One of the five plans, "a" to "e", 60 px a metre."""
    outer, inner = (0.4, 0.15) if letter in "ce" else (0.3, 0.2)
    out, m = _rooms(outer, inner), PX_PER_M
    _door(out, (3.0, 4.2), (3.9, 4.2), -1, inner)
    _door(out, (10.0, 4.2), (9.1, 4.2), 1, inner)
    _door(out, (3.5, 5.8), (4.4, 5.8), 1, inner)
    _door(out, (11.0, 5.8), (10.1, 5.8), -1, inner)
    _door(out, (1.0, 4.55), (1.0, 5.45), -1, outer)
    if letter == "a":
        for words, x, y in (
            ("BEDROOM", 3, 2.5),
            ("LIVING 21 m2", 8.8, 2.5),
            ("BATH", 3, 7.5),
            ("KITCHEN", 9, 7.5),
            ("HALL", 6, 5.1),
        ):
            out.text(words, x * m, y * m)
        out.text("FIRST FLOOR PLAN", 4 * m, 10 * m, 1.2)
    if letter == "b":
        _furniture(out)
    if letter in "ce":
        _stairs(out)
        out.text("UP", 11.9 * m, 2.2 * m)
        out.text("STORE", 2 * m, 7.5 * m)
        out.text("S=38.60 m2", 8 * m, 7.5 * m)
        out.wall((4.5 * m, 1 * m), (4.5 * m, 4.2 * m), 0.1 * m)
    if letter == "e":
        _angled(out)
        out.wall((9 * m, 5.8 * m), (9 * m, 9 * m), 0.25 * m, hatched=True)
    return out


def _furniture(out: Plan) -> None:
    """Beds, tables with chairs, a sink: outlines that are no walls."""
    m = PX_PER_M
    for x, y, w, h in (
        (1.4, 1.4, 2.0, 1.6),
        (1.4, 1.4, 0.6, 1.6),
        (8.5, 2.0, 1.6, 0.9),
        (10.8, 6.2, 1.9, 0.6),
        (6.5, 8.2, 2.2, 0.6),
    ):
        out.line(
            (x * m, y * m),
            ((x + w) * m, y * m),
            ((x + w) * m, (y + h) * m),
            (x * m, (y + h) * m),
            closed=True,
        )
    for x, y, r in ((9.3, 7.4, 0.6), (11.3, 6.5, 0.2), (4.0, 7.6, 0.35)):
        cv2.circle(out.gray, (round(x * m), round(y * m)), round(r * m), 0, 1, cv2.LINE_AA)


def _stairs(out: Plan) -> None:
    """Ten treads with their arrow."""
    m = PX_PER_M
    for k in range(11):
        out.line(((10.3 + 0.25 * k) * m, 1.25 * m), ((10.3 + 0.25 * k) * m, 2.35 * m))
    out.line((10.3 * m, 2.35 * m), (12.8 * m, 2.35 * m))
    out.line((10.4 * m, 1.8 * m), (12.6 * m, 1.8 * m))


def _angled(out: Plan) -> None:
    """A wall across a corner of a room with a door in it."""
    m = PX_PER_M
    a, b = (1.0 * m, 7.2 * m), (2.8 * m, 9.0 * m)
    out.wall(a, b, 0.12 * m)
    u = (b[0] - a[0]) / hypot(b[0] - a[0], b[1] - a[1])
    hinge, end = (a[0] + 0.8 * m * u, a[1] + 0.8 * m * u), (a[0] + 1.7 * m * u, a[1] + 1.7 * m * u)
    out.opening(hinge, end, 0.14 * m)
    out.leaf(hinge, end, -pi / 2)


def sheet_of_symbols(width: float = 60.0) -> npt.NDArray[np.uint8]:
    """Every symbol at eight turns, in a wall, as one picture."""
    rows = []
    for kind in SYMBOLS:
        row = [symbol(kind, 45.0 * k, width, True)[0].gray for k in range(8)]
        cv2.putText(row[0], kind, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, 0, 1)
        rows.append(np.hstack(row))
    return np.vstack(rows)


def main() -> None:
    """Write all of them as PNG into the folder of the first argument."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    for letter in "abcde":
        drawn = plan(letter)
        cv2.imwrite(str(folder / f"plan_{letter}.png"), drawn.gray)
        mask = np.where(drawn.walls, 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"plan_{letter}_walls.png"), mask)
    cv2.imwrite(str(folder / "door_symbols.png"), sheet_of_symbols())


if __name__ == "__main__":
    main()
