"""What `tune` writes and says: the prior's values, the front as CSV, figures, and the facts."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import Notes, UsageError
from formats.grid import Update
from formats.output import check_output, write_bytes
from formats.plans.prior_values import PriorValues, write_prior_values
from replay.facts import sensor_of
from replay.tuning.choosing import Tuned, shares_of_hypervolume
from replay.tuning.picks import PICKS, in_shortlist
from replay.tuning.search import Search
from replay.tuning.sources import Source
from replay.tuning.surfaces import Scores, grid

NEAR_BEST = 0.01  # F2 below the best that our shortlist allows


def write_all(
    sources: Sequence[Source],
    found: Mapping[Update, Tuned],
    stem: Path,
    pick: str,
    search: Search,
    objective: str,
    *,
    figures: bool,
    force: bool,
    notes: Notes,
) -> dict[str, Any]:
    """Write the files and tell what was found."""
    inputs = [name for source in sources for name in source.inputs]
    rule: Update = "bayes" if "bayes" in found else "paper"
    main = found[rule]
    if pick not in main.picks:
        raise UsageError("", f"the pick {pick!r} was not found", hint="choose another")
    facts: dict[str, Any] = {
        "sources": [str(source.path) for source in sources],
        "poses_depend_on": {str(s.path): s.depends for s in sources if s.depends},
        "search": {
            "algorithm": search.algorithm,
            "objective": objective,
            "seed": search.seed,
            "population": search.population,
            "generations_at_most": search.generations,
        },
        "rules": {name: told(tuned, search) for name, tuned in found.items()},
    }
    p_wall, p_space = main.picks[pick]
    values = main.together.values
    for name, tuned in found.items():
        broken = tuned.broken(*tuned.picks[pick])
        if broken:
            notes.warn(sources[0].path, f"{pick} under {name}: {broken}")
    chosen = PriorValues(
        p_wall,
        p_space,
        values.p_door,
        values.p_window,
        values.p_outside,
        values.prior_scale,
        round(1 - values.p_levels[0], 6),
        round(1 - values.p_levels[-1], 6),
        rule,
        {"pick": pick, "tuned_on": [source.path.name for source in sources]},
    )
    facts["chosen"] = {"pick": pick, **chosen.options()}
    files: dict[str, bytes] = {"front.csv": front_csv(found)}
    if figures:
        from replay.tuning.drawing_figures import drawn

        for name, tuned in found.items():
            files |= {f"{name}_{part}.png": data for part, data in drawn(tuned).items()}
    targets = {stem.with_name(f"{stem.name}_{name}"): data for name, data in files.items()}
    prior = stem.with_name(f"{stem.name}_prior.json")
    for path in (prior, *targets):
        check_output(path, force=force, inputs=inputs)
    write_prior_values(prior, chosen, force=force, inputs=inputs)
    for path, data in targets.items():
        write_bytes(path, data, force=force, inputs=inputs)
    facts["written"] = [str(prior), *map(str, targets)]
    return facts


def measured(scores: Scores, k: int | None = None) -> dict[str, float]:
    """Precision, recall and F2 of one point."""
    three = {"precision": scores.precision, "recall": scores.recall, "f2": scores.f2}
    return {name: float(v if k is None else v[k]) for name, v in three.items()}


def told(tuned: Tuned, search: Search) -> dict[str, Any]:
    """One rule's findings as --json has them."""
    whole, of_front, of_archive = shares_of_hypervolume(tuned)
    names = list(tuned.picks)
    pairs = np.array([tuned.picks[name] for name in names])
    scores = tuned.together.at(pairs[:, 0], pairs[:, 1])
    each = np.array([one.at(pairs[:, 0], pairs[:, 1]).f2 for one in tuned.tables])
    early = np.mean([one.mean(pairs[:, 0], pairs[:, 1]) for one in tuned.courses], axis=0)
    ten = grid(10)
    surface = tuned.together.surface(ten, ten)
    none = tuned.together.without_prior()
    early_none = [float(one.weights @ one.without_prior()) for one in tuned.courses]
    return {
        "sensor": sensor_of(tuned.together.values.p_levels),
        "prior_scale": tuned.together.values.prior_scale,
        "cells": tuned.whole.size,
        "walls": tuned.whole.walls,
        "no_prior": {
            **measured(none),
            "worst_f2": min(float(one.without_prior().f2) for one in tuned.tables),
            "early_f2": float(np.mean(early_none)),
        },
        "picks": {
            name: {
                "what": PICKS[name],
                "p_wall": pairs[k, 0],
                "p_space": pairs[k, 1],
                **measured(scores, k),
                "worst_f2": float(each[:, k].min()),
                "early_f2": float(early[k]),
                "equation_13": tuned.broken(*tuned.picks[name]),
            }
            for k, name in enumerate(names)
        },
        "front": {
            "exact": tuned.exact,
            "points": len(tuned.front.scores.tp),
            "acceptable": len(tuned.front.acceptable.scores.tp),
            "hypervolume": whole,
        },
        "search": {
            "evaluations": tuned.search.evaluations,
            "generations": tuned.search.generations,
            "ended": tuned.search.ended,
            "front_points": len(tuned.search.x),
            "front_share_of_hypervolume": of_front,
            "archive_share_of_hypervolume": of_archive,
        },
        "clusters": [
            {"p_wall": float(wall), "p_space": float(space), "points": int(size)}
            for (wall, space), size in zip(
                tuned.clusters.centres,
                np.bincount(tuned.clusters.labels, minlength=len(tuned.clusters.centres)),
                strict=True,
            )
        ],
        "shortlist": shortlist(surface, ten),
        "surfaces": {
            "p": ten.tolist(),
            "precision": surface.precision.tolist(),
            "recall": surface.recall.tolist(),
            "f2": surface.f2.tolist(),
        },
        "doors": doors(tuned),
        "sensors": sensors(tuned),
        "seconds": tuned.seconds,
    }


def shortlist(surface: Scores, p: np.ndarray[Any, Any]) -> list[dict[str, Any]]:
    """Our counterpart of Equation 11: pairs of tenths within C whose F2 is nearly the best."""
    f2 = surface.f2
    good = (surface.objectives() < 2.5).all(axis=-1)
    near = good & (f2 >= (f2[good].max() if good.any() else np.inf) - NEAR_BEST)
    rows = []
    for i in np.flatnonzero(near.any(axis=1)):
        spaces = p[near[i]]
        inside = in_shortlist(np.full(len(spaces), p[i]), spaces)
        rows.append(
            {
                "p_wall": float(p[i]),
                "p_space": [float(space) for space in spaces],
                "in_equation_11": int(inside.sum()),
            }
        )
    return rows


def doors(tuned: Tuned) -> dict[str, Any] | None:
    """The best prior with a value of its own for doors."""
    if tuned.doors is None or not len(tuned.doors.scores.tp):
        return None
    k = int(np.argmax(tuned.doors.scores.f2))
    p_wall, p_space, p_door = tuned.doors.points[k].tolist()
    least, _, most = tuned.doors.spans[k, 2].tolist()
    return {
        "p_wall": p_wall,
        "p_space": p_space,
        "p_door": p_door,
        "p_door_from": least,
        "p_door_to": most,
        **measured(tuned.doors.scores, k),
    }


def sensors(tuned: Tuned) -> dict[str, Any] | None:
    """The best sensor probabilities with the best prior for them."""
    if tuned.sensors is None:
        return None
    i, j = tuned.sensors.best
    p_wall, p_space = tuned.sensors.points[i, j].tolist()
    return {
        "p_hit": float(tuned.sensors.p_hit[i]),
        "p_miss": float(tuned.sensors.p_miss[j]),
        "p_wall": p_wall,
        "p_space": p_space,
        "f2": float(tuned.sensors.f2[i, j]),
        "f2_without_prior": float(tuned.sensors.none[i, j]),
        "grid": {
            "p_hit": tuned.sensors.p_hit.tolist(),
            "p_miss": tuned.sensors.p_miss.tolist(),
            "f2": tuned.sensors.f2.tolist(),
        },
    }


def front_csv(found: Mapping[Update, Tuned]) -> bytes:
    """Every front as a table: of each run and of all together."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    spans = [f"p_{kind}{end}" for kind in ("wall", "space") for end in ("_from", "", "_to")]
    table.writerow(["update", "run", *spans, "precision", "recall", "f2", "tp", "fp", "fn"])
    for update, tuned in found.items():
        parts = [(case.name, front) for case, front in zip(tuned.cases, tuned.fronts, strict=True)]
        if len(parts) > 1:
            parts.append(("all", tuned.front))
        for name, front in parts:
            scores = front.scores
            for k in range(len(scores.tp)):
                table.writerow(
                    [
                        update,
                        name.lstrip("=+-@"),
                        *(f"{p:.6f}" for p in front.spans[k].ravel()),
                        *(f"{v[k]:.6f}" for v in (scores.precision, scores.recall, scores.f2)),
                        *(scores.tp[k], scores.fp[k], scores.walls - scores.tp[k]),
                    ]
                )
    return text.getvalue().encode()
