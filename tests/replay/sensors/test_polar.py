"""The continuous models: by hand, against the oracle, and how fine their levels are."""

from __future__ import annotations

import dataclasses
from math import inf, nan, radians
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation

from formats.frame import Frame, Pose, Scan
from formats.grid import Evidence, Geometry, Grid, logit
from replay.mapper import Mapper
from replay.scoring.count_metrics import f2
from replay.scoring.scorer import tell
from replay.sensors.observer import MODELS
from replay.sensors.polar import observer
from replay.simulator.casting import cast
from replay.simulator.driving import drive
from replay.simulator.frames import frames
from replay.simulator.sensors import Lidar, Planar, Sonar
from replay.simulator.site import Site
from tests.replay.sensors.test_observer import KINDS, agree, beams, lattices, scans, views

ROW = Geometry(1, 60, 0.05, 0.0, 0.0)
BESIDE = Pose(0.0, 0.025, 0.0)  # on the row's axis
GAUSSIAN, CONE = MODELS["gaussian"], MODELS["cone"]


def shown(name: str, scan: Scan, geometry: Geometry = ROW, pose: Pose = BESIDE) -> Any:
    """P(occupied) that one reading gives each cell of the first row, nan where it shows nothing."""
    model = MODELS[name]
    counts = Evidence.empty(geometry, model.levels).counts
    observer(geometry, model)(pose, scan, counts)
    p = 1.0 - np.array(model.p_levels())
    assert counts.sum(axis=0).max() <= 1
    return np.where(counts.any(axis=0), p[counts.argmax(axis=0)], nan)


def one(r: float, width: float = 0.3, least: float = 0.1) -> Scan:
    return Scan(np.zeros(1), np.array([width]), np.array([r]), least, 4.0)


def test_a_gaussian_about_the_range_by_hand() -> None:
    z = 1.5
    sigma = np.hypot(0.01 + 1.425e-3 * z * z, 0.025)
    found = shown("gaussian", one(z))[0]
    d = (np.arange(60) + 0.5) * 0.05
    w = np.round(16 * np.exp(-((d - z) ** 2) / (2 * sigma**2))) / 16
    expected = np.where(d <= z, 0.4 + 0.3 * w, 0.5 + 0.2 * w)
    expected[(d > z) & (w == 0)] = nan
    assert found == pytest.approx(expected, nan_ok=True)
    assert np.nanmax(found) > 0.6
    assert found[:25].tolist() == pytest.approx([0.4] * 25)


def test_a_far_hit_is_wider() -> None:
    widths = []
    for r in (0.6, 2.2):
        wide = dataclasses.replace(GAUSSIAN, growth=0.02)
        counts = Evidence.empty(ROW, wide.levels).counts
        observer(ROW, wide)(BESIDE, one(r), counts)
        widths.append(int(counts[:-1].sum()))  # all but full misses
    # sigma 0.030 and 0.110 m, a weight of 1/32 at 2.63 of them: centres of cells from 0.520 to
    # 0.680 m, and from 1.912 to 2.489 m
    assert widths == [4, 12]


def test_a_cone_by_hand() -> None:
    g, z, half = Geometry(41, 60, 0.05, 0.0, -1.025), 2.0, radians(15.0)
    found = shown("cone", one(z, 2 * half), g, Pose(0.0, 0.0, 0.0))
    rows, cols = np.mgrid[:41, :60]
    x, y = (cols + 0.5) * 0.05, (rows - 20) * 0.05
    d, off = np.hypot(x, y), np.arctan2(y, x) / half
    inner = 1 - off**2
    empty = inner * (1 - (np.maximum(d - 0.1, 0.0) / (1.9 - 0.1)) ** 2)
    full = inner * (1 - ((d - z) / 0.1) ** 2)
    weight = np.where(d < 1.9, -empty, np.where(d <= 2.1, full, 0.0))
    weight[np.abs(off) > 1.0] = 0.0
    steps = np.round(16 * weight) / 16
    expected = np.where(steps > 0, 0.5 + 0.2 * steps, 0.5 + 0.1 * steps)
    expected[steps == 0] = nan
    assert found == pytest.approx(expected, nan_ok=True)
    assert found[20, 39] == pytest.approx(0.6875, abs=0.02)  # the axis, 2.5 cm before the range


def test_a_cone_that_saw_nothing_is_empty_as_far_as_it_clears() -> None:
    found = shown("cone", one(inf))[0]
    d = (np.arange(60) + 0.5) * 0.05
    assert (found[d < 2.5] < 0.5).all()
    assert not (found > 0.5).any()
    assert shown("cone", Scan(np.zeros(1), np.ones(1), np.array([nan]), 0.1, 4.0))[
        0
    ] == pytest.approx(np.full(60, nan), nan_ok=True)


def test_levels_that_say_next_to_nothing_are_no_visit() -> None:
    for model in (GAUSSIAN, CONE):
        p = np.array(model.p_levels())
        assert (np.abs(np.log(p / (1 - p))) < 0.02).tolist() == model.silent.tolist()
        assert model.silent[model.steps]  # nothing known
        assert model.silent.sum() <= 2
    for name in ("beam", "eq10", "eq15"):
        assert not MODELS[name].silent.any()


def test_probabilities_are_joined_afterwards() -> None:
    levels = GAUSSIAN.p_levels(0.9, 0.1)
    assert (levels[0], levels[-1]) == (0.1, 0.9)
    assert levels[GAUSSIAN.steps] == 0.5
    assert levels[8] == pytest.approx(1 - (0.5 + 0.4 * 0.5))  # half of a hit behind it
    assert levels[24] == pytest.approx(1 - (0.1 + 0.8 * 0.5))
    assert CONE.p_levels(0.8, 0.3)[:2] == pytest.approx([0.2, 0.2 + 0.3 / 16])
    assert CONE.p_levels(0.8, 0.3)[-1] == 0.7


@pytest.mark.parametrize("name", ["gaussian", "cone"])
@settings(deadline=None, max_examples=60)
@given(
    st.lists(beams, min_size=1, max_size=10),
    lattices(),
    views,
    st.sampled_from([1.5, 4.0, 50.0]),
    st.sampled_from(["near", "clear", "ignore"]),
)
def test_any_beams_agree_with_the_oracle(
    name: str,
    chosen: list[tuple[float, ...]],
    g: Geometry,
    pose: Pose,
    max_range: float,
    no_return: str,
) -> None:
    bearings, widths, ranges = np.array(chosen).T
    scan = Scan(bearings, widths, ranges, 0.1, 5.0)
    agree(name, g, pose, scan, max_range=max_range, no_return=no_return)


@pytest.mark.parametrize("kind", KINDS)
def test_another_scan_of_other_beams_and_the_first_again(kind: str) -> None:
    rng = np.random.default_rng(3)
    g = Geometry(30, 30, 0.1, -1.5, -1.5)
    model = MODELS["cone"]
    same = observer(g, model)
    for scan in (
        one(1.0, 0.5),
        scans(rng, kind),
        one(1.0, 0.5),
        Scan(np.empty(0), np.empty(0), np.empty(0), 0.1, 5.0),
    ):
        a, b = (Evidence.empty(g, model.levels).counts for _ in range(2))
        same(Pose(0.1, 0.2, 0.3), scan, a)
        observer(g, model)(Pose(0.1, 0.2, 0.3), scan, b)
        assert (a == b).all()


def flat() -> tuple[Site, npt.NDArray[np.bool_], list[tuple[float, float]]]:
    """Two rooms of 3 x 4 m with a gap between, in cells of 5 cm; a way through both."""
    wall = np.zeros((90, 130), dtype=bool)
    wall[5:85, 5:125] = True
    wall[7:83, 7:123] = False
    wall[7:35, 64:66] = wall[55:83, 64:66] = True
    way = [(1.0, 1.0), (2.6, 1.2), (2.6, 3.5), (1.5, 2.3), (4.0, 2.2), (5.5, 1.0), (5.4, 3.6)]
    return Site.of(np.kron(wall, np.ones((5, 5), dtype=bool)) > 0, 0.01), wall, way


@pytest.mark.parametrize(
    ("name", "sensor"), [("gaussian", Lidar(rate=4.0)), ("cone", Sonar(rate=10.0))]
)
def test_finer_levels_change_next_to_nothing_under_bayes(name: str, sensor: Planar) -> None:
    site, wall, way = flat()
    g = Geometry(90, 130, 0.05, 0.0, 0.0)
    prior = Grid(g, np.where(wall, logit(0.18), logit(0.81)))
    readings = list(frames(site, drive(way), sensor))
    maps = []
    for steps in (MODELS[name].steps, 4 * MODELS[name].steps):
        mapper = Mapper(g, dataclasses.replace(MODELS[name], steps=steps))
        for frame in readings:
            mapper.insert(frame)
        maps.append(mapper.evidence.on(prior, mapper.model.p_levels()).occupied())
    seen = mapper.evidence.visits() > 0
    coarse, fine = (f2(tell(found[seen], wall[seen])) for found in maps)
    assert abs(coarse - fine) < 0.005
    assert (maps[0] != maps[1]).sum() < 0.005 * seen.sum()


def test_a_cone_maps_what_a_single_beam_as_wide_cannot() -> None:
    site, wall, way = flat()
    g = Geometry(90, 130, 0.05, 0.0, 0.0)
    nothing = Grid(g, np.zeros(g.shape))
    ring = [
        Frame(f.time_ns, f.pose, f.scan) for f in frames(site, drive(way * 3), Sonar(rate=20.0))
    ]
    scores = {}
    for name in ("beam", "cone"):
        mapper = Mapper(g, name)
        for frame in ring:
            mapper.insert(frame)
        found = mapper.evidence.on(nothing, mapper.model.p_levels()).occupied()
        scores[name] = (found & about(wall)).sum(), found.sum()
    assert scores["cone"][0] > 3 * scores["beam"][0]
    assert scores["cone"][0] / scores["cone"][1] > 1.5 * about(wall).mean()


def about(wall: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Walls and the cells beside them, since their faces lie on the borders of cells."""
    return np.asarray(binary_dilation(wall))


def test_a_depth_camera_and_its_model() -> None:
    """Ranges with the model's own noise: what is sure of a wall lies on it."""
    site, wall, _ = flat()
    g, rng = Geometry(90, 130, 0.05, 0.0, 0.0), np.random.default_rng(0)
    pose, bearings = Pose(1.5, 2.0, 1.0), np.linspace(-0.5, 0.5, 300)
    mapper = Mapper(g, "gaussian")
    for k in range(60):
        turned = Pose(pose.x, pose.y, pose.yaw + 0.1 * k)
        true = cast(site, turned, bearings, 8.0)
        ranges = true + rng.normal(size=true.size) * 1.425e-3 * true**2
        widths = np.full(300, 1.0 / 299)
        mapper.insert(Frame(k, turned, Scan(bearings, widths, ranges, 0.3, 8.0)))
    values = mapper.evidence.total(mapper.model.p_levels())
    assert about(wall)[values < -3.0].mean() > 0.98
    assert (values < -3.0).sum() > 100
    assert not wall[values > 3.0].any()
