"""Another truth for a result that is there: laid onto its lattice as a run would."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.plans.file import Plan, open_plan
from formats.results.groups import grouped, scored_cells
from formats.results.kept import Kept
from replay.cells import truth_cells
from replay.options import PLAN, effective, plan_values
from replay.world import truth_beside


def plan_of(kept: Kept, notes: Notes) -> Plan:
    """The plan of a run from the copy in its result.

    Raises:
        FormatError: it holds none.
    """
    name = Path(str(kept.settings.get("prior") or "")).name
    if not name or name not in kept.attachments:
        hint = "put a map yaml of the truth's stem beside it"
        raise FormatError(kept.path, "holds no plan beside which a truth could lie", hint=hint)
    with tempfile.TemporaryDirectory() as folder:
        for attached, data in kept.attachments.items():
            Path(folder, Path(attached).name).write_bytes(data)
        known = {key: value for key, value in kept.settings.items() if key in PLAN}
        corner = known.get("plan_origin")
        known |= {"plan_edits": None, "plan_origin": None if corner is None else Pose(*corner)}
        plan = open_plan(Path(folder, name), notes, **plan_values(effective(known)))
    if not plan.placed:
        hint = "put a map yaml of the truth's stem beside it"
        raise FormatError(
            kept.path, "its plan was laid under the log, and the truth is not", hint=hint
        )
    return plan


def with_truth(kept: Kept, truth: Path, notes: Notes) -> Kept:
    """The same result, scored against another truth.

    Args:
        kept: read whole; changed.
        truth: a plan or map in the frame of the run's plan.
        notes: told how the scored region was found.

    Raises:
        FormatError: nothing says where it lies.
    """
    real = open_plan(truth, notes)
    if not (real.placed and real.resolution is not None):
        real = truth_beside(real, plan_of(kept, notes))
    pose = kept.settings.get("plan_pose")
    frame = kept.map_to_plan if pose is None else Pose(*pose).inverse() @ kept.map_to_plan
    rule = kept.settings.get("cell_rule", "any")
    wall, scored = truth_cells(real, kept.geometry, rule, frame=frame, notes=notes)
    kept.layers["truth_wall"] = wall.astype(np.uint32)
    if kept.settings.get("region", "footprint") == "footprint" or not kept.settings.get("prior"):
        kept.layers["truth_scored"] = scored.astype(np.uint32)
    cells = scored_cells(kept.layers, kept.evidence().counts)
    kept.groups = cells and grouped(cells)
    return kept
