"""Counts, Step, Result: what a run yields."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Frame
from formats.grid import Evidence, Geometry, Grid, Update


class Counts(NamedTuple):
    """Cells of a map against the truth; occupied is positive (paper, section 3.2)."""

    tp: int
    fp: int
    fn: int
    tn: int

    def __add__(self, other: tuple[Any, ...]) -> Counts:
        """Cell by cell sums: the observed and the unobserved part make the whole."""
        return Counts(*(a + b for a, b in zip(self, other, strict=True)))


class Split(NamedTuple):
    """Counts inside the cells that some reading observed, and in all the others."""

    observed: Counts
    unobserved: Counts

    @property
    def whole(self) -> Counts:
        """Over the whole scored region."""
        return self.observed + self.unobserved


class Curve(NamedTuple):
    """How a map is drawn from evidence.

    Attributes:
        prior: l0 by cell.
        p_levels: P(empty) that a reading of each level stands for.
        update: "bayes" or "paper".
    """

    prior: Grid
    p_levels: tuple[float, ...]
    update: Update = "bayes"

    def of(self, evidence: Evidence) -> Grid:
        """The map of this evidence."""
        return evidence.on(self.prior, self.p_levels, self.update)


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")  # of a curve: it becomes part of a ROS topic's name


def checked_curves(curves: Mapping[str, Curve], main: str, geometry: Geometry) -> dict[str, Curve]:
    """The curves; ValueError where they do not fit together, or `main` is none of them."""
    if main not in curves:
        raise ValueError(f"the main curve {main!r} is not among {sorted(curves)}")
    for name, curve in curves.items():
        if not NAME.fullmatch(name):
            raise ValueError(f"{name!r} cannot be part of a topic's name")
        if curve.prior.geometry != geometry or len(curve.p_levels) != len(curves[main].p_levels):
            raise ValueError(f"the curve {name!r} lies on another lattice or has other levels")
    return dict(curves)


class Maps(Mapping[str, Grid]):
    """The map of each curve, drawn from the evidence when it is asked for."""

    def __init__(self, curves: Mapping[str, Curve], evidence: Evidence) -> None:
        self.curves, self.evidence = curves, evidence

    def __getitem__(self, name: str) -> Grid:
        return self.curves[name].of(self.evidence)

    def __iter__(self) -> Iterator[str]:
        return iter(self.curves)

    def __len__(self) -> int:
        return len(self.curves)

    def window(self, rows: slice, cols: slice) -> Maps:
        """The same maps within rows and cols, at the cost of that part alone."""
        geometry = self.evidence.geometry.window(rows, cols)
        curves = {
            name: curve._replace(prior=Grid(geometry, curve.prior.values[rows, cols]))
            for name, curve in self.curves.items()
        }
        return Maps(curves, Evidence(geometry, self.evidence.counts[:, rows, cols]))


@dataclass(slots=True)
class Step:
    """The state after one frame.

    Attributes:
        index: of the frame, from 0.
        frame: with its pose in the plan's frame.
        grids: curve name ("none", "bayes", "paper") -> map; computed when asked for.
        counts: curve name -> counts so far.
        keyframe: worth keeping a whole picture of: the first, the last, and by change.
        evidence: all readings so far; it goes on growing, so whoever keeps it copies it.
    """

    index: int
    frame: Frame
    grids: Mapping[str, Grid]
    counts: Mapping[str, Split]
    keyframe: bool = False
    evidence: Evidence | None = None


@dataclass(slots=True)
class Result:
    """What a run found.

    Attributes:
        settings: every option that had effect, by its flag's name.
        times_ns: (frames,) int64.
        counts: curve name -> (frames, 2, 4) int64: observed / unobserved by tp, fp, fn, tn.
        grids: curve name -> the last map.
        facts: what the run says of itself: scans, skipped, lost, reasons, hashes, versions.
    """

    settings: dict[str, Any]
    times_ns: npt.NDArray[np.int64]
    counts: dict[str, npt.NDArray[np.int64]]
    grids: dict[str, Grid] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)

    def split(self, curve: str, frame: int = -1) -> Split:
        """Counts of a curve after a frame (the last by default)."""
        observed, unobserved = self.counts[curve][frame]
        return Split(Counts(*(int(n) for n in observed)), Counts(*(int(n) for n in unobserved)))

    def _repr_html_(self) -> str:
        """The scores after the last frame, as a notebook shows them; numbers of ours alone."""
        head = ("curve", "precision", "recall", "F2", "observed F2", "unobserved F2")
        lines = [f"<tr>{''.join(f'<th>{name}</th>' for name in head)}</tr>"]
        for curve in self.counts if len(self.times_ns) else ():
            observed, unobserved = self.split(curve)
            precision, recall, f2 = ratios(observed + unobserved)
            numbers = (precision, recall, f2, ratios(observed)[2], ratios(unobserved)[2])
            cells = "".join(f"<td>{number:.3f}</td>" for number in numbers)
            lines.append(f"<tr><td>{escape(curve)}</td>{cells}</tr>")
        return f"<table>{''.join(lines)}</table>"


def ratios(counts: Counts) -> tuple[float, float, float]:
    """Precision, recall and F2; 0 where nothing is found (PAPER A13)."""
    tp, fp, fn, _ = counts
    if not tp:
        return 0.0, 0.0, 0.0
    return tp / (tp + fp), tp / (tp + fn), 5 * tp / (5 * tp + 4 * fn + fp)
