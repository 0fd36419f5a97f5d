"""Depth images and clouds in the one frame stream, and the maps that they make."""

from __future__ import annotations

import zlib
from math import remainder, tau
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Frame, Pose
from formats.results.file import read_result
from formats.sensing.echo import Echo
from formats.stream import frames, survey
from replay.cli import _exit_code as main
from scripts.flat import cast
from scripts.kinect import CELL, Cells, boxes, f2, sensor_xy
from scripts.kinect import mapped as map_of
from tests.depth_worlds import as_image
from tests.drives import points
from tests.flat_sensors import (
    COLUMNS,
    FOCAL,
    ROWS,
    camera_info,
    depth,
    drive_of,
    half_view,
    mount,
    picture,
    poses,
)
from tests.ros_logs import RosLog

TOPIC = "/camera/depth/image_raw"
FRAME = "camera_depth_optical_frame"


# ---------------------------------------------------------------------------- the maps of a drive


def mapped(log: RosLog, folder: Path, name: str) -> tuple[Cells, Cells]:
    """Cells that are occupied, and cells that were seen, of a log that is written and mapped."""
    return map_of(log.write(folder / f"{name}.mcap"), folder / f"{name}.replay.mcap")


def far_share(columns: int) -> float:
    """Share of the laser's beams that end where half a beam of the camera is wider than a cell."""
    wide = half_view(columns)
    limit = CELL / (0.5 / (FOCAL * columns / COLUMNS))
    angles = np.linspace(-wide, wide, COLUMNS)
    ranges = [cast(boxes(), *sensor_xy(p), p[2] + angles, 20.0) for p in poses()[1]]
    return float((np.array(ranges) > limit).mean())


@pytest.mark.parametrize(
    ("columns", "step"), [(COLUMNS, 75), pytest.param(640, 50, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("kind", ["depth", "cloud"])
def test_maps_of_a_kinect_and_of_a_laser_agree(
    tmp_path: Path, columns: int, step: int, kind: str
) -> None:
    """A return stands at the middle of its beam, half a beam aside at most: within one cell but
    for what lies too far. Their share is the bound; 1 % are left to cells at whose edges hits and
    misses nearly tie."""
    laser = mapped(drive_of("laser", step, columns), tmp_path, "laser")
    other = mapped(drive_of(kind, step, columns), tmp_path, kind)
    assert len(laser[0]) > 800
    exact, near = f2(laser, other, 0), f2(laser, other, 1)
    print(
        f"{kind} of {columns}: F2 {exact:.3f}, within a cell {near:.3f}, {far_share(columns):.3f}"
    )
    assert near >= 1.0 - max(far_share(columns), 0.01)
    moved = {(r + 2, c + 2) for r, c in other[0]}, other[1]
    assert f2(laser, moved, 1) < exact  # the measure sees a map that is 0.1 m off


def wall_distance(at: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
    """(n,) m from points to the nearest box."""
    low, high = boxes()[None, :, :2], boxes()[None, :, 2:]
    outside = np.maximum(np.maximum(low - at[:, None], at[:, None] - high), 0.0)
    return np.hypot(*np.moveaxis(outside, -1, 0)).min(axis=1)


@pytest.mark.parametrize("kind", ["depth", "cloud"])
def test_every_return_lies_on_a_wall(kind: str) -> None:
    """At most half a beam aside, and the rounding to mm and of the mount to 0.1 mrad."""
    log = drive_of(kind, step=500)
    found = list(frames(log.opened()))
    assert len(found) == len(poses(500)[0])
    returns = 0
    for frame, pose in zip(found, poses(500)[1], strict=True):
        assert frame.pose == pytest.approx((*sensor_xy(pose), remainder(pose[2], tau)), abs=1e-9)
        ranges = frame.scan.ranges.astype(np.float64)
        good = np.isfinite(ranges)
        aside = 2 * ranges[good] * np.sin(frame.scan.widths[good] / 4) + 0.003
        assert (wall_distance(points(frame)[good]) <= aside).all()
        returns += int(good.sum())
    assert returns > 30 * len(found)


# ---------------------------------------------------------------------------- one still camera


def still(count: int = 3, **fields: Any) -> RosLog:
    """A robot that stands in the flat with a camera."""
    log = RosLog()
    log.static("base_footprint", FRAME, mount())
    for k in range(count):
        log.tf(k / 10, "map", "base_footprint", poses()[1][0].tolist())
        picture(log, k / 10, depth(poses()[1][0]), FRAME, **fields)
    return log


def first(log: RosLog, **options: Any) -> tuple[Frame, list[str]]:
    notes = Notes()
    found = list(frames(log.opened(), notes, **options))
    return found[0], [f"{note.kind}: {note}" for note in notes if note.kind != "info"]


def test_heights_count_from_the_base_whatever_the_height_of_the_map() -> None:
    log = still()
    plain, _ = first(log)
    for _, topic, _, _, fields in log.happened:
        if topic == "/tf":
            fields["transforms"][0]["transform"]["translation"]["z"] = 7.5
    lifted, _ = first(log)
    np.testing.assert_array_equal(lifted.scan.ranges, plain.scan.ranges)


def test_the_slab_is_a_choice() -> None:
    """A floor seen below the default slab is a wall to whoever asks for it."""
    usual, _ = first(still())
    low, _ = first(still(), scan_height=(-0.05, 1.0))
    near = np.nanmin(low.scan.ranges)
    # The lowest row looks down by the pitch and half the view: the floor at 0.6 m / tan of it.
    assert near == pytest.approx(0.6 / np.tan(np.radians(8.0) + np.arctan(29.5 / FOCAL)), abs=0.02)
    assert np.nanmin(usual.scan.ranges) > near
    with pytest.raises(UsageError, match=r"--scan-height 1,0\.5 is not"):
        survey(still().opened(), Notes(), scan_height=(1.0, 0.5))


def test_a_sensor_pose_is_the_floor_of_its_camera() -> None:
    """Taken as level at x = 0.1 m: what lies within 0.1 m of the camera's height counts."""
    log = still()
    found, _ = first(log, sensor_pose=Pose(0.1, 0.0, 0.0), scan_height=(-0.1, 0.1))
    x, y, yaw = found.pose
    assert (x, y) == pytest.approx(sensor_xy(poses()[1][0]))
    assert yaw == pytest.approx(poses()[1][0][2])
    assert np.isfinite(found.scan.ranges).any()


# ---------------------------------------------------------------------------- frame by frame


def test_mono16_is_depth_with_a_warning_and_colour_is_none() -> None:
    plain, said = first(still())
    assert said == []
    frame, said = first(still(encoding="mono16"))
    np.testing.assert_array_equal(frame.scan.ranges, plain.scan.ranges)
    assert said == [f"warning: memory: {TOPIC}: mono16 taken as depth in mm"]
    with pytest.raises(FormatError, match=r"no scans: .*Image x3.*; rgb8 is no depth"):
        first(still(encoding="rgb8"))
    with pytest.raises(FormatError, match=r"no scan can be used: encoding 'rgb8' is no depth"):
        first(still(encoding="rgb8"), scan=TOPIC)


def test_colour_and_infrared_beside_depth_are_no_choice() -> None:
    log = still()
    for name, encoding in (("/camera/rgb/image_raw", "rgb8"), ("/camera/ir/image_raw", "mono16")):
        fields: dict[str, Any] = {
            "height": 1,
            "width": 1,
            "encoding": encoding,
            "step": 3,
            "data": [0, 0, 0],
        }
        for k in range(3):
            header = log.header(k / 10, FRAME, None)
            log.say(k / 10, name, "sensor_msgs/msg/Image", header=header, **fields)
    assert survey(log.opened(), Notes()).choice.scan.name == TOPIC


BAD: list[tuple[dict[str, Any], str]] = [
    ({"data": [0] * 9}, "lost: memory: {}: message not readable: too few pixels at 0.00 s"),
    ({"step": 2}, "skipped: memory: {}: step of 2 bytes is short of 80 pixels at 0.00 s"),
    (
        {"height": 1 << 31, "width": 1 << 31, "step": 0, "data": []},
        "skipped: memory: {}: implausible image of 2147483648 x 2147483648 pixels at 0.00 s",
    ),
    ({"height": 0, "width": 0}, "skipped: memory: {}: image without pixels at 0.00 s"),
]


@pytest.mark.parametrize(("fields", "said"), BAD)
def test_impossible_images_are_counted(fields: dict[str, Any], said: str) -> None:
    log = still()
    next(row[4] for row in log.happened if row[1] == TOPIC).update(fields)
    notes = Notes()
    assert len(list(frames(log.opened(), notes))) == 2
    assert [f"{note.kind}: {note}" for note in notes if note.kind != "info"] == [said.format(TOPIC)]


def test_an_image_of_zeros_is_no_reading() -> None:
    frame, said = first(still(data=np.zeros(2 * ROWS * COLUMNS, np.uint8)))
    assert np.isnan(frame.scan.ranges).all()
    words = "no return from 0.1 to 1 m above the floor: see --scan-height"
    assert said == [f"warning: memory: {TOPIC}: {words}"]


@pytest.mark.parametrize(
    ("encoding", "big", "padding"), [("16UC1", False, 6), ("16UC1", True, 0), ("32FC1", True, 3)]
)
def test_padding_and_byte_order(encoding: str, big: bool, padding: int) -> None:
    metres = np.round(depth(poses()[1][0]), 3)
    plain, _ = first(still())
    image = as_image(metres, encoding, big, padding)
    given: dict[str, Any] = {
        "encoding": encoding,
        "is_bigendian": int(big),
        "step": image.step,
        "data": image.data,
    }
    frame, said = first(still(**given))
    np.testing.assert_allclose(frame.scan.ranges, plain.scan.ranges, atol=1e-5)
    assert said == []


def test_camera_info_that_is_absent_or_impossible() -> None:
    with pytest.raises(FormatError, match=r"looked for /camera/depth/camera_info; found none"):
        first(still(info=False))
    for k, words in (([0.0] * 9, "no focal length"), ([np.nan] * 9, "not finite")):
        log = still(info=False)
        camera_info(log, 0.0, log.header(0.0, FRAME, None), k=k)
        with pytest.raises(FormatError, match=words):
            first(log)


def test_camera_info_named_or_of_another_size_or_frame() -> None:
    plain, _ = first(still())
    log = still(info=False)
    size = {"height": 2 * ROWS, "width": 2 * COLUMNS}
    k = [2 * FOCAL, 0, COLUMNS - 0.5, 0, 2 * FOCAL, ROWS - 0.5, 0, 0, 1]
    camera_info(log, 0.0, log.header(0.0, "elsewhere", None), k=k, **size)
    frame, said = first(log)
    np.testing.assert_allclose(frame.scan.ranges, plain.scan.ranges, atol=1e-6)
    assert said == [
        f"warning: memory: {TOPIC}: camera_info of 160 x 120 scaled to 80 x 60 pixels",
        f"warning: memory: {TOPIC}: image in frame '{FRAME}', its camera_info in 'elsewhere'",
    ]
    moved = [
        (t, topic.replace("depth/camera", "other/camera"), *r) for t, topic, *r in log.happened
    ]
    log.happened = moved  # type: ignore[assignment]
    with pytest.raises(FormatError, match=r"found /camera/other/camera_info; name it with --cam"):
        first(log)
    assert len(first(log, camera_info="camera/other/camera_info")[0].scan.ranges)
    with pytest.raises(UsageError, match=r"/x: no such camera_info; there are: /camera/other/"):
        first(log, camera_info="/x")


def test_camera_info_that_changes_counts_as_it_began() -> None:
    log = still()
    camera_info(log, 0.3, log.header(0.3, FRAME, None), k=[9, 0, 9, 0, 9, 9, 0, 0, 1])
    frame, said = first(log)
    np.testing.assert_array_equal(frame.scan.ranges, first(still())[0].scan.ranges)
    assert said == [
        "warning: memory: /camera/depth/camera_info: camera_info changes: the first one counts"
    ]


def test_a_frame_that_is_no_optical_one_is_warned_of() -> None:
    log = still()
    log.happened.pop(0)
    log.static("base_footprint", FRAME, (0.1, 0.0, 0.6, 0.0, 0.0, 0.0))
    assert any("is its frame an optical one" in line for line in first(log)[1])


def packed(change: Any = lambda png: png) -> RosLog:
    """The same pictures as image_transport compresses them, one of them changed."""
    import cv2

    log = still()
    png = bytes(cv2.imencode(".png", np.round(depth(poses()[1][0]) * 1000).astype(np.uint16))[1])
    for i, (t, topic, _, latched, fields) in enumerate(log.happened):
        if topic == TOPIC:
            made = {
                "header": fields["header"],
                "format": "16UC1; compressedDepth png",
                "data": np.frombuffer(bytes(12) + (change(png) if t == log.ns(0.1) else png), "u1"),
            }
            name, kind = f"{TOPIC}/compressedDepth", "sensor_msgs/msg/CompressedImage"
            log.happened[i] = t, name, kind, latched, made
    return log


def bomb(png: bytes) -> bytes:
    """The same PNG with a header of 30000 x 30000 pixels."""
    head = b"IHDR" + (30000).to_bytes(4, "big") * 2 + png[24:29]
    return png[:12] + head + zlib.crc32(head).to_bytes(4, "big") + png[33:]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda png: png, ""),
        (lambda png: png[:99], "damaged PNG"),
        (lambda png: png[:99] + b"x" + png[100:], "damaged PNG"),
        (bomb, "PNG of too many pixels"),
    ],
)
def test_compressed_depth(change: Any, problem: str) -> None:
    notes = Notes()
    found = list(frames(packed(change).opened(), notes))
    np.testing.assert_array_equal(found[0].scan.ranges, first(still())[0].scan.ranges)
    assert len(found) == (2 if problem else 3)
    wanted = [f"memory: {TOPIC}/compressedDepth: message not readable: {problem} at 0.10 s"]
    assert [str(note) for note in notes.of("lost")] == (wanted if problem else [])


def test_pixels_damaged_under_sound_checksums_are_counted_once() -> None:
    def change(png: bytes) -> bytes:
        at = png.index(b"IDAT")
        size = int.from_bytes(png[at - 4 : at], "big")
        body = b"IDAT" + b"\xff" * size
        return png[:at] + body + zlib.crc32(body).to_bytes(4, "big") + png[at + 8 + size :]

    notes = Notes()
    drive = survey(packed(change).opened(), notes)
    for _ in range(2):
        assert len(list(drive.frames())) == 2
    assert notes.total("lost") == 1


# ---------------------------------------------------------------------------- echoes, and the CLI


@pytest.mark.parametrize(("echo", "metres"), [("first", 1.0), ("last", 3.0), ("strongest", 2.0)])
def test_a_run_with_each_echo(tmp_path: Path, echo: Echo, metres: float) -> None:
    """One beam ahead, three echoes: the wall of the map is where the asked one came from."""
    log = RosLog()
    for k in range(3):
        log.tf(k / 10, "map", "base_link", (0.0, 0.02, 0.0))
        log.say(
            k / 10,
            "/echoes",
            "sensor_msgs/msg/MultiEchoLaserScan",
            header=log.header(k / 10, "base_link", None),
            angle_increment=0.01,
            range_max=10.0,
            ranges=[{"echoes": np.array([1.02, 2.02, 3.02], "f4")}],
            intensities=[{"echoes": np.array([5, 9, 1], "f4")}],
        )
    path, out = log.write(tmp_path / "echo.mcap"), tmp_path / "out.mcap"
    assert main(["run", str(path), "--echo", echo, "--quiet", "-o", str(out)]) == 0
    found = read_result(out)
    rows, cols = np.nonzero(found.evidence().counts[0])
    x = found.geometry.x + cols * CELL
    assert len(rows) == 1
    assert x[0] == pytest.approx(metres, abs=1e-9)


def test_a_depth_log_through_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = still().write(tmp_path / "kinect.mcap")
    out = ["--quiet", "-o", str(tmp_path / "out.mcap")]
    told = ["--scan-height", "0.2,0.8", "--camera-info", "/camera/depth/camera_info"]
    assert main(["run", str(path), *told, *out]) == 0
    assert f"scans from {TOPIC} (Image: the only Image)" in capsys.readouterr().out
    assert main(["run", str(path), "--scan-height", "1", *out, "--force"]) == 2
    assert "is not LOW,HIGH" in capsys.readouterr().err
