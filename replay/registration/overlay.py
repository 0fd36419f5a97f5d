"""Pictures of a map on a plan: what was found, and the other places that were thought of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from replay.registration.seen import Doubles, Mask, Seen, points_of

Pixels = npt.NDArray[np.uint8]
SIDE = 1400  # px of the longer side
FREE, OCCUPIED, ARROW = (200, 235, 200), (0, 0, 213), (178, 80, 0)  # BGR
LONGEST = 40.0  # px of the longest arrow, about


def overlay(grey: Pixels, seen: Seen, matrix: Doubles, side: int = SIDE) -> Pixels:
    """The plan in pale grey, the map's free space green and its walls red; (h, w, 3) BGR.

    Args:
        grey: (H, W) the plan as it is shown.
        seen: the map.
        matrix: (2, 3) map cells -> plan pixels.
        side: px of the longer side; small plans are not enlarged.
    """
    import cv2

    k = min(1.0, side / max(grey.shape))
    small = cv2.resize(grey, None, fx=k, fy=k, interpolation=cv2.INTER_AREA)
    pale = 255 - (255 - small) // 2
    out = np.repeat(pale[..., None], 3, axis=2)
    turned = matrix * k
    turned[:, 2] = (matrix[:, 2] + 0.5) * k - 0.5
    free = _drawn(seen.free, turned, small.shape)
    out[free] = np.minimum(out[free], FREE)
    out[_drawn(seen.occupied, turned, small.shape)] = OCCUPIED
    return out.astype(np.uint8)


def arrows(grey: Pixels, seen: Seen, matrix: Doubles, nodes: Doubles, moves: Doubles) -> Pixels:
    """The overlay, with an arrow from each node of the map to where the plan is.

    Arrows are longer than what they stand for, by a round factor that is written below.

    Args:
        grey, seen, matrix: as of `overlay`.
        nodes: (n, 2) x, y in plan pixels.
        moves: (n, 2) plan pixels.
    """
    import cv2

    k = min(1.0, SIDE / max(grey.shape))
    out = overlay(grey, seen, matrix)
    longest = k * float(np.hypot(*moves.T).max(initial=0.0))
    factor = _round(LONGEST / max(longest, LONGEST / 100.0))
    starts = (nodes + 0.5) * k - 0.5
    for start, end in zip(starts, starts + k * factor * moves, strict=True):
        a, b = ((round(float(p[0])), round(float(p[1]))) for p in (start, end))
        cv2.circle(out, a, 2, ARROW, -1, cv2.LINE_AA)
        if a != b:
            cv2.arrowedLine(out, a, b, ARROW, 2, cv2.LINE_AA, tipLength=0.25)
    foot = np.full((28, out.shape[1], 3), 255, np.uint8)
    text = f"arrows: from the map to the plan, {factor:g} times as long"
    cv2.putText(foot, text, (6, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.5, ARROW, 1, cv2.LINE_AA)
    return np.vstack([out, foot])


def _round(factor: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is not above a factor; 1 at least."""
    tens = 10.0 ** np.floor(np.log10(max(factor, 1.0)))
    return float(tens * max(n for n in (1.0, 2.0, 5.0) if n * tens <= max(factor, 1.0)))


def candidates(grey: Pixels, seen: Seen, matrices: Sequence[Doubles]) -> Pixels:
    """The first four places, two in a row."""
    tiles = [overlay(grey, seen, matrix, SIDE // 2) for matrix in matrices[:4]]
    while len(tiles) % 2:
        tiles.append(np.full_like(tiles[0], 255))
    rows = [np.hstack(tiles[i : i + 2]) for i in range(0, len(tiles), 2)]
    return np.vstack(rows)


def _drawn(mask: Mask, matrix: Doubles, shape: tuple[int, ...]) -> Mask:
    """The pixels that a mask's cells fall on, without holes where it is enlarged."""
    import cv2

    flags = cv2.INTER_NEAREST
    scale = float(np.hypot(matrix[0, 0], matrix[1, 0]))
    if scale >= 1.0:
        size = (shape[1], shape[0])
        return np.asarray(cv2.warpAffine(mask.astype(np.uint8), matrix, size, flags=flags)) > 0
    out = np.zeros(shape, np.bool_)
    at = np.rint(points_of(mask) @ matrix[:, :2].T + matrix[:, 2]).astype(np.int64)
    inside = ((at >= 0) & (at < [shape[1], shape[0]])).all(axis=1)
    out[at[inside, 1], at[inside, 0]] = True
    return out
