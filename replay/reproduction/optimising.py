"""G3, G4, T1, T2, X6: surfaces, fronts and their priors over the five drawings."""

from __future__ import annotations

from itertools import product

import numpy as np

from replay import figures
from replay.figures import Chart, Line, Picture, Surface
from replay.reproduction.claims import Section
from replay.reproduction.studies import Study, shade, three
from replay.reproduction.tables import TENTHS, TINY, best_pairs
from replay.tuning.clusters import cluster
from replay.tuning.front import Front, exact_front, hypervolume
from replay.tuning.genetic import evolve
from replay.tuning.objectives import exact
from replay.tuning.picks import PAPER
from replay.tuning.search import Search
from replay.tuning.surfaces import Scores, grid


def g3(study: Study) -> Section:
    """Figure 3: one drawing from maps to front."""
    letter, cell = study.letters[0], study.cells[min(1, len(study.cells) - 1)]
    one, tables = study.explored(letter, cell), study.tables(letter, cell)
    out = Section(
        "G3",
        f"Fig 3: drawing ({letter}), cells of {cell} x {cell} px",
        "Equation 5 as printed, Equation 10 on the true occupancy, values times 0.9 (A5), scored "
        "by map pixel inside the building (A14), unvisited cells with their prior (A12).",
    )
    scores, front = tables.surface(TENTHS, TENTHS), exact_front(tables)
    found = evolve(exact(tables), Search())
    values = one.values()
    picks = {
        "most precision": best_pairs(scores.precision)[0],
        "most recall": best_pairs(scores.recall)[0],
        "the paper's (.2, .9)": np.array(PAPER),
    }
    pictures = [
        Picture(f"{name}: ({p[0]:g}, {p[1]:g})", shade(one.map(values, p[0], p[1]), cell))
        for name, p in picks.items()
    ]
    drawing = Picture("A: the drawing", study.drawn[letter].gray / 255.0)
    out.figure("drawing and maps (B, E)", figures.pictures([drawing, *pictures], 2, 4.2))
    fine = grid(91)
    smooth = tables.surface(fine, fine)
    out.figure(
        "C: precision and recall, the exact front in black",
        figures.surfaces(
            [
                Surface("precision", scores.precision, TENTHS, TENTHS, front.points),
                Surface("recall", scores.recall, TENTHS, TENTHS, front.points),
                Surface("F2", scores.f2, TENTHS, TENTHS, front.points),
                Surface("precision, 91 x 91", smooth.precision, fine, fine, front.points),
                Surface("recall, 91 x 91", smooth.recall, fine, fine, front.points),
                Surface("F2, 91 x 91", smooth.f2, fine, fine, front.points),
            ]
        ),
    )
    f = front.scores.objectives()
    out.figure(
        "D: the front",
        figures.charts(
            [
                Chart(
                    "Pareto front",
                    "1 / precision",
                    "1 / recall",
                    [
                        Line("exact", f[:, 0], f[:, 1]),
                        Line("genetic search", found.f[:, 0], found.f[:, 1], "o", figures.ORANGE),
                    ],
                )
            ]
        ),
    )
    sharp, full = picks["most precision"], picks["most recall"]
    at_sharp, at_full = tables.at(sharp[:1], sharp[1:]), tables.at(full[:1], full[1:])
    out.claim(
        "precision and recall conflict: what is best for one is not best for the other",
        bool(
            at_sharp.recall[0] < at_full.recall[0] and at_full.precision[0] < at_sharp.precision[0]
        ),
        f"most precision: {three(at_sharp)}; most recall: {three(at_full)}; the exact front has "
        f"{len(front.scores.tp)} points, so no prior is best for both",
    )
    mine = tables.at([PAPER[0]], [PAPER[1]])
    out.claim(
        "the map at (.2, .9) keeps both above 40 %",
        bool((mine.objectives() < 2.5).all()),
        three(mine),
    )
    whole = hypervolume(f)
    share = hypervolume(found.archive_f) / whole if whole else 0.0
    out.claim(
        "the genetic search finds the front",
        share >= 0.99,
        f"{found.evaluations:,} evaluations reach {share:.4f} of the exact hypervolume, the last "
        f"population's {len(found.x)} points {hypervolume(found.f) / max(whole, TINY):.4f}",
    )
    return out


def g4(study: Study) -> Section:
    """Figure 4: five drawings together."""
    cell = study.cells[min(1, len(study.cells) - 1)]
    out = Section("G4", f"Fig 4: all drawings, cells of {cell} x {cell} px", "as Fig 3")
    fronts: dict[str, Front] = {}
    panels = []
    near = np.ones((10, 10), dtype=np.bool_)
    good = np.ones((10, 10), dtype=np.bool_)
    for letter in study.letters:
        tables = study.tables(letter, cell)
        fronts[letter] = exact_front(tables)
        scores = tables.surface(TENTHS, TENTHS)
        points = fronts[letter].points
        panels.append(Surface(f"({letter}) precision", scores.precision, TENTHS, TENTHS, points))
        panels.append(Surface(f"({letter}) recall", scores.recall, TENTHS, TENTHS, points))
        near &= unbeaten(scores)
        good &= (scores.objectives() < 2.5).all(axis=-1)
        good &= scores.f2 >= scores.f2.max() - 0.05
    out.figure("B: colour maps", figures.surfaces(panels, 4, 2.8))
    lines = []
    for letter, front in fronts.items():
        f = front.scores.objectives()
        lines.append(Line(f"({letter})", f[:, 0], f[:, 1]))
    chart = Chart("C: Pareto fronts", "1 / precision", "1 / recall", lines, (1, 2.5), (1, 2.5))
    out.figure("C: fronts", figures.charts([chart]))
    points = np.concatenate([front.acceptable.points for front in fronts.values()])
    found = cluster(points)
    names = [f"cluster {k + 1}: ({c[0]:.2f}, {c[1]:.2f})" for k, c in enumerate(found.centres)]
    out.figure(
        "D: priors on the fronts",
        figures.scatter("by drawing", {f"({a})": f.acceptable.points for a, f in fronts.items()}),
    )
    groups = {name: points[found.labels == k] for k, name in enumerate(names)}
    out.figure("E: 3 clusters", figures.scatter("k-means", groups, found.centres))
    out.claim(
        "the fronts of all drawings share a region of (p_wall, p_space)",
        bool(good.any()),
        f"{int(good.sum())} of the 100 pairs of tenths are within .05 of the best F2 of every "
        f"drawing at once: {listed(good)}; exactly on all fronts of the tenths: {listed(near)}",
    )
    proposed = found.centres[found.proposed]
    low = proposed[0] < 0.5 < proposed[1]
    out.claim(
        "one of the three clusters has a low p_wall and a high p_space",
        bool(low),
        "; ".join(names),
        ""
        if low
        else "under Equation 5 with many readings p acts as a threshold on coverage (A2), which "
        "draws the fronts towards the values at which l0 is 0 or equals a level's log-odds",
    )
    return out


def unbeaten(scores: Scores) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Which of the pairs no other pair beats in precision and recall."""
    pre, rec = scores.precision.ravel(), scores.recall.ravel()
    beaten = np.zeros(pre.size, dtype=np.bool_)
    for k in range(pre.size):
        beaten[k] = ((pre >= pre[k]) & (rec >= rec[k]) & ((pre > pre[k]) | (rec > rec[k]))).any()
    return np.asarray(~beaten.reshape(scores.precision.shape) & (scores.tp > 0))


def listed(chosen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], most: int = 12) -> str:
    """The chosen pairs of tenths, the first few of them."""
    pairs = [f"({a:g}, {b:g})" for a, b in TENTHS[np.argwhere(chosen)].tolist()]
    more = f" and {len(pairs) - most} more" if len(pairs) > most else ""
    return (", ".join(pairs[:most]) + more) or "none"


def x6(study: Study) -> Section:
    """(0.5, 0.5) against the fronts."""
    out = Section("X6", "(0.5, 0.5) is not on the Pareto front", "0.5 everywhere, never scaled")
    rows, beaten, outside, cases = [], 0, 0, 0
    for letter, cell in product(study.letters, study.cells):
        tables = study.tables(letter, cell)
        none, front = tables.without_prior(), exact_front(tables)
        better = (front.scores.precision >= none.precision) & (front.scores.recall >= none.recall)
        more = (front.scores.precision > none.precision) | (front.scores.recall > none.recall)
        cases += 1
        is_beaten = bool((better & more).any())
        beaten += is_beaten
        outside += not is_beaten and not bool((none.objectives() < 2.5).all())
        best = int(np.argmax(front.scores.f2))
        rows.append(
            (f"({letter}) {cell} px", three(none), f"F2 {float(front.scores.f2[best]):.3f}")
        )
    out.table("no prior, and the best of the front", ("case", "no prior", "best"), rows)
    out.claim(
        "the non-informative prior is not Pareto optimal",
        beaten + outside == cases,
        f"another prior beats it in {beaten} of {cases} cases; in {outside} more nothing beats its "
        "precision, but its recall is below the 40 % of C, outside of which Equation 7 calls "
        "nothing optimal",
        "without a prior nothing is guessed, so what is called wall nearly always is one: its "
        "precision can lie at the very end of the front",
    )
    return out
