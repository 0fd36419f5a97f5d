"""The smooth field that a similarity leaves: known warps come back, exact maps leave none."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import BSpline, LinearNDInterpolator, NearestNDInterpolator

from replay.registration.residual import Residual, _basis, _bending, residual
from replay.registration.seen import Seen
from tests.plans_and_maps import FLAT, ROOM, ROOMS, case, files, run

Doubles = npt.NDArray[np.float64]


def warped(seen: Seen, most: float) -> tuple[Seen, npt.NDArray[np.float32]]:
    """A map that drifted smoothly, and (H, W, 2) from each of its cells to where it belongs."""
    high, wide = seen.free.shape
    rows, cols = (np.asarray(a, np.float32) for a in np.mgrid[:high, :wide])
    x = np.asarray(0.7 * most * np.cos(np.pi * rows / high), np.float32)
    y = np.asarray(most * np.sin(np.pi * cols / wide), np.float32)
    occupied, free = (
        cv2.remap(m.astype(np.uint8), cols + x, rows + y, interpolation=cv2.INTER_NEAREST) > 0
        for m in (seen.occupied, seen.free)
    )
    return Seen(occupied, free), np.stack([x, y], axis=-1)


def moves_at(found: Residual, field: npt.NDArray[np.float32], true: Doubles) -> Doubles:
    """What a field of the map's cells says at the nodes, in plan pixels."""
    back = np.linalg.inv(np.vstack([true, [0.0, 0.0, 1.0]]))[:2]
    cells = np.rint(found.nodes @ back[:, :2].T + back[:, 2]).astype(np.int64)
    cells = np.clip(cells, 0, np.array(field.shape[1::-1]) - 1)
    out: Doubles = field[cells[:, 1], cells[:, 0]] @ true[:, :2].T
    return out


@pytest.mark.parametrize(("most", "mirrored"), [(5.0, False), (9.0, False), (6.0, True)])
def test_a_known_warp_is_recovered_to_within_a_cell(most: float, mirrored: bool) -> None:
    walls, seen, true = case(FLAT, 1.0, 37.0, mirrored, (0, 0, 1, 1))
    bent, field = warped(seen, most)
    found = residual(bent, walls, true)
    want = moves_at(found, field, true)
    assert len(found.nodes) > 40
    assert np.hypot(*want.T).max() > most  # of both directions together
    assert np.hypot(*(found.moves - want).T).max() < 1.0
    assert found.before > 0.6 * most
    assert found.after < 1.0  # of cells that are whole, on walls whose pixels are
    assert found.on_walls > 0.97


def test_an_exact_map_leaves_next_to_nothing() -> None:
    walls, seen, true = case(FLAT, 0.8, 37.0, False, (0, 0, 1, 1))
    found = residual(seen, walls, true)
    assert np.hypot(*found.moves.T).max() < 0.5
    assert found.before - found.after < 0.1


def test_furniture_does_not_bend_the_field() -> None:
    """Boxes in the rooms, some beside walls, are as many cells as a fifth of the walls."""
    walls, seen, true = case(FLAT, 1.0, 0.0, False, (0, 0, 1, 1))
    rng = np.random.default_rng(4)
    occupied, free = seen.occupied.astype(np.uint8), seen.free.copy()
    rooms = np.argwhere(cv2.erode(free.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0)
    low, high = seen.points.min(axis=0)[::-1] + 12, seen.points.max(axis=0)[::-1] - 12
    rooms = rooms[((rooms > low) & (rooms < high)).all(axis=1)]
    for row, col in rooms[rng.choice(len(rooms), 30)].tolist():
        cv2.rectangle(occupied, (col - 6, row - 5), (col + 6, row + 5), 1, 1)
    mask = occupied > 0
    assert mask.sum() > 1.1 * seen.occupied.sum()
    bare, found = residual(seen, walls, true), residual(Seen(mask, free & ~mask), walls, true)
    assert np.array_equal(found.nodes, bare.nodes)
    assert np.hypot(*(found.moves - bare.moves).T).max() < 1.0
    assert found.on_walls < 0.97


def test_nothing_is_said_of_parts_that_were_not_seen() -> None:
    """A map of the left half: no node lies a spacing beyond it."""
    walls, seen, true = case(FLAT, 1.0, 0.0, False, (0, 0, 0.5, 1))
    found = residual(seen, walls, true)
    at = seen.points @ true[:, :2].T + true[:, 2]
    assert (found.nodes > at.min(axis=0) - found.spacing).all()
    assert (found.nodes < at.max(axis=0) + found.spacing).all()


def test_the_basis_is_scipys() -> None:
    at = np.random.default_rng(1).uniform([0, 0], [4, 2], (50, 2))
    ours = _basis(at, np.array([5, 3]))
    sides = []
    for axis, count in ((0, 5), (1, 3)):
        knots = np.arange(-3, count + 3, dtype=float)
        sides.append(BSpline.design_matrix(at[:, axis], knots, 3).toarray())
    scipys = (sides[0][:, :, None] * sides[1][:, None, :]).reshape(50, -1)
    assert ours == pytest.approx(scipys)


def test_only_what_bends_has_energy() -> None:
    energy = _bending(np.array([4, 3]))
    x, y = (a.ravel().astype(float) for a in np.meshgrid(range(4), range(3), indexing="ij"))
    flat = 2.0 + 3.0 * x - y
    assert flat @ energy @ flat == pytest.approx(0.0, abs=1e-9)
    assert x**2 @ energy @ x**2 == pytest.approx(6 * 2.0**2)  # 2 x 3 second differences of 2
    assert (x * y) @ energy @ (x * y) == pytest.approx(2 * 3 * 2 * 1.0)  # 3 x 2 mixed ones


def test_facts_in_pixels_and_metres_by_hand() -> None:
    nodes, moves = np.array([[10.0, 20.0], [30.0, 20.0]]), np.array([[3.0, 4.0], [0.0, 1.0]])
    facts = Residual(nodes, moves, 20.0, 4.0, 0.5, 0.9, 0.02).facts()
    assert facts["nodes"] == [[10.0, 20.0, 3.0, 4.0], [30.0, 20.0, 0.0, 1.0]]
    assert (facts["median"], facts["largest"], facts["largest_m"]) == (3.0, 5.0, 0.1)
    assert (facts["rms_before_m"], facts["rms_after"], facts["spacing_m"]) == (0.08, 0.5, 0.4)
    assert "largest_m" not in Residual(nodes, moves, 20.0, 4.0, 0.5, 0.9, None).facts()


def test_the_verb_reports_it_and_keeps_the_similarity(tmp_path: Path) -> None:
    walls, seen, _ = case(FLAT, 1.0, 37.0, False, (0, 0, 1, 1))
    map_file, plan_file = files(tmp_path, walls, warped(seen, 5.0)[0])
    picture = tmp_path / "o.png"
    plain = json.loads(run(map_file, "--prior", plan_file, "--json")[1])
    code, stdout, _ = run(
        map_file, "--prior", plan_file, "--json", "--residual", "--picture", str(picture)
    )
    said = json.loads(stdout)
    assert code == 0
    assert said["matrix"] == plain["matrix"]
    assert "residual" not in plain
    assert said["residual"]["rms_after"] < 0.5 * said["residual"]["rms_before"]
    image = cv2.imread(str(picture))
    assert image is not None
    assert (image == (178, 80, 0)).all(axis=2).sum() > 500
    spoken = run(map_file, "--prior", plan_file, "--residual", "-o", str(tmp_path / "a.json"))[1]
    assert "the plan lies off the map by" in spoken


def test_a_refused_place_has_no_residual(tmp_path: Path) -> None:
    walls, seen, _ = case(ROOMS, 1.0, 30.0, False, ROOM)
    map_file, plan_file = files(tmp_path, walls, seen)
    code, stdout, _ = run(map_file, "--prior", plan_file, "--json", "--residual", "--scale", "1")
    assert code == 1
    assert "residual" not in json.loads(stdout)


@pytest.mark.slow
def test_keypoints_that_people_associated_come_closer(shared_data: Path) -> None:
    """Halmstad-Robot-Maps; the field does not know them. Similarity alone: 8.5 px on the mean."""
    from formats.errors import Notes
    from formats.plans.file import open_plan
    from replay.registration.register import align
    from replay.registration.seen import seen_in_map
    from scripts.score_align import halmstad_maps, halmstad_pairs

    data = shared_data / "plans_with_logs"
    before, after = [], []
    for building, name in halmstad_maps():
        maps = data / "halmstad" / "maps" / building
        plan = open_plan(maps / "layout" / f"{building}_layout.png", Notes())
        seen = seen_in_map(open_plan(maps / "pseudo_occupancy" / f"{name}.png", Notes()))
        matrix = align(seen, plan.wall).best.matrix
        found = residual(seen, plan.wall, matrix)
        points, drawn = halmstad_pairs(data, building, name)
        at = points @ matrix[:, :2].T + matrix[:, 2]
        moved = LinearNDInterpolator(found.nodes, found.moves)(at)
        nearest = NearestNDInterpolator(found.nodes, found.moves)(at)
        moved = np.where(np.isnan(moved), nearest, moved)
        before.append(float(np.median(np.hypot(*(at - drawn).T))))
        after.append(float(np.median(np.hypot(*(at + moved - drawn).T))))
    assert np.mean(after) < 0.75 * np.mean(before)
    assert np.sum(np.array(after) < np.array(before)) >= 16
