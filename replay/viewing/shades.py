"""Maps as pictures that grow: drawn anew only where readings came."""

from __future__ import annotations

from formats.grid import Evidence, Geometry
from formats.result import Curve
from formats.results.keyframes import Change, changed
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
        for name, cells, now in changed(self._curves, self._evidence, change):
            self.shades[name].reshape(-1)[cells] = gray(now)[0]
            self.occupied[name].reshape(-1)[cells] = now.occupied()[0]
