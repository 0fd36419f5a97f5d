"""k-means over pairs (p_wall, p_space), started by k-means++ (sections 5.2; Arthur 2007)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from replay.tuning.cases import Floats, Ints

RESTARTS, ROUNDS = 20, 300


class Clusters(NamedTuple):
    """Groups of points, by the p_space of their centres less the p_wall, ascending.

    Attributes:
        centres: (k, 2).
        labels: (n,) the cluster of each point.
        inertia: sum of the squared distances to the centres.
    """

    centres: Floats
    labels: Ints
    inertia: float

    @property
    def proposed(self) -> int:
        """The cluster of low p_wall and high p_space, as the paper chooses it."""
        return len(self.centres) - 1


def cluster(points: Floats, k: int = 3, seed: int = 1) -> Clusters:
    """The best of several k-means, each from its own k-means++ start.

    Args:
        points: (n, 2).
        k: clusters; fewer where there are fewer distinct points.
        seed: of the starts.
    """
    random = np.random.default_rng(seed)
    k = min(k, len(np.unique(points, axis=0)))
    if k == 0:
        return Clusters(np.zeros((0, 2)), np.zeros(0, dtype=np.int64), 0.0)
    found = [_settled(points, _start(points, k, random)) for _ in range(RESTARTS)]
    centres, labels, inertia = min(found, key=lambda clusters: clusters.inertia)
    order = np.argsort(centres[:, 1] - centres[:, 0], kind="stable")
    names = np.empty(k, dtype=np.int64)
    names[order] = np.arange(k)
    return Clusters(centres[order], names[labels], inertia)


def _start(points: Floats, k: int, random: np.random.Generator) -> Floats:
    """k-means++: each next centre by the squared distance to those before."""
    centres = [points[random.integers(len(points))]]
    while len(centres) < k:
        far = _squares(points, np.array(centres)).min(axis=1)
        centres.append(points[random.choice(len(points), p=far / far.sum())])
    return np.array(centres)


def _settled(points: Floats, centres: Floats) -> Clusters:
    """Lloyd's rounds until nothing moves; a cluster that empties keeps its centre."""
    labels = np.full(len(points), -1, dtype=np.int64)
    for _ in range(ROUNDS):
        now = _squares(points, centres).argmin(axis=1)
        if np.array_equal(now, labels):
            break
        labels = now
        for i in range(len(centres)):
            if (labels == i).any():
                centres[i] = points[labels == i].mean(axis=0)
    squares = _squares(points, centres)
    return Clusters(centres, labels, float(squares[np.arange(len(points)), labels].sum()))


def _squares(points: Floats, centres: Floats) -> Floats:
    """(n, k) squared distances."""
    return np.asarray(((points[:, None, :] - centres[None, :, :]) ** 2).sum(axis=2))
