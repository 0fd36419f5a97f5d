"""Confidence of an extraction: every pixel has one, and it scales the prior's log-odds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.grid import Geometry
from formats.plans.file import open_plan
from replay import run
from replay.cells import mean_values
from replay.drawing import extract
from replay.drawing.confidence import SHARES, confidence, kinds
from replay.world import build_world

SAMPLES = Path(__file__).resolve().parents[3] / "sample_logs"
BOUNDS = (0.0, 0.0, 1.0, 0.1)


def test_every_pixel_is_of_one_kind_and_has_its_share() -> None:
    found = extract(open_plan(SAMPLES / "drawing.png", Notes()).grey)
    masks = kinds(found)
    assert set(masks) == set(SHARES)
    assert (np.sum([mask.astype(int) for mask in masks.values()], axis=0) == 1).all()
    sure = confidence(found)
    for name, mask in masks.items():
        assert np.allclose(sure[mask], 2 * SHARES[name] - 1)
    assert masks["wall's edge"][40:42, 300].all()  # the outer wall begins at row 40
    assert masks["wall"][50, 300]


def test_a_cell_has_the_mean_of_its_pixels() -> None:
    plan = open_plan(SAMPLES / "plan.png", Notes())
    values = np.zeros(plan.wall.shape, dtype=np.float32)
    values[:, 1::2] = 1.0
    x, y = plan.corner
    means = mean_values(plan, values, Geometry(4, 5, 2 * plan.scale, x, y))
    assert np.allclose(means, 0.5)
    beyond = mean_values(plan, values, Geometry(2, 2, 1.0, x - 50.0, y))
    assert np.allclose(beyond, 1.0)


def test_the_prior_is_scaled_towards_one_half_where_it_is_asked_for() -> None:
    plan = open_plan(SAMPLES / "drawing.png", Notes())
    plain, scaled = (
        build_world(plan, None, BOUNDS, 1.0, Notes(), plan_confidence=on) for on in (False, True)
    )
    assert plain.layers.uniform
    assert not scaled.layers.uniform
    sure = scaled.layers.confidence
    assert sure is not None
    inside = ~scaled.layers.outside
    one, other = (w.curves["bayes"].prior.values for w in (plain, scaled))
    assert np.allclose(other[inside], one[inside] * sure[inside])
    assert (other[~inside] == one[~inside]).all()
    assert sure[inside].min() < 0.99  # some of it is less sure


def test_such_a_result_is_neither_tuned_nor_scored_again(tmp_path: Path) -> None:
    from formats.results.file import read_result
    from replay.archive.rescoring import options_of
    from replay.tuning.reading import ground_of

    result = run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "drawing.png",
        output=tmp_path / "out.mcap",
        plan_confidence=True,
        every=200,
    )
    kept = read_result(result.facts["result"])
    with pytest.raises(FormatError, match="--plan-confidence"):
        ground_of(kept)
    with pytest.raises(FormatError, match="--plan-confidence"):
        options_of(kept, {})  # type: ignore[arg-type]
