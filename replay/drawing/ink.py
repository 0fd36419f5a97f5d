"""Gray picture to ink: what is drawn at all, how thick each stroke is, how it runs.

Nothing here knows of walls. Pictures are (H, W), masks uint8 of 0 and 1 inside this package.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

Gray = npt.NDArray[np.uint8]
Bits = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]
Whole = npt.NDArray[np.int64]

PAPER_SHARE = 0.25  # ink is darker than paper by this share of the darkest tone's distance
DARK_PERCENTILE = 20  # of the pixels that differ from paper: the tone of full ink
FAINT = 12  # grey levels below paper that are a faint line, on a sheet without grain
COARSE = 600  # px of the longer side at which floors are looked for
FLOOR = 1 / 16  # of it: no wall is thicker
FLOOR_LEAST = 0.6  # of the paper's tone: no floor is darker
FLOOR_SHARE = 3.0  # per cent of the picture that may be darker floors still
NEARLY = 15  # grey levels below paper that are never ink
NOISY = 5.0  # and so many times the noise
THIN = 9  # px: no faint line is as thick
ROWS = 300  # of a picture, at least, tell its noise
EXACT = 1 << 24  # a float32 counts so far
BAND = 1_500_000  # px of a picture of floats that is worked on at a time: it stays in the cache
GRAIN = 0.01  # share of pixels that are nearly paper; a scan has more, a plot fewer


def tones(gray: Gray) -> npt.NDArray[np.int64]:
    """(256,) pixels of each grey."""
    flat = gray.reshape(1, -1)
    counts = np.zeros(256, dtype=np.int64)
    for start in range(0, flat.shape[1], EXACT):  # OpenCV counts in float32
        part = cv2.calcHist([flat[:, start : start + EXACT]], [0], None, [256], [0, 256])
        counts += np.asarray(part).ravel().astype(np.int64)
    return counts


def upright(gray: Gray) -> Gray:
    """Dark ink on bright paper: a picture that is mostly dark is turned over."""
    counts = tones(gray)
    return 255 - gray if counts[:128].sum() > counts[128:].sum() else gray


def _usual(counts: npt.NDArray[np.int64]) -> int:
    """The most frequent bright tone."""
    return 128 + int(counts[128:].argmax())


def paper_tone(gray: Gray) -> int:
    """The tone that ink is darker than: the most frequent bright one, or that of darker floors.

    Floors are what is wide: coloured rooms, and the shaded side of a scan. What is narrower than a
    16th of the picture is closed at a coarse size, so that walls do not count, however thick.
    """
    most = _usual(tones(gray))
    factor = max(1, round(max(gray.shape) / COARSE))
    if min(gray.shape) < factor:
        return most
    rows, cols = (side // factor * factor for side in gray.shape)
    blocks = gray[:rows, :cols].reshape(rows // factor, factor, cols // factor, factor)
    small = np.ascontiguousarray(blocks.max(axis=(1, 3)))
    side = round(max(small.shape) * FLOOR) | 1
    floor = np.asarray(cv2.morphologyEx(small, cv2.MORPH_CLOSE, square(side)))
    bright = floor[floor > FLOOR_LEAST * most]
    return min(most, int(np.percentile(bright, FLOOR_SHARE))) if bright.size else most


def noise(gray: Gray) -> float:
    """Standard deviation of the paper's grain in grey levels, by pixels beside each other."""
    rows = gray[:: max(1, gray.shape[0] // ROWS)].astype(np.int16)
    steps = np.abs(np.diff(rows, axis=1))
    return float(np.median(steps)) / 0.954 if steps.size else 0.0  # of a normal distribution


def binarise(gray: Gray) -> Bits:
    """Ink as 1: darker than paper by a quarter of the way to the tone of full ink.

    Light grey hatching and thin grey lines count, the grain of a scanned sheet does not.
    """
    return _darker(gray, paper_tone(gray))


def _darker(gray: Gray, paper: int) -> Bits:
    """What is ink on paper of that tone."""
    counts = tones(gray)
    dark = counts[: max(1, paper - max(NEARLY, round(NOISY * noise(gray))))]
    if dark.sum() == 0:
        return np.zeros(gray.shape, dtype=np.uint8)
    full = int(np.searchsorted(dark.cumsum(), dark.sum() * DARK_PERCENTILE / 100))
    return (gray < paper - PAPER_SHARE * (paper - full)).astype(np.uint8)


def faint(gray: Gray, ink: Bits) -> Bits:
    """Ink with its faintest lines, which plotters use for door arcs; the ink alone on a scan.

    Where floors have tones of their own, of what is darker than the paper only what is thin.
    """
    counts = tones(gray)
    paper = _usual(counts)
    if counts[max(0, paper - FAINT) : paper].sum() > GRAIN * gray.size:
        pale = _darker(gray, paper)
    else:
        pale = (gray < paper - FAINT).astype(np.uint8)
    if paper_tone(gray) < paper:
        pale &= 1 - grown(opened(pale, THIN), 3)
    return ink | pale


def square(side: int) -> Bits:
    """A structuring element."""
    return np.ones((side, side), dtype=np.uint8)


def grown(mask: Bits, side: int) -> Bits:
    """The mask dilated by a square of `side` px."""
    return np.asarray(cv2.dilate(mask, square(side)), dtype=np.uint8)


def distance(mask: Bits) -> Floats:
    """Distance in px of every pixel of the mask to the nearest one outside it."""
    deep = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(deep, dtype=np.float32)


def opened(mask: Bits, side: int) -> Bits:
    """What a square of `side` px fits into."""
    return opened_by(mask, (side, side))


def opened_by(mask: Bits, size: tuple[int, int]) -> Bits:
    """What a rectangle of (rows, cols) px fits into; an even one must not shift what it passes."""
    block = np.ones(size, dtype=np.uint8)
    anchor = (size[1] // 2, size[0] // 2)
    mirrored = (size[1] - 1 - anchor[0], size[0] - 1 - anchor[1])
    thin = cv2.erode(mask, block, anchor=anchor)
    return np.asarray(cv2.dilate(thin, block, anchor=mirrored), dtype=np.uint8)


def closed(mask: Bits, side: int) -> Bits:
    """The mask with gaps of less than `side` px filled, not glued to the picture's edge."""
    padded = cv2.copyMakeBorder(mask, side, side, side, side, cv2.BORDER_CONSTANT, value=0)
    out = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, square(side))
    return np.ascontiguousarray(out[side:-side, side:-side], dtype=np.uint8)


def directions(
    ink: Bits, rows: Whole, cols: Whole, sigma: float = 2.5
) -> tuple[Floats, Floats, Floats]:
    """Normals (nx, ny) of the strokes at some pixels, and how surely (0 to 1): all (n,).

    By the structure tensor, a band of the picture at a time.

    Args:
        ink: (H, W).
        rows, cols: (n,) of the pixels, by rows.
        sigma: px, over which it is averaged.
    """
    nx, ny, sure = (np.zeros(len(rows), dtype=np.float32) for _ in range(3))
    high, halo = max(1, BAND // max(1, ink.shape[1])), round(4 * sigma) + 8
    for top in range(0, ink.shape[0], high):
        first, last = np.searchsorted(rows, [top, top + high])
        if first == last:
            continue
        start = max(0, top - halo)
        soft = cv2.GaussianBlur(ink[start : top + high + halo].astype(np.float32), (0, 0), 1.0)
        gx, gy = cv2.Scharr(soft, cv2.CV_32F, 1, 0), cv2.Scharr(soft, cv2.CV_32F, 0, 1)
        place = rows[first:last] - start, cols[first:last]
        xx, yy, xy = (
            np.asarray(cv2.GaussianBlur(g, (0, 0), sigma))[place]
            for g in (gx * gx, gy * gy, gx * gy)
        )
        gap = np.sqrt((xx - yy) ** 2 + 4 * xy * xy)
        angle = 0.5 * np.arctan2(2 * xy, xx - yy)
        nx[first:last], ny[first:last] = np.cos(angle), np.sin(angle)
        sure[first:last] = gap / (xx + yy + 1e-9)
    return nx, ny, sure


def straight(mask: Bits, length: int) -> Bits:
    """Where a straight line of `length` px fits into the mask, in one of 12 directions."""
    out = np.zeros_like(mask)
    for turn in np.arange(12) * np.pi / 12:
        reach = length / 2 * np.array([np.cos(turn), np.sin(turn)])
        size = 2 * int(np.ceil(np.abs(reach).max())) + 1
        line = np.zeros((size, size), dtype=np.uint8)
        middle = np.array([size // 2, size // 2])
        a, b = np.rint(middle - reach).astype(int), np.rint(middle + reach).astype(int)
        cv2.line(line, (int(a[0]), int(a[1])), (int(b[0]), int(b[1])), 1)
        out |= np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, line), dtype=np.uint8)
    return out


def shrunk(mask: Bits, factor: int) -> Bits:
    """A pixel for each block of `factor` by `factor`: ink where any of it is."""
    rows, cols = mask.shape
    even = np.pad(mask, ((0, -rows % factor), (0, -cols % factor)))
    blocks = even.reshape(even.shape[0] // factor, factor, even.shape[1] // factor, factor)
    return np.asarray(blocks.max(axis=(1, 3)), dtype=np.uint8)


def straight_runs(ink: Bits, length: float) -> Bits:
    """Ink through which a straight line of `length` px runs, seen at about 15 px a line."""
    factor = max(1, round(length / 15))
    runs = grown(straight(shrunk(ink, factor), max(3, round(length / factor))), 3)
    full = cv2.resize(runs, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    return ink & np.asarray(full, dtype=np.uint8)[: ink.shape[0], : ink.shape[1]]
