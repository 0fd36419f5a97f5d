"""Sparse changes of evidence add up to it, however they are thinned and joined."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.grid import Counted, Evidence, Geometry, Grid
from formats.result import Curve
from formats.results import messages as ros
from formats.results.keyframes import Change, Keyframes, Pictures, change, joined, percent

GEOMETRY = Geometry(3, 4, 0.5, 0.0, 0.0)
SIZE = 2 * 3 * 4
COUNTS = st.lists(st.integers(0, 2**32 - 1), min_size=SIZE, max_size=SIZE)
READINGS = st.lists(st.integers(0, SIZE - 1), max_size=30)


def counted(values: list[int]) -> Counted:
    return np.array(values, dtype=np.uint32).reshape(2, 3, 4)


@given(COUNTS, COUNTS)
def test_a_change_leads_from_one_to_the_other(before: list[int], after: list[int]) -> None:
    old, new = counted(before), counted(after)
    found = change(7, new, old)
    assert np.array_equal(old, new)  # brought up to date
    evidence = Evidence(GEOMETRY, counted(before))
    found.add_to(evidence)
    assert np.array_equal(evidence.counts, new)
    differ = [i for i in range(SIZE) if before[i] != after[i]]
    assert found.where.tolist() == differ
    assert found.added.tolist() == [(after[i] - before[i]) % 2**32 for i in differ]


@given(COUNTS, COUNTS, COUNTS)
def test_two_changes_joined_are_the_change_over_both(
    first: list[int], second: list[int], third: list[int]
) -> None:
    state = counted(first)
    a, b = change(1, counted(second), state), change(2, counted(third), state)
    one, both = change(2, counted(third), counted(first)), joined(a, b)
    assert both.frame == 2
    evidence = Evidence(GEOMETRY, counted(first))
    both.add_to(evidence)
    assert np.array_equal(evidence.counts, counted(third))
    assert set(one.where.tolist()) <= set(both.where.tolist())
    assert np.all(np.diff(both.where) > 0)


@given(COUNTS)
def test_the_message_comes_back(values: list[int]) -> None:
    found = change(3, counted(values), np.zeros((2, 3, 4), dtype=np.uint32))
    message = ros.decode(ros.evidence_message(5, GEOMETRY, 2, found), ros.EVIDENCE)
    assert (message.frame, message.levels, message.rows, message.cols) == (3, 2, 3, 4)
    flat = np.zeros(SIZE, dtype=np.int64)
    at = 0
    for step, added in zip(message.steps.tolist(), message.added.tolist(), strict=True):
        at += step
        flat[at] = added
    assert flat.tolist() == values


@given(st.lists(READINGS, min_size=1, max_size=60), st.sampled_from([3, 5, 9]))
def test_thinning_keeps_the_evidence_of_every_moment_it_keeps(
    frames: list[list[int]], limit: int
) -> None:
    keyframes = Keyframes(GEOMETRY, 2, limit)
    evidence = Evidence.empty(GEOMETRY, 2)
    seen = []
    for i, readings in enumerate(frames):
        np.add.at(evidence.counts.reshape(-1), readings, 1)
        seen.append(evidence.counts.copy())
        keyframes.offer(i, evidence)
    keyframes.close(len(frames) - 1, evidence)
    kept = [each.frame for each in keyframes.kept]
    assert kept[0] == 0
    assert kept[-1] == len(frames) - 1
    assert len(kept) <= limit + 1
    assert len(kept) >= min(len(frames), (limit + 1) // 2)
    assert len(set(np.diff(kept[:-1]).tolist())) <= 1
    found = Evidence.empty(GEOMETRY, 2)
    for each in keyframes.kept:
        each.add_to(found)
        assert np.array_equal(found.counts, seen[each.frame])


@pytest.mark.parametrize("limit", [0, 1, 2, 100])
def test_only_odd_limits_thin_evenly(limit: int) -> None:
    with pytest.raises(ValueError, match="odd"):
        Keyframes(GEOMETRY, 2, limit)


@given(st.lists(READINGS, max_size=8), st.sampled_from(["bayes", "paper"]), st.integers(0, 2**32))
def test_pictures_are_the_maps_drawn_whole(frames: list[list[int]], update: str, seed: int) -> None:
    prior = Grid(GEOMETRY, np.random.default_rng(seed).normal(0.0, 2.0, GEOMETRY.shape))
    curve = Curve(prior, (0.3, 0.6), update)  # type: ignore[arg-type]
    pictures = Pictures({"it": curve}, GEOMETRY, 2)
    state = np.zeros((2, 3, 4), dtype=np.uint32)
    evidence = Evidence.empty(GEOMETRY, 2)
    assert np.array_equal(pictures.cells["it"], percent(curve.of(evidence).values).ravel())
    for i, readings in enumerate(frames):
        np.add.at(evidence.counts.reshape(-1), readings, 1)
        pictures.add(change(i, evidence.counts, state))
        whole = np.rint(100 * curve.of(evidence).p_occupied()).ravel()
        assert np.array_equal(pictures.cells["it"], whole)


def test_nothing_seen_is_an_empty_change() -> None:
    nothing = np.zeros((2, 3, 4), dtype=np.uint32)
    found = change(0, nothing, nothing.copy())
    assert isinstance(found, Change)
    assert len(found.where) == len(found.added) == 0
    assert len(joined(found, found).where) == 0
