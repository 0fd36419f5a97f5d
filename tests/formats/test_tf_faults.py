"""What is wrong with transforms in real logs: dropped, put right or refused, and counted."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from formats.errors import FormatError
from formats.messages import Numbers, Transform
from formats.streaming.clock import SECOND, Clock
from formats.streaming.tf import Tree
from formats.streaming.track import Why
from tests.trees import numbers, put, tree


def problems(tf: Tree) -> list[str]:
    return [str(note) for note in tf.notes]


def test_a_loop_is_an_error() -> None:
    tf = tree()
    for parent, child in (("a", "b"), ("b", "c"), ("c", "a")):
        put(tf, parent, child, 0.0)
    with pytest.raises(
        FormatError, match=r"log.bag: /tf: the transforms form a loop, \w > \w > \w"
    ):
        tf.lookup("a", "c", [0])


def test_unconnected_frames_are_an_error_that_names_both() -> None:
    tf = tree()
    put(tf, "odom", "base", 0.0)
    with pytest.raises(FormatError, match="no transform odom <- laser"):
        tf.lookup("odom", "laser", [0])


def test_of_two_parents_the_one_with_more_transforms_counts() -> None:
    tf = tree()
    put(tf, "footprint", "base", 0.0, numbers(9, 9, 0), static=True)
    for t in (0.0, 0.5):
        put(tf, "odom", "base", t, numbers(1, 0, 0))
    found = tf.lookup("odom", "base", [0])
    assert found.matrices[0, 0, 3] == 1.0
    assert problems(tf) == ["log.bag: /tf: base has two parents, footprint and odom"]


def test_a_transform_to_itself_and_an_unnamed_one_are_counted() -> None:
    tf = tree()
    for _ in range(3):
        put(tf, "base", "/base", 0.0)
    put(tf, "", "base", 0.0)
    assert problems(tf) == [
        "log.bag: /tf: 3 x transform of a frame to itself ignored (first at base > base)",
        "log.bag: /tf: transform of an unnamed frame ignored at  > base",
    ]
    assert not tf.edges


def test_bad_numbers_are_dropped_or_normalised_and_counted() -> None:
    tf = tree()
    nan = float("nan")
    x, y, z, qx, qy, qz, qw = numbers(1, 0, 0.4)
    bad: list[Numbers] = [
        (x, y, z, 0.0, 0.0, 0.0, 0.0),
        (x, y, z, qx, qy, nan, qw),
        (nan, y, z, qx, qy, qz, qw),
        (1e9, y, z, qx, qy, qz, qw),
    ]
    good = [(x, y, z, 1.1 * qx, 1.1 * qy, 1.1 * qz, 1.1 * qw), (x, y, z, qx, qy, qz, qw)]
    for k, what in enumerate([good[0], *bad, good[1]]):
        put(tf, "odom", "base", k / 10, what)
    found = tf.lookup("odom", "base", [SECOND // 4])
    assert found.valid.all()
    np.testing.assert_allclose(found.matrices[0, :2, 0], [np.cos(0.4), np.sin(0.4)], atol=1e-12)
    assert problems(tf) == [
        "log.bag: /tf: 2 x odom > base: quaternion of zeros or not finite (dropped)",
        "log.bag: /tf: 2 x odom > base: place not finite or beyond 1e8 m (dropped)",
        "log.bag: /tf: odom > base: quaternion not of norm 1 (normalised)",
    ]


def test_a_bad_static_transform_does_not_count() -> None:
    tf = tree()
    put(tf, "base", "laser", 0.0, (0, 0, 0, 0, 0, 0, 0), static=True)
    put(tf, "base", "laser", 0.0, (0, 0, 0, 0, 0, sqrt(0.5), sqrt(0.5)), static=True)
    found = tf.lookup("base", "laser", [0])
    np.testing.assert_allclose(found.matrices[0, :2, 0], [0, 1], atol=1e-12)
    assert len(problems(tf)) == 1


def test_slashes_are_stripped() -> None:
    tf = tree()
    put(tf, "/odom", "/base", 0.0, numbers(1, 0, 0))
    put(tf, "odom", "base", 1.0, numbers(2, 0, 0))
    assert tf.lookup("/odom", "base", [SECOND // 2]).matrices[0, 0, 3] == 1.5
    assert tf.edges == {("odom", "base"): 2}


def test_of_samples_at_one_time_the_first_counts_and_others_are_noted() -> None:
    tf = tree()
    for t, x in ((0.0, 0), (0.1, 0.1), (0.1, 0.1), (0.1, 0.9), (0.2, 0.2)):
        put(tf, "odom", "base", t, numbers(x, 0, 0))
    found = tf.lookup("odom", "base", [SECOND // 10])
    assert found.matrices[0, 0, 3] == pytest.approx(0.1)
    what = "odom > base: another value at the same time (first one kept)"
    assert problems(tf) == [f"log.bag: /tf: {what}"]


def test_samples_out_of_order_are_sorted_and_counted() -> None:
    tf = tree()
    for t in (0.0, 0.2, 0.1, 0.3):
        put(tf, "odom", "base", t, numbers(t, 0, 0))
    found = tf.lookup("odom", "base", [round(0.15 * SECOND)])
    assert found.matrices[0, 0, 3] == pytest.approx(0.15)
    assert problems(tf) == ["log.bag: /tf: odom > base: out of order (sorted)"]


def test_passes_with_the_same_stamps_are_not_mixed() -> None:
    tf = tree()
    stamps, logs = [], []
    for again in (0, 1):
        for k in range(30):
            stamp, log = k * SECOND // 10, (again * 40 + k) * SECOND // 10
            what = numbers(0.01 * k, 5.0 * again, 0)
            tf.add([Transform(stamp, "odom", "base", what)], log, static=False)
            stamps.append(stamp)
            logs.append(log)
    clock = Clock.of(np.array(stamps), np.array(logs))
    tf.settle(clock)
    times = clock.times(np.array(stamps), np.array(logs))
    assert times.tolist() == logs  # the second pass goes on as the log times do
    found = tf.lookup("odom", "base", times + SECOND // 20)
    expected = [True] * 29 + [False] + [True] * 29 + [False]
    assert found.valid.tolist() == expected
    y = found.matrices[found.valid, 1, 3]
    assert y.tolist() == [0.0] * 29 + [5.0] * 29


def test_forgotten_edges_are_those_that_lead_nowhere() -> None:
    tf = tree()
    for child in ("wheel", "laser"):
        put(tf, "base", child, 0.0)
    put(tf, "odom", "base", 0.0)
    tf.forget({"laser"})
    assert tf.lookup("odom", "laser", [0]).valid.all()
    assert not tf.lookup("base", "wheel", [0]).valid.any()


def test_static_transforms_that_change_are_counted_and_repeated_ones_are_not() -> None:
    tf = tree()
    for x in (1.0, 1.0, 2.0, 2.0, 3.0):
        put(tf, "base", "laser", 0.0, numbers(x, 0, 0), static=True)
    assert tf.lookup("base", "laser", [0]).matrices[0, 0, 3] == 3.0
    assert [(note.problem, note.count) for note in tf.notes] == [
        ("base > laser: another static value (the last one counts)", 2)
    ]


def test_a_static_turn_alone_is_another_value() -> None:
    tf = tree()
    for yaw in (0.0, 0.1):
        put(tf, "base", "laser", 0.0, numbers(0, 0, yaw), static=True)
    tf.lookup("base", "laser", [0])
    assert len(problems(tf)) == 1


def test_pairs_of_frames_have_a_limit() -> None:
    tf = tree()
    for k in range(10_003):
        put(tf, "map", f"f{k}", 0.0, static=True)
    assert len(tf.edges) == 10_000
    put(tf, "map", "f5", 0.0, static=True)  # known ones go on
    assert tf.edges["map", "f5"] == 2
    assert [(note.problem, note.count) for note in tf.notes] == [
        ("transforms beyond 10000 pairs of frames ignored", 3)
    ]


def test_of_parents_with_as_many_transforms_the_later_counts() -> None:
    tf = tree()
    for parent in ("map", "odom"):
        put(tf, parent, "base", 0.0)
    assert tf.parents == {"base": "odom"}


def test_a_frame_below_a_loop_and_its_relatives() -> None:
    tf = tree()
    put(tf, "b", "c", 0.0)
    put(tf, "c", "b", 0.0)
    put(tf, "c", "d", 0.0)
    put(tf, "map", "odom", 0.0)
    put(tf, "odom", "base", 0.0)
    with pytest.raises(FormatError, match=r"loop, (b > c > b|c > b > c)"):
        tf.ancestors("d")
    assert tf.relatives("base") == ["base", "map", "odom"]
    assert tf.relatives("elsewhere") == []


def test_stamps_before_1970_are_dropped_and_counted() -> None:
    tf = tree()
    for t in (-0.1, 0.1, 0.2, 0.3):
        put(tf, "odom", "base", t, numbers(t, 0, 0))
    track = tf.track(("odom", "base"))
    assert (track.times_ns / SECOND).tolist() == [0.1, 0.2, 0.3]
    assert [(note.problem, note.count) for note in tf.notes] == [
        ("odom > base: stamp before 1970 (dropped)", 1)
    ]


def test_what_moves() -> None:
    """By translation alone, by a turn alone; one value again and again does not, nor a mounting."""
    tf = tree()
    for k in range(3):
        put(tf, "a", "still", k / 10, numbers(1, 2, 0.5))
        put(tf, "a", "pushed", k / 10, numbers(1, 2 + k / 100, 0.5))
        put(tf, "a", "turned", k / 10, numbers(1, 2, 0.5 + k / 100))
    put(tf, "a", "fixed", 0.0, static=True)
    moving = {child: tf.moves(("a", child)) for child in ("still", "pushed", "turned", "fixed")}
    assert moving == {"still": False, "pushed": True, "turned": True, "fixed": False}
    samples = tf.samples(("a", "still"))
    assert samples is not None
    assert len(samples) == 3
    assert tf.samples(("a", "fixed")) is None


@pytest.mark.parametrize(
    ("x", "yaw", "seconds", "jumps"),
    [
        (1.5, 0.0, 0.1, True),  # 15 m/s
        (1.5, 0.0, 0.2, False),  # 7.5 m/s
        (0.9, 0.0, 0.05, False),  # 18 m/s over less than a metre
        (0.0, 1.05, 0.1, True),  # 10.5 rad/s
        (0.0, 1.05, 0.11, False),  # 9.5 rad/s
        (0.0, 0.9, 0.05, False),  # less than 1 rad
    ],
)
def test_a_teleport_is_long_and_fast(x: float, yaw: float, seconds: float, jumps: bool) -> None:
    tf = tree()
    put(tf, "odom", "base", 0.0)
    put(tf, "odom", "base", seconds, numbers(x, 0, yaw))
    assert (tf.track(("odom", "base")).broken[0] == Why.JUMP) == jumps


@pytest.mark.parametrize(
    ("steps", "gap", "held"), [(20, 9.0, True), (20, 11.0, False), (10, 9.0, True)]
)
def test_poses_that_always_come_seldom_have_longer_gaps(steps: int, gap: float, held: bool) -> None:
    """Every 3 s: five times that are 15 s, of which 10 s count."""
    tf = tree()
    for k in range(steps):
        put(tf, "odom", "base", 3.0 * k)
    put(tf, "odom", "base", 3.0 * (steps - 1) + gap)
    middle = round((3.0 * (steps - 1) + gap / 2) * SECOND)
    assert tf.lookup("odom", "base", [middle]).valid.tolist() == [held]
    assert tf.lookup("odom", "base", [round(4.5 * SECOND)]).valid.all()


def test_the_farthest_place_that_counts() -> None:
    """Below 1e8 m along every axis, either way."""
    tf = tree()
    far = float(np.nextafter(1e8, 0.0))
    odd = [(1e8, 0.0, 0.0), (0.0, -1e8, 0.0), (0.0, 0.0, 1e8)]
    places = [(far, -far, far), *odd, (-far, far, -far)]
    for k, (x, y, z) in enumerate(places):
        put(tf, "odom", "base", 10.0 * k, (x, y, z, 0.0, 0.0, 0.0, 1.0))
    track = tf.track(("odom", "base"))
    assert (track.times_ns / SECOND).tolist() == [0.0, 40.0]
    assert track.odd == {"place not finite or beyond 1e8 m (dropped)": 3}


def test_samples_a_nanosecond_apart_are_two() -> None:
    tf = tree()
    for ns, x in ((0, 0.0), (1, 0.5)):
        tf.add([Transform(ns, "odom", "base", numbers(x, 0, 0))], ns, static=False)
    found = tf.lookup("odom", "base", [0, 1])
    assert found.valid.all()
    assert found.matrices[:, 0, 3].tolist() == [0.0, 0.5]
