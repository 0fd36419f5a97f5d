"""How well walls and doors were read from a drawing: pixels of walls, sectors of doors."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, pi
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.plans.annotations import Truth, filled
from replay.drawing.shapes import Door, Drawing

Mask = npt.NDArray[np.bool_]
Polygon = npt.NDArray[np.float64]
GROWN = 7  # px, side of the square that forgives 3 px
IOU_NEEDED = 0.5  # of swept sectors
HINGE_NEAR = 0.3  # of the true door's width
WIDTH_NEAR = 0.25  # of the true door's width


class WallScore(NamedTuple):
    """Pixels of walls; f1_3px forgives 3 px by growing either mask."""

    precision: float
    recall: float
    f1: float
    iou: float
    f1_3px: float


class DoorScore(NamedTuple):
    """Doors found, one to one."""

    precision: float
    recall: float
    f1: float


def score_walls(walls: Mask, truth: Mask) -> WallScore:
    """Compare two masks (H, W) of walls. 0/0 is 0, as in PAPER A11-A13.

    `f1_3px` joins the share of found pixels on the grown truth with the share of true pixels
    under the grown finding; grown by a square of 7 x 7.
    """
    import cv2

    square = np.ones((GROWN, GROWN), dtype=np.uint8)

    def grown(mask: Mask) -> Mask:
        return np.asarray(cv2.dilate(mask.astype(np.uint8), square)).astype(np.bool_)

    both = int(np.count_nonzero(walls & truth))
    found, true = int(np.count_nonzero(walls)), int(np.count_nonzero(truth))
    near = share(int(np.count_nonzero(walls & grown(truth))), found)
    reached = share(int(np.count_nonzero(truth & grown(walls))), true)
    precision, recall = share(both, found), share(both, true)
    return WallScore(
        precision,
        recall,
        harmonic(precision, recall),
        share(both, found + true - both),
        harmonic(near, reached),
    )


def score_doors(doors: Sequence[Door], truth: Sequence[Polygon]) -> DoorScore:
    """Swept sectors against annotated ones: a pair counts from an IoU of 0.5 on."""
    overlaps = np.zeros((len(doors), len(truth)))
    for i, door in enumerate(doors):
        sector = door.sector()
        for j, polygon in enumerate(truth):
            overlaps[i, j] = iou(sector, polygon)
    return _score(_pairs(overlaps, IOU_NEEDED), len(doors), len(truth))


def score_hinges(doors: Sequence[Door], truth: Sequence[Polygon]) -> DoorScore:
    """Hinge within 0.3 and width within 0.25 of the true door's width.

    The truth's hinge and width are those of the quarter circle that fits its polygon best.
    """
    true = [quarter(polygon) for polygon in truth]
    nearness = np.zeros((len(doors), len(true)))
    for i, door in enumerate(doors):
        for j, other in enumerate(true):
            far = hypot(door.hinge[0] - other.hinge[0], door.hinge[1] - other.hinge[1])
            alike = abs(door.width - other.width) <= WIDTH_NEAR * other.width
            if alike and far <= HINGE_NEAR * other.width:
                nearness[i, j] = 1.0 - 0.5 * far / max(other.width, 1e-9)
    return _score(_pairs(nearness, IOU_NEEDED), len(doors), len(true))


def score(drawing: Drawing, truth: Truth) -> dict[str, dict[str, float]]:
    """Every score of a drawing, by name: walls, and doors where the truth has them."""
    out = {"walls": dict(score_walls(drawing.walls, truth.walls)._asdict())}
    if truth.has_doors:
        out["doors"] = dict(score_doors(drawing.doors, truth.doors)._asdict())
        out["doors_hinge"] = dict(score_hinges(drawing.doors, truth.doors)._asdict())
    return out


def share(part: int, whole: int) -> float:
    """A part of a whole; of nothing it is 0."""
    return part / whole if whole else 0.0


def harmonic(a: float, b: float) -> float:
    """F1 of a precision and a recall."""
    return 2 * a * b / (a + b) if a + b else 0.0


def iou(a: Polygon, b: Polygon) -> float:
    """Pixels of both over pixels of either, on a raster of the two polygons' surroundings."""
    low = np.floor(np.minimum(a.min(axis=0), b.min(axis=0)))
    if (a.max(axis=0) < b.min(axis=0)).any() or (b.max(axis=0) < a.min(axis=0)).any():
        return 0.0
    width, height = (np.ceil(np.maximum(a.max(axis=0), b.max(axis=0))) - low + 1).astype(int)
    one, other = (filled([polygon - low], (int(height), int(width))) for polygon in (a, b))
    return share(int(np.count_nonzero(one & other)), int(np.count_nonzero(one | other)))


def quarter(polygon: Polygon) -> Door:
    """The quarter circle that overlaps a door's polygon best; hinge and ends on its corners."""
    best, found = -1.0, Door((0.0, 0.0), (0.0, 0.0), pi / 2)
    corners = [(float(x), float(y)) for x, y in polygon]
    for hinge in corners:
        for end in corners:
            if hypot(end[0] - hinge[0], end[1] - hinge[1]) < 1.0:
                continue
            for swing in (-pi / 2, pi / 2):
                door = Door(hinge, end, swing)
                overlap = iou(door.sector(), polygon)
                if overlap > best:
                    best, found = overlap, door
    return found


def _pairs(likeness: npt.NDArray[np.float64], needed: float) -> int:
    """Pairs made one to one, the most alike first, until none reaches what is needed."""
    left, pairs = likeness.copy(), 0
    while left.size and left.max() >= needed:
        i, j = np.unravel_index(int(left.argmax()), left.shape)
        left[i, :], left[:, j] = -1.0, -1.0
        pairs += 1
    return pairs


def _score(pairs: int, found: int, true: int) -> DoorScore:
    precision, recall = share(pairs, found), share(pairs, true)
    return DoorScore(precision, recall, harmonic(precision, recall))
