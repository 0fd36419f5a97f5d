"""A result of a run as the search sees it: its classes, its truth, its evidence through time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from formats.errors import FormatError
from formats.grid import Update, logit
from formats.results.file import RunFile
from replay.cells import Rule
from replay.prior import P_OUTSIDE, P_SPACE, P_WALL, PRIOR_SCALE, used
from replay.sensors.observer import MODELS
from replay.tuning.cases import DOOR, KINDS, MIXED, OUTSIDE, SPACE, WALL, WINDOW, Ground, ground
from replay.tuning.surfaces import Values

SAME = 1e-9  # log-odds: how far the prior in a result may be from the one its settings give


def ground_of(run: RunFile) -> Ground:
    """Classes and truth of a result's cells.

    Raises:
        FormatError: the run had no plan or no truth, or a prior that p_wall and p_space do not
            make.
    """
    layers = run.layers
    if run.settings.get("plan_confidence"):
        problem = "its prior is scaled cell by cell (--plan-confidence): there is no exact front"
        raise FormatError(run.path, problem, hint="run it again without")
    for name in ("wall", "outside", "truth_wall", "truth_scored"):
        if name not in layers:
            hint = "give a result of `replay run` with --prior, and --truth where there is one"
            raise FormatError(run.path, f"nothing to tune: it has no layer {name!r}", hint=hint)
    scored = layers["truth_scored"] > 0
    wall = (layers["truth_wall"] > 0) & scored
    if not wall.any():
        raise FormatError(run.path, "nothing to tune: its truth has no wall where it is scored")
    found = ground(
        run.path.name.removesuffix(".mcap").removesuffix(".replay"),
        layers["wall"],
        layers["outside"] > 0,
        wall.astype(np.int64),
        scored.astype(np.int64),
        rule=cast("Rule", run.settings.get("cell_rule", "any")),
        door=layers.get("door"),
        window=layers.get("window"),
        observed_only=run.settings.get("region") == "observed",
    )
    _check(run, found)
    return found


def values_of(
    run: RunFile, update: Update, p_hit: float | None = None, p_miss: float | None = None
) -> Values:
    """What held beside p_wall and p_space when the run was made, under one rule.

    Args:
        run: the result.
        update: the rule; its own curve says which sensor it took.
        p_hit, p_miss: another sensor; both or none of them.
    """
    curve = run.curves.get(update) or run.curves[run.main]
    levels = curve.p_levels
    if p_hit is not None or p_miss is not None:
        levels = tuple(MODELS[str(run.settings["sensor"])].p_levels(p_hit, p_miss))
    said = _numbers(run.settings)
    return Values(
        levels,
        update,
        said["prior_scale"],
        said["p_door"],
        said["p_window"],
        said["p_outside"],
    )


def _numbers(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The values of the run's own prior, defaults filled in."""
    known = {
        "p_wall": P_WALL,
        "p_space": P_SPACE,
        "p_outside": P_OUTSIDE,
        "prior_scale": PRIOR_SCALE,
        "p_door": None,
        "p_window": None,
    }
    return {name: settings.get(name, default) for name, default in known.items()}


def _check(run: RunFile, found: Ground) -> None:
    """Refuse a result whose prior is not what its classes and settings give."""
    if "prior_log_odds" not in run.layers:
        return
    said = _numbers(run.settings)
    scale = said["prior_scale"]
    door = said["p_space"] if said["p_door"] is None else said["p_door"]
    window = said["p_wall"] if said["p_window"] is None else said["p_window"]
    p = {
        WALL: used(said["p_wall"], scale),
        SPACE: used(said["p_space"], scale),
        DOOR: used(door, scale),
        WINDOW: used(window, scale),
        OUTSIDE: used(said["p_outside"], 1.0),
        MIXED: 0.5,
    }
    want = np.array([logit(p[kind]) for kind in KINDS])[found.kinds]
    mixed = found.kinds == KINDS.index(MIXED)
    parts = found.shares[mixed]
    both = parts * p[WALL] + (1.0 - parts) * p[SPACE]
    want[mixed] = np.log(both / (1.0 - both))
    have = -run.layers["prior_log_odds"].reshape(-1)[found.where]
    if not np.allclose(want, have, rtol=0.0, atol=SAME):
        raise FormatError(
            run.path,
            "its prior is not made of p_wall and p_space alone, so they cannot be tuned",
            hint="run it again without what changes the prior cell by cell",
        )
