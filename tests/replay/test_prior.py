"""The prior by hand: scaled, clamped, unknown outside; and what breaks Equation 13."""

from __future__ import annotations

from dataclasses import replace
from math import log

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.errors import UsageError
from formats.grid import Evidence, Geometry
from replay.cells import CellLayers, Rule
from replay.prior import breaks_e13, build_prior, informative, no_prior, used

GEOMETRY = Geometry(1, 5, 0.05, 0.0, 0.0)
# space, a quarter wall, three quarters wall, outside, ink outside
LAYERS = CellLayers(
    GEOMETRY,
    pixels=np.array([[4, 4, 4, 0, 4]], np.uint32),
    wall=np.array([[0, 1, 3, 0, 4]], np.uint32),
    known=np.array([[4, 4, 4, 0, 4]], np.uint32),
    footprint=np.array([[True, True, True, False, False]]),
)


def odds(p: float) -> float:
    return log(p / (1 - p))


def values(rule: Rule = "any", **options: float) -> list[float]:
    row: list[float] = build_prior(LAYERS, rule=rule, **options).values[0].tolist()
    return row


def test_the_papers_proposal_by_hand() -> None:
    """0.2 and 0.9 times 0.9 are 0.18 and 0.81; outside is 0.5, not 0.45 (A4, A5)."""
    wall, space = odds(0.18), odds(0.81)
    assert values() == pytest.approx([space, wall, wall, 0.0, wall])
    assert values()[3] == 0.0


def test_majority_by_hand() -> None:
    wall, space = odds(0.18), odds(0.81)
    assert values("majority") == pytest.approx([space, space, wall, 0.0, wall])


def test_fraction_by_hand() -> None:
    """A quarter of 0.18 and three quarters of 0.81 are 0.6525; the other way round 0.3375."""
    wanted = [odds(0.81), odds(0.6525), odds(0.3375), 0.0, odds(0.18)]
    assert values("fraction") == pytest.approx(wanted)


def test_without_the_scale() -> None:
    row = values(prior_scale=1.0, p_wall=0.1, p_space=0.6, p_outside=0.3)
    assert row == pytest.approx([odds(0.6), odds(0.1), odds(0.1), odds(0.3), odds(0.1)])


def test_values_of_the_tables_are_clamped() -> None:
    """The tables go to 1: unscaled that is 0.999; 0 is 0.001; outside likewise."""
    row = values(prior_scale=1.0, p_wall=0.0, p_space=1.0, p_outside=1.0)
    assert row == pytest.approx([odds(0.999), odds(0.001), odds(0.001), odds(0.999), odds(0.001)])
    assert used(1.0, 0.9) == 0.9


def test_walls_are_occupied_and_space_is_not() -> None:
    assert build_prior(LAYERS).occupied().tolist() == [[False, True, True, False, True]]


def test_no_prior_says_nothing() -> None:
    grid = no_prior(LAYERS)
    assert grid.values.tolist() == [[0.0] * 5]
    seen = Evidence(GEOMETRY, np.array([[[1, 0, 2, 0, 1]], [[0, 3, 1, 0, 1]]], np.uint32))
    assert np.array_equal(seen.on(grid, (0.1, 0.9), "paper").values, seen.total((0.1, 0.9)))


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0.01, 1))
def test_every_probability_gives_a_finite_prior(
    p_wall: float, p_space: float, p_outside: float, scale: float
) -> None:
    for rule in ("any", "majority", "fraction"):
        row = build_prior(LAYERS, p_wall, p_space, p_outside, scale, rule).values
        assert np.isfinite(row).all()
        assert (np.abs(row) <= odds(0.999) + 1e-9).all()


@pytest.mark.parametrize(
    "options",
    [{"p_wall": 1.1}, {"p_space": -0.1}, {"p_outside": float("nan")}, {"prior_scale": 0.0}],
)
def test_no_probability_is_an_error_of_usage(options: dict[str, float]) -> None:
    with pytest.raises(UsageError) as caught:
        build_prior(LAYERS, **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("sensor", "prior", "broken"),
    [
        ((0.9, 0.1), (0.2, 0.9, 0.9), ""),  # 0.9 > 0.81 and 0.1 < 0.18
        ((0.9, 0.1), (0.1, 0.9, 0.9), "hit"),  # A6: 0.1 is not below 0.09
        ((0.9, 0.1), (0.2, 1.0, 0.9), "miss"),  # 0.9 is not above 0.9
        ((0.8, 0.2), (0.2, 0.9, 0.9), "miss hit"),  # 0.8 against 0.81, 0.2 against 0.18
        ((0.7, 0.4), (0.2, 0.9, 0.9), "miss hit"),  # the default of replay run
        ((0.8, 0.2), (0.4, 0.75, 0.9), ""),  # X2: 0.8 > 0.675 and 0.2 < 0.36
        ((0.9, 0.1), (0.2, 0.9, 1.0), "miss"),  # unscaled: 0.9 against 0.9
        ((0.75, 0.05), (0.25, 0.9, 1.0), "hit"),  # 0.25 against 0.25
    ],
)
def test_equation_13(
    sensor: tuple[float, float], prior: tuple[float, float, float], broken: str
) -> None:
    line = breaks_e13(*sensor, *prior)
    if not broken:
        assert line is None
    else:
        assert line is not None
        assert ("a miss says" in line, "a hit says" in line) == ("miss" in broken, "hit" in broken)


def test_what_equation_13_is_about() -> None:
    """A6: under `paper` a hit on a wall of 0.1 x 0.9 makes it emptier; on 0.2 x 0.9 it does not."""
    hits = Evidence(GEOMETRY, np.array([[[0, 0, 2, 0, 0]], [[0] * 5]], np.uint32))
    for p_wall, emptier in ((0.1, True), (0.2, False)):
        prior = build_prior(LAYERS, p_wall)
        after = hits.on(prior, (0.1, 0.9), "paper")
        assert bool(after.values[0, 2] > odds(0.1)) == emptier


# a door in space, a door in a cell with wall, a window in wall; shares of 1 % count
OPENINGS = {
    "door": np.array([[0.01, 1.0, 0.0, 0.0, 0.0]]),
    "window": np.array([[0.0, 0.0, 0.01, 0.0, 0.0]]),
}


def opened(**options: float | None) -> list[float]:
    row: list[float] = informative(LAYERS, OPENINGS, **options).values[0].tolist()  # type: ignore[arg-type]
    return row


def test_openings_are_space_and_wall_unless_they_have_values() -> None:
    assert opened() == values()
    assert informative(LAYERS, {}, p_door=0.3, p_window=0.4).values[0].tolist() == values()


def test_doors_and_windows_by_hand() -> None:
    """0.6 and 0.5 times 0.9 are 0.54 and 0.45; wall in a door's cell shuts it."""
    wall, space = odds(0.18), odds(0.81)
    assert opened(p_door=0.6) == pytest.approx([odds(0.54), wall, wall, 0.0, wall])
    assert opened(p_window=0.5) == pytest.approx([space, wall, odds(0.45), 0.0, wall])
    unscaled = opened(p_door=0.6, p_window=0.5, prior_scale=1.0)
    expected = [odds(0.6), odds(0.2), odds(0.5), 0.0, odds(0.2)]
    assert unscaled == pytest.approx(expected)


def test_a_door_s_cell_is_shut_by_the_rule_of_the_walls() -> None:
    """A quarter of wall is none by the majority, so the door of that cell is open."""
    row = informative(LAYERS, OPENINGS, cell_rule="majority", p_door=0.6).values[0].tolist()
    assert row[:3] == pytest.approx([odds(0.54), odds(0.54), odds(0.18)])


def test_confidence_scales_log_odds_of_the_building_alone() -> None:
    trust: npt.NDArray[np.float64] = np.array([[0.5, 0.25, 1.0, 0.5, 0.5]])
    layers = replace(LAYERS, confidence=trust)
    row = informative(layers, {}, p_outside=0.3).values[0].tolist()
    outside = LAYERS.outside[0].tolist()
    before = values(p_outside=0.3)
    expected = [
        value if out else value * share
        for value, out, share in zip(before, outside, trust[0].tolist(), strict=True)
    ]
    assert outside[3]
    assert not outside[0]
    assert row == pytest.approx(expected)
    assert row[0] == pytest.approx(odds(0.81) / 2)
    assert row[3] == pytest.approx(odds(0.3))


@pytest.mark.parametrize("scale", [1.01, 2.0, float("nan")])
def test_no_scale_above_one(scale: float) -> None:
    with pytest.raises(UsageError):
        used(0.5, scale)
    assert used(0.5, 1.0) == 0.5
