"""The sensor models: what a reading's levels are, and what they are worth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formats.grid import P_MAX, P_MIN, logit

GAUSSIAN, CONE = "gaussian", "cone"
QUIET = 0.02  # log-odds: one reading in fifty of a 0.7 / 0.3 sensor's
STEPS = 16  # a split four times as fine moves F2 by less than 0.005 (a test)


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
        steps: of the weights of a model with continuous values (`polar`), 0 for the others.
        profile: of such a model, GAUSSIAN or CONE.
        spread, growth: m, 1/m: of its range, spread + growth * range^2.
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
    steps: int = 0
    profile: str = ""
    spread: float = 0.0
    growth: float = 0.0

    @property
    def levels(self) -> int:
        """How many levels a reading has: level k shows a share k / (levels - 1) empty."""
        return 2 * self.steps + 1 if self.steps else self.samples**2 + 1

    @property
    def silent(self) -> npt.NDArray[np.bool_]:
        """Levels (levels,) of continuous values that say next to nothing, hence are no visit.

        Under `paper` a visit costs l0 whatever it says. Decided with the model's own
        probabilities, so that evidence is the same under all.
        """
        odds = [logit(p) for p in self.p_levels()]
        return np.array([bool(self.steps) and abs(odd) < QUIET for odd in odds])

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


def bell(share: float, p_hit: float, p_miss: float) -> float:
    """A hit at 0; behind it falling to 0.5 at a half; before it from there to a miss at 1.

    P(occupied) is base + (p_hit - base) w with w = exp(-(d - z)^2 / 2 sigma^2), and base p_miss
    before the range and 0.5 behind it (Andert 2009, whose profile Pirker et al. 2011 follow).
    """
    if share <= 0.5:
        return 1.0 - (0.5 + (p_hit - 0.5) * (1.0 - 2.0 * share))
    return 1.0 - (p_miss + (p_hit - p_miss) * (2.0 - 2.0 * share))


def profile(share: float, p_hit: float, p_miss: float) -> float:
    """From surely hit at 0 by nothing known at a half to surely empty at 1 (Elfes 1989)."""
    known = 1.0 - 2.0 * share
    return 0.5 - (p_hit - 0.5) * known if known > 0.0 else 0.5 - (0.5 - p_miss) * known


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
    "gaussian": Model(
        "depth cameras: a Gaussian about the range, wider with distance (Pirker 2011)",
        *(0.7, 0.4, 1, False, 0.0, bell),
        steps=STEPS,
        profile=GAUSSIAN,
        spread=0.01,
        growth=1.425e-3,  # 1/m, of a Kinect (Khoshelham and Elberink 2012)
    ),
    "cone": Model(
        "sonar: empty up to the range and hit about it, most on the axis (Moravec and Elfes 1985)",
        *(0.7, 0.4, 1, False, 0.0, profile),
        steps=STEPS,
        profile=CONE,
        spread=0.1,
    ),
}
"""Name -> model. One test walks the table: every entry has a slow oracle of its own."""
