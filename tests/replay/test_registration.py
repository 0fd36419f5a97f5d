"""A map finds its place on a plan, and says when it cannot."""

from __future__ import annotations

import json
from dataclasses import replace
from math import cos, exp, radians, sin
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.grid import Evidence, Geometry
from formats.plans.file import Plan, open_plan
from formats.plans.placement import Placement, read_placement
from replay.cli.align import command
from replay.registration.placing import metres_of, pinned, placed, posed
from replay.registration.register import SURE, Alignment, align, confidence, contradicted
from replay.registration.search import matrix_of
from replay.registration.seen import Seen, seen_in_log, seen_in_map, unframed
from tests.pictures import pgm, png
from tests.plans_and_maps import (
    BORDER,
    FLAT,
    OTHER,
    ROOM,
    ROOMS,
    SIDE,
    case,
    files,
    off,
    plan_of,
    run,
)


def test_the_matrix_of_a_similarity() -> None:
    # 90 degrees clockwise on the screen: x to the right becomes y down
    assert matrix_of(2.0, 90.0, False, 5, 7) == pytest.approx(np.array([[0, -2, 5], [2, 0, 7]]))
    assert matrix_of(1.0, 0.0, True) == pytest.approx(np.array([[1, 0, 0], [0, -1, 0]]))


@pytest.mark.parametrize(
    ("scale", "turn", "mirrored", "part"),
    [
        (1.0, 0.0, False, (0, 0, 1, 1)),
        (0.8, 37.0, False, (0, 0, 1, 1)),
        (1.3, 200.0, False, (0, 0, 0.7, 1)),
        (1.7, -95.0, False, (0.05, 0.1, 1, 0.8)),
        (0.9, 120.0, True, (0, 0, 1, 1)),
    ],
)
def test_a_map_finds_its_place(
    scale: float, turn: float, mirrored: bool, part: tuple[float, ...]
) -> None:
    walls, seen, true = case(FLAT, scale, turn, mirrored, part)
    found = align(seen, walls)
    assert found.confident
    assert found.best.mirrored is mirrored
    assert off(found.best.matrix, true, seen) < 3.0
    assert found.best.scale == pytest.approx(scale, rel=0.01)
    assert abs((found.best.turn_deg - turn + 180) % 360 - 180) < 0.5


def test_a_known_scale_holds() -> None:
    walls, seen, true = case(FLAT, 0.8, 37.0, False, (0, 0, 0.6, 0.7))
    found = align(seen, walls, scale=0.8)
    assert off(found.best.matrix, true, seen) < 3.0
    assert all(0.8 / 1.08 < place.scale < 0.8 * 1.08 for place in found.places)


def test_the_same_input_gives_the_same_bits() -> None:
    walls, seen, _ = case(FLAT, 1.1, 10.0, False, (0, 0, 0.6, 0.7))
    first, again = align(seen, walls), align(seen, walls)
    assert first.facts() | {"seconds": 0} == again.facts() | {"seconds": 0}


def test_four_equal_rooms_are_refused_and_all_four_are_named() -> None:
    walls, seen, true = case(ROOMS, 1.0, 30.0, False, ROOM)
    found = align(seen, walls, scale=1.0)
    assert not found.confident
    step = 11 * SIDE, 7 * SIDE
    offsets = {
        min(((abs(place.matrix[:, 2] - true[:, 2] - (i * step[0], j * step[1])).max(), (i, j)))
            for i in (0, 1) for j in (0, 1))
        for place in found.places
        if place.score > found.best.score - 0.02
    }  # fmt: skip
    assert {name for far, name in offsets if far < 3.0} == {(0, 0), (0, 1), (1, 0), (1, 1)}


def test_a_map_of_another_building_is_refused() -> None:
    _, seen, _ = case(OTHER, 1.0, 25.0, False, (0, 0, 1, 1))
    assert not align(seen, plan_of(FLAT)).confident
    assert not align(seen, plan_of(FLAT), scale=1.0).confident


def test_a_map_that_shows_next_to_nothing_is_refused(tmp_path: Path) -> None:
    grey = np.full((40, 40), 255, np.uint8)
    grey[3, 3:9] = 0
    (tmp_path / "m.png").write_bytes(png(grey))
    with pytest.raises(FormatError, match="too few occupied"):
        seen_in_map(open_plan(tmp_path / "m.png", Notes()))


def test_a_log_is_seen_from_above_with_y_up() -> None:
    evidence = Evidence.empty(Geometry(40, 60, 0.05, -1.0, 2.0), 2)
    evidence.counts[0, 5:15, 10:20] = 3  # hits: 10 x 10 cells from x -0.5, y 2.25
    evidence.counts[1, 15:20, 10:20] = 1  # misses above them
    seen = seen_in_log(evidence, "a.bag")
    assert seen.occupied.shape == (15, 10)
    assert seen.free[:5].all()
    assert seen.occupied[5:].all()
    # the centre of the upper left cell: x -0.5 + 0.025, y 2.0 + 20 * 0.05 - 0.025
    assert seen.to_cells @ [-0.475, 2.975, 1.0] == pytest.approx([0.0, 0.0])
    assert seen.to_cells @ [-0.475, 2.275, 1.0] == pytest.approx([0.0, 14.0])


def test_pins_by_hand() -> None:
    # plan = 2 * map turned 90 degrees clockwise + (5, 7)
    pins = [(5.0, 7.0, 0.0, 0.0), (5.0, 27.0, 10.0, 0.0)]
    assert pinned(pins, metres=False) == pytest.approx(np.array([[0, -2, 5], [2, 0, 7]]))
    # a log's y counts upwards: plan = (20 x + 10, 89 - 20 y)
    pins = [(10.0, 89.0, 0.0, 0.0), (30.0, 69.0, 1.0, 1.0), (10.0, 69.0, 0.0, 1.0)]
    assert pinned(pins, metres=True) == pytest.approx(np.array([[20, 0, 10], [0, -20, 89]]))


def test_three_pins_tell_a_mirror() -> None:
    pins = [(10.0, 10.0, 0.0, 0.0), (9.0, 10.0, 1.0, 0.0), (10.0, 11.0, 0.0, 1.0)]
    assert pinned(pins, metres=False) == pytest.approx(np.array([[-1, 0, 10], [0, 1, 10]]))


@pytest.mark.parametrize(
    "pins", [[], [(0.0, 0.0, 1.0, 1.0)], [(0.0, 0.0, 1.0, 1.0), (5.0, 5.0, 1.0, 1.0)]]
)
def test_too_few_pins(pins: list[tuple[float, float, float, float]]) -> None:
    with pytest.raises(UsageError):
        pinned(pins, metres=False)


def yaml_of(path: Path, origin: str) -> None:
    path.with_suffix(".yaml").write_text(
        f"image: {path.name}\nresolution: 0.1\norigin: {origin}\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def test_metres_of_a_map_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "m.pgm"
    grey = np.full((20, 30), 254, np.uint8)
    grey[0] = 0
    path.write_bytes(pgm(grey))
    yaml_of(path, "[1.0, 2.0, 0.0]")
    matrix = metres_of(open_plan(path, Notes()))
    assert matrix is not None
    # the lower left pixel's centre is (1.05, 2.05) m
    assert matrix @ [1.05, 2.05, 1.0] == pytest.approx([0.0, 19.0])
    assert matrix @ [3.95, 3.95, 1.0] == pytest.approx([29.0, 0.0])


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_a_plan_pose_and_its_placement_agree(tmp_path: Path, yaw: float) -> None:
    path = tmp_path / "p.pgm"
    grey = np.full((20, 30), 254, np.uint8)
    grey[0] = 0
    path.write_bytes(pgm(grey))
    yaml_of(path, f"[1.0, 2.0, {yaw}]")
    plan = open_plan(path, Notes())
    pose = Pose(0.5, -0.25, radians(30.0))
    put = placed(plan, Placement(posed(plan, pose), "metres"))
    assert put.resolution == pytest.approx(0.1)
    assert put.origin == pytest.approx(pose @ plan.origin)


def test_a_mirrored_plan_is_turned_over_when_placed(tmp_path: Path) -> None:
    path = tmp_path / "p.png"
    grey = np.full((20, 30), 255, np.uint8)
    grey[:, 2] = 0
    path.write_bytes(png(grey))
    # pixel = (29 - 10 X, 19 - 10 Y): flipped, x grows with X, and the column 2 is column 27
    matrix = np.array([[-10.0, 0.0, 29.0], [0.0, -10.0, 19.0]])
    put = placed(open_plan(path, Notes()), Placement(matrix, "metres"))
    assert put.wall[:, 27].all()
    assert put.wall.sum() == 20
    # the lower left corner of the flipped picture is pixel (29.5, 19.5): X -0.05, Y -0.05
    assert put.origin == pytest.approx(Pose(-0.05, -0.05, 0.0))


def test_the_verb_says_writes_and_draws(tmp_path: Path) -> None:
    walls, seen, true = case(FLAT, 0.8, 37.0, False, (0, 0, 1, 1))
    map_file, plan_file = files(tmp_path, walls, seen)
    output = tmp_path / "out.json"
    code, stdout, _ = run(map_file, "--prior", plan_file, "--json", "-o", str(output))
    assert code == 0
    said = json.loads(stdout)
    names = "confident mirrored scale turn_deg x y matrix runners_up seconds"
    assert set(names.split()) <= set(said)
    assert said["confident"] is True
    assert said["mirrored"] is False
    matrix = np.array(said["matrix"])
    assert off(matrix, true, seen) < 3.0
    assert [said["x"], said["y"]] == matrix[:, 2].tolist()
    turn = radians(said["turn_deg"])
    assert matrix[:, 0] == pytest.approx([said["scale"] * cos(turn), said["scale"] * sin(turn)])
    assert np.array_equal(read_placement(output).matrix, matrix)
    picture = cv2.imread(str(tmp_path / "out.png"))
    assert picture is not None
    assert picture.shape[:2] == walls.shape
    red = (picture == (0, 0, 213)).all(axis=2)
    near = np.asarray(cv2.dilate(walls.astype(np.uint8), np.ones((9, 9), np.uint8))) > 0
    assert (red & near).sum() > 2000
    assert not (red & ~near).any()


def test_the_verb_refuses_with_a_picture_and_no_placement(tmp_path: Path) -> None:
    walls, seen, _ = case(ROOMS, 1.0, 30.0, False, ROOM)
    map_file, plan_file = files(tmp_path, walls, seen)
    output = tmp_path / "out.json"
    code, stdout, stderr = run(map_file, "--prior", plan_file, "--json", "-o", str(output))
    assert code == 1
    assert json.loads(stdout)["confident"] is False
    assert "no place on the plan is clearly the best" in stderr
    assert not output.exists()
    assert (tmp_path / "out.png").exists()


def test_pins_settle_what_is_ambiguous(tmp_path: Path) -> None:
    walls, seen, true = case(ROOMS, 1.0, 30.0, False, ROOM)
    map_file, plan_file = files(tmp_path, walls, seen)
    pins = []
    for x, y in ((20.0, 30.0), (150.0, 90.0)):
        u, v = true @ [x, y, 1.0]
        pins += ["--pin", f"{u:.4f},{v:.4f}={x},{y}"]
    code, stdout, _ = run(map_file, "--prior", plan_file, "--json", *pins)
    assert code == 0
    assert off(np.array(json.loads(stdout)["matrix"]), true, seen) < 0.01


@pytest.mark.parametrize("pin", ["1,2", "1,2=3", "1,2=3,x", "1,2,3=4", "1,2=3,nan"])
def test_a_pin_has_a_form(tmp_path: Path, pin: str) -> None:
    result = CliRunner().invoke(command, ["m.png", "--prior", "p.png", "--pin", pin])
    assert result.exit_code == 2
    assert "PLANX,PLANY=MAPX,MAPY" in result.stderr


def test_confidence_by_hand() -> None:
    # lead 0.2 of the 0.378 that are left, 0.05 by length: -1.76 + 14.6 * 0.529101 + 20.6 * 0.05
    # = 6.994868
    assert confidence([0.6, 0.4, 0.1], [0.7, 0.6, 0.65]) == pytest.approx(0.9990843, abs=1e-6)
    assert confidence([0.6, 0.6], [0.7, 0.7]) == pytest.approx(0.1467903, abs=1e-6)
    assert confidence([0.95, 0.93], [1, 1]) == pytest.approx(confidence([0.9, 0.88], [1, 1]))
    assert confidence([0.6], [0.9]) == pytest.approx(1 / (1 + exp(1.76 - 14.6 * 0.3 / 0.378)))


def test_what_contradicts_the_first_place() -> None:
    assert not contradicted([0.7], [0.5])
    assert not contradicted([0.7, 0.6], [0.5, 0.57])
    assert contradicted([0.7, 0.7], [0.5, 0.5])  # as good, and second for being mirrored
    assert contradicted([0.7, 0.6, 0.5], [0.5, 0.4, 0.59])  # explains more of the map


@pytest.mark.parametrize(
    "seed",
    [
        195,  # the true room is hatched; half of the map falls off the sheet at the other place
        409,  # a drawing turned over, with a place that fits nearly as well the right way round
        463,  # one room and a strip, on a small sheet full of ink
    ],
)
def test_a_wrong_place_that_leads_is_not_claimed(seed: int) -> None:
    from scripts.random_flats import case as random_case
    from scripts.score_align import NEAR, _off, as_plan

    one = random_case(seed)
    seen = seen_in_map(as_plan("map.png", one.map))
    found = align(seen, as_plan("plan.png", one.plan).wall, scale=one.scale)
    assert one.matrix is not None
    assert _off(seen, found.best.matrix, one.matrix) >= NEAR
    scores = [place.score for place in found.places if not place.mirrored]
    assert confidence(scores, [0.0] * len(scores)) > 0.85  # by the lead in score alone
    assert not found.confident
    assert found.confidence < SURE


@pytest.mark.parametrize("told", [1.1, None])
def test_thick_walls_do_not_stretch_the_scale(told: float | None) -> None:
    """A map shows the faces of walls that a plan draws 24 px thick; a flat of 400 x 300 px."""
    plan = np.zeros((400, 500), np.uint8)
    cv2.rectangle(plan, (50, 50), (449, 349), 1, -1)
    for x0, y0, x1, y1 in ((74, 74, 220, 325), (244, 74, 425, 190), (244, 214, 425, 325)):
        cv2.rectangle(plan, (x0, y0), (x1, y1), 0, -1)
    cv2.rectangle(plan, (221, 120), (243, 160), 0, -1)  # doors
    cv2.rectangle(plan, (221, 250), (243, 290), 0, -1)
    walls = plan > 0
    inside = np.zeros_like(walls)
    inside[74:326, 74:426] = True
    surface = walls & (
        np.asarray(cv2.dilate((inside & ~walls).view(np.uint8), np.ones((3, 3)))) > 0
    )
    matrix = matrix_of(1.1, 25.0, False)
    matrix[:, 2] = [160.0, -90.0]
    flags, size = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP, (480, 480)
    occupied = cv2.warpAffine(surface.astype(np.uint8), matrix, size, flags=flags) > 0
    free = cv2.warpAffine((inside & ~walls).astype(np.uint8), matrix, size, flags=flags) > 0
    seen = Seen(occupied, free & ~occupied)
    found = align(seen, walls, scale=told)
    assert found.best.scale == pytest.approx(1.1, rel=0.0005)
    assert off(found.best.matrix, matrix, seen) < 0.5


def test_a_known_scale_is_not_left_while_polishing() -> None:
    """Whatever the walls pull at, no place is lost for having drifted from the scale."""
    walls, seen, _ = case(FLAT, 0.8, 37.0, False, (0, 0, 0.6, 0.7))
    low, high = 0.8 / 1.04 / 1.03, 0.8 * 1.04 * 1.03
    assert all(low <= p.scale <= high for p in align(seen, walls, scale=0.8).places)


def test_a_frame_around_a_map_is_not_seen(tmp_path: Path) -> None:
    walls, seen, true = case(FLAT, 0.8, 37.0, False, (0, 0, 1, 1))
    for unknown in (205, 255):  # as a map's, and a picture without any unknown
        grey = np.where(seen.occupied, 0, np.where(seen.free, 255, unknown)).astype(np.uint8)
        cv2.rectangle(grey, (1, 1), (grey.shape[1] - 2, grey.shape[0] - 2), 0, 2)
        (tmp_path / "m.png").write_bytes(png(grey))
        again = seen_in_map(open_plan(tmp_path / "m.png", Notes()))
        assert not again.occupied[:, :4].any()
        assert again.occupied.sum() == pytest.approx(seen.occupied.sum(), rel=0.1)
        found = align(again, walls)
        assert off(found.best.matrix, true, seen) < 3.0


def test_a_building_drawn_to_its_edges_is_no_frame() -> None:
    walls = plan_of(FLAT)[BORDER:-BORDER, BORDER:-BORDER]
    walls[:3] = walls[-3:] = True
    walls[:, :3] = walls[:, -3:] = True
    assert np.array_equal(unframed(walls), walls)


def test_extracted_walls_tell_where_ink_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second try is on the walls, and only where the first did not settle it."""
    from replay.registration import aligning

    walls, seen, true = case(FLAT, 0.9, 20.0, False, (0, 0, 1, 1))
    rng = np.random.default_rng(3)
    littered = np.where(walls, 0, 255).astype(np.uint8)
    for _ in range(2500):  # furniture, hatching, text
        x, y = (int(rng.uniform(0, n)) for n in walls.shape[::-1])
        cv2.rectangle(littered, (x, y), (x + 14, y + 9), 0, 1)
    plan = Plan(
        Path("a.png"), littered, np.where(littered < 128, 100, 0).astype(np.int8), None,
        Pose(0.0, 0.0, 0.0), False, {},
    )  # fmt: skip
    assert not align(seen, plan.wall).confident
    bare = replace(plan, occupancy=np.where(walls, 100, 0).astype(np.int8))
    monkeypatch.setattr(aligning, "taken_apart", lambda plan, method, notes: (bare, None))
    found = aligning.align_drawing(seen, plan)
    assert found.confident
    assert off(found.best.matrix, true, seen) < 3.0
    monkeypatch.setattr(aligning, "taken_apart", lambda plan, method, notes: (plan, None))
    assert not aligning.align_drawing(seen, plan).confident


def test_a_log_finds_its_place_on_a_bare_plan(tmp_path: Path) -> None:
    """From metres, y up: by the plan's own yaml a metre is 50 px, and (-2.4, -4.4) m the corner."""
    samples = Path(__file__).resolve().parent.parent.parent / "sample_logs"
    bare = tmp_path / "bare.png"
    bare.write_bytes((samples / "plan.png").read_bytes())
    yaml = (samples / "plan.yaml").read_text()
    assert "resolution: 0.02" in yaml
    assert "origin: [-2.40, -4.40, 0" in yaml
    code, stdout, _ = run(str(samples / "turtlebot.mcap"), "--prior", str(bare), "--json")
    assert code == 0
    said = json.loads(stdout)
    # 440 rows: the lower left corner is pixel (-0.5, 439.5)
    true = np.array([[50.0, 0.0, 2.4 * 50 - 0.5], [0.0, -50.0, 439.5 - 4.4 * 50]])
    corners = np.array([[-2, -4, 1], [9, -4, 1], [-2, 4, 1], [9, 4, 1]], dtype=float)
    assert np.abs(corners @ (np.array(said["matrix"]) - true).T).max() < 3.0
    assert said["mirrored"] is False
    assert said["scale"] == pytest.approx(50.0, rel=0.005)
    assert said["turn_deg"] == pytest.approx(0.0, abs=0.3)


def test_places_are_apart_and_the_likeliest_comes_first() -> None:
    walls, seen, _ = case(FLAT, 1.1, 10.0, False, (0, 0, 0.6, 0.7))
    found = align(seen, walls)
    assert isinstance(found, Alignment)
    assert len(found.places) > 1
    assert all(off(p.matrix, found.best.matrix, seen) > 20.0 for p in found.places[1:])
    assert found.best.score == max(place.score for place in found.places)


@pytest.mark.slow
def test_eighteen_real_maps_find_their_places(shared_data: Path) -> None:
    """Halmstad-Robot-Maps; the keypoints of both pictures were associated by hand."""
    from scripts.score_align import halmstad_maps, halmstad_off

    data = shared_data / "plans_with_logs"
    for building, name in halmstad_maps():
        maps = data / "halmstad" / "maps" / building
        plan = open_plan(maps / "layout" / f"{building}_layout.png", Notes())
        seen = seen_in_map(open_plan(maps / "pseudo_occupancy" / f"{name}.png", Notes()))
        found = align(seen, plan.wall)
        assert halmstad_off(data, building, name, found.best.matrix) < 30.0, name
        assert found.confident, name


@pytest.mark.slow
def test_a_map_of_a_real_flat_is_not_at_home_in_an_office(shared_data: Path) -> None:
    maps = shared_data / "plans_with_logs" / "halmstad" / "maps"
    plan = open_plan(maps / "E5" / "layout" / "E5_layout.png", Notes())
    for i in (1, 3):
        path = maps / "HIH" / "pseudo_occupancy" / f"HIH_{i:02d}.png"
        assert not align(seen_in_map(open_plan(path, Notes())), plan.wall).confident
