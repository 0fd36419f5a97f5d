"""X4: a stale plan. A wall is gone, a wall has collapsed: do the data overrule the prior?"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from formats.grid import Update
from replay import figures
from replay.figures import Chart, Line, Picture
from replay.reproduction.claims import Section
from replay.reproduction.maps import RULES
from replay.reproduction.studies import PIXEL, Study, shade
from replay.tuning.cases import Bools
from replay.tuning.picks import PAPER
from replay.tuning.simulated import Explored

GONE = ((7.0, 1.4), (7.0, 3.9))  # m: the wall between two rooms
FALLEN = ((2.6, 7.4), (3.6, 8.0))  # m: rubble in the middle of a room


def changed(walls: Bools) -> tuple[Bools, Bools, Bools]:
    """What stands after the wall is gone and rubble lies there; where either of it is."""
    gone, rubble = (np.zeros(walls.shape, dtype=np.uint8) for _ in range(2))
    ends = [tuple(round(v / PIXEL) for v in end) for end in GONE]
    cv2.line(gone, ends[0], ends[1], 1, round(0.3 / PIXEL))
    a, b = ([round(v / PIXEL) for v in end] for end in FALLEN)
    cv2.rectangle(rubble, a, b, 1, -1)
    opened = (gone > 0) & walls
    return (walls & ~opened) | (rubble > 0), opened, rubble > 0


def x4(study: Study) -> Section:
    """The changed places, reading by reading."""
    letter = study.letters[min(3, len(study.letters) - 1)]
    cell = study.cells[min(1, len(study.cells) - 1)]
    walls = study.drawn[letter].walls
    now, opened, rubble = changed(walls)
    setup = replace(study.setup, cell=cell)
    one = Explored(letter, now, study.read[letter].walls, PIXEL, setup, world=now)
    out = Section(
        "X4",
        "a stale plan: a wall gone, rubble of another",
        f"drawing ({letter}), {cell} px: the plan still has the wall between two rooms, and knows "
        "nothing of rubble in a third; share of the observed changed pixels that the map has right",
    )
    keyframes = [
        (time, _right(one, evidence, opened, rubble)) for time, evidence in one.evidences()
    ]
    panels, times = [], [time for time, _ in keyframes]
    for rule in RULES:
        lines = []
        for k, name in enumerate(("wall gone", "rubble")):
            for prior, style in (("with prior", "-"), ("no prior", "--")):
                shares = [right[rule][prior][k] for _, right in keyframes]
                lines.append(Line(f"{name}, {prior}", times, shares, style, figures.COLOURS[k]))
        panels.append(
            Chart(rule, "readings (s)", "share that is right", lines, None, (-0.02, 1.05))
        )
    out.figure("changed pixels that the map has right", figures.charts(panels))
    values = {rule: one.values(rule) for rule in RULES}
    out.figure(
        "the plan, what stands, and the maps",
        figures.pictures(
            [
                Picture("plan", 1.0 - one.prior),
                Picture("what stands now", 1.0 - now),
                *(Picture(rule, shade(one.map(values[rule], *PAPER), cell)) for rule in RULES),
            ],
            2,
            4.2,
        ),
    )
    last = keyframes[-1][1]
    for rule in RULES:
        gone, rubble_right = last[rule]["with prior"]
        base = last[rule]["no prior"]
        out.claim(
            f"the data overrule the prior ({rule})",
            gone >= 0.9 and rubble_right >= 0.9 * base[1],
            f"wall gone: {gone:.2f} of its observed pixels are mapped empty (no prior "
            f"{base[0]:.2f}); "
            f"rubble: {rubble_right:.2f} of its observed pixels are mapped occupied "
            f"(no prior {base[1]:.2f})",
        )
    return out


Shares = dict[Update, dict[str, tuple[float, float]]]


def _right(one: Explored, evidence: object, opened: Bools, rubble: Bools) -> Shares:
    """Share of the observed pixels of both changes that each map has right."""
    from formats.grid import Evidence

    assert isinstance(evidence, Evidence)
    seen = evidence.visits() > 0
    out: Shares = {}
    weights = [one.cells(opened) * seen, one.cells(rubble) * seen]
    for rule in RULES:
        values = one.values(rule)
        priors = {
            "with prior": one.l0(values, *PAPER),
            "no prior": one.l0(replace(values, prior_scale=1.0), 0.5, 0.5),
        }
        out[rule] = {}
        for name, prior in priors.items():
            occupied = evidence.on(prior, values.p_levels, rule).occupied()
            gone = float((weights[0] * ~occupied).sum() / max(weights[0].sum(), 1))
            fell = float((weights[1] * occupied).sum() / max(weights[1].sum(), 1))
            out[rule][name] = gone, fell
    return out
