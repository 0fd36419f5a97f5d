"""The figures of `tune`: colour maps, fronts, chosen priors, F2 while exploring, other sensors."""

from __future__ import annotations

import numpy as np

from replay import figures
from replay.figures import Chart, Line, Surface
from replay.tuning.choosing import Tuned
from replay.tuning.surfaces import grid

NAMES = ("low p_space", "between", "low p_wall, high p_space")


def drawn(tuned: Tuned) -> dict[str, bytes]:
    """Name of the figure -> PNG."""
    out = {
        "surfaces": surfaces(tuned),
        "front": fronts(tuned),
        "priors": priors(tuned),
        "early": early(tuned),
    }
    if tuned.sensors is not None:
        out["sensors"] = figures.surfaces(
            [
                Surface(
                    f"best F2 of any prior, {tuned.update}",
                    tuned.sensors.f2,
                    tuned.sensors.p_hit,
                    tuned.sensors.p_miss,
                    span=None,
                    labels=("p_hit", "p_miss"),
                ),
                Surface(
                    "F2 without a prior",
                    tuned.sensors.none,
                    tuned.sensors.p_hit,
                    tuned.sensors.p_miss,
                    span=None,
                    labels=("p_hit", "p_miss"),
                ),
            ]
        )
    return out


def surfaces(tuned: Tuned) -> bytes:
    """Figures 3C and 4B: the 10 x 10 maps, and fine ones with the front in black."""
    panels = []
    for p in (grid(10), tuned.p):
        scores = tuned.together.surface(p, p)
        for name in ("precision", "recall", "f2"):
            points = tuned.front.points if p is tuned.p else None
            crosses = np.array([tuned.picks["paper"]])
            title = f"{name}, {tuned.update}, {len(p)} x {len(p)}"
            panels.append(Surface(title, getattr(scores, name), p, p, points, crosses))
    return figures.surfaces(panels)


def fronts(tuned: Tuned) -> bytes:
    """Figures 3D and 4C: the exact front, what the search found, single priors."""
    lines = []
    for case, front in zip(tuned.cases, tuned.fronts, strict=True):
        f = front.scores.objectives()
        lines.append(Line(f"{case.name}: exact front", f[:, 0], f[:, 1]))
    searched = tuned.together.at(tuned.search.x[:, 0], tuned.search.x[:, 1]).objectives()
    lines.append(Line("last population", searched[:, 0], searched[:, 1], "o", figures.ORANGE))
    for name, style in (("paper", "*"), ("f2", "^"), ("knee", "s")):
        if name in tuned.picks:
            wall, space = tuned.picks[name]
            f = tuned.together.at([wall], [space]).objectives()
            if np.isfinite(f).all():
                lines.append(Line(name, f[:, 0], f[:, 1], style, figures.RED))
    objectives = Chart(
        f"Pareto front, {tuned.update}", "1 / precision", "1 / recall", lines, (1, 2.6), (1, 2.6)
    )
    scores = tuned.front.scores
    plain = [Line("exact front", scores.recall, scores.precision)]
    none = tuned.together.without_prior()
    plain.append(Line("no prior", [none.recall], [none.precision], "*", figures.RED))
    plane = Chart("the same as rates", "recall", "precision", plain, (0, 1.02), (0, 1.02))
    return figures.charts([objectives, plane])


def priors(tuned: Tuned) -> bytes:
    """Figures 4D and 4E: the fronts' priors, and their clusters."""
    count = len(tuned.clusters.centres)
    names = NAMES if count == len(NAMES) else tuple(f"cluster {k + 1}" for k in range(count))
    groups = {
        f"{names[k]} ({int((tuned.clusters.labels == k).sum())})": tuned.points[
            tuned.clusters.labels == k
        ]
        for k in range(count)
    }
    return figures.scatter(f"priors on the fronts, {tuned.update}", groups, tuned.clusters.centres)


def early(tuned: Tuned) -> bytes:
    """F2 against what was explored, of several priors, and the mean over it as a colour map."""
    panels = []
    for case, course in zip(tuned.cases, tuned.courses, strict=True):
        lines = [Line("no prior", course.explored, course.without_prior(), "--", figures.GREY)]
        for name in ("paper", "f2", "early", "robust"):
            if name in tuned.picks:
                wall, space = tuned.picks[name]
                f2 = course.f2([wall], [space])[:, 0]
                lines.append(Line(f"{name} ({wall:.2f}, {space:.2f})", course.explored, f2))
        panels.append(
            Chart(f"{case.name}, {tuned.update}", "explored", "F2", lines, None, (0.0, 1.02))
        )
    return figures.charts(panels)
