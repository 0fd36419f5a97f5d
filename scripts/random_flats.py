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


def drawn(rng: Rng, boxes: Floats, unit: float, clutter: bool) -> tuple[Grey, float]:
    """The drawing, `unit` m a pixel; with a frame, letters and lines of other ink."""
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
    if clutter:
        cv2.rectangle(out, (2, 2), (cols - 3, rows - 3), 0, 1)
        for _ in range(int(wide * deep / 25)):
            at = (int(rng.uniform(0, cols)), int(rng.uniform(0, rows)))
            cv2.putText(out, f"{rng.uniform(2, 40):.1f}", at, 0, 0.35, 0, 1)
            if rng.random() < 0.4:
                to = (at[0] + int(rng.normal(0, 2 / unit)), at[1] + int(rng.normal(0, 2 / unit)))
                cv2.line(out, at, to, 0, 1)
    return out, border


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


def case(seed: int) -> Case:
    """One random case."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(["plain", "clutter", "twins", "stranger", "part"]))
    wide, deep = rng.uniform(9, 40), rng.uniform(7, 20)
    make = twins if kind == "twins" else building
    boxes = np.array(make(rng, wide, deep))
    real = np.array(building(rng, wide, deep)) if kind == "stranger" else boxes
    unit = max(wide, deep) / rng.uniform(350, 900)
    plan, border = drawn(rng, boxes, unit, kind == "clutter")
    scale = float(np.exp(rng.uniform(np.log(0.55), np.log(1.9))))
    if kind != "stranger":
        real = np.vstack([boxes[:4], boxes[4:][rng.random(len(boxes) - 4) > rng.uniform(0, 0.2)]])
    scans = int(rng.integers(2, 6)) if kind == "part" else int(rng.integers(6, 40))
    bend = float(rng.uniform(0, 0.013) * max(wide, deep))
    grey, metres = mapped(rng, real, scale * unit, scans, bend)
    matrix = metres / unit
    matrix[:, 2] += border / unit - 0.5
    if rng.random() < 0.05:
        plan = np.ascontiguousarray(plan[:, ::-1])
        matrix[0] = -matrix[0]
        matrix[0, 2] += plan.shape[1] - 1
    told = scale if rng.random() < 0.4 else None
    return Case(kind, plan, grey, None if kind == "stranger" else matrix, told)
