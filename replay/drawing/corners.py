"""FindHarrisCorners of Algorithm 1 (PAPER D1). The paper prints no parameters: these are ours."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from replay.drawing.ink import Gray

Doubles = npt.NDArray[np.float64]
BLOCK, SOBEL, K = 3, 3, 0.04  # neighbourhood, aperture and Harris's constant
STRENGTH = 0.01  # of the strongest corner's response
APART = 5  # px: of corners nearer than half of this only the strongest stays
MOST = 4000  # corners at most, the strongest


def harris_corners(gray: Gray, most: int = MOST) -> Doubles:
    """Corners (n, 2) of x, y in px, sorted by row and column.

    Args:
        gray: (H, W), dark on bright.
        most: at most so many, by response.
    """
    soft = cv2.GaussianBlur(gray, (3, 3), 0)
    response = np.asarray(cv2.cornerHarris(soft, BLOCK, SOBEL, K), dtype=np.float32)
    if response.size == 0 or response.max() <= 0:
        return np.zeros((0, 2))
    peak = response >= cv2.dilate(response, np.ones((APART, APART), dtype=np.uint8))
    rows, cols = np.nonzero(peak & (response > STRENGTH * response.max()))
    strongest = np.argsort(-response[rows, cols], kind="stable")[:most]
    strongest.sort()
    return np.column_stack((cols[strongest], rows[strongest])).astype(np.float64)
