"""`replay plan`: what it writes is what is drawn."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from formats.errors import FormatError, Notes
from formats.plan_file import open_plan
from replay import plan
from replay.planning import DOOR, read_drawing
from scripts.flat import DOORS, LEFT, LOW

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
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
