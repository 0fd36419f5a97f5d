"""How the scores of a run went: the counts of every curve after each frame."""

from __future__ import annotations

from array import array
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from formats.result import Step

Ints = npt.NDArray[np.int64]


class History:
    """Counts over time, held as numbers alone: 64 bytes a frame and curve.

    Args:
        names: of the curves.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = list(names)
        self._times, self._counts = array("q"), array("q")

    def add(self, step: Step) -> None:
        """One more frame."""
        self._times.append(step.frame.time_ns)
        for split in step.counts.values():
            self._counts.extend((*split.observed, *split.unobserved))

    def __len__(self) -> int:
        return len(self._times)

    @property
    def seconds(self) -> float:
        """From the first frame to the last."""
        return (self._times[-1] - self._times[0]) / 1e9 if self._times else 0.0

    def last(self) -> dict[str, list[int]]:
        """Curve -> observed, then unobserved tp, fp, fn, tn after the last frame."""
        rows = self._counts[-8 * len(self._names) :]
        return {name: list(rows[8 * i : 8 * i + 8]) for i, name in enumerate(self._names)}

    def times_ns(self) -> Ints:
        """(n,) of the frames."""
        return np.array(self._times, dtype=np.int64)

    def counts(self) -> dict[str, Ints]:
        """Curve -> (n, 2, 4): observed and unobserved tp, fp, fn, tn."""
        table = np.array(self._counts, dtype=np.int64).reshape(len(self), len(self._names), 2, 4)
        return {name: table[:, i] for i, name in enumerate(self._names)}
