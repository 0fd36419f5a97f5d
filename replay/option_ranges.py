"""Options are checked by name and range before anything is done with them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from math import inf
from typing import Any

from formats.errors import UsageError


def check_options(
    options: Mapping[str, Any],
    defaults: Mapping[str, Any],
    ranges: Mapping[str, tuple[float, float]],
    unlimited: Collection[str] = (),
) -> None:
    """Refuse names that are no options, and numbers out of their range; nan is in none.

    Args:
        options: as given.
        defaults: every option.
        ranges: least and most of those that are numbers.
        unlimited: of these, such as may be inf, too.

    Raises:
        UsageError: see above.
    """
    for name, value in options.items():
        if name not in defaults:
            close = get_close_matches(name, defaults, 1)
            hint = f"did you mean {close[0]}?" if close else ""
            raise UsageError("", f"there is no option {name}", hint=hint)
        low, high = ranges.get(name, (-inf, inf))
        endless = value == inf and name in unlimited
        if name in ranges and value is not None and not (low <= value <= high or endless):
            flag = "--" + name.replace("_", "-")
            raise UsageError("", f"{flag} {value:g} is not from {low:g} to {high:g}")
