"""Kernels of the sensor models: a scan as star-shaped chains, filled row by row.

The plane is a lattice of samples (cells, or sub-samples of cells), in units of its own step. Every
chain starts and ends at the sensor; its crossings with the rows of sample centres become events,
sorted by column, so that a row is filled by a winding number. Crossings are half open, hence two
chains that share a border neither overlap nor leave a slit, to the bit: a radial border is
computed from its direction alone.
"""

from __future__ import annotations

from math import ceil, cos, nan, sin

import numpy as np
import numpy.typing as npt

from formats.grid import Counted
from formats.jit import njit

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
Place = tuple[float, float, float]

# An event is column * 4 + one of these: a set begins or ends here. Hits are a set of samples for
# `fill_shares`, and single cells, each one event, for `fill_cells`.
FREE, HIT, LEAVE = 0, 2, 1
# An edge follows a border that two sectors share, closes a sector, or leads home and out again.
ALONG, ACROSS, GAP = 0, 1, 2


@njit
def clean(ranges: Floats, limits: Floats, scale: float, depths: Floats) -> float:
    """How far each beam is seen empty, and where its hit band begins and ends; 0 for nothing.

    REP-117: nan, -inf, 0 and what lies below the sensor's least range is no reading; +inf and
    what lies at or above its greatest range saw nothing.

    Args:
        ranges: (n,) m.
        limits: m: nearest reading, first no-return, farthest hit, clear range of a no-return,
            margin before the hit, depth of the hit band, where it ends at the earliest.
        scale: samples a metre.
        depths: (3, n) out, samples: free, front and back.

    Returns:
        the farthest of them all, in samples.
    """
    nearest, nothing, farthest, clear, margin, band, shadow = limits
    reach = 0.0
    for i in range(ranges.size):
        r = ranges[i]
        seen, hit = 0.0, False
        if r >= nearest:
            if r >= nothing:
                seen = clear
            elif r > farthest:
                seen = max(min(r - margin, farthest), 0.0)
            else:
                seen, hit = max(r - margin, 0.0), True
        depths[0, i] = seen * scale
        depths[1, i] = r * scale if hit else 0.0
        depths[2, i] = max(r + band, shadow) * scale if hit else 0.0
        reach = max(reach, depths[0, i], depths[2, i])
    return reach


@njit
def turn(corners: Floats, beams: Ints, depth: Floats, place: Place, points: Floats) -> None:
    """Corners of the sectors on the lattice.

    Args:
        corners: (4, s) directions of each sector's two borders, counter-clockwise, in the
            sensor's frame: cos, sin, cos, sin.
        beams: (2, s) beams whose depths hold at the two borders.
        depth: (beams,) samples.
        place: of the sensor: samples, samples, rad.
        points: (6, s) out: x and y from the sensor of the two corners, and the first row whose
            centre lies at or above each.
    """
    c, s, y = cos(place[2]), sin(place[2]), place[1] - 0.5
    for k in range(corners.shape[1]):
        for end in range(2):
            r = depth[beams[end, k]]
            points[2 * end, k] = r * (c * corners[2 * end, k] - s * corners[2 * end + 1, k])
            points[2 * end + 1, k] = r * (s * corners[2 * end, k] + c * corners[2 * end + 1, k])
            points[4 + end, k] = ceil(points[2 * end + 1, k] + y)


@njit
def list_edges(points: Floats, joined: Ints, home: float, first: int, edges: Ints) -> int:
    """The edges that cross a row of centres, in order: sector * 4 + the kind of edge.

    Written without branches on the data, since which edges cross cannot be predicted.

    Args:
        points: as `turn` gives them.
        joined: (s,) 1 where a sector's first border is the last one of the sector before, 0 where
            a gap (or an overlap) lies between them; the first follows the last.
        home: the first row whose centre lies at or above the sensor.
        first: the sector to begin with.
        edges: (2 * s + 1,) out.

    Returns:
        how many there are.
    """
    if joined.size == 0:
        return 0
    n, row = 0, points[5, first - 1 if first > 0 else joined.size - 1]
    for i in range(joined.size):
        k = first + i
        k -= joined.size if k >= joined.size else 0
        start, end = points[4, k], points[5, k]
        if joined[k] != 0:
            edges[n] = 4 * k + ALONG
            n += int(row != start)
        else:
            edges[n] = 4 * k + GAP
            n += int(row != home) | int(start != home)
        edges[n] = 4 * k + ACROSS
        n += int(start != end)
        row = end
    return n


@njit
def begin(corners: Floats, c: float, s: float) -> int:
    """The sector at which the fan turns from up to down, so that rows are crossed in order."""
    above = False
    for k in range(corners.shape[1]):
        up = s * corners[0, k] + c * corners[1, k] >= 0.0
        if above and not up:
            return k
        above = up
    return 0


@njit
def note(events: Ints, filled: Ints, row: int, at: float, columns: int, code: int) -> None:
    """Write an event in a row; where there is no room it is only counted."""
    if filled[row] < events.shape[1]:
        events[row, filled[row]] = int(min(max(at, 0.0), float(columns))) * 4 + code
    filled[row] += 1


@njit
def gap(
    before: float,
    after: float,
    home: float,
    x: float,
    y: float,
    back: float,
    out: float,
    row0: int,
    columns: int,
    code: int,
    events: Ints,
    filled: Ints,
) -> None:
    """Events of a border home and of the next one out again, where a centre lies between them.

    Args:
        before, after: the first rows of the two corners.
        home: the sensor's.
        x, y: samples, of the sensor from the centre of sample (0, 0).
        back, out: dx / dy of the two borders.
    """
    low = max(int(min(before, after, home)) - row0, 0)
    high = min(int(max(before, after, home)) - row0, filled.size)
    for i in range(low, high):
        row = float(i + row0)
        first = min(before, home) <= row < max(before, home)
        second = min(after, home) <= row < max(after, home)
        u, v = ceil(x + (row - y) * back), ceil(x + (row - y) * out)
        if first and second and u == v:
            continue
        if first:
            note(events, filled, i, u, columns, code ^ int(before < home))
        if second:
            note(events, filled, i, v, columns, code ^ int(home < after))


@njit
def chain(
    corners: Floats,
    joined: Ints,
    points: Floats,
    place: Place,
    row0: int,
    columns: int,
    code: int,
    edges: Ints,
    events: Ints,
    filled: Ints,
) -> None:
    """Events of the triangles between the sensor and each sector's two corners.

    Args:
        corners, place: as for `turn`; points: as it gives them.
        joined, edges: as for `list_edges`.
        row0: the lattice row of row 0 of `events`.
        columns: of the lattice; events lie in 0..columns.
        code: set of the events, FREE or HIT; with LEAVE the chain is subtracted.
        events: (rows, room) out; filled: (rows,) how many there are, also where there is no room.
    """
    x, y = place[0] - 0.5, place[1] - 0.5
    c, s = cos(place[2]), sin(place[2])
    home = ceil(y)
    leftmost = begin(corners, c, s)
    for j in range(list_edges(points, joined, home, leftmost, edges)):
        k, kind = edges[j] >> 2, edges[j] & 3
        before = k - 1 if k > 0 else joined.size - 1
        px, py = 0.0, 0.0
        if kind == ACROSS:
            first, last = points[4, k], points[5, k]
            px, py = points[0, k], points[1, k]
            slope = (points[2, k] - px) / (points[3, k] - py)
        else:
            first, last = points[5, before], points[4, k]
            u, v = corners[0, k], corners[1, k]
            slope = (c * u - s * v) / (s * u + c * v)
        if kind == GAP:
            u, v = corners[2, before], corners[3, before]
            back = (c * u - s * v) / (s * u + c * v)
            gap(first, last, home, x, y, back, slope, row0, columns, code, events, filled)
            continue
        said = code ^ int(first < last)  # going down enters, going up leaves
        low = max(int(min(first, last)) - row0, 0)
        high = min(int(max(first, last)) - row0, filled.size)
        for row in range(low, high):
            at = ceil(x + px + (row + row0 - (y + py)) * slope)
            note(events, filled, row, at, columns, said)


@njit
def ends(
    centres: Floats,
    order: Ints,
    front: Floats,
    place: Place,
    points: Floats,
    counts: Counted,
    runs: Ints,
    held: Counted,
) -> int:
    """The cells that contain an end point, and what they hold.

    Args:
        centres: (2, k) directions of the beams in the sensor's frame, in the order of `order`.
        front: (beams,) cells, 0 where there is no hit.
        points: (2 at least, k at least) scratch.
        runs: (k at least, 3) out: a run of one cell each, which may come again.
        held: (k, 2) out: counts of hits and misses of each.

    Returns:
        how many runs were written.
    """
    c, s = cos(place[2]), sin(place[2])
    for k in range(order.size):
        r = front[order[k]]
        r = r if r > 0.0 else nan
        # numpy's floor keeps nan; that of math makes an integer, and nan has none.
        points[0, k] = np.floor(place[0] + r * (c * centres[0, k] - s * centres[1, k]))
        points[1, k] = np.floor(place[1] + r * (s * centres[0, k] + c * centres[1, k]))
    n = 0
    rows, columns = float(counts.shape[1]), float(counts.shape[2])
    column, row = -1.0, -1.0
    for k in range(order.size):  # without branches, which could not be predicted
        u, v = points[0, k], points[1, k]
        inside = int(u >= 0.0) & int(u < columns) & int(v >= 0.0) & int(v < rows)
        flat = int(v * columns + u) if inside != 0 else 0
        runs[n, 0], runs[n, 1], runs[n, 2] = flat, flat + 1, 0
        n += inside & (int(u != column) | int(v != row))
        column, row = u, v
    hits, misses = counts[0].reshape(-1), counts[1].reshape(-1)
    for k in range(n):
        held[k, 0], held[k, 1] = hits[runs[k, 0]], misses[runs[k, 0]]
    return n
