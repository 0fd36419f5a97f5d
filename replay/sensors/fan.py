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
def ends(bearing: float, width: float) -> tuple[float, float, float]:
    """Width of a beam, a full circle at most, and where its first part begins and its last ends."""
    w = min(width, 2.0 * pi)
    parts = ceil(w / WIDEST)
    start = bearing - 0.5 * w
    return w, start, start + parts * (w / parts)


@njit
def borders(
    bearings: Floats, widths: Floats, order: Ints, corners: Floats, links: Ints, centres: Floats
) -> int:
    """Sectors of the beams' widths, and how many; the arguments as in Fan, the last three written.

    Parts of a beam that lie whole in the overlap with the one before are left to that one.
    """
    n, k, last, wide, circle = order.size, 0, inf, 0.0, False
    if n > 0:
        w, start, _ = ends(bearings[order[0]], widths[order[0]])
        wide, _, last = ends(bearings[order[n - 1]], widths[order[n - 1]])
        circle = abs(start + 2.0 * pi - last) <= JOIN * min(w, wide)
        last -= 2.0 * pi
    for i in range(n):
        b, w = bearings[order[i]], min(widths[order[i]], 2.0 * pi)
        c, s = cos(b), sin(b)
        centres[0, i], centres[1, i] = c, s
        parts = ceil(w / WIDEST)
        step, start = w / parts, b - 0.5 * w
        joined = circle if i == 0 else abs(start - last) <= JOIN * min(w, wide)
        for part in range(parts):
            end = start + (part + 1) * step
            if joined and end <= last:
                continue
            if k == 0 or (part == 0 and not joined):
                corners[0, k], corners[1, k] = cos(start), sin(start)
            else:
                corners[0, k], corners[1, k] = corners[2, k - 1], corners[3, k - 1]
            corners[2, k], corners[3, k] = cos(end), sin(end)
            links[0, k] = links[1, k] = order[i]
            links[2, k] = 1 if k > 0 and (part > 0 or joined) else 0
            k += 1
        last, wide = start + parts * step, w
    if k > 1 and circle:
        corners[0, 0], corners[1, 0] = corners[2, k - 1], corners[3, k - 1]
        links[2, 0] = 1
    return k


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
    k = borders(bearings, widths, order, found.corners, found.links, found.centres)
    if k < parts:
        corners = np.ascontiguousarray(found.corners[:, :k])
        return found._replace(corners=corners, links=np.ascontiguousarray(found.links[:, :k]))
    return found
