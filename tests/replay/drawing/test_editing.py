"""Edits by hand change what they say, where they say it, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from formats.errors import Notes
from formats.frame import Pose
from formats.plans.edits import PlanEdits, read_plan_edits
from formats.plans.plan import Plan
from replay.drawing import Door, Drawing
from replay.drawing.editing import edited, regions


def drawing() -> Drawing:
    """A wall across a sheet of 100 x 80 px in rows 40 to 44, and a door at its right."""
    walls = np.zeros((80, 100), dtype=np.bool_)
    walls[40:45] = True
    outline = np.zeros_like(walls)
    outline[30:60] = True
    text = np.zeros_like(walls)
    text[10:15, 10:15] = True
    layers = {"walls": walls.copy(), "text": text, "windows": np.zeros_like(walls)}
    return Drawing(walls, [Door((60.0, 42.0), (80.0, 42.0), -np.pi / 2)], outline, layers)


def after(folder: Path, *lines: str, notes: Notes | None = None) -> tuple[Drawing, PlanEdits]:
    path = folder / "a.edits"
    path.write_text("\n".join(lines))
    sheet = np.zeros((80, 100), dtype=np.uint8)
    plan = Plan(path, sheet, sheet.astype(np.int8), 0.1, Pose(0.0, 0.0, 0.0), True, {})
    edits = read_plan_edits(path)
    return edited(drawing(), edits, edits.on(plan), notes or Notes()), edits


def test_a_wall_is_added_where_its_band_is(tmp_path: Path) -> None:
    found, _ = after(tmp_path, "add wall 20,5 20,35 4")
    new = found.walls & ~drawing().walls
    rows, cols = np.nonzero(new)
    assert (rows.min(), rows.max()) == (5, 35)
    assert (cols.min(), cols.max()) == (18, 22)
    assert new.sum() == 31 * 5
    assert found.outline[new].all()


def test_a_wall_round_a_corner_has_no_notch(tmp_path: Path) -> None:
    found, _ = after(tmp_path, "add wall 20,20 40,20 40,36 6")
    assert found.walls[18:22, 20:42].all()
    assert found.walls[20, 43]
    assert not found.walls[10, 40]


def test_a_removed_wall_is_gone_in_its_band_alone_and_shown(tmp_path: Path) -> None:
    found, _ = after(tmp_path, "remove wall 30,42 50,42 6")
    assert not found.walls[40:45, 30:51].any()
    assert found.walls[40:45, :29].all()
    assert found.walls[40:45, 52:].all()
    assert found.layers["edited"][40:45, 30:51].all()
    assert found.outline[42, 40]  # still building


def test_an_added_door_opens_the_wall_and_is_a_door(tmp_path: Path) -> None:
    found, _ = after(tmp_path, "add door 10,42 30,42 right")
    assert not found.walls[40:45, 11:30].any()
    door = found.doors[-1]
    assert (door.hinge, door.end) == ((10.0, 42.0), (30.0, 42.0))
    assert door.opened == pytest.approx((10.0, 62.0))  # to the right of the way along x, y down


def test_a_door_is_removed_by_a_place_in_it_and_its_walls_stay(tmp_path: Path) -> None:
    notes = Notes()
    found, _ = after(tmp_path, "remove door 65,38", notes=notes)
    assert found.doors == []
    assert (found.walls == drawing().walls).all()
    assert not list(notes)


def test_no_door_to_remove_is_a_warning_with_its_line(tmp_path: Path) -> None:
    notes = Notes()
    found, _ = after(tmp_path, "", "remove door 10,10", notes=notes)
    assert found.doors == drawing().doors
    (said,) = notes.of("warning")
    assert "a.edits: line 2: there is no door" in str(said)


def test_windows_are_added_to_walls_and_removed(tmp_path: Path) -> None:
    found, _ = after(tmp_path, "add window 20,42 40,42 6")
    assert found.layers["windows"][40:45, 20:41].all()
    assert not found.walls[40:45, 20:41].any()
    again, _ = after(tmp_path, "add window 20,42 40,42 6", "remove window 20,42 40,42 7")
    assert not again.layers["windows"].any()


def test_regions_change_the_building(tmp_path: Path) -> None:
    corners = "50,20 90,20 90,70 50,70"
    added, _ = after(tmp_path, f"add region {corners}")
    assert added.outline[20:71, 50:91].all()
    assert (added.walls == drawing().walls).all()
    removed, _ = after(tmp_path, f"remove region {corners}")
    assert not removed.outline[20:71, 50:91].any()
    assert not removed.walls[40:45, 50:91].any()
    assert removed.doors == []  # its opening lies in the region
    cleared, _ = after(tmp_path, f"clear region {corners}")
    assert cleared.outline[20:71, 50:91].all()
    assert not cleared.walls[40:45, 50:91].any()


def test_edits_are_replayed_in_their_order(tmp_path: Path) -> None:
    corners = "50,20 90,20 90,70 50,70"
    one, _ = after(tmp_path, f"clear region {corners}", "add wall 60,30 80,30 4")
    other, _ = after(tmp_path, "add wall 60,30 80,30 4", f"clear region {corners}")
    assert one.walls[30, 70]
    assert not other.walls[30, 70]
    _, edits = after(tmp_path, f"add region {corners}", f"remove region {corners}")
    inside, outside = regions((80, 100), edits.edits)
    assert not inside.any()
    assert outside[50, 70]


def test_no_pixel_is_in_two_layers_after_edits(tmp_path: Path) -> None:
    found, _ = after(tmp_path, "add wall 5,12 30,12 8", "add window 40,42 60,42 6")
    total = np.sum([mask.astype(int) for mask in found.layers.values()], axis=0)
    assert total.max() == 1
    assert found.layers["walls"][12, 12]  # letters under a wall that was added
