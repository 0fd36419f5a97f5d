"""G5, G6, X3, X5, X7: log-odds, what a prior is worth, the sensor, exploration, cost."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from formats.grid import Update, logit
from replay import figures
from replay.figures import Chart, Line, Picture, Surface
from replay.prior import breaks_e13
from replay.reproduction.claims import Section
from replay.reproduction.studies import Study, shade
from replay.tuning.early import Course, course, keyframes
from replay.tuning.picks import PAPER
from replay.tuning.simulated import Explored
from replay.tuning.surfaces import Tables, Values, grid

RULES: tuple[Update, ...] = ("paper", "bayes")
PARTIAL = 0.6  # of the places: Figure 6 shows a building that is not explored to the end


def g5() -> Section:
    """Figure 5: the log-odds curve."""
    out = Section("G5", "Fig 5: log-odds", "log(p / (1 - p))")
    p = np.linspace(0.005, 0.995, 199)
    l0 = np.array([logit(v) for v in p.tolist()])
    inner = (p >= 0.2) & (p <= 0.8)
    slope = float(np.polyfit(p[inner] - 0.5, l0[inner], 1)[0])
    line = slope * (p - 0.5)
    chart = Chart(
        "log-odds of a probability",
        "p",
        "log-odds",
        [Line("log-odds", p, l0), Line("line fitted to 0.2 .. 0.8", p, line, "--")],
    )
    out.figure("the curve, and a line", figures.charts([chart]))
    near = float(np.abs(l0 - line)[inner].max())
    far = abs(logit(0.05) - slope * (0.05 - 0.5))
    out.claim(
        "about linear from 0.2 to 0.8, steep outside",
        near < 0.15 < far,
        f"the line is off by at most {near:.3f} inside, by {far:.2f} at 0.05",
    )
    return out


def g6(study: Study) -> Section:
    """Figure 6: informative against non-informative."""
    cells = study.cells[-2:]
    out = Section(
        "G6",
        "Fig 6: the proposed prior against none",
        f"(.2, .9) times 0.9; maps of a robot that stops after {PARTIAL:.0%} of its places, at two "
        "resolutions; F2 of all drawings and cell sizes after the whole way",
    )
    letter = study.letters[min(3, len(study.letters) - 1)]
    panels, curves = [], []
    early: dict[Update, list[tuple[float, float]]] = {rule: [] for rule in RULES}
    ahead = dict.fromkeys(RULES, True)
    for cell in cells:
        one = study.explored(letter, cell)
        places = max(1, round(PARTIAL * len(one.places())))
        part = Explored(letter, one.truth, one.prior, one.pixel, replace(one.setup, places=places))
        seen = keyframes(part.ground, part.evidences())
        for rule in RULES:
            values = part.values(rule)
            found = course(seen, values)
            lines = [
                Line("no prior", found.explored, found.without_prior(), "--", figures.GREY),
                Line("(.2, .9)", found.explored, found.f2(*_paper())[:, 0]),
            ]
            curves.append(
                Chart(f"({letter}) {cell} px, {rule}", "explored", "F2", lines, None, (0, 1.02))
            )
            curves.append(over_time(f"({letter}) {cell} px, {rule}", found))
            with_prior, without = found.f2(*_paper())[:, 0], found.without_prior()
            early[rule].append((float(with_prior[1]), float(without[1])))
            ahead[rule] &= bool((with_prior >= without).all())
        values = part.values("paper")
        panels.append(Picture(f"no prior, {cell} px", shade(part.map_without_prior(values), cell)))
        panels.append(Picture(f"(.2, .9), {cell} px", shade(part.map(values, *PAPER), cell)))
    out.figure("A, B: maps, rule paper", figures.pictures(panels, 2, 4.2))
    out.figure("D: F2 while exploring", figures.charts(curves, 2, 4.4, 2.8))
    for rule in RULES:
        _gain(study, out, rule)
        firsts = ", ".join(f"{a:.2f} against {b:.2f}" for a, b in early[rule])
        out.claim(
            f"F2 is high from the early stages on and stays above ({rule})",
            ahead[rule] and all(a > 0.5 for a, _ in early[rule]),
            f"after the first place {firsts} at {' and '.join(f'{c} px' for c in cells)}",
        )
    return out


def _paper() -> tuple[list[float], list[float]]:
    return [PAPER[0]], [PAPER[1]]


def over_time(title: str, found: Course) -> Chart:
    """F2 against the time of a reading a second, that is against the readings."""
    lines = [
        Line("no prior", found.times, found.without_prior(), "--", figures.GREY),
        Line("(.2, .9)", found.times, found.f2(*_paper())[:, 0]),
    ]
    return Chart(title, "readings (s)", "F2", lines, None, (0, 1.02))


def _gain(study: Study, out: Section, rule: Update) -> None:
    """Figure 6C under one rule."""
    groups, none, mine = [], [], []
    for letter in study.letters:
        for cell in study.cells:
            tables = study.tables(letter, cell, rule)
            groups.append(f"{letter}{cell}")
            none.append(float(tables.without_prior().f2))
            mine.append(float(tables.at(*_paper()).f2[0]))
    out.figure(
        f"C: F2 of drawing and cell size, {rule}",
        figures.bars(f"F2, {rule}", groups, {"no prior": none, "(.2, .9)": mine}, width=11.0),
    )
    points = np.array(mine) - np.array(none)
    relative = points / np.maximum(none, 1e-9)
    out.claim(
        f"F2 is up by 20 % or more ({rule})",
        bool((relative >= 0.2).all()),
        f"relative: {100 * relative.min():.0f} % to {100 * relative.max():.0f} %; in points (A24): "
        f"{points.min():.2f} to {points.max():.2f}",
    )
    coarse = [m for m, g in zip(mine, groups, strict=True) if g.endswith(str(study.cells[-1]))]
    bare = [n for n, g in zip(none, groups, strict=True) if g.endswith(str(study.cells[-1]))]
    out.claim(
        f"coarse grids stay usable with the prior ({rule})",
        min(coarse) > 0.7 and min(coarse) > max(bare),
        f"{study.cells[-1]} px: F2 {min(coarse):.2f} to {max(coarse):.2f} with, "
        f"{min(bare):.2f} to {max(bare):.2f} without",
    )


def x3(study: Study) -> Section:
    """Section 5.3: which sensors leave a prior its worth."""
    cell = study.cells[min(1, len(study.cells) - 1)]
    letter = study.letters[min(3, len(study.letters) - 1)]
    one = study.explored(letter, cell)
    out = Section(
        "X3",
        "section 5.3: the effect of the sensor model",
        f"drawing ({letter}), {cell} px; (.2, .9) under every p_free and p_occupied of the sensor",
    )
    hits, misses = (
        np.round(np.linspace(0.55, 0.98, 15), 3),
        np.round(np.linspace(0.02, 0.45, 15), 3),
    )
    case = one.ground.case(one.evidence)
    f2 = {rule: np.zeros((len(hits), len(misses))) for rule in RULES}
    broken = np.zeros((len(hits), len(misses)), dtype=np.bool_)
    for i, hit in enumerate(hits.tolist()):
        for j, miss in enumerate(misses.tolist()):
            broken[i, j] = breaks_e13(hit, miss, *PAPER) is not None
            for rule in RULES:
                values = Values(tuple(one.model.p_levels(hit, miss)), rule)
                f2[rule][i, j] = float(Tables(case, values).at(*_paper()).f2[0])
    edge = np.array([(hits[i], misses[j]) for i, j in np.argwhere(broken)]).reshape(-1, 2)
    out.figure(
        "F2 by sensor; dots: Equation 13 is broken",
        figures.surfaces(
            [
                Surface(rule, f2[rule], hits, misses, edge, labels=("p_hit", "p_miss"))
                for rule in RULES
            ],
            2,
            4.0,
        ),
    )
    kept, undone = f2["paper"][~broken], f2["paper"][broken]
    out.claim(
        "under Equation 5 the sensor must be surer than the prior (E13)",
        bool(undone.size and kept.size and kept.mean() > undone.mean()),
        f"mean F2 {kept.mean():.3f} where E13 holds, {undone.mean():.3f} where it is broken (least "
        f"{undone.min():.3f}); under bayes {f2['bayes'][~broken].mean():.3f} and "
        f"{f2['bayes'][broken].mean():.3f}",
        "it is a property of the printed update, which counts the prior against every reading "
        "(A1); the consistent update does not need it",
    )
    return out


def x5(study: Study) -> Section:
    """Partial, time-critical exploration."""
    cell = study.cells[min(1, len(study.cells) - 1)]
    out = Section("X5", "partial exploration", f"cells of {cell} px; F2 against what was explored")
    p, panels, rows = grid(46), [], []
    ahead = dict.fromkeys(RULES, 0)
    for letter in study.letters:
        one = study.explored(letter, cell)
        for rule in RULES:
            found = course(study.keyframes(letter, cell), one.values(rule))
            surface = found.surface(p)
            i, j = np.unravel_index(int(np.argmax(surface)), surface.shape)
            mine, none = found.f2(*_paper())[:, 0], found.without_prior()
            ahead[rule] += bool((mine > none).all())
            mean = float(found.weights @ none)
            rows.append(
                (
                    f"({letter}) {rule}",
                    f"{mean:.3f}",
                    f"{float(found.weights @ mine):.3f}",
                    f"{surface[i, j]:.3f} at ({p[i]:.2f}, {p[j]:.2f})",
                )
            )
            lines = [
                Line("no prior", found.explored, none, "--", figures.GREY),
                Line("(.2, .9)", found.explored, mine),
                Line("best early", found.explored, found.f2([p[i]], [p[j]])[:, 0], ":"),
            ]
            panels.append(Chart(f"({letter}) {rule}", "explored", "F2", lines, None, (0, 1.02)))
    out.figure("F2 while exploring", figures.charts(panels, 2, 4.4, 2.6))
    out.table(
        "mean F2 over the explored share", ("case", "no prior", "(.2, .9)", "best of all"), rows
    )
    for rule in RULES:
        out.claim(
            f"the prior is above at every share explored ({rule})",
            ahead[rule] == len(study.letters),
            f"in {ahead[rule]} of {len(study.letters)} drawings",
        )
    return out


def x7(study: Study) -> Section:
    """No added computing cost."""
    cell = study.cells[0]
    letter = study.letters[0]
    one = study.explored(letter, cell)
    out = Section(
        "X7",
        "no added computing cost",
        f"drawing ({letter}), {cell} px: the map drawn from the same evidence over both priors, "
        "the fastest of 15 each, in one run; readings are counted once for both",
    )
    values = one.values("paper")
    prior, nothing = one.l0(values, *PAPER), one.l0(replace(values, prior_scale=1.0), 0.5, 0.5)
    best = {}
    for name, grid_ in (("with", prior), ("without", nothing)):
        taken = []
        for _ in range(15):
            start = perf_counter()
            one.evidence.on(grid_, values.p_levels, values.update)
            taken.append(perf_counter() - start)
        best[name] = min(taken)
    start = perf_counter()
    readings = sum(1 for _ in one.evidences()) * one.setup.headings
    frame = (perf_counter() - start) / max(readings, 1)
    ratio = best["with"] / best["without"]
    out.claim(
        "a prior adds no computing cost to mapping",
        ratio < 1.25,
        f"a reading (simulated and counted) takes {1e6 * frame:.0f} us whatever the prior is; "
        f"drawing the map takes "
        f"{ratio:.2f} times as long with the prior as without",
        "the evidence of a reading does not depend on the prior at all: one pass serves them all",
    )
    return out
