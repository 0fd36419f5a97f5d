"""What is told of a picture that is no drawing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from formats.errors import Notes
from formats.plans.ink import drawn, shaded

Grey = npt.NDArray[np.uint8]
SIDE = 200


def photograph() -> Grey:
    """Every grey there is, as often as any other: a slope from black to white."""
    return np.tile(np.linspace(0, 255, SIDE).astype(np.uint8), (SIDE, 1))


def plan() -> Grey:
    """A frame of ink on paper, and a floor of one grey."""
    grey = np.full((SIDE, SIDE), 255, np.uint8)
    grey[20:180, 20:180] = 150
    grey[20:26, 20:180] = grey[174:180, 20:180] = grey[20:180, 20:26] = grey[20:180, 174:180] = 0
    return grey


def scan() -> Grey:
    """Ink on grey paper that is nowhere quite the same."""
    grain = np.random.default_rng(0).normal(170, 4, (SIDE, SIDE))
    return np.where(plan() == 0, 0, np.clip(grain, 0, 255)).astype(np.uint8)


def test_shades_of_a_slope_by_hand() -> None:
    even = np.full(
        256, 10, np.int64
    )  # of 64 to 192; 64 counts as paper, with 12 more, and 3 as tones
    assert shaded(even) == pytest.approx((129 - 13 - 3) / 256)


@pytest.mark.parametrize(("picture", "told"), [(photograph, True), (plan, False), (scan, False)])
def test_a_photograph_is_told_from_a_drawing(picture: object, told: bool, tmp_path: Path) -> None:
    assert callable(picture)
    notes = Notes()
    drawn(tmp_path / "x.png", picture(), False, notes)
    assert any("photograph" in note.problem for note in notes) == told
