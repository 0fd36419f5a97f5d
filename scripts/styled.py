"""One building with exact truth, drawn in the styles that offices draw, print, scan and send.

Lengths are in metres of the building, x right and y down, until `Pen` turns them into pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from math import atan2, cos, hypot, pi, radians, sin

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.shapes import Door

Gray = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Point = tuple[float, float]
PX = 70.0  # a metre
EDGE = 2.0  # m of paper about the building
FINE = 2  # pixels are drawn so much finer, then averaged
OUTER, INNER, THIN = 0.30, 0.14, 0.09
WIDE, HIGH = 14.0, 10.0
WALLS: tuple[tuple[Point, Point, float], ...] = (
    ((-0.15, 0.0), (14.15, 0.0), OUTER),
    ((-0.15, 10.0), (14.15, 10.0), OUTER),
    ((0.0, 0.0), (0.0, 10.0), OUTER),
    ((14.0, 0.0), (14.0, 10.0), OUTER),
    ((0.0, 4.2), (14.0, 4.2), INNER),
    ((0.0, 5.8), (14.0, 5.8), INNER),
    ((4.5, 0.0), (4.5, 4.2), INNER),
    ((9.2, 0.0), (9.2, 4.2), INNER),
    ((5.2, 5.8), (5.2, 10.0), INNER),
    ((10.0, 5.8), (10.0, 10.0), INNER),
    ((10.0, 7.9), (14.0, 7.9), THIN),
)
# hinge, end, turn (-1 or 1), thickness of the wall that it opens
DOORS: tuple[tuple[Point, Point, int, float], ...] = (
    ((2.0, 4.2), (2.9, 4.2), -1, INNER),
    ((7.5, 4.2), (6.6, 4.2), 1, INNER),
    ((12.0, 4.2), (12.9, 4.2), -1, INNER),
    ((3.0, 5.8), (3.9, 5.8), 1, INNER),
    ((8.0, 5.8), (7.1, 5.8), -1, INNER),
    ((11.0, 5.8), (11.8, 5.8), 1, INNER),
    ((13.2, 7.9), (12.4, 7.9), -1, THIN),
    ((0.0, 4.5), (0.0, 5.5), -1, OUTER),
    ((14.0, 4.35), (14.0, 5.0), 1, OUTER),
    ((14.0, 5.65), (14.0, 5.0), -1, OUTER),
)
WINDOWS: tuple[tuple[Point, Point], ...] = (
    ((1.2, 0.0), (3.2, 0.0)),
    ((6.0, 0.0), (8.0, 0.0)),
    ((10.8, 0.0), (12.6, 0.0)),
    ((1.5, 10.0), (3.5, 10.0)),
    ((6.5, 10.0), (8.5, 10.0)),
    ((0.0, 1.4), (0.0, 2.8)),
    ((14.0, 8.4), (14.0, 9.4)),
)
LABELS: tuple[tuple[str, float, float], ...] = (
    ("BEDROOM", 1.3, 2.4),
    ("LIVING 19.7 m2", 5.6, 1.6),
    ("STUDY", 10.4, 2.9),
    ("HALL", 6.6, 5.1),
    ("KITCHEN", 1.6, 8.6),
    ("DINING", 6.8, 8.8),
    ("BATH", 11.6, 7.2),
)


@dataclass
class Pen:
    """A picture under the pen: lines, walls' mask and doors."""

    stroke: float = 1.4
    gray: Gray = field(init=False)
    walls: Gray = field(init=False)
    doors: list[Door] = field(default_factory=list)

    def __post_init__(self) -> None:
        shape = tuple(round((side + 2 * EDGE) * PX * FINE) for side in (HIGH, WIDE))
        self.gray = np.full(shape, 255, dtype=np.uint8)
        self.walls = np.zeros(shape, dtype=np.uint8)

    @staticmethod
    def px(*points: Point) -> npt.NDArray[np.int32]:
        """Places in the fine picture."""
        return np.rint((np.array(points) + EDGE) * (PX * FINE) - 0.5).astype(np.int32)

    def line(self, *points: Point, stroke: float = 0, tone: int = 0, closed: bool = False) -> None:
        """A stroke through points."""
        wide = max(1, round(FINE * (stroke or self.stroke)))
        cv2.polylines(self.gray, [self.px(*points)], closed, tone, wide)

    def box(self, x: float, y: float, w: float, h: float, tone: int | None = None) -> None:
        """A rectangle, filled with a tone or not."""
        corners = (x, y), (x + w, y), (x + w, y + h), (x, y + h)
        if tone is not None:
            cv2.fillPoly(self.gray, [self.px(*corners)], tone)
        self.line(*corners, closed=True)

    def arc(self, x: float, y: float, r: float, first: float = 0.0, extent: float = 2 * pi) -> None:
        """A circle or a part of it."""
        turns = first + np.linspace(0.0, extent, 60)
        self.line(*[(x + r * cos(t), y + r * sin(t)) for t in turns])

    def text(self, words: str, x: float, y: float, size: float = 0.16) -> None:
        """Letters of a height in m."""
        scale = size * PX * FINE / 22
        at = self.px((x, y))[0].tolist()
        cv2.putText(self.gray, words, at, cv2.FONT_HERSHEY_SIMPLEX, scale, 0, FINE, cv2.LINE_AA)

    def band(self, a: Point, b: Point, thick: float, value: int) -> None:
        """A straight stretch of wall (1), or none (0)."""
        u, v = (b[0] - a[0]), (b[1] - a[1])
        dx, dy = -v / hypot(u, v) * thick / 2, u / hypot(u, v) * thick / 2
        corners = (
            (a[0] + dx, a[1] + dy),
            (b[0] + dx, b[1] + dy),
            (b[0] - dx, b[1] - dy),
            (a[0] - dx, a[1] - dy),
        )
        cv2.fillPoly(self.walls, [self.px(*corners)], value)

    def door(self, hinge: Point, end: Point, turn: int, thick: float) -> None:
        """An opening with its leaf and arc."""
        self.band(hinge, end, thick + 0.04, 0)
        wide, shut = (
            hypot(end[0] - hinge[0], end[1] - hinge[1]),
            atan2(end[1] - hinge[1], end[0] - hinge[0]),
        )
        self.arc(*hinge, wide, shut, turn * pi / 2)
        self.line(
            hinge,
            (
                hinge[0] + wide * cos(shut + turn * pi / 2),
                hinge[1] + wide * sin(shut + turn * pi / 2),
            ),
        )
        a, b = ((np.array(p) + EDGE) * PX - 0.5 for p in (hinge, end))
        self.doors.append(Door((a[0], a[1]), (b[0], b[1]), turn * pi / 2))

    def window(self, a: Point, b: Point) -> None:
        """An opening in an outer wall with its sill and pane."""
        self.band(a, b, OUTER + 0.04, 0)
        across = np.array([-(b[1] - a[1]), b[0] - a[0]]) / hypot(b[0] - a[0], b[1] - a[1])
        for side in (-0.5, -0.1, 0.1, 0.5):
            p, q = (tuple((np.array(end) + side * OUTER * across).tolist()) for end in (a, b))
            self.line(p, q)


Fill = Callable[[Pen], None]


def solid(tone: int, rim: bool = False) -> Fill:
    """Walls of one tone, with their outline drawn or not."""

    def fill(pen: Pen) -> None:
        pen.gray[pen.walls > 0] = tone
        if rim:
            hollow(pen)

    return fill


def hollow(pen: Pen, stroke: float = 0.0) -> None:
    """The outlines of the walls alone."""
    rims, _ = cv2.findContours(pen.walls, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.polylines(pen.gray, rims, True, 0, max(1, round(FINE * (stroke or pen.stroke))))


def hatched(step: float, crossed: bool = False) -> Fill:
    """Slanted lines every `step` px, from edge to edge."""

    def fill(pen: Pen) -> None:
        rows, cols = np.indices(pen.gray.shape)
        every = round(step * FINE * 1.414)
        on = (rows + cols) % every < FINE
        if crossed:
            on |= (rows - cols) % every < FINE
        pen.gray[on & (pen.walls > 0)] = 0
        hollow(pen)

    return fill


def building(fill: Fill, stroke: float = 1.4, curved: bool = False, bare: bool = False) -> Pen:
    """The building with doors and windows; with furniture, stairs and labels unless bare."""
    pen = Pen(stroke)
    for a, b, thick in WALLS:
        pen.band(a, b, thick, 1)
    if curved:
        _curved(pen)
    for a, b in WINDOWS:
        pen.window(a, b)
    for door in DOORS:
        pen.door(*door)
    if curved:  # a door in the slanted wall
        u = 0.7071
        hinge = (2.2 * u, 10.0 - 2.2 * u)
        hinge = (0.7, 7.7)
        pen.door(hinge, (hinge[0] + 0.9 * u, hinge[1] + 0.9 * u), -1, INNER)
    if not bare:
        furniture(pen)
        for label in LABELS:
            pen.text(*label)
    fill(pen)
    return pen


def _curved(pen: Pen) -> None:
    """A bay of a half circle on the upper wall, a round wall in a room, a slanted one."""
    for x, y, r, first, thick in ((4.5, 0.0, 1.1, pi, OUTER), (9.2, 4.2, 1.6, -pi / 2, INNER)):
        extent = pi if thick == OUTER else pi / 2
        turns = first + np.linspace(0, extent, 60)
        for s, t in pairwise(turns.tolist()):
            pen.band(
                (x + r * cos(s), y + r * sin(s)),
                (x + r * cos(t + 0.01), y + r * sin(t + 0.01)),
                thick,
                1,
            )
    pen.band((0.0, 7.0), (3.0, 10.0), INNER, 1)


def furniture(pen: Pen) -> None:
    """Beds, tables with chairs, cupboards, sanitary ware, a stair."""
    for x, y, w, h in (
        (0.2, 0.3, 2.0, 0.6),
        (1.0, 2.7, 1.6, 1.3),
        (4.7, 2.2, 0.8, 1.8),
        (6.0, 2.5, 1.2, 0.7),
        (11.5, 0.2, 2.3, 0.6),
        (0.2, 9.25, 4.8, 0.6),
        (6.5, 7.4, 1.8, 0.9),
        (10.15, 6.9, 0.7, 0.9),
        (10.2, 8.1, 1.5, 0.7),
    ):
        pen.box(x, y, w, h)
    pen.line((0.2, 0.6), (2.2, 0.6))
    for x in (6.8, 7.4, 8.0):
        pen.arc(x, 7.15, 0.17)
        pen.arc(x, 8.55, 0.17)
    pen.arc(10.5, 7.3, 0.2)
    pen.arc(13.4, 6.5, 0.3)
    for k in range(9):
        pen.line((9.6 + 0.26 * k, 3.0), (9.6 + 0.26 * k, 4.0))
    pen.line((9.6, 3.0), (9.6 + 0.26 * 8, 3.0))
    pen.line((9.7, 3.5), (11.6, 3.5))


def dimensions(pen: Pen) -> None:
    """Dimension lines with ticks and figures on two sides, and axes through the building."""
    for y, marks in ((-1.0, (0, 4.5, 9.2, 14)), (-0.6, (0, 1.2, 3.2, 6, 8, 10.8, 12.6, 14))):
        pen.line((marks[0], y), (marks[-1], y))
        for x in marks:
            pen.line((x - 0.08, y + 0.08), (x + 0.08, y - 0.08))
            pen.line((x, y - 0.15), (x, -0.25))
        for a, b in pairwise(marks):
            pen.text(f"{b - a:.2f}", (a + b) / 2 - 0.2, y - 0.06, 0.12)
    pen.line((-0.8, 0), (-0.8, 10))
    for y in (0, 4.2, 5.8, 10):
        pen.line((-0.88, y + 0.08), (-0.72, y - 0.08))
        pen.line((-0.95, y), (-0.25, y))


def dashes(pen: Pen) -> None:
    """Dashed axes, beams overhead and cupboards on the wall."""
    ways = [((x, -1.2), (x, 11.2)) for x in (2.25, 6.85, 11.6)]
    ways += [((-1.2, y), (15.2, y)) for y in (2.1, 5.0, 7.9)]
    ways += [((0.2, 8.9), (5.0, 8.9)), ((5.4, 3.0), (9.0, 3.0)), ((5.4, 3.2), (9.0, 3.2))]
    for a, b in ways:
        long = hypot(b[0] - a[0], b[1] - a[1])
        for s in np.arange(0.0, long, 0.3):
            p, q = (
                (a[0] + (b[0] - a[0]) * t / long, a[1] + (b[1] - a[1]) * t / long)
                for t in (s, min(long, s + 0.18))
            )
            pen.line(p, q)


def words(pen: Pen) -> None:
    """Notes in every room and a legend beside."""
    for k in range(7):
        pen.text(
            f"{k}: plaster 15 mm, skirting oak, floor 2 coats", 14.4 - 0.1, 1.0 + 0.4 * k, 0.09
        )
    for x, y in ((0.4, 1.4), (5.0, 0.7), (9.6, 1.0), (0.5, 6.6), (5.6, 6.5), (10.5, 9.2)):
        for k, note in enumerate(("H=2.60 F30", "A 12.4 U 14.1", "P 3x16A")):
            pen.text(note, x, y + 0.25 * k, 0.13)
    pen.text("GROUND FLOOR PLAN SCALE 1:100", 2.0, 11.6, 0.35)


def title_block(pen: Pen) -> None:
    """The border of the sheet, and a large block of fields with letters and a logo."""
    pen.line((-1.8, -1.8), (15.8, -1.8), (15.8, 11.8), (-1.8, 11.8), closed=True, stroke=3)
    pen.box(9.0, 10.5, 6.8, 1.3)
    for y in (10.8, 11.1, 11.4):
        pen.line((9.0, y), (15.8, y))
    pen.line((12.0, 10.5), (12.0, 11.8))
    for k, words_ in enumerate(("PROJECT 17", "ARCHITECT", "1:100", "DATE 2017")):
        pen.text(words_, 9.2, 10.75 + 0.3 * k)
    pen.box(14.6, 10.55, 0.9, 0.2, 0)


def coloured(pen: Pen) -> Gray:
    """Rooms, floors and furniture in colours, as brochures have them; walls dark brown."""
    colour = np.full((*pen.gray.shape, 3), 255, dtype=np.uint8)
    tones = {
        (0, 0, 4.5, 4.2): (205, 235, 250),
        (4.5, 0, 9.2, 4.2): (190, 225, 245),
        (9.2, 0, 14, 4.2): (225, 245, 220),
        (0, 4.2, 14, 5.8): (235, 240, 245),
        (0, 5.8, 5.2, 10): (200, 220, 255),
        (5.2, 5.8, 10, 10): (190, 225, 245),
        (10, 5.8, 14, 10): (250, 230, 200),
    }
    for (x0, y0, x1, y1), tone in tones.items():
        cv2.rectangle(colour, pen.px((x0, y0))[0].tolist(), pen.px((x1, y1))[0].tolist(), tone, -1)
    for x, y, w, h in ((1.0, 2.7, 1.6, 1.3), (4.7, 2.2, 0.8, 1.8), (6.5, 7.4, 1.8, 0.9)):
        a, b = pen.px((x, y), (x + w, y + h)).tolist()
        cv2.rectangle(colour, a, b, (150, 190, 220), -1)
    colour[pen.gray < 128] = (70, 70, 70)
    colour[pen.walls > 0] = (30, 45, 60)
    return np.asarray(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class Sheet:
    """A finished drawing: (H, W), with its walls and doors."""

    gray: Gray
    walls: Mask
    doors: list[Door]


def finished(pen: Pen, gray: Gray | None = None) -> Sheet:
    """The fine picture at its size."""
    size = pen.gray.shape[1] // FINE, pen.gray.shape[0] // FINE
    small, walls = (
        cv2.resize(p, size, interpolation=cv2.INTER_AREA)
        for p in (pen.gray if gray is None else gray, pen.walls * np.uint8(255))
    )
    return Sheet(np.asarray(small, np.uint8), np.asarray(walls) > 127, pen.doors)


def turned(sheet: Sheet, degrees: float, scale: float = 1.0) -> Sheet:
    """The sheet laid down askew, or printed at another size."""
    rows, cols = sheet.gray.shape
    plain = cv2.getRotationMatrix2D((cols / 2, rows / 2), degrees, 1.0)
    way: npt.NDArray[np.float64] = np.array(plain, dtype=np.float64)
    way[:, :2] *= scale
    wide = round(scale * (cols + rows * abs(sin(radians(degrees)))))
    high = round(scale * (rows + cols * abs(sin(radians(degrees)))))
    way[:, 2] = np.array([wide, high]) / 2 - way[:, :2] @ np.array([cols, rows]) / 2
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    if degrees == 0:
        gray, walls = (
            cv2.resize(p, (wide, high), interpolation=how)
            for p in (sheet.gray, sheet.walls.astype(np.uint8) * 255)
        )
    else:
        gray = cv2.warpAffine(sheet.gray, way, (wide, high), flags=how, borderValue=255)
        walls = cv2.warpAffine(sheet.walls.astype(np.uint8) * 255, way, (wide, high), flags=how)

    def moved(p: Point) -> Point:
        x, y = way[:, :2] @ np.array(p) + way[:, 2]
        return float(x), float(y)

    doors = [Door(moved(d.hinge), moved(d.end), d.swing) for d in sheet.doors]
    return Sheet(np.asarray(gray, np.uint8), np.asarray(walls) > 127, doors)


def scanned(sheet: Sheet, degrees: float) -> Sheet:
    """Askew, soft, with the grain of paper, shadows along one edge and specks."""
    out = turned(sheet, degrees)
    rng = np.random.default_rng(5)
    soft = cv2.GaussianBlur(out.gray.astype(np.float32), (0, 0), 0.9)
    shade = 240 - 25 * np.linspace(0, 1, soft.shape[1])[None, :] ** 3
    noisy = 40 + soft / 255 * (shade - 40) + rng.normal(0, 7, soft.shape)
    specks = rng.random(soft.shape) < 2e-4
    noisy[specks] = 60
    return Sheet(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), out.walls, out.doors)


def as_jpeg(sheet: Sheet, quality: int) -> Sheet:
    """Through a JPEG and back."""
    _, data = cv2.imencode(".jpg", sheet.gray, [cv2.IMWRITE_JPEG_QUALITY, quality])
    gray = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    return Sheet(np.asarray(gray, np.uint8), sheet.walls, sheet.doors)


def with_(pen: Pen, *more: Callable[[Pen], None]) -> Pen:
    """The same with more drawn on it."""
    for draw in more:
        draw(pen)
    return pen


def _pale(pen: Pen) -> Gray:
    """Grey pencil on yellowed paper."""
    return (232 - (255 - pen.gray.astype(np.int32)) * 90 // 255).astype(np.uint8)


def _coloured() -> Sheet:
    pen = building(solid(0))
    return finished(pen, coloured(pen))


STYLES: dict[str, Callable[[], Sheet]] = {
    "filled black": lambda: finished(building(solid(0))),
    "filled grey": lambda: finished(building(solid(150))),
    "light grey with outlines": lambda: finished(building(solid(205, rim=True))),
    "coloured rooms": _coloured,
    "hollow, double lines": lambda: finished(building(hollow, 2.0)),
    "hatched at 45 degrees": lambda: finished(building(hatched(5))),
    "cross-hatched": lambda: finished(building(hatched(6, crossed=True))),
    "thin hollow, dimensioned": lambda: finished(with_(building(hollow, 1.0), dimensions)),
    "filled, dimensioned": lambda: finished(with_(building(solid(0), 1.0), dimensions)),
    "scanned, 1.5 degrees askew": lambda: scanned(finished(building(solid(0))), 1.5),
    "scanned hollow": lambda: scanned(finished(building(hollow, 2.0)), -1.0),
    "JPEG of quality 30": lambda: as_jpeg(finished(building(solid(0))), 30),
    "JPEG of quality 30, hollow": lambda: as_jpeg(finished(building(hollow, 2.0)), 30),
    "low resolution, 28 px a metre": lambda: turned(finished(building(solid(0))), 0.0, 0.4),
    "inverted": lambda: (lambda s: Sheet(255 - s.gray, s.walls, s.doors))(
        finished(building(solid(0)))
    ),
    "frame and title block": lambda: finished(with_(building(solid(0)), title_block)),
    "hollow, frame and title block": lambda: finished(with_(building(hollow, 2.0), title_block)),
    "dashed axes and beams": lambda: finished(with_(building(solid(0)), dashes)),
    "hollow, dashed axes and beams": lambda: finished(with_(building(hollow), dashes)),
    "text-heavy": lambda: finished(with_(building(solid(0)), words)),
    "curved and slanted walls": lambda: finished(building(solid(0), curved=True)),
    "hollow, curved and slanted": lambda: finished(building(hollow, 2.0, curved=True)),
    "turned by 20 degrees": lambda: turned(finished(building(solid(0))), 20.0),
    "hollow, turned by 7 degrees": lambda: turned(finished(building(hollow, 2.0)), 7.0),
    "pencil, pale on yellowed paper": lambda: (lambda pen: finished(pen, _pale(pen)))(
        building(solid(0))
    ),
    "bare walls and doors": lambda: finished(building(solid(0), bare=True)),
    "bare, hollow": lambda: finished(building(hollow, bare=True)),
}
