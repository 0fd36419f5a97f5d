"""The fan of a scan: the borders of what each beam stands for, in the order of bearing."""

from __future__ import annotations

from math import ceil, cos, inf, isfinite, pi, sin
from typing import Literal, NamedTuple

import numpy as np

from formats.grid import Floats
from formats.jit import njit
from replay.sensors.kernels import Ints

Shape = Literal["sectors", "polygon"]

JOIN = 0.1  # of a beam's width: borders of neighbours nearer than this are one
WIDEST = 0.05  # rad, a wider beam is filled as several, so that its front is an arc


class Fan(NamedTuple):
    """Sectors in the order of bearing; see `kernels.chain`.

    Attributes:
        corners: (4, s) directions of the two borders, counter-clockwise: cos, sin, cos, sin.
        links: (3, s) beams that bound them, and 1 where the first border is the last one of the
            sector before (of the last sector, for the first).
        centres: (2, k) directions of the beams, cos and sin, in the order of `order`.
        order: (k,) beams by bearing.
    """

    corners: Floats
    links: Ints
    centres: Floats
    order: Ints


@njit
def usable(bearings: Floats, widths: Floats, order: Ints) -> tuple[int, int, bool]:
    """How many beams have a direction, their sectors, and whether they come by bearing.

    Args:
        bearings, widths: (n,) rad.
        order: (n,) out: those beams.
    """
    n, parts, before, ascending = 0, 0, -inf, True
    for i in range(bearings.size):
        if isfinite(bearings[i]) and isfinite(widths[i]) and widths[i] > 0.0:
            order[n] = i
            n += 1
            parts += ceil(min(widths[i], 2.0 * pi) / WIDEST)
            ascending &= bearings[i] >= before
            before = bearings[i]
    return n, parts, ascending


@njit
def borders(
    bearings: Floats, widths: Floats, order: Ints, corners: Floats, links: Ints, centres: Floats
) -> None:
    """Sectors of the beams' widths; the arguments as in Fan, the last three written."""
    k, last, wide = 0, inf, 0.0
    for i in range(order.size):
        b, w = bearings[order[i]], min(widths[order[i]], 2.0 * pi)
        c, s = cos(b), sin(b)
        centres[0, i], centres[1, i] = c, s
        parts = ceil(w / WIDEST)
        step, start = w / parts, b - 0.5 * w
        joined = abs(start - last) <= JOIN * min(w, wide)
        for part in range(parts):
            if part == 0 and not joined:
                corners[0, k], corners[1, k] = cos(start), sin(start)
            else:
                corners[0, k], corners[1, k] = corners[2, k - 1], corners[3, k - 1]
            end = start + (part + 1) * step
            corners[2, k], corners[3, k] = cos(end), sin(end)
            links[0, k] = links[1, k] = order[i]
            links[2, k] = 1 if part > 0 or joined else 0
            k += 1
        last, wide = start + parts * step, w
    if k > 1:
        b, w = bearings[order[0]], min(widths[order[0]], 2.0 * pi)
        if abs(b - 0.5 * w + 2.0 * pi - last) <= JOIN * min(w, wide):  # a full circle
            corners[0, 0], corners[1, 0] = corners[2, k - 1], corners[3, k - 1]
            links[2, 0] = 1


def triangles(bearings: Floats, widths: Floats, order: Ints) -> Fan:
    """Triangles between neighbouring beams, where their widths meet."""
    b, w = bearings[order], np.minimum(widths[order], 2.0 * pi)
    centres = np.stack((np.cos(b), np.sin(b)))
    near, far = np.arange(order.size), np.roll(np.arange(order.size), -1)
    gap = np.append(b[1:], b[:1] + 2.0 * pi) - b  # below 0: turned by more than a full circle
    keep = (gap >= 0.0) & (gap <= np.minimum(0.5 * (w + w[far]) * (1.0 + JOIN), 3.0))
    near, far = near[keep], far[keep]
    corners = np.concatenate((centres[:, near], centres[:, far]))
    joined = near == np.roll(far, 1)
    links = np.stack((order[near], order[far], joined)).astype(np.int32)
    return Fan(corners, links, centres, order)


def fan(bearings: Floats, widths: Floats, shape: Shape = "sectors") -> Fan:
    """What the beams stand for.

    Args:
        bearings: (n,) rad, in any order; widths: (n,) rad. A beam where either is not finite, or
            whose width is not positive, is left out.
        shape: "sectors" of the beams' widths, or "polygon", one vertex a beam, which closes the
            gaps between rays.
    """
    order = np.empty(bearings.size, dtype=np.int32)
    n, parts, ascending = usable(bearings, widths, order)
    order = order[:n]
    if not ascending:
        order = order[np.argsort(bearings[order], kind="stable")]
    if shape == "polygon":
        return triangles(bearings, widths, order)
    found = Fan(np.empty((4, parts)), np.empty((3, parts), np.int32), np.empty((2, n)), order)
    borders(bearings, widths, order, found.corners, found.links, found.centres)
    return found
