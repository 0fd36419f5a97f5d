"""Kernels of the sensor models: rows of events are filled, and the cells counted."""

from __future__ import annotations

from math import floor

from formats.grid import Counted
from formats.jit import njit
from replay.sensors.kernels import (
    FREE,
    HIT,
    LEAVE,
    Floats,
    Ints,
    Place,
    chain,
    clean,
    ends,
    turn,
)

# Moves that sorting an event by insertion may take on average; scans can come in bad order.
PATIENCE = 8


@njit
def sort(line: Ints, filled: Ints, backwards: bool, spare: Ints) -> None:
    """Sort a row's events: each part comes almost in order, backwards above the sensor.

    Args:
        line: (n,) events.
        filled: (parts,) where each part ends.
        backwards: the sensor lies below.
        spare: (room,) scratch.
    """
    start = 0
    for end in filled:
        if backwards:
            for i in range((end - start) // 2):
                j, k = start + i, end - 1 - i
                line[j], line[k] = line[k], line[j]
        moves = 0
        for i in range(start + 1, end):
            key = line[i]
            j = i
            while j > start and line[j - 1] > key:
                line[j] = line[j - 1]
                j -= 1
            line[j] = key
            moves += i - j
            if moves > PATIENCE * (end - start):
                line[start:end].sort()
                break
        if start > 0:  # merge from the end, without branches on the data
            i, j, k = start - 1, end - start - 1, end - 1
            spare[: end - start] = line[start:end]
            while j >= 0 and i >= 0:
                old = int(line[i] > spare[j])
                line[k] = line[i] if old != 0 else spare[j]
                i -= old
                j -= 1 - old
                k -= 1
            for q in range(j + 1):
                line[q] = spare[q]
        start = end


@njit
def fill_cells(
    events: Ints,
    filled: Ints,
    row0: int,
    y: float,
    spare: Ints,
    counts: Counted,
    runs: Ints,
    held: Counted,
    n: int,
) -> int:
    """Count the filled cells as misses and those of the first n runs as hits: hit beats miss.

    Args:
        events: (rows, room); filled: (1, rows) how many there are.
        runs, held: as `ends` gives them.

    Returns:
        how many runs there are now.
    """
    hits, misses, known = counts[0].reshape(-1), counts[1].reshape(-1), n
    for i in range(filled.shape[1]):
        if filled[0, i] == 0:
            continue
        line = events[i, : filled[0, i]]
        sort(line, filled[:, i], row0 + i >= y, spare)
        flat = (row0 + i) * counts.shape[2]
        at, free, first = 0, 0, n
        for key in line:
            column = key >> 2
            runs[n, 0], runs[n, 1], runs[n, 2] = flat + at, flat + column, 1
            n += int(free != 0) & int(column > at)
            at = column
            free += 1 - 2 * (key & LEAVE)
        for k in range(first, n):
            cells = misses[runs[k, 0] : runs[k, 1]]
            for q in range(cells.size):
                cells[q] += 1
    for k in range(known):
        hits[runs[k, 0]], misses[runs[k, 0]] = held[k, 0] + 1, held[k, 1]
    return n


@njit
def add_share(shares: Ints, start: int, end: int, n: int) -> None:
    """Count the samples start..end of one sample row in the cells that hold them, n to a cell."""
    first, last = start // n, (end - 1) // n
    if first == last:
        shares[first] += end - start
        return
    shares[first] += (first + 1) * n - start
    run = shares[first + 1 : last]
    for q in range(run.size):
        run[q] += n
    shares[last] += end - last * n


@njit
def fill_shares(
    events: Ints,
    filled: Ints,
    row0: int,
    y: float,
    side: int,
    least: float,
    spare: Ints,
    shares: Ints,
    counts: Counted,
    runs: Ints,
) -> int:
    """Count each cell at the level of its empty share of observed samples, halves rounded up.

    Args:
        events: (sample rows, room); filled: (3, sample rows) where each part of them ends.

        row0: the sample row of row 0 of `events`, a whole number of cells.
        y: samples, of the sensor.
        side: samples along a cell's side.
        least: samples that must be observed to make it a visit.
        shares: (2, columns) zeros, scratch: empty and occupied samples of a row of cells.

    Returns:
        how many runs were written.
    """
    whole, found = side * side, 0
    for r in range(filled.shape[1] // side):
        low, high = counts.shape[2], 0
        for i in range(r * side, r * side + side):
            if filled[2, i] == 0:
                continue
            line = events[i, : filled[2, i]]
            sort(line, filled[:, i], row0 + i >= y, spare)
            at, free, hit = 0, 0, 0
            for key in line:
                column = key >> 2
                if column > at:
                    if free != 0 or hit != 0:
                        add_share(shares[1 if hit != 0 else 0], at, column, side)
                        low, high = min(low, at // side), max(high, (column - 1) // side + 1)
                    at = column
                step = -1 if key & LEAVE else 1
                if key & HIT:
                    hit += step
                else:
                    free += step
        for c in range(low, high):
            empty, seen = shares[0, c], shares[0, c] + shares[1, c]
            shares[0, c] = shares[1, c] = 0
            if seen > 0 and seen >= least:
                level = whole if empty == seen else (2 * whole * empty + seen) // (2 * seen)
                row = row0 // side + r
                counts[level, row, c] += 1
                flat = row * counts.shape[2] + c
                if found > 0 and runs[found - 1, 1] == flat and runs[found - 1, 2] == level:
                    runs[found - 1, 1] = flat + 1
                else:
                    runs[found, 0], runs[found, 1], runs[found, 2] = flat, flat + 1, level
                    found += 1
    return found


@njit
def by_truth(truth: Ints, counts: Counted, runs: Ints, n: int) -> int:
    """Count the cells of a reading at the level that they really have instead.

    Args:
        truth: (cells,) level of each.
        counts: (levels, rows, columns), with the reading counted in.
        runs: the reading's, no cell twice; one run a cell afterwards.
        n: how many runs there are.

    Returns:
        how many there are now.
    """
    cells, total = counts.reshape(counts.shape[0], -1), 0
    for k in range(n):
        total += runs[k, 1] - runs[k, 0]
    at = total
    for k in range(n - 1, -1, -1):  # from the end, since one run becomes several
        first, behind, level = runs[k, 0], runs[k, 1], runs[k, 2]
        for cell in range(behind - 1, first - 1, -1):
            at -= 1
            cells[level, cell] -= 1
            cells[truth[cell], cell] += 1
            runs[at, 0], runs[at, 1], runs[at, 2] = cell, cell + 1, truth[cell]
    return total


@njit
def read(
    corners: Floats,
    links: Ints,
    centres: Floats,
    order: Ints,
    ranges: Floats,
    depths: Floats,
    points: Floats,
    edges: Ints,
    limits: Floats,
    place: Place,
    scale: float,
    side: int,
    banded: bool,
    least: float,
    events: Ints,
    filled: Ints,
    spare: Ints,
    shares: Ints,
    held: Counted,
    counts: Counted,
    runs: Ints,
) -> int:
    """Count one reading in the cells that it shows.

    Args:
        corners: as for `turn`; links: (3, sectors) its `beams`, and `joined` as for `chain`.
        centres, order: as for `ends`.
        ranges: (beams,) m.
        depths: (3, beams), points: (6, k), edges: (2 * k + 1,): scratch, k as the more of sectors
            and beams.
        limits: as for `clean`, m.
        place: of the sensor from the lattice's corner: samples, samples, rad.
        scale: samples a metre.
        side: samples along a cell's side.
        banded: hits are the samples in a band behind the range, else the cells of end points.
        least: samples that make a visit.
        events: (rows * side, room), filled: (3, rows * side), spare: (room,): scratch.
        shares: (2, columns) zeros, scratch.
        counts: (levels, rows, columns).
        held: (beams, 2), scratch.
        runs: (rows * columns + beams, 3) out: first flat index, one after the last, level.

    Returns:
        how many runs of cells were touched; minus the room that a row of events needs where it
        is too small, and then nothing was counted.
    """
    reach = clean(ranges, limits, scale, depths)
    rows, columns = counts.shape[1], counts.shape[2] * side
    row0 = int(min(max(floor((place[1] - reach) / side), 0.0), float(rows))) * side
    row1 = int(min(max(floor((place[1] + reach) / side) + 1.0, 0.0), float(rows))) * side
    used = filled[: 3 if banded else 1, : max(row1 - row0, 0)]
    used[:] = 0
    beams, joined, y = links[:2], links[2], place[1]
    turn(corners, beams, depths[0], place, points)
    chain(corners, joined, points, place, row0, columns, FREE, edges, events, used[0])
    if banded:
        used[1] = used[0]
        turn(corners, beams, depths[2], place, points)
        chain(corners, joined, points, place, row0, columns, HIT, edges, events, used[1])
        used[2] = used[1]
        turn(corners, beams, depths[1], place, points)
        chain(corners, joined, points, place, row0, columns, HIT | LEAVE, edges, events, used[2])
    room = 0
    for k in used[-1]:
        room = max(room, k)
    if room > events.shape[1]:
        return -room
    if banded:
        return fill_shares(events, used, row0, y, side, least, spare, shares, counts, runs)
    hit = ends(centres, order, depths[1], place, points, counts, runs, held)
    return fill_cells(events, used, row0, y, spare, counts, runs, held, hit)
