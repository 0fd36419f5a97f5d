"""Under which priors results are scored anew: values, files of them, and grids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from formats.errors import UsageError, printable
from formats.plans.prior_values import read_prior_values
from replay.archive.finding import places
from replay.archive.places import Place, local
from replay.archive.rescoring import VALUES

Values = Mapping[str, Any]


def asked_for(
    prior_values: Place | Sequence[Place] | None,
    priors: Mapping[str, Values] | Sequence[Values] | None,
    grid: Mapping[str, Sequence[float]] | None,
    values: Values,
) -> dict[str, Values]:
    """Label -> values, of all the priors that are asked for.

    Raises:
        UsageError: a value that needs the log.
        FormatError: a file of values cannot be read.
    """
    for name in values:
        if name not in VALUES:
            hint = f"without the log these can be changed: {', '.join(VALUES)}"
            raise UsageError(name, "cannot be changed in a result", hint=hint)
    common = {name: value for name, value in values.items() if value is not None}
    out: dict[str, Values] = {}
    for file in places(prior_values or ()):
        name = printable(Path(file).name)
        # An option goes before its value in a file.
        out[name] = {**read_prior_values(local(file)).options(), **common}
    if priors is not None:
        named = priors if isinstance(priors, Mapping) else {_label(each): each for each in priors}
        out |= {label: {**common, **each} for label, each in named.items()}
    if grid:
        for name in grid:
            if name not in VALUES:
                raise UsageError(name, "cannot be changed in a result")
        for combination in product(*grid.values()):
            each = dict(zip(grid, combination, strict=True))
            out[_label(each)] = {**common, **each}
    return out or {_label(common): common}


def _label(values: Values) -> str:
    said = (
        f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in values.items()
    )
    return ", ".join(said) or "as it was"
