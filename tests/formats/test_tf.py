"""Transforms: batch lookups against scipy, one time at a time, and the faults of tf trees."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from formats.messages import Numbers, Transform
from formats.streaming.clock import SECOND, Clock
from formats.streaming.tf import Tree
from formats.streaming.track import Floats, Why
from tests.trees import IDENTITY, numbers, put, tree


def problems(tf: Tree) -> list[str]:
    return [str(note) for note in tf.notes]


def oracle(edges: list[tuple[bool, list[tuple[int, Numbers]]]], time: int) -> Floats | None:
    """One chain at one time by scipy: edges from the target to the source."""
    whole = np.eye(4)
    for static, samples in edges:
        step = np.eye(4)
        if static:
            n = np.array(samples[-1][1])
            step[:3, :3], step[:3, 3] = Rotation.from_quat(n[3:]).as_matrix(), n[:3]
        else:
            times = [t for t, _ in samples]
            if not times[0] <= time <= times[-1]:
                return None
            rows = np.array([n for _, n in samples])
            if len(times) == 1:
                turn = Rotation.from_quat(rows[0, 3:])
            else:
                turn = Slerp(times, Rotation.from_quat(rows[:, 3:]))(time)
            step[:3, :3] = turn.as_matrix()
            step[:3, 3] = [np.interp(time, times, rows[:, k]) for k in range(3)]
        whole = whole @ step
    return whole


place = st.floats(-0.4, 0.4)
# Neighbouring samples must not look like teleports, so turns stay within 1 rad of each other.
angle = st.floats(-0.2, 0.2)


@st.composite
def sampled(draw: st.DrawFn) -> tuple[bool, list[tuple[int, Numbers]]]:
    static = draw(st.booleans())
    base = Rotation.from_euler("xyz", draw(st.tuples(*[st.floats(-pi, pi)] * 3)))
    times = draw(st.lists(st.integers(0, 1_500_000_000), min_size=1, max_size=6, unique=True))
    samples = []
    for time in sorted(times):
        turn = base * Rotation.from_euler("xyz", draw(st.tuples(angle, angle, angle)))
        sign = draw(st.sampled_from([-1.0, 1.0]))  # q and -q are one rotation
        q = [sign * float(c) for c in turn.as_quat()]
        x, y, z = draw(st.tuples(place, place, place))
        samples.append((time, (x, y, z, q[0], q[1], q[2], q[3])))
    return static, samples


@settings(max_examples=60, deadline=None)
@given(st.lists(sampled(), min_size=1, max_size=4), st.randoms(use_true_random=False))
def test_lookup_agrees_with_scipy_one_time_at_a_time(
    edges: list[tuple[bool, list[tuple[int, Numbers]]]], random: object
) -> None:
    tf = tree()
    for k, (static, samples) in enumerate(edges):
        shuffled = list(samples)
        if not static:
            random.shuffle(shuffled)  # type: ignore[attr-defined]
        for time, what in shuffled:
            tf.add([Transform(time, f"f{k}", f"f{k + 1}", what)], time, static=static)
    times = np.array([0, 1, 400_000_000, 750_000_001, 1_500_000_000, edges[0][1][0][0]])
    found = tf.lookup("f0", f"f{len(edges)}", times)
    back = tf.lookup(f"f{len(edges)}", "f0", times)
    for k, time in enumerate(times.tolist()):
        expected = oracle(edges, time)
        assert found.valid[k] == (expected is not None)
        if expected is not None:
            np.testing.assert_allclose(found.matrices[k], expected, atol=1e-8)
            np.testing.assert_allclose(back.matrices[k], np.linalg.inv(expected), atol=1e-8)
    assert (
        sorted(int(r) for m in found.missing for r in m.rows)
        == np.flatnonzero(~found.valid).tolist()
    )


def test_halfway_by_hand() -> None:
    tf = tree()
    put(tf, "odom", "base", 0.0, numbers(0, 0, 0))
    put(tf, "odom", "base", 1.0, numbers(2, 0, pi / 2 * 0.5))
    put(tf, "base", "laser", 9.0, numbers(1, 0, 0), static=True)
    found = tf.lookup("odom", "laser", [SECOND // 2])
    # Half of 45 degrees turned, 1 m on, and the laser 1 m ahead of that.
    c, s = np.cos(pi / 8), np.sin(pi / 8)
    np.testing.assert_allclose(found.matrices[0, :2, 3], [1 + c, s], atol=1e-12)
    np.testing.assert_allclose(found.matrices[0, :2, :2], [[c, -s], [s, c]], atol=1e-12)


def test_map_may_hang_below_odom() -> None:
    tf = tree()  # as some localisers publish it: odom > map
    put(tf, "odom", "map", 0.0, numbers(3, 0, pi / 2), static=True)
    put(tf, "odom", "base", 0.0, numbers(3, 1, pi / 2), static=True)
    found = tf.lookup("map", "base", [0])
    np.testing.assert_allclose(found.matrices[0, :3, 3], [1, 0, 0], atol=1e-12)


def test_nothing_is_extrapolated_and_the_reason_is_said() -> None:
    tf = tree()
    for t in (1.0, 1.5, 2.0):
        put(tf, "odom", "base", t, numbers(t, 0, 0))
    found = tf.lookup("odom", "base", [SECOND - 1, SECOND, 2 * SECOND, 2 * SECOND + 1])
    assert found.valid.tolist() == [False, True, True, False]
    assert [(m.what, m.why, m.bound_ns, m.rows.tolist()) for m in found.missing] == [
        ("transform odom > base", Why.BEFORE, SECOND, [0]),
        ("transform odom > base", Why.AFTER, 2 * SECOND, [3]),
    ]


def test_a_gap_is_refused_but_its_ends_hold() -> None:
    tf = tree()
    for t in (0.0, 0.1, 0.2, 5.0, 5.1, 5.2):
        put(tf, "odom", "base", t, numbers(t / 10, 0, 0))
    found = tf.lookup("odom", "base", [SECOND // 5, SECOND, 5 * SECOND])
    assert found.valid.tolist() == [True, False, True]
    assert found.missing[0].why == Why.GAP
    tf.settle(Clock(), max_gap_ns=5 * SECOND)
    assert tf.lookup("odom", "base", [SECOND]).valid.all()


def test_a_teleport_is_not_interpolated_and_its_time_is_said() -> None:
    tf = tree()
    for k in range(10):
        put(tf, "odom", "base", k / 10, numbers(0.05 * k + (3 if k > 4 else 0), 0, 0))
    found = tf.lookup("odom", "base", [round(t * SECOND) for t in (0.35, 0.4, 0.45, 0.5)])
    assert found.valid.tolist() == [True, True, False, True]
    assert found.missing[0].why == Why.JUMP
    # 0.05 m on and 3 m aside: along x both add up to 3.05 m.
    assert problems(tf) == ["log.bag: /tf: odom > base jumps by 3.0 m; not interpolated at 0.50 s"]


def test_half_a_turn_at_once_is_a_teleport_too() -> None:
    tf = tree()
    for k in range(6):
        put(tf, "map", "odom", k / 10, numbers(0, 0, pi if k > 2 else 0))
    assert tf.lookup("map", "odom", [round(0.25 * SECOND)]).missing[0].why == Why.JUMP


def test_static_transforms_hold_always_wherever_they_are() -> None:
    tf = tree()
    put(tf, "base", "laser", 100.0, numbers(0.2, 0, 0), static=True)
    found = tf.lookup("base", "laser", [0, 10**18])
    assert found.valid.all()
    assert found.matrices[:, 0, 3] == pytest.approx([0.2, 0.2])


def test_a_mounting_published_on_tf_holds_always_only_when_asked_so() -> None:
    tf = tree()
    for t in (1.0, 2.0, 3.0):
        put(tf, "base", "laser", t, numbers(0.2, 0, 0.1))
    put(tf, "odom", "base", 1.0)
    assert tf.lookup("base", "laser", [0], mounted=False).valid.tolist() == [False]
    assert tf.lookup("base", "laser", [0], mounted=True).valid.tolist() == [True]
    put(tf, "base", "laser", 4.0, numbers(0.2, 0, 0.2))  # it tilts after all
    tf.settle(Clock())
    assert tf.lookup("base", "laser", [0], mounted=True).valid.tolist() == [False]


def test_a_single_sample_that_moves_holds_at_its_time_only() -> None:
    tf = tree()
    put(tf, "odom", "base", 1.0, numbers(1, 2, 0))
    found = tf.lookup("odom", "base", [SECOND - 1, SECOND, SECOND + 1])
    assert found.valid.tolist() == [False, True, False]


def test_many_lookups_are_quick_enough_for_a_long_log() -> None:
    """36,000 samples and as many lookups, far below the second that a slow loop would take."""
    import time

    tf = tree()
    n = 36_000
    for k in range(n):
        tf.add([Transform(k * 20_000_000, "odom", "base", IDENTITY)], k, static=False)
    start = time.process_time()
    assert tf.lookup("odom", "base", np.arange(n - 1) * 20_000_000 + 1).valid.all()
    assert time.process_time() - start < 1.0
