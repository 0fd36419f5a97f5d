"""Scored cells counted by what they are and what was seen of them: all that a score depends on.

A cell's log-odds depend on its kind (wall, outside, door, ...) and on its readings by level. Cells
that share both share their fate under every prior, so a few thousand groups stand for a map.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.grid import Counted

ANY, MOST, OUTSIDE, DOOR, WINDOW, TRUTH = (1 << bit for bit in range(6))
KINDS = 64
NEEDED = ("wall", "outside", "truth_wall", "truth_scored")
Kinds = npt.NDArray[np.uint8]


class Groups(NamedTuple):
    """Cells by kind and readings.

    Attributes:
        kind: (n,) sums of ANY (some of it is wall), MOST (more than half), OUTSIDE, DOOR, WINDOW,
            TRUTH (wall in truth).
        counts: (levels, n) readings of each cell of the group.
        cells: (n,) how many there are.
    """

    kind: Kinds
    counts: Counted
    cells: Counted


def kinds(layers: Mapping[str, npt.NDArray[Any]]) -> Kinds:
    """What each cell is, in the shape of the layers ("wall" is a share, see CellLayers)."""
    wall = layers["wall"]
    out = np.where(wall > 0.0, ANY, 0).astype(np.uint8)
    marks = {
        MOST: wall > 0.5,
        OUTSIDE: layers["outside"] != 0,
        TRUTH: layers["truth_wall"] != 0,
        DOOR: layers["door"] > 0.0 if "door" in layers else None,
        WINDOW: layers["window"] > 0.0 if "window" in layers else None,
    }
    for bit, where in marks.items():
        if where is not None:
            out[where] |= bit
    return out


def scored_cells(layers: Mapping[str, npt.NDArray[Any]], counts: Counted) -> Groups | None:
    """Each scored cell as a group of its own, in the order of the lattice.

    Args:
        layers: (rows, cols) each.
        counts: (levels, rows, cols).

    Returns:
        None where layers are missing that scores depend on.
    """
    if any(name not in layers for name in NEEDED):
        return None
    where = np.flatnonzero(layers["truth_scored"])
    seen = counts.reshape(len(counts), -1)[:, where]
    kind = kinds({name: layer.reshape(-1)[where] for name, layer in layers.items()})
    return Groups(kind, seen, np.ones(len(where), dtype=np.uint32))


def grouped(cells: Groups) -> Groups:
    """The same cells in fewer groups, sorted by kind, then by their readings level by level."""
    key, bits = cells.kind.astype(np.uint64), 6
    for level in cells.counts:
        width = int(level.max(initial=0)).bit_length()
        if bits + width > 64:  # number the keys so far, which takes fewer bits
            key = np.unique(key, return_inverse=True)[1].astype(np.uint64)
            bits = int(key.max(initial=0)).bit_length()
        key, bits = (key << np.uint64(width)) | level.astype(np.uint64), bits + width
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    sizes = np.zeros(len(first), dtype=np.uint32)
    np.add.at(sizes, which, cells.cells)
    return Groups(cells.kind[first], np.ascontiguousarray(cells.counts[:, first]), sizes)
