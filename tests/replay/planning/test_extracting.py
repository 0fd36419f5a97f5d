"""`replay plan`: what it writes is what is drawn."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from formats.errors import FormatError, Notes
from formats.plans.file import open_plan
from replay import plan
from replay.planning.extracting import DOOR, read_drawing
from replay.planning.pictures import LAYERS, WALLS, overlay
from scripts.flat import DOORS, LEFT, LOW

SAMPLES = Path(__file__).resolve().parents[3] / "sample_logs"
DRAWING = SAMPLES / "drawing.png"


def test_what_is_written_is_what_is_drawn(tmp_path: Path) -> None:
    facts = plan(DRAWING, output=tmp_path / "flat")
    assert facts["doors_count"] == len(DOORS)
    features = json.loads((tmp_path / "flat_plan.geojson").read_text())
    assert features["units"] == "m"
    doors = [f for f in features["features"] if f["properties"]["kind"] == "door"]
    hinges = np.array([f["geometry"]["coordinates"][0][0] for f in doors])
    for (x, y), _, _ in DOORS:
        assert np.hypot(*(hinges - [x + LEFT, y + LOW]).T).min() < 0.1
    assert all(abs(f["properties"]["width"] - 0.9) < 0.06 for f in doors)
    walls = open_plan(tmp_path / "flat_walls.yaml", Notes())
    truth = open_plan(SAMPLES / "plan.png", Notes())
    grown = np.kron(truth.wall, np.ones((2, 2), dtype=bool))
    both = (walls.wall & grown).sum()
    assert both / (walls.wall | grown).sum() > 0.97


def test_a_truth_scores_it(tmp_path: Path) -> None:
    import cv2

    truth = open_plan(SAMPLES / "plan.png", Notes())
    mask = np.kron(np.where(truth.wall, 0, 255), np.ones((2, 2))).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "walls.png"), mask)
    facts = plan(DRAWING, truth=tmp_path / "walls.png", output=tmp_path / "flat")
    assert set(facts["walls"]) == {"precision", "recall", "f1", "f1_3px", "iou"}
    assert facts["walls"]["f1_3px"] > 0.99


def test_doors_estimate_a_scale_that_nothing_says(tmp_path: Path) -> None:
    bare = tmp_path / "bare.png"
    bare.write_bytes(DRAWING.read_bytes())
    reading = read_drawing(open_plan(bare, Notes()))
    assert reading.resolution is not None
    assert abs(reading.resolution - 0.01 * DOOR / 0.9) < 0.0005  # doors of 0.9 m taken for 0.85
    assert "door widths" in reading.how


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    plan(DRAWING, output=tmp_path / "flat")
    with pytest.raises(FormatError, match="--force"):
        plan(DRAWING, output=tmp_path / "flat")
    plan(DRAWING, output=tmp_path / "flat", force=True)


def test_edits_show_in_all_that_is_written(tmp_path: Path) -> None:
    edits = tmp_path / "flat.edits"
    edits.write_text("remove door 240,560\nadd wall 400,100 400,300 20\n")
    plain = plan(DRAWING, output=tmp_path / "plain")
    edits.write_text(
        f"unit m\nremove door {DOORS[0][0][0] + LEFT},{DOORS[0][0][1] + LOW}\n"
        "unit px\nadd wall 400,120 400,300 20\n"
    )
    facts = plan(DRAWING, edits=edits, output=tmp_path / "flat")
    assert facts["edits"] == 2
    assert facts["doors_count"] == plain["doors_count"] - 1
    features = json.loads((tmp_path / "flat_plan.geojson").read_text())["features"]
    assert sum(f["properties"]["kind"] == "door" for f in features) == facts["doors_count"]
    walls = open_plan(tmp_path / "flat_walls.pgm", Notes())
    assert walls.wall[125:295, 392:409].all()


def test_the_overlay_shows_each_layer_and_names_it(tmp_path: Path) -> None:
    reading = read_drawing(open_plan(DRAWING, Notes()))
    picture = overlay(reading.drawing)[..., ::-1]  # red green blue
    rows, cols = reading.drawing.walls.shape
    assert picture.shape[0] > rows
    assert picture.shape[1] == cols
    far = np.ones((rows, cols), dtype=bool)  # from the triangles, which lie over all
    for door in reading.drawing.doors:
        x, y = np.rint(door.hinge).astype(int)
        reach = round(1.5 * door.width)
        far[max(0, y - reach) : y + reach, max(0, x - reach) : x + reach] = False
    assert (picture[:rows][far & reading.drawing.walls] == WALLS).all()
    for name, colour in LAYERS.items():
        layer = reading.drawing.layers.get(name)
        if layer is not None and layer.any():
            assert (picture[:rows][far & layer & ~reading.drawing.walls] == colour).all()
            assert (picture[rows:] == colour).all(axis=-1).any()  # its swatch


def test_without_a_door_or_a_wall_nothing_is_made_up(tmp_path: Path) -> None:
    walls = np.full((300, 400), 255, dtype=np.uint8)
    walls[60:68, 60:340] = walls[232:240, 60:340] = 0
    walls[60:240, 60:68] = walls[60:240, 332:340] = 0
    words = np.full((300, 400), 255, dtype=np.uint8)
    words[100:103, 100:112] = words[100:120, 105:108] = 0
    Image.fromarray(walls).save(tmp_path / "walls.png")
    Image.fromarray(words).save(tmp_path / "words.png")
    notes = Notes()
    facts = plan(tmp_path / "walls.png", output=tmp_path / "walls", notes=notes)
    assert facts["doors_count"] == 0
    assert facts["wall_pixels"] > 0
    assert facts["resolution"] is None
    assert facts["resolution_from"] == "not known: no door tells it"
    assert not any("no wall" in note.problem for note in notes.of("warning"))
    facts = plan(
        tmp_path / "words.png", output=tmp_path / "words", plan_resolution=0.01, notes=notes
    )
    assert facts["wall_pixels"] == 0
    assert any("no wall is found in it" in note.problem for note in notes.of("warning"))
