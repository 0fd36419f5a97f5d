"""What a similarity leaves: a smooth field of displacements from the map to the plan.

A drawing is not exact, and a map drifts. The field is a cubic B-spline over a coarse lattice,
fitted along the walls' normals as the similarity was (iterated closest points, Welsch's weights),
and kept from bending where nothing asks for it. It says how far off each part is; it never moves
the similarity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from formats.jit import njit
from replay.registration.fields import Floats
from replay.registration.polish import Bench, target
from replay.registration.seen import Doubles, Mask, Seen

LATTICE = 8  # spacings along the map's longer side
STIFF = 0.1  # of the readings' weight, which the bending of the lattice has
WEAK = 1e-4  # the same of its size, for parts that nothing is seen of
ROUNDS = (4.0, 4.0, 3.0, 3.0, 2.0, 2.0, 1.5, 1.5, 1.0, 1.0, 1.0, 1.0)  # of the tolerance
NEAR = 2.0  # times the tolerance: what is farther from a wall at the end is no wall
LEAST = 6  # points within a spacing of a node, below which nothing is said of it


@dataclass(frozen=True)
class Residual:
    """How far the plan lies from the map, part by part.

    Attributes:
        nodes: (n, 2) x, y in the plan's pixels, of the lattice where walls were seen.
        moves: (n, 2) plan pixels from where the similarity puts the map to where the plan is.
        spacing: plan pixels between nodes.
        before, after: rms in plan pixels from what was seen to its walls, without and with the
            field; of the same points, those that lie on walls in the end.
        on_walls: their share.
        metres: a plan pixel, None where it is not known.
    """

    nodes: Doubles
    moves: Doubles
    spacing: float
    before: float
    after: float
    on_walls: float
    metres: float | None

    def facts(self) -> dict[str, Any]:
        """What `--json` says of it: pixels of the plan, and metres where they are known."""
        sizes = np.hypot(*self.moves.T)
        lengths = {
            "spacing": self.spacing,
            "rms_before": self.before,
            "rms_after": self.after,
            "median": float(np.median(sizes)) if len(sizes) else 0.0,
            "largest": float(sizes.max(initial=0.0)),
        }
        found: dict[str, Any] = {
            "nodes": np.hstack([self.nodes, self.moves]).round(3).tolist(),
            "on_walls": self.on_walls,
            **lengths,
        }
        if self.metres is not None:
            found |= {f"{name}_m": self.metres * size for name, size in lengths.items()}
        return found


def residual(seen: Seen, walls: Mask, matrix: Doubles, *, metres: float | None = None) -> Residual:
    """The smooth field that a similarity leaves.

    Args:
        seen: the map.
        walls: (H, W) the plan's ink.
        matrix: (2, 3) map cells -> plan pixels; it is kept.
        metres: a pixel of the plan.
    """
    bench = Bench(seen, walls)
    inside = bench.inside(matrix)
    points, facing = bench.even, bench.even_facing
    at = points @ inside[:, :2].T + inside[:, 2]
    tolerance = max(0.7, bench.tolerance * float(np.hypot(inside[0, 0], inside[1, 0])))
    low, high = at.min(axis=0), at.max(axis=0)
    spacing = max(float((high - low).max()) / LATTICE, 4.0)
    count = np.ceil((high - low) / spacing).astype(np.int64) + 1  # nodes along x, y
    basis = _basis((at - low) / spacing, count)
    bending = _bending(count + 2)
    plan = bench.plan
    moves, field = np.zeros_like(at), (plan.near, plan.at, plan.across)
    edge, off = _targets(points, facing, inside, moves, *field)
    first = np.hypot(*off.T)
    for times in ROUNDS:
        sigma = times * tolerance
        square = np.square(off).sum(axis=1)
        weight = np.where(edge >= 0, np.exp(-0.5 * square / sigma**2), 0.0)
        moves = basis @ _solved(basis, bending, plan.normal[edge], off + moves, weight)
        edge, off = _targets(points, facing, inside, moves, *field)
    last = np.hypot(*off.T)
    square = np.square(off).sum(axis=1)
    weight = np.where(edge >= 0, np.exp(-0.5 * square / tolerance**2), 0.0)
    knots = _solved(basis, bending, plan.normal[edge], off + moves, weight)
    on = (edge >= 0) & (last < NEAR * tolerance)
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), axis=-1)
    grid = grid.reshape(-1, 2).astype(np.float64)
    near = np.abs((at[on] - low) / spacing - grid[:, None]).max(axis=2) < 1.0
    told = near.sum(axis=1) >= LEAST
    nodes = grid[told] * spacing + low
    return Residual(
        bench.outside(nodes),
        bench.unit * (_basis(grid[told], count) @ knots),
        bench.unit * spacing,
        bench.unit * _rms(first[on]),
        bench.unit * _rms(last[on]),
        float(on.mean()),
        metres,
    )


def _rms(values: Doubles) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


@njit
def _targets(
    points: Doubles,
    facing: Doubles,
    matrix: Doubles,
    moves: Doubles,
    near: npt.NDArray[np.int32],
    at: Floats,
    across: Floats,
) -> tuple[npt.NDArray[np.int64], Doubles]:
    """The edge that each point belongs to once it is moved (-1: none), and what is still off."""
    edge, off = np.full(points.shape[0], -1, np.int64), np.zeros((points.shape[0], 2))
    moved = matrix.copy()
    for i in range(points.shape[0]):
        moved[0, 2] = matrix[0, 2] + moves[i, 0]
        moved[1, 2] = matrix[1, 2] + moves[i, 1]
        edge[i], off[i, 0], off[i, 1] = target(points[i], facing[i], moved, near, at, across)
    return edge, off


def _basis(at: Doubles, count: npt.NDArray[np.int64]) -> Doubles:
    """(n, knots) values of the cubic B-splines at places in spacings; knots stand one beyond."""
    weights = []
    for axis in (0, 1):
        cell = np.clip(np.floor(at[:, axis]), 0, count[axis] - 2).astype(np.int64)
        t = at[:, axis] - cell
        four = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 3 * t * (1 + t - t**2) + 1, t**3])
        full = np.zeros((len(at), count[axis] + 2))
        for k in range(4):
            full[np.arange(len(at)), cell + k] = four[k] / 6.0
        weights.append(full)
    out: Doubles = (weights[0][:, :, None] * weights[1][:, None, :]).reshape(len(at), -1)
    return out


def _bending(knots: npt.NDArray[np.int64]) -> Doubles:
    """(k, k) the thin plate's energy of a lattice of knots, by second differences."""
    one = [np.eye(n) for n in knots]
    first = [np.diff(e, axis=0) for e in one]
    second = [np.diff(e, 2, axis=0) for e in one]
    parts = [
        np.kron(second[0], one[1]),
        np.kron(one[0], second[1]),
        np.sqrt(2.0) * np.kron(first[0], first[1]),
    ]
    out: Doubles = sum((p.T @ p for p in parts), np.zeros((knots.prod(), knots.prod())))
    return out


def _solved(
    basis: Doubles, bending: Doubles, normal: Floats, wanted: Doubles, weight: Doubles
) -> Doubles:
    """(knots, 2) that bring the points along their normals to where they are wanted."""
    both = np.hstack([basis * normal[:, :1], basis * normal[:, 1:]])
    left = both.T @ (weight[:, None] * both)
    right = both.T @ (weight * (normal * wanted).sum(axis=1))
    total = float(weight.sum()) / len(bending)
    stiff = total * (STIFF * bending + WEAK * np.eye(len(bending)))
    left += np.kron(np.eye(2), stiff) + 1e-9 * np.eye(len(left))
    knots: Doubles = np.linalg.solve(left, right).reshape(2, -1).T
    return knots
