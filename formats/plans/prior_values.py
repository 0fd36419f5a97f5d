"""The values of a prior: the small JSON file that `replay tune` writes and `run` takes.

    {"format": "replay prior values", "version": 1, "p_wall": 0.2, "p_space": 0.9,
     "prior_scale": 0.9, "update": "bayes", "p_hit": 0.7, "p_miss": 0.4, "source": {...}}

Names and meanings are those of the options of `replay run`: p_wall, p_space, p_door, p_window and
p_outside are P(EMPTY) as the paper prints them; p_hit and p_miss are P(OCCUPIED). Every value may
be left out but p_wall and p_space. `source` says where they came from, in any words.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from formats.errors import FormatError
from formats.errors import Path as AnyPath
from formats.grid import Update
from formats.small_json import Kind, read_small_json, write_small_json

KIND = Kind(
    *("replay prior values", 1, "holds no values of a prior"),
    hint="give the JSON file that `replay tune` wrote",
)
NEEDED = ("p_wall", "p_space")
NUMBERS = (*NEEDED, "p_door", "p_window", "p_outside", "prior_scale", "p_hit", "p_miss")
UPDATES: tuple[Update, ...] = ("bayes", "paper")


@dataclass(frozen=True)
class PriorValues:
    """Values of a prior; None where the default of `run` is to hold.

    Attributes:
        p_wall, p_space, p_door, p_window, p_outside: P(empty), before the scale.
        prior_scale: multiplies them (p_outside aside) before use.
        p_hit, p_miss: P(occupied), the sensor that the values were chosen for.
        update: the rule that they were chosen for.
        source: where they came from.
    """

    p_wall: float
    p_space: float
    p_door: float | None = None
    p_window: float | None = None
    p_outside: float | None = None
    prior_scale: float | None = None
    p_hit: float | None = None
    p_miss: float | None = None
    update: Update | None = None
    source: Mapping[str, Any] = field(default_factory=dict, compare=False)

    def options(self) -> dict[str, Any]:
        """What is said, by the names of the options of `run`."""
        said = {name: getattr(self, name) for name in (*NUMBERS, "update")}
        return {name: value for name, value in said.items() if value is not None}


def write_prior_values(
    path: AnyPath,
    values: PriorValues,
    *,
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> None:
    """Write values; numbers read back to the same bits.

    Raises:
        FormatError: it cannot be written.
    """
    value = {**values.options(), "source": dict(values.source)}
    write_small_json(path, KIND, value, force=force, inputs=inputs)


def read_prior_values(path: AnyPath) -> PriorValues:
    """Read values.

    Raises:
        FormatError: not readable, no such file of ours, of a later version, an unknown name, or a
            number that is no probability.
    """
    value = read_small_json(path, KIND)
    known = {*NUMBERS, "update", "source"}
    for name in value.keys() - known:
        raise FormatError(path, f"there is no value {name!r}", hint=f"known: {', '.join(NUMBERS)}")
    for name in NEEDED:
        if name not in value:
            raise FormatError(path, f"{name} is missing")
    numbers = {name: _probability(path, name, value[name]) for name in NUMBERS if name in value}
    update = value.get("update")
    if update is not None and update not in UPDATES:
        raise FormatError(path, f"update is {update!r}, not bayes or paper")
    source = value.get("source")
    return PriorValues(**numbers, update=update, source=source if isinstance(source, dict) else {})


def _probability(path: AnyPath, name: str, value: object) -> float:
    """A number from 0 to 1.

    Raises:
        FormatError: it is none.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not 0.0 <= value <= 1.0:  # type: ignore[operator]
        raise FormatError(path, f"{name} is {value!r}, not a number from 0 to 1")
    if name == "prior_scale" and value == 0:
        raise FormatError(path, "prior_scale is 0, which leaves no prior")
    return float(value)  # type: ignore[arg-type]
