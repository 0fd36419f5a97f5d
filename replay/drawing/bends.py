"""Stretches of outlines that bend like a circle: all outlines of a drawing as one row of rings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
SMOOTH = 3.0  # px, of the outline and of its bending
HALO = 12  # points beyond which the smoothing does not look: 4 SMOOTH


@dataclass(frozen=True, slots=True)
class Rings:
    """Closed rows of points one after another: where each begins and how many it has, (k,)."""

    first: Whole
    count: Whole

    @classmethod
    def of(cls, counts: Sequence[int]) -> Rings:
        """Rings of so many points."""
        count = np.array(counts, dtype=np.int64)
        return cls(np.cumsum(count) - count, count)

    def near(self, before: int, after: int) -> Whole:
        """Of each ring its points' numbers, with so many more from its other end on either side."""
        wide = self.count + before + after
        start = np.cumsum(wide) - wide
        place = np.arange(int(wide.sum())) - np.repeat(start + before, wide)
        return np.asarray(place % np.repeat(self.count, wide) + np.repeat(self.first, wide))

    def step(self, values: Doubles, back: int, ahead: int) -> Doubles:
        """The difference between the values so far ahead and so far back on the ring."""
        return np.asarray(values[self.near(-ahead, ahead)] - values[self.near(back, -back)])

    def smooth(self, values: Doubles) -> Doubles:
        """Each ring by a Gaussian of SMOOTH."""
        from scipy.ndimage import gaussian_filter1d  # 0.5 s to import, and many plans show no arc

        soft = gaussian_filter1d(values[self.near(HALO, HALO)], SMOOTH, axis=0)
        wide = self.count + 2 * HALO
        place = np.arange(len(values)) + np.repeat(
            2 * HALO * np.arange(len(wide)) + HALO, self.count
        )
        return np.asarray(soft[place], dtype=np.float64)

    def runs(self, on: npt.NDArray[np.bool_], amount: Doubles, least: float) -> list[Whole]:
        """The points' numbers of each run of True over which the amounts add up to the least."""
        place = np.arange(len(on)) - np.repeat(self.first, self.count)
        count = np.repeat(self.count, self.count)
        # each ring begins at its first False, so that no run goes on over its end
        begin = np.minimum.reduceat(np.where(on, count, place), self.first) % self.count
        order = (place + np.repeat(begin, self.count)) % count + np.repeat(self.first, self.count)
        bounds = np.zeros(len(on) + 1, dtype=np.bool_)
        bounds[self.first], bounds[-1] = True, True
        is_on = on[order]
        starts = np.flatnonzero(is_on & (bounds[:-1] | ~np.roll(is_on, 1)))
        stops = np.flatnonzero(is_on & (bounds[1:] | ~np.roll(is_on, -1))) + 1
        if len(starts) == 0:
            return []
        edges = np.column_stack((starts, stops)).ravel()
        totals = np.add.reduceat(np.append(amount[order], 0.0), edges)[::2]
        return [order[starts[k] : stops[k]] for k in np.flatnonzero(totals >= least)]


def bent_stretches(
    outlines: Sequence[npt.NDArray[np.number]], least: float, most: float, turn: float
) -> Iterator[tuple[Doubles, float]]:
    """Stretches whose curvature keeps between two bounds and to one side.

    Args:
        outlines: closed, (n, 2) px.
        least, most: 1 / px, of the curvature.
        turn: rad, the least that a stretch turns in all.

    Yields:
        Its points (m, 2) and what it turns, rad.
    """
    if not outlines:
        return
    rings = Rings.of([len(outline) for outline in outlines])
    points = np.vstack(outlines).astype(np.float64)
    step = rings.step(rings.smooth(points), 2, 2)
    length = np.hypot(step[:, 0], step[:, 1]) / 4 + 1e-9
    turned = rings.step(np.arctan2(step[:, 1], step[:, 0]), 0, 1)
    turned = -((-turned + np.pi) % (2 * np.pi) - np.pi)
    bend = rings.smooth(turned) / length
    amount = np.abs(bend * length)
    for sign in (-1.0, 1.0):
        bent = (sign * bend > least) & (sign * bend < most)
        for run in rings.runs(bent, amount, turn):
            yield points[run], float(amount[run].sum())
