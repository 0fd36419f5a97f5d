"""What slides or folds in a gap of the walls, told from windows, by its ink in the gap's own frame.

Lengths are in widths of the opening: u along it from the wall's end, v to its left on the picture.
Each answer is how sure it is, 0 to 1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.drawing.gaps import Patch

DRAWN = 0.85  # of a stroke is inked
FAIRLY = 0.7  # of a few places along it are
ANCHORED = 0.14  # a stroke that begins so near to a jamb hangs on it
PART = (0.3, 0.85)  # of the opening that a sliding leaf covers
APART = (0.015, 0.3)  # between two sliding leaves
BARE = 0.1  # of what lies beside a sliding leaf may be ink
CLEAN = 0.12  # of the rest of the row may be ink
BESIDE = 0.24  # from the wall's face to a leaf that slides along it
LEAF = (0.7, 1.3)  # length of such a leaf
THIN = 0.14  # its thickness
FOLDED = 0.92  # of either leg is inked
FOLDS = (0.1, 0.5)  # length of half a fold along the opening
WHOLE = 0.9  # of the opening: a line from jamb to jamb
FLOOR = 0.85  # opening widths: how far to either side a floor is looked for
CALM = 0.6  # share of a straight way over that floor that may be inked


def _rows(seen: Patch, low: float, high: float) -> list[int]:
    """Rows of the patch with v between two bounds."""
    a = round(seen.middle - high * seen.unit)
    b = round(seen.middle - low * seen.unit)
    return [r for r in range(a, b + 1) if 1 <= r < seen.ink.shape[0] - 1]


def _runs(line: npt.NDArray[np.bool_], bridge: int) -> list[tuple[int, int]]:
    """(first, last) of every run of ink, short breaks bridged."""
    on = np.flatnonzero(line)
    if len(on) == 0:
        return []
    cuts = np.flatnonzero(np.diff(on) > bridge + 1)
    firsts, lasts = np.append(on[0], on[cuts + 1]), np.append(on[cuts], on[-1])
    return [(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]


def _line(seen: Patch, row: int) -> npt.NDArray[np.bool_]:
    """Ink along a row, half a stroke of slant allowed."""
    return np.asarray(seen.ink[row - 1 : row + 2].max(axis=0) > 0)


def calm(seen: Patch) -> bool:
    """Whether no stair, shaft or frame lies before the opening, on either side.

    Treads and frames are straight lines, along the opening or across, most of its width long.
    """
    n, left = seen.unit, seen.left
    first, last = left + round(0.1 * n), left + round(0.9 * n)
    near = max(0.5 * seen.thick, BESIDE) + 0.04
    for low, high in ((-FLOOR, -near), (near, FLOOR)):
        rows = _rows(seen, low, high)
        if len(rows) < 2:
            continue
        floor = np.array([_line(seen, row)[first:last] for row in rows])
        across = floor[:, 1:] | floor[:, :-1]
        if floor.mean(axis=1).max() > CALM or across.mean(axis=0).max() > CALM:
            return False
    return True


def sliding(seen: Patch) -> float:
    """How surely two leaves lie side by side, each hung on its jamb, neither reaching across.

    Nothing else may be drawn in the opening.
    """
    n, left = seen.unit, seen.left
    reach = max(0.5 * seen.thick, 0.08) + 0.06
    rows = _rows(seen, -reach, reach)
    hung: dict[int, list[tuple[int, float, float]]] = {0: [], 1: []}
    for row in rows:
        line = _line(seen, row)[left : left + round(n) + 1]
        for first, last in _runs(line, round(0.03 * n)):
            a, b = first / n, last / n
            rest = line.sum() - (last - first + 1)
            if rest > CLEAN * (len(line) - (last - first)) or not PART[0] <= b - a <= PART[1]:
                continue
            if a <= ANCHORED:
                hung[0].append((row, a, b))
            elif b >= 1 - ANCHORED:
                hung[1].append((row, a, b))
    if not (hung[0] and hung[1]):
        return 0.0
    stop = float(np.median([b for _, _, b in hung[0]]))
    start = float(np.median([a for _, a, _ in hung[1]]))
    one, other = ([row for row, _, _ in hung[k]] for k in (0, 1))
    apart = abs(float(np.mean(one)) - float(np.mean(other))) / n
    thick = max(np.ptp(one), np.ptp(other)) / n
    if not (APART[0] <= apart <= APART[1] and -0.06 <= stop - start <= 0.4 and thick <= THIN):
        return 0.0
    alone = [
        _share_beside(seen, rows, own, a, b)
        for own, a, b in ((one, 0.06, start - 0.05), (other, stop + 0.05, 0.94))
    ]
    if max(alone) > BARE:
        return 0.0
    return min(1.0, 0.5 + 0.5 * min(stop, 1 - start))


def _share_beside(seen: Patch, rows: list[int], own: list[int], start: float, stop: float) -> float:
    """Share of ink beside a leaf, between two places along the opening."""
    first, last = (seen.left + round(u * seen.unit) for u in (start, stop))
    edge = round(0.02 * seen.unit) + 1
    others = [row for row in rows if not min(own) - edge <= row <= max(own) + edge]
    if last <= first or not others:
        return 0.0
    return float(seen.ink[others, first:last].mean())


def closing_lines(seen: Patch) -> int:
    """How many lines lead from jamb to jamb within the wall's thickness."""
    n, left = seen.unit, seen.left
    half = max(0.5 * seen.thick, 0.04) + 0.04
    rows = _rows(seen, -half, half)
    first, last = left + round(0.06 * n), left + round(0.94 * n)
    whole = np.array([_line(seen, row)[first:last].mean() > WHOLE for row in rows], dtype=np.int8)
    return int(np.count_nonzero(np.diff(np.concatenate(([0], whole, [0]))) == 1))


def pocket(seen: Patch, solid: Patch) -> float:
    """How surely a leaf slides along the wall's face: a thin closed shape, alone beside the wall.

    The opening holds a line at most.
    """
    n, left = seen.unit, seen.left
    half = max(0.5 * seen.thick, 0.04)
    inside = [_line(seen, r)[left : left + round(n) + 1] for r in _rows(seen, -half, half)]
    share = np.array([line[2:-2].mean() for line in inside])
    others = share[share <= WHOLE]
    if len(others) and np.median(others) > 0.15:
        return 0.0
    for side in (-1, 1):
        low, high = sorted((side * half, side * (half + BESIDE)))
        runs = []
        for row in _rows(seen, low, high):
            line = _line(seen, row)
            for first, last in _runs(line, round(0.03 * n)):
                a, b = (first - left) / n, (last - left) / n
                touches = first == 0 or last == len(line) - 1
                if not touches and LEAF[0] <= b - a <= LEAF[1] and a < 1.3 and b > -0.3:
                    runs.append((row, a, b))
        for row, a, b in runs:
            alike = [r for r, c, d in runs if abs(a - c) < 0.05 and abs(b - d) < 0.05]
            thick = (max(alike) - min(alike)) / n
            shaped = row == min(alike) and 0.025 <= thick <= THIN
            if shaped and _alone(seen, alike, a, b) and _by_wall(solid, a, b):
                return 0.8
    return 0.0


def _alone(seen: Patch, rows: list[int], start: float, stop: float) -> bool:
    """Whether white lies beside a leaf on the side away from the wall, and at both its ends."""
    n = seen.unit
    edge = round(0.02 * n) + 2
    above, below = (seen.middle - min(rows)) / n, (seen.middle - max(rows)) / n
    out = (
        (seen.middle - min(rows) + edge) / n if above > 0 else (seen.middle - max(rows) - edge) / n
    )
    ways = [
        ((start + 0.05, out), (stop - 0.05, out)),
        ((start - 0.06, above), (start - 0.06, below)),
        ((stop + 0.06, above), (stop + 0.06, below)),
    ]
    ends = np.array(ways, dtype=np.float64)
    return bool((seen.along(ends[:, 0], ends[:, 1]) < 0.1).all())


def _by_wall(solid: Patch, start: float, stop: float) -> bool:
    """Whether a wall runs along that part of a leaf which is not before the opening."""
    outer = (start, min(stop, -0.04)) if start + stop < 1 else (max(start, 1.04), stop)
    if outer[1] - outer[0] < 0.3:
        return False
    way = np.array([[outer[0], 0.0]]), np.array([[outer[1], 0.0]])
    return float(solid.along(*way)[0]) > DRAWN


def folding(seen: Patch) -> float:
    """How surely panels fold up from a jamb: the two equal legs of a triangle over the opening."""
    halves, heights = np.linspace(*FOLDS, 17), np.linspace(0.12, 0.5, 20)
    levels = (0.0, 0.5 * seen.thick, -0.5 * seen.thick)
    half, high, level, side, jamb = (
        a.ravel()
        for a in np.meshgrid(halves, heights, levels, (-1.0, 1.0), (0.0, 1.0), indexing="ij")
    )
    away = np.where(jamb == 0, 1.0, -1.0)
    foot = np.column_stack((jamb, level))
    top = np.column_stack((jamb + away * half, level + side * high))
    other = np.column_stack((jamb + away * 2 * half, level))
    steep = (high / half > 0.5) & (high / half < 3.0)
    steep &= seen.along(foot + 0.08 * (top - foot), top, 8) > FAIRLY
    foot, top, other = foot[steep], top[steep], other[steep]
    if len(foot) == 0:
        return 0.0
    legs = np.minimum(
        seen.along(foot + 0.08 * (top - foot), top - 0.04 * (top - foot)),
        seen.along(top + 0.04 * (other - top), other - 0.08 * (other - top)),
    )
    middle = 0.5 * (foot + other)
    inner = seen.along(middle + 0.75 * (top - middle), middle)
    good = (legs >= FOLDED) & (inner < 0.5)
    return float(legs[good].max()) if good.any() else 0.0
