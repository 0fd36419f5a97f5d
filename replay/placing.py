"""Where the plan of a run lies: as its file says, as `replay align` found, or found here."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes
from formats.plans.file import Plan
from formats.plans.placement import read_placement
from replay.registration.aligning import align_files
from replay.registration.placing import placed
from replay.registration.seen import Doubles


def located(
    plan: Plan,
    log: str | PathLike[str],
    placement: str | PathLike[str] | None,
    notes: Notes,
    **reading: Any,
) -> tuple[Plan, list[dict[str, Any]]]:
    """The plan in the frame of the poses.

    Args:
        plan: without a frame of its own, or with one that a placement overrules.
        log: what it is laid under, where no placement is given.
        placement: a file that `replay align` wrote.
        notes: told where it lies.
        reading: options of `formats.stream.survey`.

    Returns:
        The plan, and where it may lie, the place taken first: "score", and "corners" of its picture
        in the frame of the poses, m; empty where a placement says it.

    Raises:
        FormatError: no place on the plan is clearly the best; a placement of something else.
    """
    if placement is not None:
        return placed(plan, read_placement(placement)), []
    found = align_files(log, plan.path, opened=plan, notes=Notes(), **reading)
    alignment, best = found.alignment, found.alignment.best
    sure = f"confidence {alignment.confidence:.2f}"
    if not alignment.confident:
        raise FormatError(
            plan.path,
            f"nothing says where the plan lies, and no place is clearly the best ({sure})",
            hint="look at `replay align`, or give --plan-pose, or a map yaml of its stem",
        )
    mirror = ", mirrored" if best.mirrored else ""
    notes.info(
        plan.path,
        f"placed on the log: {1 / best.scale:.4f} m/px, turned {best.turn_deg:.1f} deg{mirror}, "
        f"{sure}",
    )
    shape = plan.occupancy.shape
    places = [{"score": p.score, "corners": corners_of(p.matrix, shape)} for p in alignment.places]
    return found.placed, places


def corners_of(matrix: Doubles, shape: tuple[int, int]) -> list[list[float]]:
    """Of a plan's picture (rows, cols) in a log's frame, m, around; matrix as of Place."""
    rows, cols = shape
    pixels = np.array([[0, rows], [cols, rows], [cols, 0], [0, 0]]) - 0.5
    metres = np.linalg.solve(matrix[:, :2], (pixels - matrix[:, 2]).T).T
    return [[round(float(x), 3), round(float(y), 3)] for x, y in metres]
