"""What Rerun is given: the recording is whole, holds the scores, and shows without complaint."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from scipy.stats import chi2

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Frame, Particles, Pose, Scan
from formats.results.file import read_result
from formats.sensing.ends import end_points
from replay import deviation, run, view
from replay.pictures import FALSE, FOUND, MISSED, coloured, error_kinds, errors, png, thinning
from replay.placing import corners_of
from replay.viewing.looking import record
from replay.viewing.particles import Trail
from replay.viewing.process import start_unseen
from replay.viewing.scene import Block, Outline, ellipses, label_corners

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
MAPS = ("with_prior", "without_prior", "errors")
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
    maps = column(path, "/plan/with_prior/map", "buffer")
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
    assert read_result(result.facts["result"]).facts["scans"] == 9
    assert len(said) == 1
    assert said[0].startswith("viewer: gone")


def test_an_address_that_is_none_is_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not the address of a viewer"):
        run(SAMPLES / "turtlebot.mcap", output=tmp_path / "x.mcap", connect="localhost")
    assert not list(tmp_path.iterdir())


def pictured(picture: Path, recording: Path, at: float) -> list[str]:
    """What the viewer complains of while it makes a picture; a skip where it cannot."""
    said: list[str] = []
    try:
        view(recording, screenshot=picture, at=at, say=said.append)
    except FormatError as error:
        if "the viewer did not start" in str(error):
            pytest.skip(f"no viewer without a Vulkan driver (mesa-vulkan-drivers): {error}")
        raise
    return said


def test_views_do_not_complain(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    assert pictured(tmp_path / "view.png", recorded[0], 50.0) == []
    assert (tmp_path / "view.png").stat().st_size > 50_000


def test_several_results_lie_side_by_side(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    result = recorded[1].facts["result"]
    copy = shutil.copy(result, tmp_path / "other.replay.mcap")
    assert view([result, copy], rrd=tmp_path / "two.rrd") == [tmp_path / "two.rrd"]
    curve = recorded[1].counts["bayes"].sum(axis=1)
    for root in ("/run0", "/run1"):
        shown = column(tmp_path / "two.rrd", f"{root}/score/recall/bayes", "scalars")
        assert np.allclose(np.ravel(shown), curve[:, 0] / (curve[:, 0] + curve[:, 2]))
    assert pictured(tmp_path / "two.png", tmp_path / "two.rrd", 50.0) == []


def test_a_result_without_its_log_gives_what_the_run_gave(
    recorded: tuple[Path, Any], tmp_path: Path
) -> None:
    view(recorded[1].facts["result"], rrd=tmp_path / "again.rrd")
    for entity in ("/score/f2/bayes", "/score/precision/none", "/coverage/seen"):
        live = column(recorded[0], entity, "scalars")
        assert len(live) == recorded[1].facts["scans"]
        assert column(tmp_path / "again.rrd", entity, "scalars") == live
    for entity in MAPS:
        live = column(recorded[0], f"/plan/{entity}/map", "buffer")
        assert len(live) > 50
        assert column(tmp_path / "again.rrd", f"/plan/{entity}/map", "buffer") == live
    scans = column(tmp_path / "again.rrd", "/plan/robot/scan", "positions")
    live = column(recorded[0], "/plan/robot/scan", "positions")
    assert 50 < len(scans) < len(live)  # those of keyframes
    assert all(scan in live for scan in scans[:5])


def test_what_cannot_be_viewed_is_said(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="not a result"):
        view(SAMPLES / "turtlebot.mcap", rrd=tmp_path / "x.rrd")
    with pytest.raises(FormatError, match="holds no results"):
        view(SAMPLES, rrd=tmp_path / "x.rrd")
    with pytest.raises(UsageError, match="cannot be shown as one"):
        view([recorded[0], recorded[1].facts["result"]], rrd=tmp_path / "x.rrd")
    with pytest.raises(UsageError, match="give --screenshot"):
        view(recorded[0], at=3.0)
    with pytest.raises(UsageError, match="too many side by side"):
        view([recorded[1].facts["result"]] * 7, rrd=tmp_path / "x.rrd")
    assert not list(tmp_path.iterdir())


def test_a_long_run_stays_within_its_budget(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    """A budget of a tenth of what the whole takes, and the last map all the same."""
    whole = tmp_path / "whole.rrd"
    result = recorded[1].facts["result"]
    view(result, rrd=whole)
    budget = whole.stat().st_size / 10 / 1e6
    view(result, rrd=tmp_path / "small.rrd", viewer_budget=budget)
    fixed = 250_000  # bytes of the layout and of what holds throughout, whatever the budget
    assert (tmp_path / "small.rrd").stat().st_size < budget * 1e6 + fixed
    few = column(tmp_path / "small.rrd", "/plan/errors/map", "buffer")
    every = column(whole, "/plan/errors/map", "buffer")
    assert 1 <= len(few) < len(every)
    assert few[-1] == every[-1]


def test_a_drawing_process_that_is_killed_costs_the_recording_alone(tmp_path: Path) -> None:
    killed: list[int] = []
    before = children_of_this()  # of tests before this one, in the same process

    def kill(done: int, expected: int) -> None:
        if done > expected // 2 and not killed:
            (drawing,) = children_of_this() - before
            os.kill(drawing, signal.SIGKILL)
            killed.append(drawing)

    notes = Notes()
    result = run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        output=tmp_path / "run.replay.mcap",
        rrd=tmp_path / "run.rrd",
        notes=notes,
        progress=kill,
    )
    assert killed
    assert [path.name for path in tmp_path.iterdir()] == ["run.replay.mcap"]
    assert read_result(tmp_path / "run.replay.mcap").facts["scans"] == 807
    assert result.facts["written"] == [str(tmp_path / "run.replay.mcap")]
    assert [str(note) for note in notes.of("lost")] == [
        f"{tmp_path / 'run.rrd'}: not written: the process that draws ended with code -9; "
        "the result is whole"
    ]


def children_of_this() -> set[int]:
    """Ids of this process's children, whichever of its threads began them."""
    texts = (path.read_text() for path in Path("/proc/self/task").glob("*/children"))
    return {int(word) for text in texts for word in text.split()}


@pytest.mark.slow
def test_a_viewer_that_stops_costs_a_line(tmp_path: Path) -> None:
    """It is there, takes the connection, and then hangs: the run and its recording end well."""
    said: list[str] = []
    try:
        address, viewer = start_unseen()
    except FormatError as error:
        pytest.skip(f"no viewer without a Vulkan driver (mesa-vulkan-drivers): {error}")
    try:
        os.kill(viewer.pid, signal.SIGSTOP)
        run(
            SAMPLES / "turtlebot.mcap",
            SAMPLES / "plan.png",
            output=tmp_path / "run.replay.mcap",
            rrd=tmp_path / "run.rrd",
            connect=address,
            say=said.append,
        )
    finally:
        viewer.kill()
        viewer.wait()
    assert len(said) == 1
    assert said[0].startswith("viewer: gone")
    assert read_result(tmp_path / "run.replay.mcap").facts["scans"] == 807
    assert len(column(tmp_path / "run.rrd", "/score/f2/bayes", "scalars")) == 807


def test_a_viewer_that_is_killed_costs_a_line(tmp_path: Path) -> None:
    said: list[str] = []
    try:
        address, viewer = start_unseen()
    except FormatError as error:
        pytest.skip(f"no viewer without a Vulkan driver (mesa-vulkan-drivers): {error}")

    def kill(done: int, expected: int) -> None:
        if done > expected // 2:
            viewer.kill()
            viewer.wait()

    run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        output=tmp_path / "run.replay.mcap",
        connect=address,
        progress=kill,
        say=said.append,
    )
    assert viewer.returncode is not None
    assert len(said) == 1
    assert said[0].startswith("viewer: gone")
    assert read_result(tmp_path / "run.replay.mcap").facts["scans"] == 807


def test_viewers_listen_on_the_loopback_interface_alone() -> None:
    try:
        address, viewer = start_unseen()
    except FormatError as error:
        pytest.skip(f"no viewer without a Vulkan driver (mesa-vulkan-drivers): {error}")
    port = int(address.split(":")[2].split("/")[0])
    try:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        hosts = {row[1].split(":")[0] for row in rows if row[1].endswith(f":{port:04X}")}
        assert hosts == {"0100007F"}  # 127.0.0.1, the bytes the other way round
    finally:
        viewer.kill()
        viewer.wait()


@pytest.mark.slow
def test_a_full_disk_costs_the_recording_alone(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=9m", "tmpfs", small], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip(f"no file system of 9 MB could be mounted: {done.stderr.decode().strip()}")
    notes = Notes()

    def fill(done: int, expected: int) -> None:
        if done > expected // 2:
            with contextlib.suppress(OSError), (small / "else").open("wb", buffering=0) as file:
                while True:
                    file.write(bytes(1 << 16))

    try:
        run(
            SAMPLES / "turtlebot.mcap",
            SAMPLES / "plan.png",
            output=tmp_path / "run.replay.mcap",
            rrd=small / "run.rrd",
            notes=notes,
            progress=fill,
        )
        assert [path.name for path in small.iterdir()] == ["else"]
    finally:
        subprocess.run(["umount", small], check=True)
    assert read_result(tmp_path / "run.replay.mcap").facts["scans"] == 807
    (lost,) = notes.of("lost")
    assert "the result is whole" in str(lost)


def test_north_is_up(tmp_path: Path) -> None:
    """A plan whose lower half is wall must show dark below and light above."""
    import cv2

    from tests.worlds import world_png

    rows = ["." * 40] * 20 + ["#" * 40] * 20
    world_png(tmp_path / "plan.png", "\n".join(rows))
    run(
        SAMPLES / "turtlebot.mcap",
        tmp_path / "plan.png",
        plan_resolution=0.3,
        plan_origin=Pose(-6.0, -6.0, 0.0),
        region="image",
        max_range=0.1,  # nothing is seen, the plan stands
        no_return="ignore",
        output=tmp_path / "half.mcap",
        rrd=tmp_path / "half.rrd",
        duration=1.0,
    )
    pictured(tmp_path / "half.png", tmp_path / "half.rrd", 0.0)
    shown = cv2.imread(str(tmp_path / "half.png"), cv2.IMREAD_GRAYSCALE)
    assert shown is not None
    first = shown[70:640, 150:500].astype(float)  # the view of the map with prior
    assert first[: len(first) // 2 - 40].mean() > first[len(first) // 2 + 40 :].mean() + 30


def lines(recording: Path, entity: str) -> list[Any]:
    """The strips that hold throughout."""
    for chunk in rr.chunk.RrdReader(str(recording)).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if name.endswith("strips")]
        if names and "frame" not in batch.schema.names:
            return list(batch[names[0]].to_pylist()[0])
    return []


def test_walls_show_what_became_of_them(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    """The same lines live, from the result, and in the table of `replay deviation`."""
    path, result = recorded
    told = deviation(result.facts["result"], tmp_path)
    view(result.facts["result"], rrd=tmp_path / "again.rrd")
    for state in ("confirmed", "not there", "unseen"):
        ends = [[wall["from"], wall["to"]] for wall in told["walls"] if wall["state"] == state]
        assert ends
        for recording in (path, tmp_path / "again.rrd"):
            shown = lines(recording, f"/plan/walls/{state.replace(' ', '_')}")
            assert np.allclose(shown, ends, atol=2e-3)


def test_an_ellipse_holds_95_percent() -> None:
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    covariance = np.zeros((1, 3, 3))
    covariance[0, :2, :2] = turn @ np.diag([4.0, 0.25]) @ turn.T
    (outline,) = ellipses(covariance, np.array([[10.0, -3.0]]))
    own = (outline - (10.0, -3.0)) @ turn  # along its axes
    assert np.allclose(
        (own[:, 0] / 2.0) ** 2 + (own[:, 1] / 0.5) ** 2, chi2.ppf(0.95, 2), atol=1e-3
    )
    assert np.allclose(outline[0], outline[-1])


def test_covariances_are_drawn_where_a_localiser_tells_them(tmp_path: Path) -> None:
    result = run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        poses="amcl",
        every=200,
        duration=30.0,
        output=tmp_path / "run.replay.mcap",
        rrd=tmp_path / "run.rrd",
    )
    view(result.facts["result"], rrd=tmp_path / "again.rrd")
    live = column(tmp_path / "run.rrd", "/plan/robot/covariance", "strips")
    back = read_result(result.facts["result"])
    assert back.covariances is not None
    assert np.allclose(
        np.array(live)[:, 0], ellipses(back.covariances, back.poses[:, :2]), atol=1e-4
    )
    assert np.allclose(column(tmp_path / "again.rrd", "/plan/robot/covariance", "strips"), live)
    drawn = column(tmp_path / "run.rrd", "/plan/particles", "positions")
    again = column(tmp_path / "again.rrd", "/plan/particles", "positions")
    assert drawn
    for live_ones, then in zip(drawn, again, strict=True):
        assert np.allclose(live_ones, then, atol=1e-5)
    spread = [np.ptp(np.array(points), axis=0).max() for points in drawn if points]
    assert spread[0] > 5.0  # anywhere on the plan at first


def test_particles_are_shown_until_the_robot_has_gone_on() -> None:
    """Frames every second, 0.4 m apart; samples at the first, between the sixth and the eighth."""

    def at(frames: list[int]) -> Block:
        x = 0.4 * np.array(frames)
        poses = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
        return Block(np.array(frames), 10**9 * np.array(frames), poses, {}, [None] * len(frames))

    samples = [
        Particles(int(1e9 * seconds), np.full((2, 3), seconds)) for seconds in (0.0, 5.5, 5.7, 7.0)
    ]
    trail = Trail(samples)
    first, second, third = (
        [(row, len(points), float(points[0, 0]) if len(points) else None) for row, points in rows]
        for rows in (trail.rows(at([0, 1])), trail.rows(at([2, 3, 4, 5, 6])), trail.rows(at([7])))
    )
    assert first == [(0, 2, 0.0)]
    assert second == [(1, 0, None), (4, 2, 5.7)]  # frame 3 is 1.2 m on
    assert third == [(0, 2, 7.0)]


def test_places_of_the_plan_are_outlined(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    """A picture of 2 by 1 m at 10 px a metre whose lower left corner lies at -0.55, -0.45 m."""
    matrix = np.array([[10.0, 0.0, 5.0], [0.0, -10.0, 95.0]])
    corners = corners_of(matrix, (100, 200))
    assert corners == [[-0.55, -0.45], [19.45, -0.45], [19.45, 9.55], [-0.55, 9.55]]
    found = read_result(recorded[1].facts["result"])
    found.facts["places"] = [
        {"score": 0.7, "corners": corners},
        {"score": 0.6, "corners": [[0, 0], [0, 1], [1, 1], [1, 0]]},
    ]
    record([found], tmp_path / "run.rrd", None)
    taken = found.map_to_plan.inverse().apply(corners)
    (shown,) = lines(tmp_path / "run.rrd", "/plan/places/0")
    assert np.allclose(shown, [*taken, taken[0]], atol=1e-5)
    assert lines(tmp_path / "run.rrd", "/plan/places/1")


def test_labels_of_places_that_nearly_coincide_lie_apart() -> None:
    square = np.array([[0.0, 0.0], [0.0, 4.0], [6.0, 4.0], [6.0, 0.0]])
    places = [Outline(0.9 - 0.1 * k, square + 0.01 * k) for k in range(4)]
    found = label_corners(places)
    # by hand: the farthest corner from the first, then those 4 m from the one or the other
    expected = np.array([[0.0, 0.0], [6.01, 4.01], [0.02, 4.02], [6.03, 0.03]])
    assert np.allclose(found, expected)
    turned = [Outline(0.5, np.roll(square, -k, axis=0)) for k in range(4)]
    assert len({tuple(corner) for corner in label_corners(turned)}) == 4


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


def test_kinds_of_errors_are_those_of_their_definition() -> None:
    """All eight cases of occupied, truth and scored."""
    cases = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)], dtype=bool).T[:, None]
    kinds = error_kinds(*cases)
    assert kinds.dtype == np.uint8
    #                     nothing scored is 0; scored: nothing, missed, false, found
    assert kinds.tolist() == [[0, 0, 0, 2, 0, 3, 0, 1]]


def test_end_points_are_where_beams_ended() -> None:
    ranges = np.array([1, np.inf, np.nan, 0.01, 2], np.float32)
    scan = Scan(np.array([0.0, 0.1, 0.2, 0.3, np.pi / 2]), np.full(5, 0.1), ranges, 0.1, 10.0)
    frame = Frame(0, Pose(1.0, 2.0, np.pi / 2), scan)
    assert np.allclose(end_points(frame), [[1.0, 3.0], [-1.0, 2.0]], atol=1e-6)


def test_png_keeps_red_and_thins_large_maps() -> None:
    import cv2

    cells = coloured((2, 2), [(np.array([[True, False], [False, False]]), (250, 20, 10))])
    back = cv2.imdecode(np.frombuffer(png(cells), np.uint8), cv2.IMREAD_UNCHANGED)
    assert back is not None
    assert back[0, 0].tolist() == [10, 20, 250, 255]  # OpenCV reads blue first
    assert thinning((2000, 2000)) == 1
    assert thinning((4001, 4001)) == 3
