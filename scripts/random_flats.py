"""Random buildings, their drawings, and maps of parts of them: what alignment is calibrated on."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from scripts.flat import Box, Floats, cast

Rng = np.random.Generator
Grey = npt.NDArray[np.uint8]
DOOR = 0.9  # m
FAR = 12.0  # m, the sensor's range


@dataclass(frozen=True)
class Case:
    """A drawing, a map, and the truth.

    Attributes:
        kind: what is hard about it.
        plan: (H, W) grey of the drawing.
        map: (h, w) grey of the map: 0 occupied, 205 unknown, 254 free.
        matrix: (2, 3) map pixels -> plan pixels; None where the map is of another building.
        scale: plan pixels a map pixel, as far as told; None: free.
    """

    kind: str
    plan: Grey
    map: Grey
    matrix: Floats | None
    scale: float | None


def building(rng: Rng, wide: float, deep: float) -> list[Box]:
    """Walls of rooms made by splitting a rectangle again and again, a door in each split."""
    t = float(rng.uniform(0.15, 0.3))
    walls: list[Box] = [(0, 0, wide, t), (0, deep - t, wide, deep)]
    walls += [(0, 0, t, deep), (wide - t, 0, wide, deep)]
    least = float(rng.uniform(2.2, 3.5))
    inner = float(rng.uniform(0.08, 0.15))
    stack: list[Box] = [(t, t, wide - t, deep - t)]
    while stack:
        x0, y0, x1, y1 = stack.pop()
        w, h = x1 - x0, y1 - y0
        if max(w, h) < 2.2 * least or (w * h < 40 and rng.random() < 0.15):
            continue
        if w > h:
            x = float(rng.uniform(x0 + least, x1 - least))
            door = float(rng.uniform(y0 + 0.2, max(y1 - DOOR - 0.2, y0 + 0.21)))
            walls += [(x, y0, x + inner, door), (x, door + DOOR, x + inner, y1)]
            stack += [(x0, y0, x, y1), (x + inner, y0, x1, y1)]
        else:
            y = float(rng.uniform(y0 + least, y1 - least))
            door = float(rng.uniform(x0 + 0.2, max(x1 - DOOR - 0.2, x0 + 0.21)))
            walls += [(x0, y, door, y + inner), (door + DOOR, y, x1, y + inner)]
            stack += [(x0, y0, x1, y), (x0, y + inner, x1, y1)]
    return [b for b in walls if b[2] > b[0] and b[3] > b[1]]


def twins(rng: Rng, wide: float, deep: float) -> list[Box]:
    """Two like halves side by side, of which one has had a few small changes."""
    half = building(rng, wide / 2, deep)
    step = wide / 2 - 0.15
    other = [(x0 + step, y0, x1 + step, y1) for x0, y0, x1, y1 in half]
    for _ in range(int(rng.integers(1, 4))):
        x, y = rng.uniform(1, wide / 2 - 2) + step, rng.uniform(1, deep - 2)
        other.append((x, y, x + rng.uniform(0.4, 1.2), y + rng.uniform(0.4, 1.2)))
    return half + other


def drawn(rng: Rng, boxes: Floats, unit: float, style: str) -> tuple[Grey, float]:
    """The drawing, `unit` m a pixel, and its border in m.

    Args:
        rng: of everything that is not wall.
        boxes: walls, m.
        unit: m a pixel.
        style: "plain"; "clutter" (a frame, numbers, lines); "hollow" (walls as double lines);
            "sheet" (hollow or filled, with doors, furniture, hatching, dimensions, a title block).
    """
    wide, deep = boxes[:, 2].max(), boxes[:, 3].max()
    border = float(rng.uniform(0.3, 2.0))
    rows, cols = int((deep + 2 * border) / unit), int((wide + 2 * border) / unit)
    out = np.full((rows, cols), 255, np.uint8)
    for x0, y0, x1, y1 in (boxes + border) / unit:
        a, b = (
            (round(x0), round(y0)),
            (max(round(x0), round(x1) - 1), max(round(y0), round(y1) - 1)),
        )
        cv2.rectangle(out, a, b, 0, -1)
    if style == "hollow" or (style == "sheet" and rng.random() < 0.5):
        inner = np.asarray(cv2.erode(255 - out, np.ones((3, 3), np.uint8)))
        out[inner > 0] = 255
    if style in ("clutter", "sheet"):
        cv2.rectangle(out, (2, 2), (cols - 3, rows - 3), 0, 1)
        for _ in range(int(wide * deep / 25)):
            at = (int(rng.uniform(0, cols)), int(rng.uniform(0, rows)))
            cv2.putText(out, f"{rng.uniform(2, 40):.1f}", at, 0, 0.35, 0, 1)
            if rng.random() < 0.4:
                to = (at[0] + int(rng.normal(0, 2 / unit)), at[1] + int(rng.normal(0, 2 / unit)))
                cv2.line(out, at, to, 0, 1)
    if style == "sheet":
        out = _sheet(rng, out, unit)
    return out, border


def _sheet(rng: Rng, out: Grey, unit: float) -> Grey:
    """Door swings, furniture, hatched areas, dimension lines, and a title block at the foot."""
    rows, cols = out.shape
    for _ in range(int(rows * cols * unit * unit / 12)):
        x, y = int(rng.uniform(0, cols)), int(rng.uniform(0, rows))
        size = int(rng.uniform(0.5, 1.5) / unit)
        what = rng.integers(4)
        if what == 0:
            start = 90 * int(rng.integers(4))
            cv2.ellipse(out, (x, y), (size, size), 0, start, start + 90, 0, 1)
            cv2.line(out, (x, y), (x + size, y), 0, 1)
        elif what == 1:
            cv2.rectangle(out, (x, y), (x + size, y + int(size * rng.uniform(0.4, 1))), 0, 1)
        elif what == 2:
            for k in range(0, 2 * size, 6):
                cv2.line(out, (x + k, y), (x + k - size, y + size), 0, 1)
        else:
            cv2.circle(out, (x, y), size // 3 + 1, 0, 1)
    title = np.full((max(40, rows // 6), cols), 255, np.uint8)
    cv2.rectangle(title, (cols // 2, 4), (cols - 4, title.shape[0] - 4), 0, 2)
    for k in range(1, 4):
        y = 4 + k * (title.shape[0] - 8) // 4
        cv2.line(title, (cols // 2, y), (cols - 4, y), 0, 1)
        cv2.putText(title, "SECOND FLOOR 1:100", (cols // 2 + 6, y - 3), 0, 0.3, 0, 1)
    return np.vstack([out, title])


def mapped(rng: Rng, boxes: Floats, unit: float, scans: int, bend: float) -> tuple[Grey, Floats]:
    """A robot's map of a part, and its matrix: map pixels -> metres of the building."""
    wide, deep = boxes[:, 2].max(), boxes[:, 3].max()
    real = np.vstack([boxes, _furniture(rng, wide, deep)])
    angles = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    at = _inside(rng, real, wide, deep)
    rings, hits = [], []
    for _ in range(scans):
        far = cast(real, at[0], at[1], angles, FAR)
        seen = np.minimum(far, FAR) + rng.normal(0, 0.03, len(far))
        ends = at + seen[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        rings.append(ends)
        hits.append(ends[np.isfinite(far)])
        k = int(rng.integers(len(angles)))  # on to a place that it sees
        at = at + 0.7 * rng.random() * (ends[k] - at) if seen[k] > 1.0 else at
    turn = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    spin = np.array([[c, -s], [s, c]]) / unit
    middle = np.array([wide, deep]) / 2
    phase = rng.uniform(0, 2 * np.pi, 2)

    def bent(p: Floats) -> Floats:
        wave = np.sin(2 * np.pi * p[:, ::-1] / max(wide, deep) + phase)
        return p + bend * wave

    turned = [(bent(ring) - middle) @ spin.T for ring in rings]
    marks = (bent(np.vstack(hits)) - middle) @ spin.T
    low = np.vstack(turned).min(axis=0) - 10
    size = np.ceil(np.vstack(turned).max(axis=0) - low + 10).astype(int)
    out = np.full((size[1], size[0]), 205, np.uint8)
    for ring in turned:
        cv2.fillPoly(out, [np.rint(ring - low).astype(np.int32)], 254)
    cells = np.rint(marks - low).astype(int)
    out[cells[:, 1], cells[:, 0]] = 0
    back = np.linalg.inv(spin)
    return out, np.column_stack([back, back @ low + middle])


def _furniture(rng: Rng, wide: float, deep: float) -> Floats:
    n = int(rng.uniform(0.02, 0.2) * wide * deep)
    low = rng.uniform([0.3, 0.3], [wide - 1, deep - 1], (n, 2))
    return np.hstack([low, low + rng.uniform(0.2, 0.9, (n, 2))])


def _inside(rng: Rng, boxes: Floats, wide: float, deep: float) -> Floats:
    for _ in range(1000):
        p = rng.uniform([0.5, 0.5], [wide - 0.5, deep - 0.5])
        off = np.maximum(boxes[:, :2] - p, p - boxes[:, 2:]).max(axis=1)
        if off.min() > 0.3:
            return p
    raise ValueError("no room for the robot")


KINDS = ("plain", "clutter", "hollow", "sheet", "twins", "rooms", "stranger", "part")


def rooms(rng: Rng, wide: float, deep: float) -> list[Box]:
    """Two by two rooms that are all the same: no map of one of them has a place."""
    room = building(rng, wide / 2, deep / 2)
    return [
        (x0 + i * wide / 2, y0 + j * deep / 2, x1 + i * wide / 2, y1 + j * deep / 2)
        for i in (0, 1)
        for j in (0, 1)
        for x0, y0, x1, y1 in room
    ]


def case(seed: int) -> Case:
    """One random case.

    Raises:
        ValueError: there is no room for the robot.
    """
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    wide, deep = rng.uniform(9, 40), rng.uniform(7, 20)
    boxes = np.array({"twins": twins, "rooms": rooms}.get(kind, building)(rng, wide, deep))
    real = np.array(building(rng, wide, deep)) if kind == "stranger" else boxes
    unit = max(wide, deep) / rng.uniform(350, 900)
    style = kind if kind in ("clutter", "hollow", "sheet") else "plain"
    if kind in ("stranger", "part"):
        style = str(rng.choice(["plain", "clutter", "hollow", "sheet"]))
    plan, border = drawn(rng, boxes, unit, style)
    scale = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    if kind == "rooms":  # of one of them only
        real = boxes[: len(boxes) // 4]
    elif kind != "stranger":
        real = np.vstack([boxes[:4], boxes[4:][rng.random(len(boxes) - 4) > rng.uniform(0, 0.2)]])
    scans = int(rng.integers(2, 6)) if kind == "part" else int(rng.integers(6, 40))
    bend = float(rng.uniform(0, 0.013) * max(wide, deep))
    grey, metres = mapped(rng, real, scale * unit, scans, bend)
    matrix = metres / unit
    matrix[:, 2] += border / unit - 0.5
    if rng.random() < 0.1:
        plan = np.ascontiguousarray(plan[:, ::-1])
        matrix[0] = -matrix[0]
        matrix[0, 2] += plan.shape[1] - 1
    told = scale if rng.random() < 0.4 else None
    grey[grey == 205] = rng.choice([205, 127, 128])
    if rng.random() < 0.15:
        cv2.rectangle(grey, (1, 1), (grey.shape[1] - 2, grey.shape[0] - 2), 0, 2)
    if rng.random() < 0.15:
        grey = 255 - grey
    if rng.random() < 0.15:
        plan = 255 - plan
    known = kind not in ("stranger", "rooms")
    return Case(kind, plan, grey, matrix if known else None, told)
