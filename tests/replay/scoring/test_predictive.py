"""The predictive score: by hand on a row of cells, and against small steps along each beam."""

from __future__ import annotations

from math import exp, inf, log, nan, pi

import numpy as np
import pytest

from formats.frame import Floats, Frame, Pose, Scan
from formats.grid import Evidence, Geometry, Grid, logit, probability
from formats.result import Curve
from replay.scoring.predictive import RANDOM, Predictor
from replay.sensors.observer import MODELS, Observer

ROW = Geometry(1, 40, 0.5, 0.0, 0.0)


def row_map(p_empty: Floats) -> dict[str, Curve]:
    """A map that is its prior, with nothing seen."""
    return {"none": Curve(Grid(ROW, np.vectorize(logit)(p_empty)[None, :]), (0.3, 0.6))}


def scored(
    curves: dict[str, Curve],
    geometry: Geometry,
    pose: Pose,
    scan: Scan,
    seen: Evidence | None = None,
) -> dict[str, float]:
    evidence = Evidence.empty(geometry, 2) if seen is None else seen
    predictor = Predictor(curves, Observer(geometry, MODELS["beam"], max_range=15.0))
    predictor.see(Frame(0, pose, scan), evidence)
    return predictor.scores()


def beam(r: float, bearing: float = 0.0) -> Scan:
    return Scan(np.array([bearing]), np.array([0.1]), np.array([r]), 0.1, 18.0)


def test_a_hit_by_hand() -> None:
    p = np.full(40, 0.9)
    p[10] = 0.2
    # From the middle of cell 0 to 5.25 m, the middle of cell 10: the band is cells 9 to 11.
    start, end = 0.9**8.5, 0.9**8.5 * 0.9 * 0.2 * 0.9
    density = (start - end) / 1.5
    expected = log((1 - RANDOM) * density + RANDOM / 15.0)
    found = scored(row_map(p), ROW, Pose(0.25, 0.25, 0.0), beam(5.0))
    assert found["none"] == pytest.approx(expected, rel=1e-12)


def test_no_return_by_hand() -> None:
    p = np.full(40, 0.8)
    expected = log((1 - RANDOM) * 0.8**10 + RANDOM)  # it clears 5 m, which are 10 cells
    found = scored(row_map(p), ROW, Pose(0.25, 0.25, 0.0), beam(inf))
    assert found["none"] == pytest.approx(expected, rel=1e-12)
    beyond = log((1 - RANDOM) * 0.8**30 + RANDOM)  # a return beyond the farthest that counts, 15 m
    found = scored(row_map(p), ROW, Pose(0.25, 0.25, 0.0), beam(17.0))
    assert found["none"] == pytest.approx(beyond, rel=1e-12)


def test_what_says_nothing_does_not_count() -> None:
    predictor = Predictor(row_map(np.full(40, 0.8)), Observer(ROW, MODELS["beam"]))
    for pose, r in (
        (Pose(0.25, 0.25, 0.0), nan),
        (Pose(0.25, 0.25, 0.0), 0.01),
        (Pose(nan, 0, 0), 2.0),
    ):
        predictor.see(Frame(0, pose, beam(r)), Evidence.empty(ROW, 2))
    assert predictor.scans == 0
    assert np.isnan(predictor.scores()["none"])


def small_steps(p_empty: Floats, g: Geometry, pose: Pose, bearing: float, to: float) -> float:
    """P(getting as far as `to` m), by steps of a thousandth of a cell."""
    step = g.resolution / 1000
    t = (np.arange(max(round(to / step), 0)) + 0.5) * step
    col = np.floor((pose.x + t * np.cos(pose.yaw + bearing) - g.x) / g.resolution).astype(int)
    row = np.floor((pose.y + t * np.sin(pose.yaw + bearing) - g.y) / g.resolution).astype(int)
    inside = (col >= 0) & (col < g.cols) & (row >= 0) & (row < g.rows)
    return float(np.exp(np.log(p_empty[row[inside], col[inside]]).sum() / 1000))


@pytest.mark.parametrize("update", ["bayes", "paper"])
def test_any_beam_by_small_steps(update: str) -> None:
    rng = np.random.default_rng(8)
    g = Geometry(20, 24, 0.1, -1.0, -0.8)
    seen = Evidence(g, rng.integers(0, 3, (2, *g.shape)).astype(np.uint32))
    curve = Curve(Grid(g, rng.normal(1.0, 1.0, g.shape)), (0.3, 0.6), update)  # type: ignore[arg-type]
    p_empty = probability(curve.of(seen).values)
    for _ in range(40):
        pose = Pose(*rng.uniform((-1.3, -1.1, -4.0), (1.5, 1.3, 4.0)))
        bearing, r = rng.uniform(-pi, pi), rng.uniform(0.2, 2.5)
        near, far = max(r - 0.15, 0.0), r + 0.15
        start, end = (small_steps(p_empty, g, pose, bearing, to) for to in (near, far))
        expected = log((1 - RANDOM) * (start - end) / (far - near) + RANDOM / 15.0)
        found = scored({"x": curve}, g, pose, beam(r, bearing), seen)
        assert found["x"] == pytest.approx(expected, abs=0.02)


def test_the_right_map_foretells_best_and_the_mean_is_over_scans() -> None:
    wall = np.full(40, 0.95)
    wall[10] = 0.05
    other = np.roll(wall, 5)
    curves = {"right": row_map(wall)["none"], "wrong": row_map(other)["none"]}
    predictor = Predictor(curves, Observer(ROW, MODELS["beam"], max_range=15.0))
    nothing = Evidence.empty(ROW, 2)
    ones = []
    for r in (4.9, 5.0, 5.1):
        predictor.see(Frame(0, Pose(0.25, 0.25, 0.0), beam(r)), nothing)
        ones.append(scored(curves, ROW, Pose(0.25, 0.25, 0.0), beam(r))["right"])
    assert predictor.scores()["right"] == pytest.approx(np.mean(ones))
    assert predictor.scores()["right"] > predictor.scores()["wrong"] + 1.0


def test_of_many_beams_every_so_manieth_is_taken() -> None:
    ranges = np.full(180, 5.0)
    ranges[1::3] = nan
    ranges[2::3] = 0.3
    many = Scan(np.zeros(180), np.full(180, 0.01), ranges, 0.1, 18.0)
    curves = row_map(np.full(40, 0.9))
    one = scored(curves, ROW, Pose(0.25, 0.25, 0.0), beam(5.0))
    assert scored(curves, ROW, Pose(0.25, 0.25, 0.0), many) == pytest.approx(one)


def test_surest_cells_do_not_overflow() -> None:
    p = np.full(40, 0.999)
    p[3] = 0.001
    sure = {"none": Curve(Grid(ROW, 400.0 * np.vectorize(logit)(p)[None, :]), (0.3, 0.6))}
    found = scored(sure, ROW, Pose(0.25, 0.25, 0.0), beam(9.0))["none"]
    assert found == pytest.approx(log(RANDOM / 15.0))
    assert exp(found) > 0.0
