"""T1, T2: the tables of maximum precision and recall, under every reading of the paper."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from formats.grid import Update
from replay.reproduction.claims import Section
from replay.reproduction.studies import Study
from replay.tuning.cases import Floats
from replay.tuning.simulated import ScoredRegion
from replay.tuning.surfaces import Tables, grid

TENTHS = grid(10)
TINY = 1e-12
READINGS: list[tuple[Update, float, ScoredRegion]] = list(
    product(("paper", "bayes"), (0.9, 1.0), ("footprint", "image", "observed"))
)
# What the paper prints: drawing -> most % and its pair on cells of 3, 5 and 10 pixels.
PRINTED = {
    "precision": {
        "a": ("98.49 (.3, .3)", "75.00 (.3, .3)", "48.00 (.5, .6)"),
        "b": ("99.42 (.3, .3)", "95.36 (.3, .3)", "89.14 (.1, .3)"),
        "c": ("91.77 (.3, .3)", "79.00 (.3, .3)", "77.42 (.1:.2, .3:.5)"),
        "d": ("95.56 (.1, .3)", "84.94 (.1, .3)", "92.06 (.1, .3)"),
        "e": ("93.77 (.3, .3)", "90.51 (.1, .3)", "92.68 (.1, .3)"),
    },
    "recall": {
        "a": ("80.08 (1, .2)", "66.09 (1, 1)", "66.53 (1, 1)"),
        "b": ("82.77 (.2, .1:.2)", "79.71 (.2, .2)", "73.42 (.2, 1)"),
        "c": ("69.43 (.1, 1)", "72.05 (1, 1)", "86.91 (1, 1)"),
        "d": ("82.70 (.7:1, 1)", "86.00 (.4:1, 1)", "91.69 (.4:.9, 1)"),
        "e": ("83.05 (.5:1, 1)", "88.68 (.9:1, 1)", "95.41 (.2, 1)"),
    },
}


def best_pairs(surface: Floats) -> Floats:
    """All pairs of tenths (n, 2) whose value is the greatest."""
    return TENTHS[np.argwhere(surface >= surface.max() - TINY)]


def said(pairs: Floats) -> str:
    """Pairs as the paper's tables have them: (.2:.3, 1)."""
    ends = [(pairs[:, k].min(), pairs[:, k].max()) for k in (0, 1)]
    parts = [f"{a:g}" if a == b else f"{a:g}:{b:g}" for a, b in ends]
    return f"({', '.join(parts)})"


def t1(study: Study) -> Section:
    """Table 1: maximum precision."""
    out = Section("T1", "Table 1: maximum precision", SETUP)

    def near(pairs: Floats) -> bool:
        wall, space = pairs[:, 0], pairs[:, 1]
        return bool(
            (((wall >= 0.1 - TINY) & (wall <= 0.3 + TINY)) & (np.abs(space - 0.3) < 0.11)).any()
        )

    counts = _tables(study, out, "precision", near)
    best = max(counts, key=lambda key: counts[key][0])
    hits, cases = counts["paper", 0.9, "footprint"]
    out.claim(
        "the maximum lies near p_wall .1 to .3, p_space .3",
        hits > cases / 2,
        f"in {hits} of {cases} cases (rule paper, scale 0.9, building); best under any reading: "
        f"{counts[best][0]} of {cases} ({', '.join(map(str, best))})",
        "below p_space .5 / scale every cell of space that was not visited counts as wall, which "
        "costs precision: such a maximum needs a region in which all is visited. It appears where "
        "only observed cells are scored (A14, A19)"
        if hits <= cases / 2
        else "",
    )
    return out


def t2(study: Study) -> Section:
    """Table 2: maximum recall."""
    out = Section("T2", "Table 2: maximum recall", SETUP)
    sections = [letter for letter in study.letters if letter in "cde"]

    def full(pairs: Floats) -> bool:
        return bool((pairs[:, 1] == 1.0).any())

    counts = _tables(study, out, "recall", full, "cde")
    hits, cases = counts["paper", 0.9, "footprint"]
    best = max(counts, key=lambda key: counts[key][0])
    out.claim(
        "p_space = 1 is among the best for drawings c, d, e",
        hits > cases / 2,
        f"in {hits} of {cases} cases of {', '.join(sections)} (rule paper, scale 0.9, building); "
        f"best under any reading: {counts[best][0]} of {cases} ({', '.join(map(str, best))})",
        "a p_space below .5 / scale makes all unvisited space wall, which can only raise recall; "
        "where such cells are not scored (A19) p_space = 1 is reached"
        if hits <= cases / 2
        else "",
    )
    return out


SETUP = (
    "every pair of tenths, for each drawing and cell size, under both readings of A5 (values times "
    "0.9, or as they are), of A14 and A12 (scored: the building, the whole picture, observed cells "
    "only), and both rules"
)
Counted = dict[tuple[Update, float, ScoredRegion], tuple[int, int]]


def _tables(
    study: Study, out: Section, what: str, fits: Callable[[Floats], bool], letters: str = "abcde"
) -> Counted:
    """Fill the tables; for each reading, in how many cases the claim's place is a best one."""
    counts: Counted = {}
    rows_printed = [(letter, *cells) for letter, cells in PRINTED[what].items()]
    head = ("drawing", *(f"{cell} x {cell}" for cell in (3, 5, 10)))
    out.table(f"max {what} %, as the paper prints it for its own drawings", head, rows_printed)
    for update, scale, region in READINGS:
        rows, hits, cases = [], 0, 0
        for letter in study.letters:
            row: list[object] = [letter]
            for cell in study.cells:
                tables: Tables = study.tables(letter, cell, update, scale, region)
                surface = getattr(tables.surface(TENTHS, TENTHS), what)
                pairs = best_pairs(surface)
                row.append(f"{100 * surface.max():.2f} {said(pairs)}")
                if letter in letters:
                    cases += 1
                    hits += fits(pairs)
            rows.append(row)
        counts[update, scale, region] = hits, cases
        if (update, scale) == ("paper", 0.9) or (update, scale, region) == READINGS[6]:
            sizes = ["drawing", *(f"{cell} x {cell}" for cell in study.cells)]
            out.table(f"max {what} %: rule {update}, scale {scale:g}, {region}", sizes, rows)
    out.table(
        "in how many cases the paper's place is among the best",
        ("rule", "scale", "scored", "cases"),
        [(*key, f"{hits} of {cases}") for key, (hits, cases) in counts.items()],
    )
    return counts
