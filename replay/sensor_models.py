"""The sensor models: what a reading's levels are, and what they are worth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from formats.grid import P_MAX, P_MIN


@dataclass(frozen=True, slots=True)
class Model:
    """A sensor model.

    Attributes:
        about: what a reading shows, in one line.
        p_hit, p_miss: defaults, P(occupied) of a hit and of a miss.
        samples: along a cell's side.
        banded: a hit is a band one cell deep behind the range, else the cell of the end point.
        margin: cells before the hit that are not shown empty.
        empty: P(empty) of an empty share, given p_hit and p_miss.
        shadowed: everything behind the range, as far as the sensor sees, is a hit, too.
        of_truth: the reading says only which cells were seen; the level is what they really are.
    """

    about: str
    p_hit: float
    p_miss: float
    samples: int
    banded: bool
    margin: float
    empty: Callable[[float, float, float], float]
    shadowed: bool = False
    of_truth: bool = False

    @property
    def levels(self) -> int:
        """How many levels a reading has: level k shows a share k / (levels - 1) empty."""
        return self.samples**2 + 1

    def p_levels(self, p_hit: float | None = None, p_miss: float | None = None) -> list[float]:
        """P(empty) of each level, rounded to 12 digits so that 0.9 * 5 / 9 is a tie.

        No reading is certain: they are clamped to 0.001..0.999.

        Args:
            p_hit, p_miss: P(occupied) of a full hit and a full miss; None for the default.
        """
        hit = self.p_hit if p_hit is None else p_hit
        miss = self.p_miss if p_miss is None else p_miss
        shares = [k / (self.levels - 1) for k in range(self.levels)]
        levels = [round(self.empty(share, hit, miss), 12) for share in shares]
        return [min(max(p, P_MIN), P_MAX) for p in levels]


def linear(share: float, p_hit: float, p_miss: float) -> float:
    """Equation 15, its third case a mean of the two others (PAPER A9)."""
    return (1.0 - p_hit) + (p_hit - p_miss) * share


def proportional(share: float, p_hit: float, p_miss: float) -> float:
    """Equation 10, 0.9 * share, clamped to what the sensor can say at most (PAPER A7)."""
    return min(max((1.0 - p_miss) * share, 1.0 - p_hit), 1.0 - p_miss)


def printed(share: float, p_hit: float, p_miss: float) -> float:
    """Equation 15 to the letter: the share itself between the two others (PAPER A9)."""
    if 0.0 < share < 1.0:
        return share
    return 1.0 - (p_miss if share else p_hit)


MODELS: dict[str, Model] = {
    "beam": Model("lidar: end points hit, sectors miss", 0.7, 0.4, 1, False, 0.5, linear),
    "eq10": Model(
        "the paper's Equation 10: 0.9 x empty share", 0.9, 0.1, 5, True, 0.0, proportional
    ),
    "eq10-true": Model(
        "Equation 10 on the true occupancy of the cells seen (section 4.2)",
        *(0.9, 0.1, 5, True, 0.0, proportional),
        of_truth=True,
    ),
    "eq15": Model(
        "the paper's Equation 15: 0.1 + 0.8 x empty share", 0.9, 0.1, 5, True, 0.0, linear
    ),
    "eq15-literal": Model(
        "Equation 15 as printed: mixed cells by their share, all beyond a hit occupied",
        *(0.9, 0.1, 5, True, 0.0, printed),
        shadowed=True,
    ),
    "eq15-share": Model(
        "Equation 15 with its third case as printed, a hit one cell deep",
        *(0.9, 0.1, 5, True, 0.0, printed),
    ),
    "eq15-shadow": Model(
        "Equation 15 with all beyond a hit occupied, as printed",
        *(0.9, 0.1, 5, True, 0.0, linear),
        shadowed=True,
    ),
}
"""Name -> model. One test walks the table: every entry has a slow oracle of its own."""
