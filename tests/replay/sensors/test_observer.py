from __future__ import annotations

import dataclasses
from math import inf, nan, pi
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.frame import Floats, Pose, Scan
from formats.grid import Evidence, Geometry
from replay.sensors import fan as fans
from replay.sensors.models import bell, printed
from replay.sensors.observer import MODELS, Model, Observer
from replay.sensors.polar import observer
from tests import oracles

Cells = npt.NDArray[np.int64]
ODD = [nan, inf, -inf, 0.0, -1.0, 5.0, 6.0, 1e38, 1e-310, 0.05]


def reading(geometry: Geometry, pose: Pose, scan: Scan, model: Model, **options: Any) -> Cells:
    """The level of each cell, NOTHING where it was not shown; what was counted is the same."""
    counts = Evidence.empty(geometry, model.levels).counts
    touched = observer(geometry, model, **options)(pose, scan, counts)
    cells, levels = touched.shown()
    out = np.full(geometry.rows * geometry.cols, oracles.NOTHING)
    out[cells] = levels
    expected = np.zeros_like(counts.reshape(model.levels, -1))
    expected[levels, cells] = 1
    assert (counts.reshape(model.levels, -1) == expected).all()
    return out.reshape(geometry.shape)


def truth_of(geometry: Geometry, model: Model) -> Cells:
    """Some level of each cell."""
    return np.random.default_rng(9).integers(0, model.levels, geometry.shape)


def agree(name: str, geometry: Geometry, pose: Pose, scan: Scan, **options: Any) -> int:
    """Kernel and oracle, cell by cell; returns how many lay at a rounding border."""
    samples = {"samples": options.pop("samples")} if "samples" in options else {}
    model = dataclasses.replace(MODELS[name], **samples)
    if model.of_truth:
        options["truth"] = truth_of(geometry, model)
    found = reading(geometry, pose, scan, model, **options)
    expected = oracles.READINGS[name](geometry, pose, scan, **options, **samples)
    sure = expected != oracles.UNSURE
    assert (found[sure] == expected[sure]).all()
    return int((~sure).sum())


def drawn(levels: Cells) -> list[str]:
    """Hits as #, misses as -, the highest row on top."""
    return ["".join({0: "#", 1: "-"}.get(int(c), ".") for c in row) for row in levels[::-1]]


def fan(n: int, start: float = -pi, whole: float = 2 * pi) -> tuple[Any, Any]:
    return start + (np.arange(n) + 0.5) * whole / n, np.full(n, whole / n)


# Pictures, by hand.


def test_one_beam_along_a_row() -> None:
    g = Geometry(3, 6, 1.0, 0.0, 0.0)
    scan = Scan(np.zeros(1), np.full(1, 0.1), np.array([4.4]), 0.1, 30.0)
    assert drawn(reading(g, Pose(0.2, 1.5, 0.0), scan, MODELS["beam"])) == [
        "......",
        "----#.",
        "......",
    ]
    scan.ranges = np.array([4.9])  # the end point lies 0.1 m inside cell 5
    assert drawn(reading(g, Pose(0.2, 1.5, 0.0), scan, MODELS["beam"]))[1] == "-----#"
    found = reading(g, Pose(0.2, 1.5, 0.0), scan, MODELS["beam"], margin=0.7)
    assert drawn(found)[1] == "----.#"  # cell 4's centre lies 0.6 m before the hit


def test_a_room_seen_from_its_middle() -> None:
    g = Geometry(9, 9, 1.0, 0.0, 0.0)
    bearings, widths = fan(360)
    ranges = 2.8 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    scan = Scan(bearings, widths, ranges, 0.1, 30.0)
    assert drawn(reading(g, Pose(4.45, 4.48, 0.0), scan, MODELS["beam"])) == [
        ".........",
        ".#######.",
        ".#-----#.",
        ".#-----#.",
        ".#-----#.",
        ".#-----#.",
        ".#-----#.",
        ".#######.",
        ".........",
    ]


def test_hit_beats_miss() -> None:
    # The second beam passes through the cell in which the first one ends.
    g = Geometry(1, 6, 1.0, 0.0, 0.0)
    scan = Scan(np.zeros(2), np.full(2, 0.1), np.array([2.4, 5.4]), 0.1, 30.0)
    assert drawn(reading(g, Pose(0.2, 0.5, 0.0), scan, MODELS["beam"])) == ["--#--#"]


def test_a_wide_beam_clears_its_cone_and_hits_its_axis() -> None:
    g = Geometry(5, 5, 1.0, 0.0, 0.0)
    scan = Scan(np.zeros(1), np.full(1, 0.5), np.array([4.2]), 0.1, 30.0)
    assert drawn(reading(g, Pose(0.1, 2.5, 0.0), scan, MODELS["beam"])) == [
        ".....",
        ".....",
        "----#",
        ".....",
        ".....",
    ]
    scan.widths[:] = 1.6  # 45.8 degrees to either side
    assert drawn(reading(g, Pose(0.1, 2.5, 0.0), scan, MODELS["beam"])) == [
        "..-..",  # (2.4, 2): at 3.12 m
        ".---.",
        "----#",
        ".---.",
        "..-..",
    ]


def test_levels_are_empty_shares_of_the_observed_samples() -> None:
    # From 100 m away, the front crosses the cells as a line at x = 2.408, its band ends at 3.408:
    # cell 2 has 2 of 5 columns of samples empty; of cell 3 only 2 columns are observed.
    g = Geometry(3, 5, 1.0, 0.0, -1.0)
    scan = Scan(np.zeros(1), np.full(1, 0.05), np.array([102.44]), 0.1, 300.0)
    for name in ("eq10", "eq15"):
        seen = reading(g, Pose(-100.0, 0.5, 0.0), scan, MODELS[name])
        assert seen.tolist() == [[25, 25, 10, -1, -1]] * 3
        seen = reading(g, Pose(-100.0, 0.5, 0.0), scan, MODELS[name], min_observed=0.4)
        assert seen.tolist() == [[25, 25, 10, 0, -1]] * 3


@pytest.mark.parametrize("max_range", [None, inf, 30.0])
@pytest.mark.parametrize(
    ("r", "no_return", "cleared", "hit"),
    [
        (nan, "clear", 0.0, False),
        (inf, "near", 5.0, False),
        (inf, "clear", 8.0, False),
        (inf, "ignore", 0.0, False),
        (-inf, "clear", 0.0, False),
        (0.0, "clear", 0.0, False),
        (-1.0, "clear", 0.0, False),
        (1e-310, "clear", 0.0, False),
        (0.05, "clear", 0.0, False),
        (7.9, "near", 7.65, True),
        (8.0, "near", 5.0, False),
        (8.0, "clear", 8.0, False),
        (9.0, "ignore", 0.0, False),
        (1e38, "near", 5.0, False),
    ],
)
def test_rep_117(
    r: float, no_return: str, cleared: float, hit: bool, max_range: float | None
) -> None:
    g = Geometry(1, 40, 0.5, 0.0, 0.0)
    scan = Scan(np.zeros(1), np.full(1, 0.1), np.array([r], dtype=np.float32), 0.1, 8.0)
    options = {"no_return": no_return, "max_range": max_range}
    levels = reading(g, Pose(0.0, 0.25, 0.0), scan, MODELS["beam"], **options)
    centres = (np.arange(40) + 0.5) * 0.5
    expected = np.where(centres < cleared, 1, -1)
    if hit:
        expected[int(r / 0.5)] = 0
    assert levels[0].tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("r", "range_min", "range_max", "options", "cleared"),
    [
        (1e38, 0.1, inf, {}, 5.0),
        (inf, 0.1, inf, {"no_return": "clear"}, 20.0),
        (inf, nan, nan, {}, 5.0),
        (inf, 0.0, 0.0, {}, 5.0),  # neither limit is stated
        (7.0, 0.1, 30.0, {"max_range": 6.0}, 6.0),  # something stands there, farther than asked
        (6.1, 0.1, 30.0, {"max_range": 6.0}, 5.85),
        (inf, 0.1, 30.0, {"max_range": 6.0, "no_return": "clear"}, 6.0),
        (inf, 0.1, 3.0, {}, 3.0),
        (1e-310, 0.0, 30.0, {}, 0.0),
        (float(np.float32(5.6)), 0.1, 5.6, {}, 5.0),  # float32 of a decimal range_max
    ],
)
def test_odd_limits_are_capped(
    r: float, range_min: float, range_max: float, options: dict[str, Any], cleared: float
) -> None:
    g = Geometry(1, 40, 0.5, 0.0, 0.0)
    scan = Scan(np.zeros(1), np.full(1, 0.1), np.array([r]), range_min, range_max)
    levels = reading(g, Pose(0.0, 0.25, 0.0), scan, MODELS["beam"], **options)
    assert levels[0].tolist() == np.where((np.arange(40) + 0.5) * 0.5 < cleared, 1, -1).tolist()


# Kernels against the oracles, cell by cell.


def lattices() -> st.SearchStrategy[Geometry]:
    corner = st.integers(-30, 5)
    return st.builds(
        lambda rows, cols, x, y: Geometry(rows, cols, 0.1, x * 0.1, y * 0.1),
        st.integers(1, 30), st.integers(1, 30), corner, corner,
    )  # fmt: skip


beams = st.tuples(
    st.floats(-7, 7), st.floats(0.001, 3.0), st.one_of(st.floats(0, 7), st.sampled_from(ODD))
)
views = st.builds(Pose, st.floats(-4, 4), st.floats(-4, 4), st.floats(-4, 4))
options = st.fixed_dictionaries(
    {
        "max_range": st.sampled_from([1.5, 4.0, 50.0]),
        "no_return": st.sampled_from(["near", "clear", "ignore"]),
        "margin": st.sampled_from([0.0, 0.5, 1.5]),
        "shape": st.sampled_from(["sectors", "polygon"]),
    }
)


@pytest.mark.parametrize("bearings", [[4.0, 1.625], [4.0 + 3 * pi, 1.625 + 3 * pi]])
def test_wide_beams_that_overlap_by_more_than_a_part(bearings: list[float]) -> None:
    # 2.5 and 2.75 rad wide, over each other by 0.25, while parts are 0.05 wide
    g, widths = Geometry(1, 1, 0.1, 0.0, 0.1), np.array([2.5, 2.75])
    scan = Scan(np.array(bearings), widths, np.array([1.0, 0.0]), 0.1, 5.0)
    agree("eq15", g, Pose(1.0, 0.0, 4.0 - bearings[0]), scan, samples=3)
    found = fans.fan(np.array(bearings), widths)
    a, b = (np.arctan2(*found.corners[k : k + 2][::-1]) for k in (0, 2))
    turned = (b - a) % (2 * pi)
    assert turned.max() < 0.06
    assert turned.sum() == pytest.approx(2.5 + 2.75 - 0.25)


@pytest.mark.parametrize("name", ["beam", "eq15", "eq15-literal"])
@settings(deadline=None, max_examples=100)
@given(st.lists(beams, min_size=1, max_size=12), lattices(), views, options)
def test_any_beams_agree_with_the_oracle(
    name: str, chosen: list[tuple[float, ...]], g: Geometry, pose: Pose, how: dict[str, Any]
) -> None:
    bearings, widths, ranges = np.array(chosen).T
    more = {} if name == "beam" else {"samples": 3}
    agree(name, g, pose, Scan(bearings, widths, ranges, 0.1, 5.0), **how, **more)


def scans(rng: np.random.Generator, kind: str) -> Scan:
    """A scan in one of the orders in which sensors deliver them."""
    n = int(rng.integers(20, 120))
    step = rng.uniform(0.005, 0.08)
    if kind == "circle":
        step = 2 * pi / n
    bearings = rng.uniform(-4, 4) + np.arange(n) * (-step if kind == "backwards" else step)
    widths: Floats = np.full(n, step)
    if kind == "shuffled":
        bearings = rng.permutation(bearings)
    elif kind == "gaps":
        widths = widths * 0.3
    elif kind == "overlaps":
        widths = widths * 2.5
    elif kind == "twice":
        bearings = np.repeat(bearings[::2], 2)[:n]
        widths = widths[: bearings.size]
        n = bearings.size
    elif kind == "jitter":  # as de-skewing leaves them: some borders meet, some do not
        bearings = bearings + rng.normal(0, 0.06 * step, n)
    elif kind == "uneven":
        bearings, widths = rng.uniform(-7, 7, n), rng.uniform(0.01, 0.6, n)
    ranges: Floats = rng.uniform(0.2, 4.5, n)
    odd = rng.random(n) < 0.15
    ranges[odd] = rng.choice(ODD, odd.sum())
    return Scan(bearings.astype(np.float64), widths, ranges, 0.1, 5.0)


def place(rng: np.random.Generator) -> tuple[Geometry, Pose]:
    """A small lattice, and a pose on it or beside it."""
    rows, cols = (int(v) for v in rng.integers(5, 35, 2))
    x, y, yaw = (float(v) for v in rng.uniform((-2.5, -2.5, -4), (2.5, 2.5, 4)))
    return Geometry(rows, cols, 0.1, -2.0, -1.5), Pose(x, y, yaw)


KINDS = [
    "forwards",
    "backwards",
    "circle",
    "shuffled",
    "gaps",
    "overlaps",
    "twice",
    "jitter",
    "uneven",
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", ["sectors", "polygon"])
@pytest.mark.parametrize("name", list(MODELS))
def test_every_order_of_beams_agrees_with_the_oracle(name: str, shape: str, kind: str) -> None:
    rng = np.random.default_rng(KINDS.index(kind))
    unsure = 0
    for _ in range(4 if name == "beam" else 1):
        g, pose = place(rng)
        how = {"shape": shape, "no_return": str(rng.choice(["near", "clear", "ignore"]))}
        unsure += agree(name, g, pose, scans(rng, kind), **how)
    assert unsure == 0  # no cell centre of a random pose lies within 1e-7 m of a border


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["beam", "eq10"])
def test_many_random_scans_agree_with_the_oracle(name: str, kind: str) -> None:
    rng = np.random.default_rng(100 + KINDS.index(kind))
    for _ in range(40 if name == "beam" else 4):
        g, pose = place(rng)
        for shape in ("sectors", "polygon"):
            agree(name, g, pose, scans(rng, kind), shape=shape)


def test_the_order_of_the_beams_does_not_matter() -> None:
    rng = np.random.default_rng(5)
    g, pose = Geometry(60, 60, 0.1, -3.0, -3.0), Pose(0.21, -0.13, 0.7)
    bearings, widths = fan(200)
    ranges = rng.uniform(0.5, 2.8, 200)
    first = reading(g, pose, Scan(bearings, widths, ranges, 0.1, 5.0), MODELS["beam"])
    for order in (np.arange(200)[::-1], rng.permutation(200), np.roll(np.arange(200), 77)):
        scan = Scan(bearings[order], widths[order], ranges[order], 0.1, 5.0)
        assert (reading(g, pose, scan, MODELS["beam"]) == first).all()


def test_an_upside_down_lidar_draws_the_mirror_image() -> None:
    g, rng = Geometry(41, 41, 0.1, -2.05, -2.05), np.random.default_rng(6)
    bearings, widths = fan(90)
    ranges = rng.uniform(0.5, 1.9, 90)
    upright = reading(
        g, Pose(0.013, 0.017, 0.3), Scan(bearings, widths, ranges, 0.1, 5.0), MODELS["beam"]
    )
    turned = Scan(-bearings, widths, ranges, 0.1, 5.0)
    assert (reading(g, Pose(0.013, -0.017, -0.3), turned, MODELS["beam"]) == upright[::-1]).all()


@pytest.mark.parametrize("beams", [4, 8, 16, 360])
def test_sectors_that_share_a_border_leave_no_slit(beams: int) -> None:
    # From a cell's centre, borders at multiples of 45 degrees pass through rows of centres.
    g = Geometry(41, 41, 0.1, 0.0, 0.0)
    centre = (20.5 * 0.1, 20.5 * 0.1)
    bearings, widths = fan(beams)
    scan = Scan(bearings, widths, np.full(beams, 2.0), 0.1, 5.0)
    rows, cols = np.mgrid[:41, :41]
    distance = 0.1 * np.hypot(rows - 20, cols - 20)
    inside = (distance < 1.9) & (distance > 0.0)
    for yaw in (0.0, pi / 4, pi / 2, -3 * pi / 4):
        for shape in ("sectors", "polygon") if beams > 16 else ("sectors",):
            levels = reading(g, Pose(*centre, yaw), scan, MODELS["beam"], shape=shape)
            assert (levels[inside] == 1).all()


def test_bearings_rounded_to_float32_leave_no_slit() -> None:
    g = Geometry(200, 200, 0.1, -10.0, -10.0)
    step = np.float32(2 * pi / 1440)
    bearings = (np.float32(-pi) + np.arange(1440, dtype=np.float32) * step).astype(np.float64)
    scan = Scan(bearings, np.full(1440, float(step)), np.full(1440, 9.0), 0.1, 30.0)
    levels = reading(g, Pose(0.01, 0.02, 0.1), scan, MODELS["beam"])
    rows, cols = np.mgrid[:200, :200]
    distance = np.hypot((cols + 0.5) * 0.1 - 10.01, (rows + 0.5) * 0.1 - 10.02)
    assert (levels[distance < 8.9] == 1).all()


def test_rows_with_more_borders_than_there_was_room_for() -> None:
    g, pose = Geometry(8, 40, 0.1, -2.0, -0.4), Pose(0.0313, 0.0417, 0.0)
    bearings, widths = fan(720)
    ranges = np.where(np.arange(720) % 2 == 0, 1.7, nan)
    scan = Scan(bearings, widths, ranges, 0.1, 30.0)
    for name in ("beam", "eq15"):
        observer = Observer(g, MODELS[name])
        assert observer._events.shape[1] < 700
        assert agree(name, g, pose, scan) == 0


def test_beams_that_do_not_meet_cost_no_trip_home_each() -> None:
    # 2,880 borders pass by the sensor's row; only those with a cell's centre between them count.
    g, pose = Geometry(400, 400, 0.05, -10.0, -10.0), Pose(0.0313, 0.0417, 0.3)
    bearings, widths = fan(1440)
    scan = Scan(bearings, 0.7 * widths, np.full(1440, 9.0), 0.1, 30.0)
    observer, counts = Observer(g, MODELS["beam"]), Evidence.empty(g, 2).counts
    observer(pose, scan, counts)
    assert observer._events.shape[1] < 512


def test_gaps_under_a_tenth_of_the_width_are_closed_and_wider_ones_are_not() -> None:
    g, pose = Geometry(200, 200, 0.05, 0.0, -5.0), Pose(0.0313, 0.0417, 0.0)
    bearings = np.array([-0.1, 0.1])
    for width, closed in ((0.19, True), (0.18, False)):
        scan = Scan(bearings, np.full(2, width), np.full(2, 9.0), 0.1, 30.0)
        levels = reading(g, pose, scan, MODELS["beam"])
        rows, cols = np.mgrid[:200, :200]
        x, y = (cols + 0.5) * 0.05 - pose.x, (rows + 0.5) * 0.05 - 5.0 - pose.y
        gap = (np.abs(np.arctan2(y, x)) < 0.1 - width / 2) & (np.hypot(x, y) < 8.8)
        assert gap.sum() > 100
        assert (levels[gap] == (1 if closed else oracles.NOTHING)).all()


def test_a_new_scan_of_other_beams_is_not_taken_for_the_last_one() -> None:
    g, pose, model = Geometry(40, 40, 0.1, -2.0, -2.0), Pose(0.01, 0.02, 0.0), MODELS["beam"]
    observer = Observer(g, model)
    rng = np.random.default_rng(2)
    for n in (30, 30, 45, 1):
        bearings, widths = rng.uniform(-3, 3, n), rng.uniform(0.01, 0.2, n)
        scan = Scan(bearings, widths, rng.uniform(0.3, 1.8, n), 0.1, 5.0)
        counts = Evidence.empty(g, 2).counts
        cells, levels = observer(pose, scan, counts).shown()
        again = reading(g, pose, scan, model).ravel()
        assert (again[cells] == levels).all()
        assert (again >= 0).sum() == cells.size


@pytest.mark.parametrize(
    "pose", [(nan, 0, 0), (0, inf, 0), (0, 0, nan), (1e300, 0, 0), (1e9, 0, 0)]
)
def test_poses_far_from_this_world_show_nothing(pose: tuple[float, float, float]) -> None:
    bearings, widths = fan(30)
    scan = Scan(bearings, widths, np.full(30, 3.0), 0.1, 5.0)
    g = Geometry(10, 10, 0.1, 0.0, 0.0)
    assert (reading(g, Pose(*pose), scan, MODELS["beam"]) == oracles.NOTHING).all()


def test_beams_without_a_direction_are_left_out() -> None:
    g, pose = Geometry(10, 40, 0.1, 0.0, -0.5), Pose(0.03, 0.02, 0.0)
    good = Scan(np.zeros(1), np.full(1, 0.2), np.array([2.0]), 0.1, 5.0)
    bad = Scan(
        np.array([nan, 0.0, 1.0, inf, 0.3]),
        np.array([0.2, 0.2, nan, 0.2, 0.0]),
        np.full(5, 2.0),
        0.1,
        5.0,
    )
    expected = reading(g, pose, good, MODELS["beam"])
    assert (reading(g, pose, bad, MODELS["beam"]) == expected).all()
    none = Scan(np.empty(0), np.empty(0), np.empty(0), 0.1, 5.0)
    assert (reading(g, pose, none, MODELS["beam"]) == oracles.NOTHING).all()


def test_a_plain_polygon_closes_the_gaps_between_rays_and_sectors_do_not() -> None:
    # A post in front of a wall, hit by one beam only: the polygon cuts the corners beside it.
    g, pose = Geometry(40, 60, 0.1, 0.0, -2.0), Pose(0.01, 0.02, 0.0)
    bearings, widths = fan(21, -0.5, 1.0)
    ranges = np.full(21, 4.0)
    ranges[10] = 2.0
    scan = Scan(bearings, widths, ranges, 0.1, 9.0)
    sectors = reading(g, pose, scan, MODELS["beam"])
    polygon = reading(g, pose, scan, MODELS["beam"], shape="polygon")
    assert ((sectors == 1) & (polygon == oracles.NOTHING)).sum() > 20
    # The centre of cell (21, 36) lies at 0.036 rad and 3.64 m, in a beam that saw 4 m.
    assert (sectors[21, 36], polygon[21, 36]) == (1, oracles.NOTHING)


# Tables.


def test_p_levels_by_hand() -> None:
    assert MODELS["beam"].p_levels() == [0.3, 0.6]
    assert MODELS["beam"].p_levels(0.9, 0.1) == [0.1, 0.9]
    coarse = dataclasses.replace(MODELS["eq15"], samples=2)
    assert coarse.p_levels() == [0.1, 0.3, 0.5, 0.7, 0.9]
    assert coarse.p_levels(0.8, 0.2) == [0.2, 0.35, 0.5, 0.65, 0.8]  # PAPER A9
    assert MODELS["eq15"].p_levels()[:3] == [0.1, 0.132, 0.164]


def test_no_reading_is_certain() -> None:
    for model in MODELS.values():
        levels = model.p_levels(1.0, 0.0)
        assert (levels[0], levels[-1]) == (0.001, 0.999)


def test_equation_10_by_hand() -> None:
    nine = dataclasses.replace(MODELS["eq10"], samples=3)  # a cell of 3 x 3 map pixels
    assert nine.p_levels() == [0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]
    assert MODELS["eq10"].p_levels()[:4] == [0.1, 0.1, 0.1, 0.108]  # clamped (PAPER A7)
    assert MODELS["eq10"].p_levels()[25] == 0.9


def test_equation_15_to_the_letter() -> None:
    coarse = dataclasses.replace(MODELS["eq15-literal"], samples=3)
    ninths = [round(k / 9, 12) for k in range(1, 9)]
    assert coarse.p_levels() == [0.1, *ninths, 0.9]
    assert coarse.p_levels(0.8, 0.2) == [0.2, *ninths, 0.8]  # 8 / 9 empty is emptier than empty


def test_all_behind_a_hit_is_occupied_to_the_letter_of_equation_15() -> None:
    g = Geometry(1, 12, 0.5, 0.0, 0.0)
    scan = Scan(np.zeros(1), np.full(1, 0.5), np.array([2.0]), 0.1, 4.5)
    coarse = dataclasses.replace(MODELS["eq15"], samples=1)
    last = coarse.levels - 1
    assert reading(g, Pose(0.0, 0.25, 0.0), scan, coarse)[0].tolist() == [last] * 4 + [0] + [-1] * 7
    shadow = dataclasses.replace(MODELS["eq15-shadow"], samples=1)
    found = reading(g, Pose(0.0, 0.25, 0.0), scan, shadow)[0].tolist()
    assert found == [last] * 4 + [0] * 5 + [-1] * 3  # up to 4.5 m, the sensor's range
    near = reading(g, Pose(0.0, 0.25, 0.0), scan, shadow, max_range=3.0)[0].tolist()
    assert near == [last] * 4 + [0] * 2 + [-1] * 6


def test_the_true_level_of_the_cells_that_are_seen() -> None:
    model = dataclasses.replace(MODELS["eq10-true"], samples=1)
    g, truth = Geometry(1, 6, 0.5, 0.0, 0.0), np.array([[1, 1, 0, 1, 1, 0]])
    scan = Scan(np.zeros(1), np.full(1, 0.5), np.array([2.0]), 0.1, 4.5)
    found = reading(g, Pose(0.0, 0.25, 0.0), scan, model, truth=truth)
    assert found[0].tolist() == [1, 1, 0, 1, 1, -1]  # also what the beam went through or met
    with pytest.raises(ValueError, match="needs the level of every cell"):
        Observer(g, model)
    with pytest.raises(ValueError, match="needs the level of every cell"):
        Observer(g, model, truth=truth.T)


@pytest.mark.parametrize("name", list(MODELS))
def test_every_model_is_described_and_has_an_oracle(name: str) -> None:
    model = MODELS[name]
    assert len(model.about) > 20
    assert model.empty.__doc__
    assert name in oracles.READINGS
    levels = model.p_levels()
    assert len(levels) == model.levels
    assert (levels == sorted(levels)) == (model.empty not in (printed, bell))
    assert levels[0] == round(1 - model.p_hit, 12)
    assert levels[-1] == round(1 - model.p_miss, 12)


def test_every_oracle_has_its_model() -> None:
    assert set(oracles.READINGS) == set(MODELS)
