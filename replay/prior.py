"""Walls and the paper's probabilities to a prior: log-odds of empty by cell.

p_wall, p_space and p_outside are P(empty), as the paper prints them (section 3.1).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from formats.errors import UsageError
from formats.grid import P_MAX, P_MIN, Floats, Grid, logit
from replay.cells import CellLayers, Rule

P_WALL, P_SPACE = 0.2, 0.9  # the paper's proposal
P_OUTSIDE = 0.5
PRIOR_SCALE = 0.9  # the paper multiplies the values it prints by this before use


def used(p: float, prior_scale: float = PRIOR_SCALE) -> float:
    """The P(empty) that a printed one stands for: scaled, then clamped to [0.001, 0.999] (A5).

    Raises:
        UsageError: p is not a probability, or the scale is not within 0 to 1.
    """
    if not 0.0 <= p <= 1.0:
        raise UsageError("", f"{p:g} is not a probability", hint="give 0 to 1")
    if not 0.0 < prior_scale <= 1.0:
        raise UsageError("", f"prior_scale {prior_scale:g} is not above 0 and at most 1")
    return min(max(p * prior_scale, P_MIN), P_MAX)


def build_prior(
    layers: CellLayers,
    p_wall: float = P_WALL,
    p_space: float = P_SPACE,
    p_outside: float = P_OUTSIDE,
    prior_scale: float = PRIOR_SCALE,
    rule: Rule = "any",
) -> Grid:
    """The informative prior.

    Cells outside of the building, unknown ones among them, get p_outside, unscaled (A5). Of the
    others, wall cells get p_wall and all else p_space, both scaled; under "fraction" every cell
    gets the mean of both, weighted by the wall's share of its known pixels.

    Args:
        layers: what the plan says by cell.
        p_wall: P(empty) of walls, 0 to 1.
        p_space: P(empty) of the building's space.
        p_outside: P(empty) of everything else.
        prior_scale: 0.9 in the paper.
        rule: when a cell is wall: "any" of its pixels, the "majority", or by "fraction".

    Raises:
        UsageError: a value that is not a probability.
    """
    wall, space = used(p_wall, prior_scale), used(p_space, prior_scale)
    if rule == "fraction":
        shares, which = np.unique(layers.wall_fraction, return_inverse=True)
        mixed = [logit(share * wall + (1.0 - share) * space) for share in shares.tolist()]
        values = np.array(mixed)[which].reshape(layers.geometry.shape)
    else:
        values = np.where(layers.walls(rule), logit(wall), logit(space))
    values[layers.outside] = logit(used(p_outside, 1.0))
    return Grid(layers.geometry, values)


def informative(
    layers: CellLayers,
    openings: Mapping[str, Floats],
    *,
    cell_rule: Rule = "any",
    p_door: float | None = None,
    p_window: float | None = None,
    prior_scale: float = PRIOR_SCALE,
    **prior: float,
) -> Grid:
    """The plan's prior, with the doors and windows that a drawing shows.

    Where the layers say how far they are to be believed, log-odds are scaled by that towards 0.5.

    Args:
        layers: what the plan says by cell.
        openings: "door" and "window" -> share of each cell, or neither.
        cell_rule: when a cell is wall.
        p_door, p_window: P(empty), before the scale; None: as space, as wall.
        prior_scale: multiplies all of them but p_outside.
        prior: p_wall, p_space, p_outside.

    Raises:
        UsageError: a value that is not a probability.
    """
    grid = build_prior(layers, prior_scale=prior_scale, rule=cell_rule, **prior)
    if openings:
        shut = layers.walls(cell_rule)
        for p, cells in (
            (p_door, (openings["door"] > 0) & ~shut),
            (p_window, openings["window"] > 0),
        ):
            if p is not None:
                grid.values[cells] = logit(used(p, prior_scale))
    if layers.confidence is not None:
        grid.values[~layers.outside] *= layers.confidence[~layers.outside]
    return grid


def no_prior(layers: CellLayers) -> Grid:
    """The non-informative prior: 0.5 everywhere, never scaled (A4)."""
    return Grid(layers.geometry, np.zeros(layers.geometry.shape))


def breaks_e13(
    p_hit: float,
    p_miss: float,
    p_wall: float = P_WALL,
    p_space: float = P_SPACE,
    prior_scale: float = PRIOR_SCALE,
) -> str | None:
    """One line where a prior is more certain than the sensor, which `paper` turns against it.

    Equation 13 wants p_free > p_space and p_occupied < p_wall, all P(empty), where the sensor's
    p_free is 1 - p_miss and its p_occupied is 1 - p_hit (A6).

    Args:
        p_hit: the sensor's P(occupied) after a hit.
        p_miss: the same after a miss.
        p_wall: as the paper prints it, P(empty).
        p_space: likewise.
        prior_scale: multiplies both before they are compared.

    Returns:
        None where it holds.
    """
    wall, space = used(p_wall, prior_scale), used(p_space, prior_scale)
    free, occupied = 1.0 - p_miss, 1.0 - p_hit
    broken = []
    if not free > space:
        broken.append(f"a miss says {free:.3g} empty, not above p_space {space:.3g}")
    if not occupied < wall:
        broken.append(f"a hit says {occupied:.3g} empty, not below p_wall {wall:.3g}")
    if not broken:
        return None
    return f"Equation 13 is broken: {'; '.join(broken)}: under `paper` readings undo such a prior"
