from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formats.frame import Floats, Pose
from formats.trajectory import Trajectory
from replay.trajectories.errors import (
    NO_ALIGNMENT,
    angles,
    ape,
    degrees,
    interpolated,
    lengths,
    pairs,
    planar_trajectory,
    rpe,
    statistics,
    umeyama,
)


def winding(step: float, start: float, wobble: float) -> Trajectory:
    """A way through space at 1 / step Hz for 20 s, with a wobble in place of noise."""
    t = np.arange(0.0, 20.0, step) + start
    shake = wobble * np.sin(np.outer(t, [17.0, 23.0, 29.0, 31.0, 37.0, 41.0, 43.0]))
    place = np.column_stack([3 * np.cos(t / 3), 2 * np.sin(t / 2), 0.3 * np.sin(t)])
    turn = np.column_stack([0.1 * np.sin(t), 0.1 * np.cos(t), np.sin(t / 6), np.cos(t / 6)])
    turn += shake[:, 3:] / 3
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    times = np.round((t + 100.0) * 1e9).astype(np.int64)
    return Trajectory(times, np.column_stack([place + shake[:, :3], turn]))


@pytest.fixture(scope="module")
def both() -> tuple[Trajectory, Trajectory]:
    """Poses of equal times within 20 ms: each of the fewer with the nearest of the others."""
    reference, estimate = winding(0.1, 0.0, 0.0), winding(0.17, 0.005, 0.05)
    rows = []
    for k, time in enumerate(estimate.times_ns.tolist()):
        apart = [abs(other - time) for other in reference.times_ns.tolist()]
        if min(apart) <= 20_000_000:
            rows.append((apart.index(min(apart)), k))
    i, k = np.array(rows).T
    return (
        Trajectory(reference.times_ns[i], reference.numbers[i]),
        Trajectory(estimate.times_ns[k], estimate.numbers[k]),
    )


def slow(numbers: Floats) -> list[Any]:
    return [(Rotation.from_quat(row[3:]), row[:3]) for row in numbers]


def slow_error(p: Any, q: Any) -> tuple[float, float]:
    """Length and degrees of q^-1 p."""
    rotation = q[0].inv() * p[0]
    return float(np.linalg.norm(p[1] - q[1])), float(np.degrees(rotation.magnitude()))


def test_ape_is_the_distance_and_the_turn_pose_by_pose(both: Any) -> None:
    reference, estimate = both
    expected = [
        slow_error(p, q)
        for p, q in zip(slow(estimate.numbers), slow(reference.numbers), strict=True)
    ]
    errors = ape(reference, estimate)
    assert lengths(errors) == pytest.approx([length for length, _ in expected], abs=1e-12)
    assert degrees(errors) == pytest.approx([turn for _, turn in expected], abs=1e-9)


def test_rpe_is_the_drift_from_one_pose_to_another(both: Any) -> None:
    reference, estimate = both
    q, p = slow(reference.numbers), slow(estimate.numbers)
    expected = []
    for i in range(len(p) - 3):
        found = (p[i][0].inv() * p[i + 3][0], p[i][0].inv().apply(p[i + 3][1] - p[i][1]))
        wanted = (q[i][0].inv() * q[i + 3][0], q[i][0].inv().apply(q[i + 3][1] - q[i][1]))
        expected.append(slow_error(found, wanted))
    errors = rpe(reference, estimate, 3, all_pairs=True)
    assert lengths(errors) == pytest.approx([length for length, _ in expected], abs=1e-12)
    assert degrees(errors) == pytest.approx([turn for _, turn in expected], abs=1e-9)


EVO: dict[str, tuple[int, float, float, float]] = {
    "ape raw trans_part": (48, 0.06128925924, 0.06046987747, 0.01605492959),
    "ape raw angle_deg": (48, 2.234162519, 2.256833838, 0.5147113803),
    "ape align trans_part": (48, 0.06127434964, 0.06007425389, 0.0159265765),
    "ape align angle_deg": (48, 2.234441089, 2.249718329, 0.5173427426),
    "ape scale trans_part": (48, 0.0612608232, 0.06005160928, 0.01592274654),
    "rpe 1 frames steps trans_part": (47, 0.09952396014, 0.1000032227, 0.02907591219),
    "rpe 5 frames all angle_deg": (43, 2.354978142, 2.020155161, 0.9175390006),
    "rpe 0.5 m steps trans_part": (28, 0.0961516908, 0.09633763507, 0.02605489304),
    "rpe 20.0 deg steps angle_deg": (17, 1.938889232, 1.419722835, 0.8133182781),
    "rpe 20.0 deg all trans_part": (9, 0.1013658351, 0.09783667669, 0.02221108056),
}
"""What -> how many errors, their rmse, median and std."""


@pytest.mark.parametrize("case", list(EVO))
def test_numbers_are_those_of_evo(both: Any, case: str) -> None:
    """Printed by evo 1.38.1 for these two trajectories (see the parameters of `winding`)."""
    reference, estimate = both
    assert len(reference.times_ns) == 48
    kind, *words, relation = case.split()
    if kind == "ape":
        found = {"raw": lambda: NO_ALIGNMENT, "align": lambda: umeyama(reference, estimate)}
        found["scale"] = lambda: umeyama(reference, estimate, scaled=True)
        errors = ape(reference, estimate, found[words[0]]())
    else:
        unit: Any = words[1]
        errors = rpe(reference, estimate, float(words[0]), unit, all_pairs=words[2] == "all")
    count, rmse, median, std = EVO[case]
    values = {"trans_part": lengths, "angle_deg": degrees}[relation](errors)
    assert len(values) == count
    summed = statistics(values)
    assert (summed.rmse, summed.median, summed.std) == pytest.approx((rmse, median, std), rel=1e-7)


def test_statistics_by_hand() -> None:
    found = statistics(np.array([1.0, 2.0, 3.0, 6.0]))
    assert found.mean == 3.0
    assert found.median == 2.5
    assert found.sse == 50.0
    assert found.rmse == pytest.approx(12.5**0.5)
    assert found.std == pytest.approx(3.5**0.5)
    assert (found.min, found.max) == (1.0, 6.0)
    with pytest.raises(ValueError, match="no errors"):
        statistics(np.empty(0))


def test_angles_are_exact_near_zero_and_near_a_half_turn() -> None:
    turns = np.array([0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-6, np.pi])
    errors = np.tile(np.eye(4), (turns.size, 1, 1))
    errors[:, :3, :3] = Rotation.from_rotvec(np.outer(turns, [0.6, 0.0, 0.8])).as_matrix()
    assert angles(errors) == pytest.approx(turns, rel=1e-6, abs=1e-15)


def test_an_alignment_undoes_a_similarity() -> None:
    truth = winding(0.1, 0.0, 0.0)
    turn = Rotation.from_rotvec([0.3, -0.8, 2.0])
    moved = turn.apply(truth.numbers[:, :3]) * 1.7 + [4.0, -2.0, 9.0]
    turned = (turn * Rotation.from_quat(truth.numbers[:, 3:])).as_quat()
    estimate = Trajectory(truth.times_ns, np.column_stack([moved, turned]))
    found = umeyama(truth, estimate, scaled=True)
    assert found.scale == pytest.approx(1 / 1.7)
    errors = ape(truth, estimate, found)
    assert lengths(errors).max() < 1e-12
    assert degrees(errors).max() < 1e-9
    line = Trajectory(truth.times_ns, np.outer(np.arange(200), [1.0, 2, 0, 0, 0, 0, 0]))
    with pytest.raises(ValueError, match="degenerate"):
        umeyama(line, line)


def planar(seconds: list[float], xs: list[float]) -> Trajectory:
    times = np.round(np.array(seconds) * 1e9).astype(np.int64)
    return planar_trajectory(times, np.column_stack([xs, np.zeros_like(xs), np.zeros_like(xs)]))


def test_the_reference_is_interpolated_but_not_across_gaps() -> None:
    reference = planar([0.0, 1.0, 2.0, 9.0], [0, 1, 3, 4])
    times = np.array([-1, 500_000_000, 1_500_000_000, 5_000_000_000, 9_000_000_001])
    found, known = interpolated(reference, times)
    assert known.tolist() == [False, True, True, False, False]
    assert found.numbers[1:3, 0].tolist() == [0.5, 2.0]


def test_pairs_by_way_and_by_turn() -> None:
    way = planar([0, 1, 2, 3, 4, 5], [0.0, 0.4, 1.0, 1.1, 2.05, 3.0])
    m = np.tile(np.eye(4), (6, 1, 1))
    m[:, 0, 3] = way.numbers[:, 0]
    assert [x.tolist() for x in pairs(m, 1.0, "m")] == [[0, 2], [2, 4]]
    assert [x.tolist() for x in pairs(m, 1.0, "m", all_pairs=True)] == [[0, 2, 3, 4], [2, 4, 4, 5]]
    assert [x.tolist() for x in pairs(m, 2, "frames")] == [[0, 2], [2, 4]]
    turned = planar_trajectory(way.times_ns, np.array([Pose(0, 0, a) for a in range(6)], float))
    spun = np.tile(np.eye(4), (6, 1, 1))
    spun[:, :3, :3] = Rotation.from_quat(turned.numbers[:, 3:]).as_matrix()
    assert [x.tolist() for x in pairs(spun, 1.9, "rad")] == [[0, 2], [2, 4]]
    assert [x.tolist() for x in pairs(spun, 2.0, "rad", all_pairs=True)] == [
        [0, 1, 2, 3],
        [2, 3, 4, 5],
    ]
    with pytest.raises(ValueError, match="no two poses"):
        rpe(way, way, 9.0, "m")
    assert pairs(m, 1.0, "rad")[0].size == 0
