"""The plan against the building: what a run's evidence says of every wall of its plan."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any

import cv2
import numpy as np

from formats.grid import Evidence, Geometry
from replay.surveying.compare import STATES, TOLERANCE, Seen, Wall, compare
from replay.surveying.found import Extra, extras
from replay.surveying.segments import Mask

MET = 2, 0.25  # readings that ended in a cell, and their share: a wall seen at a grazing angle
OPEN = 3, 0.1  # readings of a cell, and at most so many that ended in it: it is surely open
CONTRADICTED = 5.0, 0.5  # m of walls that were seen, and the share of them that is not there
EXPLAINED = 0.15  # m around planned and moved walls, where hits are no new wall


@dataclass(frozen=True)
class Deviations:
    """The plan against the building.

    Attributes:
        geometry: of the masks.
        wall: the plan's walls.
        seen: what was seen of each cell.
        walls: of the plan, in parts of one state each.
        found: straight faces that the plan lacks, the longest first.
    """

    geometry: Geometry
    wall: Mask
    seen: Seen
    walls: list[Wall]
    found: list[Extra]

    def numbered(self) -> Iterator[tuple[int, Wall]]:
        """Walls with their numbers, from 1."""
        return enumerate(self.walls, 1)

    def summary(self) -> dict[str, tuple[int, float]]:
        """State, or "found" -> how many walls, and how many metres of them."""
        out: dict[str, tuple[int, float]] = {}
        for state in STATES:
            some = [wall.length for wall in self.walls if wall.state == state]
            out[state] = (len(some), sum(some, 0.0))
        inside = [extra.length for extra in self.found if extra.inside]
        return {**out, "found": (len(inside), sum(inside, 0.0))}

    @property
    def contradicted(self) -> bool:
        """Whether enough was seen to say that the plan does not lie where the building stands."""
        metres = {state: length for state, (_, length) in self.summary().items()}
        seen = metres["confirmed"] + metres["moved"] + metres["not there"]
        least, share = CONTRADICTED
        return seen >= least and metres["not there"] > share * seen

    def facts(self) -> dict[str, Any]:
        """What a run says of it: metres by state, and how far confirmed walls lie off."""
        metres = {name: round(length, 2) for name, (_, length) in self.summary().items()}
        off = [abs(w.moved) for w in self.walls if w.state == "confirmed" and not isnan(w.moved)]
        return {
            "metres": metres,
            "confirmed_off": round(float(np.median(off)), 3) if off else None,
        }


def deviations(
    evidence: Evidence,
    layers: Mapping[str, Any],
    p_levels: Sequence[float],
    tolerance: float = TOLERANCE,
) -> Deviations:
    """Compare a plan with what was seen.

    Args:
        evidence: of the whole run.
        layers: by name as in a result: "wall" (share of each cell), "outside" (cells beyond the
            building).
        p_levels: P(empty) of each level.
        tolerance: m that a wall may lie off and is still confirmed.
    """
    g = evidence.geometry
    wall = np.asarray(layers["wall"]) > 0
    outside = np.asarray(layers.get("outside", np.zeros(g.shape))) > 0
    seen = seen_of(evidence, p_levels)
    walls = compare(wall, seen, g.resolution, (g.x, g.y), tolerance)
    known = wall.astype(np.uint8)
    for one in walls:
        if one.state == "moved":
            _draw(known, one, g)
    far = cv2.distanceTransform(1 - known, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    limit = max(EXPLAINED, tolerance) / g.resolution
    new = seen.occupied & (far > limit)
    found = extras(new, ~outside, g.resolution, (g.x, g.y))
    return Deviations(g, wall, seen, walls, found)


def seen_of(evidence: Evidence, p_levels: Sequence[float]) -> Seen:
    """What evidence says of each cell, without any prior.

    Args:
        evidence: of the whole run.
        p_levels: P(empty) of each level.
    """
    total, visits = evidence.total(p_levels), evidence.visits()
    blocked = evidence.counts[np.asarray(p_levels) < 0.5].sum(axis=0, dtype=np.int64)
    share = blocked / np.maximum(visits, 1)
    return Seen(
        total < 0,
        (total < 0) | ((blocked >= MET[0]) & (share >= MET[1])),
        (visits > 0) & (total > 0),
        (visits >= OPEN[0]) & (share <= OPEN[1]),
    )


def _draw(mask: Any, wall: Wall, g: Geometry) -> None:
    """A wall where it has moved to."""
    along = np.subtract(wall.end, wall.start) / max(wall.length, 1e-9)
    shift = wall.moved * np.array([-along[1], along[0]])
    ends = [(np.array(p) + shift - (g.x, g.y)) / g.resolution - 0.5 for p in (wall.start, wall.end)]
    a, b = (np.rint(end).astype(int).tolist() for end in ends)
    cv2.line(mask, a, b, 1, max(1, round(wall.thickness / g.resolution)))
