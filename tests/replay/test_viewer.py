"""What Rerun is given: the recording is whole, holds the scores, and shows without complaint."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from formats.errors import FormatError
from replay import run
from replay.pictures import FALSE, FOUND, MISSED, coloured, end_points, errors, png, thinning

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
RERUN = Path(sys.executable).with_name("rerun")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    folder = tmp_path_factory.mktemp("view")
    result = run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        truth=SAMPLES / "truth.png",
        output=folder / "run.replay.mcap",
        rrd=folder / "run.rrd",
        every=5,
    )
    return folder / "run.rrd", result


def column(recording: Path, entity: str, component: str) -> list[Any]:
    """All values of a component of an entity, in the order of frames."""
    rows = []
    for chunk in rr.chunk.RrdReader(str(recording)).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if "frame" in batch.schema.names:
            names = [name for name in batch.schema.names if name.endswith(component)]
            rows += list(zip(batch["frame"].to_pylist(), batch[names[0]].to_pylist(), strict=True))
    return [value for _, value in sorted(rows, key=lambda row: row[0])]


def test_the_recording_is_whole(recorded: tuple[Path, Any]) -> None:
    done = subprocess.run(
        [RERUN, "rrd", "verify", recorded[0]], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not list(recorded[0].parent.glob("*.part*"))


def test_the_series_are_the_scores(recorded: tuple[Path, Any]) -> None:
    path, result = recorded
    for name in ("none", "bayes", "paper"):
        shown = column(path, f"/score/f2/{name}", "scalars")
        tp, fp, fn, _ = result.counts[name].sum(axis=1).T
        expected = 5 * tp / np.maximum(5 * tp + 4 * fn + fp, 1)  # Equation 14 in counts
        assert np.allclose(np.ravel(shown), expected)


def test_maps_come_at_keyframes_and_at_the_end(recorded: tuple[Path, Any]) -> None:
    path, result = recorded
    maps = column(path, "/plan/with_prior/map", "blob")
    assert 50 < len(maps) <= 101
    assert len(maps) < result.facts["scans"]


def test_an_existing_recording_is_kept(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="--force"):
        run(
            SAMPLES / "turtlebot.mcap",
            SAMPLES / "plan.png",
            output=tmp_path / "x.mcap",
            rrd=recorded[0],
        )
    assert not list(tmp_path.iterdir())


def test_a_viewer_that_is_not_there_costs_a_line(tmp_path: Path) -> None:
    said: list[str] = []
    result = run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        output=tmp_path / "run.replay.mcap",
        connect="rerun+http://127.0.0.1:9/proxy",  # nobody listens on the discard port
        every=100,
        say=said.append,
    )
    assert Path(result.facts["result"]).exists()
    assert len(said) == 1
    assert said[0].startswith("viewer: gone")


def test_views_do_not_complain(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    from scripts.figures import screenshot

    picture = tmp_path / "view.png"
    try:
        complaints = screenshot(recorded[0], picture, at_s=50.0)
    except ConnectionError as error:
        pytest.skip(f"no viewer without a Vulkan driver (mesa-vulkan-drivers): {error}")
    assert complaints == []
    assert picture.stat().st_size > 50_000


def test_north_is_up(tmp_path: Path) -> None:
    """A plan whose lower half is wall must show dark below and light above."""
    import cv2

    from formats.errors import Notes
    from formats.frame import Frame, Pose, Scan
    from formats.plan_file import open_plan
    from replay.mapper import Mapper
    from replay.pipeline import steps
    from replay.viewer import Scene, Viewer
    from replay.world import build_world
    from scripts.figures import screenshot
    from tests.worlds import world_png

    rows = ["." * 40] * 20 + ["#" * 40] * 20
    plan = open_plan(
        world_png(tmp_path / "plan.png", "\n".join(rows)),
        Notes(),
        resolution=0.1,
        origin=Pose(7.0, 3.0, 0.0),
    )
    world = build_world(plan, None, (8.0, 6.0, 8.0, 6.0), 1.0, Notes(), region="image")
    nothing = Scan(np.zeros(1), np.full(1, 0.1), np.full(1, np.nan), 0.1, 1.0)
    with Viewer(Scene("half", world, "# half"), path=tmp_path / "half.rrd") as viewer:
        frame = Frame(0, Pose(8.0, 6.0, 0.0), nothing)
        for step in steps(iter([frame]), 1, world, Mapper(world.geometry)):
            viewer.write(step)
    try:
        screenshot(tmp_path / "half.rrd", tmp_path / "half.png", at_s=0.0)
    except ConnectionError as error:
        pytest.skip(f"no viewer without a Vulkan driver (mesa-vulkan-drivers): {error}")
    shown = cv2.imread(str(tmp_path / "half.png"), cv2.IMREAD_GRAYSCALE)
    assert shown is not None
    first = shown[70:640, 100:540].astype(float)  # the view of the map with prior
    assert first[: len(first) // 2 - 40].mean() > first[len(first) // 2 + 40 :].mean() + 30


def test_errors_are_coloured_by_kind() -> None:
    occupied = np.array([[True, True, False, False, True]])
    truth = np.array([[True, False, True, False, True]])
    scored = np.array([[True, True, True, True, False]])
    shown = errors(occupied, truth, scored)[0]
    clear = (0, 0, 0, 0)
    assert [tuple(c) for c in shown] == [
        (*FOUND, 255),
        (*FALSE, 255),
        (*MISSED, 255),
        clear,
        clear,
    ]


def test_end_points_are_where_beams_ended() -> None:
    from formats.frame import Frame, Pose, Scan
    from formats.result import Step

    ranges = np.array([1, np.inf, np.nan, 0.01, 2], np.float32)
    scan = Scan(np.array([0.0, 0.1, 0.2, 0.3, np.pi / 2]), np.full(5, 0.1), ranges, 0.1, 10.0)
    frame = Frame(0, Pose(1.0, 2.0, np.pi / 2), scan)
    assert np.allclose(end_points(Step(0, frame, {}, {})), [[1.0, 3.0], [-1.0, 2.0]], atol=1e-6)


def test_png_keeps_red_and_thins_large_maps() -> None:
    import cv2

    cells = coloured((2, 2), [(np.array([[True, False], [False, False]]), (250, 20, 10))])
    back = cv2.imdecode(np.frombuffer(png(cells), np.uint8), cv2.IMREAD_UNCHANGED)
    assert back is not None
    assert back[0, 0].tolist() == [10, 20, 250, 255]  # OpenCV reads blue first
    assert thinning((2000, 2000)) == 1
    assert thinning((4001, 4001)) == 3
