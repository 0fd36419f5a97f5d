"""What the genetic search minimises: the exact objectives, or the paper's interpolated grid."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from replay.tuning.cases import Floats
from replay.tuning.search import Objective
from replay.tuning.surfaces import Tables, grid

ObjectiveName = Literal["exact", "interpolated"]
STEPS = 10  # the paper's 0.1, 0.2, ... 1


def exact(tables: Tables) -> Objective:
    """1 / precision and 1 / recall as they are."""
    return lambda x: tables.at(x[:, 0], x[:, 1]).objectives()


def interpolated(tables: Tables, steps: int = STEPS) -> Objective:
    """Of precision and recall between the points of a grid, linear in both (section 5.1, A21)."""
    p = grid(steps)
    scores = tables.surface(p, p)
    both = RegularGridInterpolator((p, p), np.stack([scores.precision, scores.recall], axis=-1))

    def objective(x: Floats) -> Floats:
        values = np.asarray(both(x), dtype=np.float64)
        return np.divide(1.0, values, out=np.full_like(values, np.inf), where=values > 0)

    return objective


OBJECTIVES = {"exact": exact, "interpolated": interpolated}
