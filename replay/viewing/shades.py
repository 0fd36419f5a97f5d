"""Maps as pictures that grow: drawn anew only where readings came."""

from __future__ import annotations

import numpy as np

from formats.grid import Evidence, Geometry, Grid
from formats.result import Curve
from formats.results.keyframes import Change
from replay.pictures import gray


class Shades:
    """The shades and the occupied cells of some curves over growing evidence.

    Attributes:
        shades: curve -> (rows, cols) uint8, white surely empty, black surely occupied.
        occupied: curve -> (rows, cols).
    """

    def __init__(self, curves: dict[str, Curve], geometry: Geometry, levels: int) -> None:
        self._curves = dict(curves)
        self._evidence = Evidence.empty(geometry, levels)
        self.shades = {name: gray(curve.prior) for name, curve in curves.items()}
        self.occupied = {name: curve.prior.occupied() for name, curve in curves.items()}

    def add(self, change: Change) -> None:
        """Bring every map up to a keyframe."""
        change.add_to(self._evidence)
        counts = self._evidence.counts.reshape(len(self._evidence.counts), -1)
        touched = np.zeros(counts.shape[1], dtype=np.bool_)
        touched[change.where % counts.shape[1]] = True
        cells = np.flatnonzero(touched)
        strip = Geometry(1, len(cells), 1.0, 0.0, 0.0)
        part = Evidence(strip, counts[:, None, cells])
        for name, (prior, p_levels, update) in self._curves.items():
            before = Grid(strip, prior.values.reshape(1, -1)[:, cells])
            now = part.on(before, p_levels, update)
            self.shades[name].reshape(-1)[cells] = gray(now)[0]
            self.occupied[name].reshape(-1)[cells] = now.occupied()[0]
