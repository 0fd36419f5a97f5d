"""Walls as a field: from any pixel to the nearest edge, how it runs, and the wall's other face."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from replay.registration.seen import Doubles, Mask, points_of

Floats = npt.NDArray[np.float32]
MOST_WALL = 12000
THIN = 4  # px: strokes below are lines, whose two edges are one


@dataclass(frozen=True)
class Field:
    """Of a mask: how far its pixels are, where its nearest edge is, how that runs, what it faces.

    Attributes:
        far: (H, W) px to the nearest pixel of the mask.
        near: (H, W) index in `at` of the nearest pixel of an edge.
        at: (n, 2) x, y of the edges' pixels: those beside a pixel that is not of the mask.
        normal: (n, 2) unit vectors across the stroke.
        across: (n, 2) px to the stroke's other edge; 0 where it is thin, or thicker than walls.
        wall: (m, 2) a sample of the mask's pixels.
    """

    far: Floats
    near: npt.NDArray[np.int32]
    at: Floats
    normal: Floats
    across: Floats
    wall: Floats


def field_of(mask: Mask, thickest: float = 0.0) -> Field:
    """The field of a mask with any pixel.

    Args:
        mask: (H, W).
        thickest: px that a stroke with two edges may be thick; 0: edges are not told apart.
    """
    empty = (~mask).astype(np.uint8)
    far = cv2.distanceTransform(empty, cv2.DIST_L2, cv2.DIST_MASK_5)
    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)
    edge = mask & (np.asarray(inner) == 0)
    edge = edge if edge.any() else mask
    _, labels = cv2.distanceTransformWithLabels(
        (~edge).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    points = points_of(edge)
    order = np.zeros(len(points) + 1, np.int32)
    order[labels[edge]] = np.arange(len(points))
    nx, ny = _normals(mask)
    normal = np.column_stack((nx[edge], ny[edge])).astype(np.float32)
    across = _across(mask, points, thickest)
    wall = points_of(mask).astype(np.float32)
    step = max(1, len(wall) // MOST_WALL)
    at = points.astype(np.float32)
    return Field(np.asarray(far, np.float32), order[labels], at, normal, across, wall[::step])


def _across(mask: Mask, at: Doubles, thickest: float) -> Floats:
    """From each pixel of an edge to the stroke's other edge, (n, 2) px."""
    out = np.zeros((len(at), 2), np.float32)
    most = round(thickest)
    if most < THIN:
        return out
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.5)
    cols, rows = at.astype(np.int64).T
    inward = np.column_stack(
        [cv2.Sobel(smooth, cv2.CV_32F, *d)[rows, cols] for d in ((1, 0), (0, 1))]
    )
    size = np.hypot(*inward.T)
    sure = size > 0.2 * float(size.max())
    inward /= np.maximum(size, 1e-9)[:, None]
    steps = np.arange(1, most + 2)[:, None, None] * inward + at
    x, y = (np.rint(steps[..., i]).astype(np.int64) for i in (0, 1))
    inside = (x >= 0) & (y >= 0) & (x < mask.shape[1]) & (y < mask.shape[0])
    solid = inside & mask[np.where(inside, y, 0), np.where(inside, x, 0)]
    depth = np.where(solid.all(axis=0), 0, solid.argmin(axis=0))
    thick = sure & (depth + 1 >= THIN) & (depth < most + 1)
    out[thick] = (depth[:, None] * inward)[thick]
    return out


def towards_free(free: Mask, points: Doubles) -> Doubles:
    """(n, 2) unit vectors from occupied cells to where more is free; 0 where no side is freer."""
    smooth = cv2.GaussianBlur(free.astype(np.float32), (0, 0), 2.0)
    cols, rows = points.astype(np.int64).T
    gradient = np.column_stack(
        [cv2.Sobel(smooth, cv2.CV_32F, *d)[rows, cols] for d in ((1, 0), (0, 1))]
    ).astype(np.float64)
    size = np.hypot(*gradient.T)
    return np.where((size > 0.1)[:, None], gradient / np.maximum(size, 1e-9)[:, None], 0.0)


def _normals(mask: Mask) -> tuple[Floats, Floats]:
    """Unit normals of the strokes, by the structure tensor."""
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    gx, gy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    xx, yy, xy = (cv2.GaussianBlur(a, (0, 0), 2.0) for a in (gx * gx, gy * gy, gx * gy))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.cos(angle), np.sin(angle)
