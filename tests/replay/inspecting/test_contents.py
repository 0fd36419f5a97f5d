"""What `replay info` says of drives whose every fault is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from formats.errors import Notes
from replay.cli import cli
from replay.inspecting.checks import Check
from replay.inspecting.contents import Inspection, inspect
from tests.drives import drive
from tests.ros_logs import RosLog

FAR = [1.0, 2.0, inf, nan]


def steps(
    log: RosLog, first: int, last: int, *, moved: float = 0.0, parent: str = "map", **scan: Any
) -> RosLog:
    """A robot that drives at 0.5 m/s with a scan each 0.1 s, no two scans alike."""
    for k in range(first, last):
        log.tf(k / 10, parent, "base_link", (moved + 0.05 * k, 0.0, 0.0))
        log.scan(k / 10, [1.0 + 0.001 * k, 2.0, inf, nan], **scan)
    log.tf(last / 10, parent, "base_link", (moved + 0.05 * last, 0.0, 0.0))
    return log


def good() -> RosLog:
    log = RosLog()
    log.static("base_link", "laser", (0.2, 0.0, 0.0))
    return steps(log, 0, 40)


def inspected(log: RosLog, **options: Any) -> Inspection:
    return inspect(log.opened(), Notes(), **options)


def check(found: Inspection, name: str) -> Check:
    return next(check for check in found.checks if check.name == name)


def info(*words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["info", *map(str, words)], standalone_mode=False)


def test_a_good_drive_passes_every_check() -> None:
    found = inspected(good())
    assert found.usable
    assert found.problem is None
    assert [str(check) for check in found.checks if not check.ok] == []
    assert {check.name: check.text for check in found.checks} == {
        "order": "",
        "stamps": "0.00 s before log times",
        "gaps": "max 0.10 s",
        "rate": "10.0 Hz",
        "repeats": "",
        "poses": "40 of 40 scans",
        "jumps": "",
        "beams": "4",
        # 2 of 4 beams return; the median return of a scan is that of 1.0 and 2.0, about 1.52
        "ranges": "50% returns, 25% saw nothing, 25% nan, median 1.51 m",
        "fresh": "",
        "damage": "",
    }
    assert (found.scan, found.pose) == ("/scan", "tf")


def test_topics_say_what_passed_on_them() -> None:
    log = good()
    log.odometry(0.0, (0.0, 0.0, 0.0))
    log.odometry(2.0, (1.0, 0.0, 0.0))
    log.odometry(2.5, (1.0, 0.0, 0.0))
    found = {topic["name"]: topic for topic in inspected(log).facts()["topics"]}
    assert list(found) == ["/odom", "/scan", "/tf", "/tf_static"]
    scan, odom = found["/scan"], found["/odom"]
    assert (scan["count"], scan["beams"], scan["frame"]) == (40, 4, "laser")
    assert scan["rate"] == pytest.approx(10.0)
    assert scan["range_max"] == pytest.approx(10.0)
    assert scan["longest_gap"] == pytest.approx(0.1)
    assert odom["rate"] == pytest.approx(2 / 2.5)  # two steps in 2.5 s
    assert odom["longest_gap"] == pytest.approx(2.0)
    assert odom["says"] == "odom > base_link"
    assert found["/tf"]["transforms"] == [["map", "base_link", 41]]
    assert found["/tf_static"]["transforms"] == [["base_link", "laser", 1]]


def late() -> RosLog:
    log = good()
    log.tf(5.0, "map", "base_link", (2.0, 0.0, 0.0))
    log.scan(4.1, FAR, at=3.65)  # after the scan of 3.9 s
    return log


def gap() -> RosLog:
    return steps(good(), 500, 510)


def twice() -> RosLog:
    log = good()
    log.scan(4.0, FAR, at=3.9)
    return log


def teleport() -> RosLog:
    return steps(good(), 41, 80, moved=7.0)


def uncovered() -> RosLog:
    log = good()
    log.scan(4.3, FAR)
    log.scan(4.4, FAR)
    return log


def frozen() -> RosLog:
    return drive()  # the same five ranges 20 times


def frozen_on_the_move() -> RosLog:
    """Faster and faster: `run` de-skews each scan by another motion."""
    log = RosLog()
    log.static("base_link", "laser", (0.2, 0.0, 0.0))
    for k in range(21):
        log.tf(k / 10, "map", "base_link", (0.01 * k * k, 0.0, 0.0))
        if k < 20:
            log.scan(k / 10, [1.0, 2.0, 3.0, 4.0, 5.0], time_increment=0.02)
    return log


def millimetres() -> RosLog:
    log = good()
    log.happened = [row for row in log.happened if row[1] != "/scan"]
    for k in range(40):
        log.scan(k / 10, [1000.0 + k, 2000.0], range_max=10_000.0)
    return log


def blind() -> RosLog:
    log = good()
    log.happened = [row for row in log.happened if row[1] != "/scan"]
    for k in range(40):
        log.scan(k / 10, [inf] * 99 + [1.0 + 0.01 * k])
    return log


def unstamped() -> RosLog:
    log = good()
    for row in log.happened:
        for part in [row[4], *row[4].get("transforms", [])]:
            if "header" in part:
                part["header"]["stamp"] = {"sec": 0, "nanosec": 0}
    return log


def varying() -> RosLog:
    log = good()
    log.tf(5.0, "map", "base_link", (2.0, 0.0, 0.0))
    log.scan(4.0, [1.0, 2.0, 3.0, 4.0, 5.0])
    return log


FAULTS: dict[str, tuple[Callable[[], RosLog], str, str]] = {
    "late": (late, "order", "1 out of order"),
    "gap": (gap, "gaps", "max 46.10 s after 3.90 s"),
    "twice": (twice, "repeats", "1 of 41 scans have the stamp of another"),
    "teleport": (teleport, "jumps", "1 in the poses"),
    "uncovered": (uncovered, "poses", "40 of 42 scans"),
    "frozen": (frozen, "fresh", "19 of 20 scans have the ranges of the one before"),
    "frozen on the move": (frozen_on_the_move, "fresh", "19 of 20 scans"),
    "millimetres": (millimetres, "ranges", "are these metres?"),
    "blind": (blind, "ranges", "1% returns, 99% saw nothing"),
    "unstamped": (unstamped, "stamps", "all 0, log times count"),
    "varying": (varying, "beams", "4 to 5"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_said_by_its_own_check_alone(name: str) -> None:
    make, where, text = FAULTS[name]
    found = inspected(make())
    wrong = [check for check in found.checks if not check.ok]
    assert [check.name for check in wrong] == [where]
    assert text in wrong[0].text


def test_uneven_rates_are_shown() -> None:
    log = good()
    scans = [row for row in log.happened if row[1] == "/scan"]
    gone = {id(row) for i, row in enumerate(scans) if i % 5 in (1, 2)}
    log.happened = [row for row in log.happened if id(row) not in gone]
    found = check(inspected(log), "rate")
    assert not found.ok
    # 24 scans remain, 0.3, 0.1 and 0.1 s apart: 8 of 23 steps are of 0.3 s
    assert "10.0 Hz, but 35% of the steps" in found.text


def test_a_log_without_poses_says_what_is_missing() -> None:
    log = RosLog()
    for k in range(5):
        log.scan(k / 10, FAR)
    found = inspected(log)
    assert not found.usable
    assert "no pose source" in str(found.problem)
    assert [topic.count for topic in found.topics] == [5]


def test_two_scans_are_a_choice_that_an_option_makes(tmp_path: Path) -> None:
    log = good()
    for k in range(40):
        log.scan(k / 10, FAR, topic="/rear")
    assert inspected(log).usable
    path = log.write(tmp_path / "two.mcap")
    asked, chosen = info(path, "--check"), info(path, "--check", "--scan", "/rear")
    assert asked.return_value == 2
    assert "choose one with --scan /rear or --scan /scan" in asked.stdout
    assert chosen.return_value == 0
    assert "scans from /rear (LaserScan: as asked for)" in chosen.stdout


def test_every_message_is_counted_though_few_are_asked_for(tmp_path: Path) -> None:
    log = good()
    for k in range(7):
        log.say(k / 10, "/chatter", "std_msgs/msg/String", data="x")
    counts = {"/chatter": 7, "/scan": 40, "/tf": 41, "/tf_static": 1}
    for name in ("a.bag", "a.mcap"):
        found = inspect(log.write(tmp_path / name))
        assert {tally.topic.name: tally.count for tally in found.topics} == counts


def test_the_report_shows_container_topics_choice_and_checks(tmp_path: Path) -> None:
    path = good().write(tmp_path / "good.mcap")
    done = info(path)
    assert done.return_value == 0
    lines = done.stdout.splitlines()
    assert lines[0].startswith(f"{path}   MCAP ros2, zstd, ")
    assert "4.0 s, 2020-09-13T12:26:40Z, complete" in lines[0]
    assert "  /scan       40  10.0 Hz  LaserScan  4 beams, 0.1-10 m, laser   <- scans" in lines
    assert "  /tf         41  10.0 Hz  TFMessage  map > base_link   <- poses" in lines
    assert "  use     scans from /scan (LaserScan: the only LaserScan)" in lines
    assert any(line.startswith("  checks  order ok   stamps ok") for line in lines)
    assert f"next: replay run {path} --prior plan.png" in done.stderr


def test_what_run_does_with_odometry_is_said(tmp_path: Path) -> None:
    log = RosLog()
    log.static("base_link", "laser", (0.2, 0.0, 0.0))
    path = steps(log, 0, 40, parent="odom").write(tmp_path / "odom.mcap")
    (line,) = [line for line in info(path).stderr.splitlines() if line.startswith("next: ")]
    assert line.endswith("--prior plan.png  (finds where on the plan the robot was, by AMCL)")
    known = info(good().write(tmp_path / "good.mcap")).stderr
    assert "AMCL" not in known


def test_json_has_a_schema_and_only_json_numbers(tmp_path: Path) -> None:
    log = good()
    log.scan(3.95, [1.0, 2.0, 3.0, 4.0], topic="/wild", range_max=inf)
    done = info(log.write(tmp_path / "a.mcap"), "--json", "--scan", "/scan")
    answer = json.loads(done.stdout, parse_constant=pytest.fail)
    assert answer["schema"] == 1
    (found,) = answer["logs"]
    assert found["usable"] is True
    assert found["container"]["kind"] == "MCAP ros2"
    assert found["checks"]["gaps"] == {"ok": True, "text": "max 0.10 s", "longest": 0.1}
    wild = next(topic for topic in found["topics"] if topic["name"] == "/wild")
    assert wild["range_max"] is None


def test_check_exits_1_where_no_scan_can_be_used(tmp_path: Path) -> None:
    log = RosLog()
    log.odometry(0.0, (0.0, 0.0, 0.0))
    path = log.write(tmp_path / "odometry.mcap")
    assert info(path).return_value == 0
    done = info(path, "--check")
    assert done.return_value == 1
    assert "  cannot  no scans: looked for LaserScan" in done.stdout


def test_a_cut_log_exits_3_and_says_where(tmp_path: Path) -> None:
    path = good().write(tmp_path / "whole.bag")
    cut = tmp_path / "cut.bag"
    cut.write_bytes(path.read_bytes()[:9000])
    done = info(cut, "--check")
    assert done.return_value == 3
    assert "! damage: " in done.stdout
    assert "lost: " in done.stderr


def test_several_logs_are_looked_at_each(tmp_path: Path) -> None:
    path = good().write(tmp_path / "a.mcap")
    other = good().write(tmp_path / "b.bag")
    (tmp_path / "no.mcap").write_text("nothing of the kind")
    done = info(path, tmp_path / "no.mcap", other)
    assert done.return_value == 3  # some of many failed
    assert done.stdout.count("checks  ") == 2
    assert "no.mcap: is text, not a log" in done.stderr
    answer = json.loads(info(path, tmp_path / "no.mcap", "--json").stdout)
    assert [log["usable"] for log in answer["logs"]] == [True, False]
    assert info(path, tmp_path / "no.mcap", "--check").return_value == 1


def test_text_from_the_log_is_escaped_and_never_markup(tmp_path: Path) -> None:
    log = good()
    log.say(0.1, "/[red]\x1b[31m" + "x" * 60_000, "std_msgs/msg/String", data="x")
    log.tf(0.1, "a\nb", "[bold]c", (0.0, 0.0, 0.0))
    done = info(log.write(tmp_path / "a.mcap"))
    assert done.return_value == 0
    assert "\x1b" not in done.stdout
    assert "/[red]\\x1b[31mxxx" in done.stdout
    assert "a\\nb > [bold]c" in done.stdout
    assert max(map(len, done.stdout.splitlines())) < 500


def test_real_logs_are_as_their_recorders_left_them(shared_data: Path) -> None:
    found = inspect(shared_data / "bags/bham_pioneer/trace0.bag")
    counts = {tally.topic.name: tally.count for tally in found.topics}
    assert counts == {"/base_scan": 958, "/odom": 958, "/tf": 2876}
    assert check(found, "beams").text == "726"
    turtlebot = inspect(shared_data / "bags/olin_mac_floor1/macfirst_floor_take_2")
    assert check(turtlebot, "poses").text == "356 of 357 scans"
    assert "odometry alone" in " ".join(map(str, turtlebot.notes))
    backpack = shared_data / "bags/cartographer_backpack/b0-2014-07-21-12-42-53-tiny.bag"
    assert "no pose source" in str(inspect(backpack).problem)
