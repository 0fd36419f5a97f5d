"""CARMEN logs: lines written by hand, their poses and scans, and every way in which they break."""

from __future__ import annotations

import bz2
import gzip
import random
from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.carmen import log as carmen
from formats.carmen.lines import LINES, Malformed, parse
from formats.errors import FormatError, Notes
from formats.frame import Frame
from formats.grid import Geometry
from formats.stream import Drive, frames, open_log, survey
from replay.mapper import Mapper
from tests.ros_logs import RosLog

HEADER = "# CARMEN Logfile\n# message formats defined: PARAM SYNC ODOM FLASER RLASER\n"
RANGES = " ".join(["2.5"] * 180)


def flaser(t: float, laser: str, robot: str, ranges: str = RANGES, word: str = "FLASER") -> str:
    return f"{word} {len(ranges.split())} {ranges} {laser} {robot} {t:.6f} host {t:.6f}\n"


def odom(t: float, pose: str) -> str:
    return f"ODOM {pose} 0 0 0 {t:.6f} host {t:.6f}\n"


def write(tmp_path: Path, text: str, name: str = "drive.log") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def opened(tmp_path: Path, text: str, name: str = "drive.log") -> tuple[carmen.CarmenLog, Notes]:
    notes = Notes()
    log = open_log(write(tmp_path, text, name), notes)
    assert isinstance(log, carmen.CarmenLog)
    return log, notes


def surveyed(tmp_path: Path, text: str, name: str = "a.log", **options: Any) -> tuple[Drive, Notes]:
    log, notes = opened(tmp_path, text, name)
    return survey(log, notes, **options), notes


def lost(notes: Notes) -> dict[str, tuple[int, str]]:
    return {note.problem: (note.count, note.at) for note in notes.of("lost")}


def counts(log: carmen.CarmenLog) -> dict[str, int]:
    found: dict[str, int] = {}
    for message in log.messages():
        found[message.topic.name] = found.get(message.topic.name, 0) + 1
    return found


def drive(count: int = 5, start: float = 100.0) -> str:
    """A robot that drives along x by 0.1 m in 0.2 s, its laser 0.25 m ahead."""
    lines = [HEADER, "PARAM robot_frontlaser_offset 0.25 nohost 0\n"]
    for k in range(count):
        x, t = 0.1 * k, start + 0.2 * k
        lines += [odom(t - 0.05, f"{x} 0 0"), flaser(t, f"{x + 0.25} 0 0", f"{x} 0 0")]
    return "".join(lines)


def test_scans_have_the_poses_of_their_lines(tmp_path: Path) -> None:
    found, notes = surveyed(tmp_path, drive())
    assert [note.kind for note in notes if note.kind not in ("info", "warning")] == []
    assert str(found.choice.source) == "tf odom > base_link"
    np.testing.assert_allclose(found.poses[:, 0], [0.25, 0.35, 0.45, 0.55, 0.65], atol=1e-9)
    assert found.times_ns.tolist() == [100_000_000_000 + 200_000_000 * k for k in range(5)]
    scan = next(found.frames()).scan
    assert scan.bearings[0] == pytest.approx(-pi / 2)
    assert scan.bearings[90] == pytest.approx(0.0)  # of 180 readings the 91st looks ahead
    assert scan.widths[0] == pytest.approx(pi / 180)
    assert scan.max_range == 80.0
    assert scan.ranges.tolist() == [2.5] * 180


@pytest.mark.parametrize(
    ("count", "start", "last"), [(180, -90, 89), (181, -90, 90), (361, -90, 90), (401, -50, 50)]
)
def test_the_number_of_readings_tells_their_angles(count: int, start: float, last: float) -> None:
    line = parse(flaser(1.0, "0 0 0", "0 0 0", " ".join(["1"] * count)).encode())
    assert np.degrees(line.start) == pytest.approx(start)
    assert np.degrees(line.start + line.step * (count - 1)) == pytest.approx(last)


def test_a_mapper_s_log_has_its_poses_in_the_map_frame(tmp_path: Path) -> None:
    text = drive() + "NEFF 12.5\n"
    found, notes = surveyed(tmp_path, text)
    assert str(found.choice.source) == "tf map > base_link"
    assert found.choice.in_map
    assert "corrected: the log is a mapper's" in " ".join(map(str, notes))
    named, _ = surveyed(tmp_path, drive(), "intel-corrected.log")
    assert named.choice.in_map


def test_a_mapper_s_odometry_does_not_say_how_the_robot_moved(tmp_path: Path) -> None:
    text = HEADER
    for k in range(20):  # between corrections it goes on from the last one, too far to the left
        text += odom(k / 5 - 0.01, f"{0.1 * k} 0.2 0.3")
        text += flaser(k / 5, f"{0.1 * k} 0 0", f"{0.1 * k} 0 0")
    found, _ = surveyed(tmp_path, text + "NEFF 12.5\n", poses="odometry")
    np.testing.assert_allclose(found.poses, [[0.1 * k, 0, 0] for k in range(20)], atol=1e-9)
    driven, _ = surveyed(tmp_path, text, "driven.log", poses="odometry")
    assert not driven.choice.in_map


def test_corrected_lasers_beside_raw_odometry_are_taken_as_they_are(tmp_path: Path) -> None:
    text = HEADER + "PARAM robot_frontlaser_offset 0.25 nohost 0\n"
    for k in range(6):  # the laser turns away from the odometry
        text += flaser(k / 5, f"{0.1 * k} {0.05 * k * k} {0.1 * k}", f"{0.1 * k} 0 0")
    found, _ = surveyed(tmp_path, text)
    assert found.choice.in_map
    expected = [[0.1 * k, 0.05 * k * k, 0.1 * k] for k in range(6)]
    np.testing.assert_allclose(found.poses, expected, atol=1e-9)


def test_the_mounting_comes_from_the_poses_of_robot_and_laser(tmp_path: Path) -> None:
    # robot at (1, 2) heads along y; 0.3 m ahead and 0.1 m to its left (so at smaller x), turned
    text = HEADER + flaser(1.0, f"0.9 2.3 {pi}", f"1 2 {pi / 2}") * 3
    log, notes = opened(tmp_path, text)
    found = survey(log, notes, pose="tf")
    mount = found.choice.sensor_pose
    assert mount == pytest.approx((0.3, 0.1, pi / 2), abs=1e-6)


def test_a_rear_laser_looks_back(tmp_path: Path) -> None:
    text = HEADER
    for k in range(4):
        text += flaser(k / 5, f"{0.1 * k - 0.3} 0 {pi}", f"{0.1 * k} 0 0", word="RLASER")
    found, _ = surveyed(tmp_path, text)
    assert found.choice.scan.name == "RLASER"
    assert abs(found.poses[0, 2]) == pytest.approx(pi)
    assert found.poses[0, 0] == pytest.approx(-0.3)


def robot_laser(t: float, remissions: str = "0", word: str = "ROBOTLASER1") -> str:
    setup = f"0 {-pi / 2:.9f} {pi:.9f} {pi / 4:.9f} 20.5 0.01 0"
    poses = f"{0.2 + t} 1 0.5 {t} 1 0.5"
    return f"{word} {setup} 5 1 2 3 4 21 {remissions} {poses} 0 0 0.3 0.3 100 {t:.6f} h {t:.6f}\n"


def test_robotlaser_lines_say_their_own_angles_and_limits(tmp_path: Path) -> None:
    text = "".join(robot_laser(t, "2 7 8") for t in (1.0, 1.2)) + robot_laser(1.4)
    found, notes = surveyed(tmp_path, text)
    assert lost(notes) == {}
    scan = next(found.frames()).scan
    assert scan.bearings == pytest.approx([-pi / 2, -pi / 4, 0, pi / 4, pi / 2], abs=1e-6)
    assert scan.max_range == 20.5
    assert scan.ranges.tolist() == [1, 2, 3, 4, 21]
    assert found.poses[0] == pytest.approx([1.2, 1.0, 0.5])


def test_the_oldest_robotlaser_lines_have_no_remissions(tmp_path: Path) -> None:
    line = robot_laser(1.0).replace(" 21 0 ", " 21 ").replace(" 100 1.0", " 1.0")
    assert parse(line.encode()) == parse(robot_laser(1.0).encode())


def test_rawlaser_lines_are_joined_with_odometry(tmp_path: Path) -> None:
    text = "PARAM robot_frontlaser_offset 0.5 nohost 0\n"
    setup = f"0 {-pi / 2:.9f} {pi:.9f} {pi / 4:.9f} 20.5 0.01 0"
    for k in range(5):
        text += odom(k / 5, f"{0.1 * k} 0 0")
        text += f"RAWLASER1 {setup} 5 1 2 3 4 5 0 {k / 5 + 0.1} h {k / 5 + 0.1}\n"
    found, _ = surveyed(tmp_path, text)
    assert found.choice.source.topic is not None
    assert found.choice.source.topic.name == "ODOM"
    np.testing.assert_allclose(found.poses[:, 0], [0.55, 0.65, 0.75, 0.85], atol=1e-6)


def test_wean_hall_s_lines_are_in_centimetres(tmp_path: Path) -> None:
    ranges = " ".join(["250"] * 180)
    text = "O 100 200 0 0.5\n"
    text += "".join(f"L {100 + k} 200 0 {125 + k} 200 0 {ranges} {k / 5:.6f}\n" for k in range(4))
    found, _ = surveyed(tmp_path, text)
    assert found.choice.scan.name == "L"
    assert found.poses[0] == pytest.approx([1.25, 2.0, 0.0])
    assert found.choice.sensor_pose == pytest.approx((0.25, 0.0, 0.0))
    assert next(found.frames()).scan.ranges[0] == pytest.approx(2.5)


def test_truepos_of_the_simulator_is_preferred_to_odometry(tmp_path: Path) -> None:
    text = drive()
    for k in range(6):
        text += f"TRUEPOS {5 + 0.1 * k} 1 0 0 0 0 {100 + 0.2 * k} h {100 + 0.2 * k}\n"
    found, _ = surveyed(tmp_path, text)
    assert str(found.choice.source) == "TRUEPOS map > base_link"
    assert found.poses[0] == pytest.approx([5.25, 1.0, 0.0])


def test_lines_come_in_the_order_of_their_times_also_where_the_host_s_clock_is_another(
    tmp_path: Path,
) -> None:
    first = "ODOM 0 0 0 0 0 0 976052857.3 nohost 0.000\n"
    late = "ODOM 2 0 0 0 0 0 976052857.9 nohost 0.600\n"
    early = "ODOM 1 0 0 0 0 0 976052857.6 nohost 0.300\n"
    log, _ = opened(tmp_path, first + late + early)
    assert [bytes(m.data).split()[1] for m in log.messages()] == [b"0", b"1", b"2"]
    assert log.container.start_ns == 976_052_857_300_000_000
    assert log.container.end_ns == 976_052_857_900_000_000


def test_times_that_lost_their_figures_are_replaced_by_the_order_of_lines(tmp_path: Path) -> None:
    text = HEADER
    for k in range(30):
        text += flaser(0.0, f"{0.1 * k} 0 0", f"{0.1 * k} 0 0").replace("0.000000", "1.13486e+09")
    found, notes = surveyed(tmp_path, text)
    assert len(found) == 30
    assert np.diff(found.times_ns).tolist() == [100_000_000] * 29
    np.testing.assert_allclose(found.poses[:, 0], 0.1 * np.arange(30), atol=1e-9)
    assert "times say nothing: lines are taken as 0.1 s apart" in " ".join(map(str, notes))


BROKEN: dict[str, tuple[str, str]] = {
    "cut": (flaser(9.0, "0 0 0", "0 0 0")[:300] + "\n", "cut short, or its count is wrong"),
    "count too large": (
        flaser(9.0, "0 0 0", "0 0 0").replace("FLASER 180", "FLASER 181"),
        "cut short, or its count is wrong",
    ),
    "count too small": (
        flaser(9.0, "0 0 0", "0 0 0").replace("FLASER 180", "FLASER 179"),
        "cut short, or its count is wrong",
    ),
    "huge count": (
        flaser(9.0, "0 0 0", "0 0 0").replace("FLASER 180", "FLASER 99999999999999999999"),
        "cut short, or its count is wrong",
    ),
    "endless count": ("FLASER " + "9" * 9000 + " 1 2\n", "no count of readings"),
    "negative count": (
        flaser(9.0, "0 0 0", "0 0 0").replace("FLASER 180", "FLASER -1"),
        "cut short, or its count is wrong",
    ),
    "no number": (
        flaser(9.0, "0 0 0", "0 0 0").replace(" 2.5 2.5 ", " 2.5 2.x5 ", 1),
        "a word that should be a number",
    ),
    "time nan": ("ODOM 0 0 0 0 0 0 nan h 1\n", "a time that is none"),
    "time 1e300": ("ODOM 0 0 0 0 0 0 1e300 h 1\n", "a time that is none"),
    "odometry cut": ("ODOM 0 0 0 0 0\n", "cut short, or its count is wrong"),
    "binary": ("\x01\x02\xff\xfe garbage\n", "line that is no message of CARMEN"),
    "lower case": ("flaser 1 2 3\n", "line that is no message of CARMEN"),
    "wean cut": ("L 1 2 3 4 5 6 7 8 9\n", "cut short, or not of 180 readings"),
    "robotlaser cut": (robot_laser(3.0)[:60] + "\n", "no count of readings"),
    "remissions lie": (robot_laser(3.0, "7 1"), "cut short, or its count is wrong"),
    "too long": ("FLASER 600000" + " 1" * 600_000 + "\n", "line of more than 1048576 bytes"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_line_costs_itself_and_is_counted_with_its_number(
    name: str, tmp_path: Path
) -> None:
    line, problem = BROKEN[name]
    good = drive(5)
    log, notes = opened(tmp_path, good + line + drive(3, start=200.0).removeprefix(HEADER))
    assert counts(log)["FLASER"] == 8
    assert lost(notes) == {problem: (1, f"line {good.count(chr(10)) + 1}")}
    assert not log.container.whole


def test_a_last_line_that_is_cut_is_lost_and_the_rest_is_there(tmp_path: Path) -> None:
    text = drive(5)
    log, notes = opened(tmp_path, text[:-400])
    assert counts(log) == {"FLASER": 4, "FLASER/tf": 4, "ODOM": 5, "PARAM/tf_static": 1}
    assert log.container.state == "cut at line 13"
    assert lost(notes) == {"cut short, or its count is wrong": (1, "line 13")}
    log, notes = opened(tmp_path, text.removesuffix("\n"))
    assert counts(log)["FLASER"] == 5
    assert lost(notes) == {}


def test_nan_in_readings_and_poses_is_data(tmp_path: Path) -> None:
    text = drive(5).replace(" 2.5 2.5 ", " nan inf ", 1)
    text += flaser(101.0, "nan 0 0", "nan 0 0") + flaser(101.2, "0.7 0 0", "0.5 0 nan")
    found, notes = surveyed(tmp_path, text)
    first = next(found.frames()).scan.ranges
    assert np.isnan(first[0])
    assert np.isinf(first[1])
    assert lost(notes) == {}
    assert "dropped" in " ".join(map(str, notes))


def test_huge_ranges_are_no_warning_of_numpy(tmp_path: Path) -> None:
    found, _ = surveyed(tmp_path, drive().replace("2.5 2.5 ", "1e300 -1e300 ", 1))
    assert next(found.frames()).scan.ranges[:2].tolist() == [np.inf, -np.inf]


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_packed_logs_are_unpacked(pack: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / "drive.clf.packed"
    path.write_bytes(pack(drive().encode()))
    assert len(list(frames(path))) == 5


def test_other_text_is_not_taken_for_a_log(tmp_path: Path) -> None:
    for text in ("hello\nworld\n", "L is a letter\nO is another\n", "", "a,b\n1,2\n"):
        with pytest.raises(FormatError, match=r"is text, not a log|is empty"):
            open_log(write(tmp_path, text, "text"), Notes())


def test_windows_line_ends_are_no_matter(tmp_path: Path) -> None:
    found, notes = surveyed(tmp_path, drive().replace("\n", "\r\n"))
    assert len(found) == 5
    assert lost(notes) == {}


def test_random_damage_ends_in_counted_losses_or_an_error_of_ours(tmp_path: Path) -> None:
    rng, text = random.Random(7), drive(8).encode()
    for _ in range(150):
        data = bytearray(text)
        for _ in range(rng.randint(1, 20)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path = tmp_path / "damaged.log"
        path.write_bytes(data[: rng.randint(1, len(data))] if rng.random() < 0.3 else data)
        notes = Notes()
        try:
            found = sum(1 for _ in frames(path, notes))
        except FormatError:
            continue
        assert found <= 8


@pytest.mark.parametrize("word", sorted(LINES))
def test_every_kind_of_line_refuses_its_own_halves(word: bytes) -> None:
    whole = {
        b"ODOM": odom(1.0, "1 2 3").encode(),
        b"TRUEPOS": b"TRUEPOS 1 2 3 4 5 6 1.0 h 1.0",
        b"O": b"O 1 2 3 4",
        b"L": b"L 1 2 3 4 5 6 " + b"100 " * 180 + b"7",
    }.get(word)
    if word in (b"FLASER", b"RLASER"):
        whole = flaser(1.0, "1 2 3", "4 5 6", word=word.decode()).encode()
    elif word.startswith(b"ROBOT"):
        whole = robot_laser(1.0, word=word.decode()).encode()
    elif whole is None:
        whole = word + b" 0 -1.5 3.1 0.7 20 0.01 0 5 1 2 3 4 5 0 1.0 h 1.0"
    assert parse(whole).stamp in (1.0, 4.0, 7.0)
    words = whole.split()
    for keep in range(1, len(words)):
        with pytest.raises(Malformed):
            parse(b" ".join(words[:keep]))


def test_the_same_drive_as_a_bag_gives_the_same_frames_and_the_same_map(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    start, step = (float(np.float32(angle)) for angle in (-pi / 2, pi / 180))  # as LaserScan has it
    ros, text = RosLog(), HEADER
    ros.static("base_link", "laser", (0.0, 0.0, 0.0))
    for k in range(12):
        t, x, y, yaw = 0.2 * k, round(0.13 * k, 2), round(0.01 * k * k, 2), round(0.05 * k, 2)
        ranges = rng.uniform(0.5, 6.0, 180).astype(np.float32)
        ros.tf(t, "map", "base_link", (x, y, yaw))
        ros.scan(t, ranges, angle_min=start, increment=step, range_max=80.0, range_min=0.0)
        at, told = f"{ros.start_ns / 1e9 + t:.6f}", " ".join(f"{r:.9g}" for r in ranges)
        setup = f"0 {start!r} 3.1 {step!r} 80.0 0.01 0 180 {told} 0"
        text += f"ROBOTLASER1 {setup} {x} {y} {yaw} {x} {y} {yaw} 0 0 0 0 0 {at} h {at}\nNEFF 3\n"
    one = list(frames(ros.write(tmp_path / "drive.bag")))
    two = list(frames(write(tmp_path, text)))
    assert [frame.time_ns for frame in one] == [frame.time_ns for frame in two]
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(a.pose, b.pose, atol=1e-15)
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
        np.testing.assert_array_equal(a.scan.bearings, b.scan.bearings)
    np.testing.assert_array_equal(mapped(one), mapped(two))


def mapped(found: list[Frame]) -> Any:
    mapper = Mapper(Geometry(300, 300, 0.05, -7.0, -7.0), "beam")
    for frame in found:
        mapper.insert(frame)
    assert mapper.evidence.counts.sum() > 1000
    return mapper.evidence.counts


def test_real_logs_hold_what_their_index_says(shared_data: Path) -> None:
    expected = {
        "ple_corrected/intel-corrected.log.gz": (910, 180, True),
        "ple_corrected/csail-corrected.log.gz": (406, 361, True),
        "ple_corrected/freiburg-079-corrected.log.gz": (4791, 360, True),
        "cmu_wean/robotdata1.log.gz": (713, 180, False),
        "mola_radish/aces.clf.bz2": (7374, 180, False),
    }
    for name, (scans, beams, in_map) in expected.items():
        notes = Notes()
        found = survey(open_log(shared_data / "carmen" / name, notes), notes)
        assert (len(found), found.choice.in_map) == (scans, in_map)
        assert len(next(found.frames()).scan.ranges) == beams
        assert lost(notes) == {}


def test_intel_s_walls_are_thinnest_with_the_angles_as_read(shared_data: Path) -> None:
    found = list(frames(shared_data / "carmen/ple_corrected/intel-corrected.log.gz", Notes()))

    def cells(turned: float) -> int:
        """How many cells of 5 cm the returns within 8 m end in."""
        ends = []
        for frame in found:
            r = frame.scan.ranges.astype(np.float64)
            b = frame.scan.bearings[r < 8.0] + np.radians(turned)
            r = r[r < 8.0]
            ends.append(frame.pose.apply(np.stack([r * np.cos(b), r * np.sin(b)], axis=1)))
        return len(np.unique(np.floor(np.concatenate(ends) / 0.05).astype(int), axis=0))

    assert cells(0.0) < cells(1.0)
    assert cells(0.0) < cells(-1.0)
