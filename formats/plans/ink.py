"""Plain pictures: dark ink on light paper, or light ink on a dark ground, is wall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.plans.raster import Grey, Raster, strips, turned

Cells = npt.NDArray[np.int8]
Picture = tuple[Grey, Cells]
INK = 128  # grey below half of white is ink
FAINTEST = 32  # greys between paper and ink that is paler than that
BETWEEN, PAPER, PHOTO = (64, 193), 12, 0.2  # greys of no ink; around the paper's own; their share
MAP_GREYS = ((205, 205), (127, 128))  # how maps without their yaml show the unknown


def paper_grey(path: Path, raster: Raster, notes: Notes) -> Grey:
    """The picture in grey on white paper (H, W), upright; white ink on nothing turns black."""
    grey = raster.grey()
    if raster.alpha is None or int(grey.min()) < 255:
        return grey
    if raster.alpha.min() == raster.alpha.max():
        return grey
    notes.warn(path, "white ink on a transparent ground: its opacity is read as ink")
    ink = np.rint(raster.alpha * (255 / raster.full)).astype(np.uint8)
    return turned(255 - ink, raster.header.turn)


def drawn(path: Path, grey: Grey, invert: bool | None, notes: Notes) -> Picture:
    """A plain picture's wall is its ink; the grey of a map without its yaml is unknown.

    Returns:
        The grey, turned over where the ink is light, and the occupancy.
    """
    light_ink = has_light_ink(grey) if invert is None else invert
    if light_ink:
        grey = 255 - grey
        if invert is None:
            notes.warn(path, "light lines on a dark ground: turned over")
    counts = sum(
        (np.bincount(grey[rows].ravel(), minlength=256) for rows in strips(*grey.shape)),
        start=np.zeros(256, dtype=np.int64),
    )
    if (shades := shaded(counts)) > PHOTO:
        what = "shades of grey, as in a photograph: walls found in it mean little"
        notes.warn(path, f"{100 * shades:.0f} % of its pixels are {what}")
    occupancy = np.multiply(grey < ink_level(path, counts, notes), 100, dtype=np.int8)
    ends = counts[:6].sum() + counts[250:].sum()
    for low, high in MAP_GREYS:
        unknown = counts[low : high + 1].sum()
        if unknown >= 0.05 * grey.size and unknown + ends >= 0.8 * grey.size:
            share = f"{100 * unknown / grey.size:.0f} % is grey {low}"
            notes.warn(path, f"{share}, as in a map without its yaml: taken as unknown")
            occupancy[(grey >= low) & (grey <= high)] = -1
            break
    return grey, occupancy


def shaded(counts: npt.NDArray[np.int64]) -> float:
    """Share of pixels, of (256,) by grey, that are no ink, no paper and none of three flat tones.

    Drawings have few: a scan's lie about its paper, a coloured plan's and a map's in single tones.
    """
    between = counts[slice(*BETWEEN)].copy()
    paper = int(np.argmax(counts[BETWEEN[0] :]))  # the ink may be of one grey, the paper of many
    between[max(0, paper - PAPER) : max(0, paper + PAPER + 1)] = 0
    between[np.argsort(between)[-3:]] = 0
    return float(between.sum() / max(int(counts.sum()), 1))


def ink_level(path: Path, counts: npt.NDArray[np.int64], notes: Notes) -> int:
    """The grey below which a pixel is ink: half of white, unless all ink is paler than that.

    Args:
        path: of the picture, for the note.
        counts: (256,) pixels of each grey.
        notes: told of pale ink, which counts below half way between it and the paper.
    """
    darkest, paper = int(np.flatnonzero(counts)[0]), int(np.argmax(counts))
    if darkest < INK or paper - darkest < FAINTEST:
        return INK
    level = (darkest + paper + 1) // 2
    notes.warn(path, f"its ink is pale: grey below {level} is taken as ink, not below {INK}")
    return level


def has_light_ink(grey: Grey) -> bool:
    """Whether a picture is mostly dark and what is light in it is lines.

    Rooms left white in a black ground are no lines: most of them is wider than a fiftieth of the
    picture.
    """
    import cv2

    light = (grey >= INK).view(np.uint8)
    total = int(cv2.countNonZero(light))
    if not 0 < total < 0.5 * light.size:
        return False
    square = np.ones(2 * [max(3, max(grey.shape) // 50)], np.uint8)
    cv2.erode(light, square, dst=light, borderValue=0)
    cv2.dilate(light, square, dst=light)
    return cv2.countNonZero(light) < 0.3 * total
