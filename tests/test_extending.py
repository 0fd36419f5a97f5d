"""The recipes of docs/extending.md, followed: what is added is one function or module, and a line.

Each test adds an entry to one table and nothing else, and uses it the way a user would.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import Notes, UsageError
from formats.frame import Pose, Scan
from formats.grid import Grid
from formats.log import Message, Topic
from formats.messages import LaserScan
from formats.opening import READERS
from formats.result import Counts
from formats.ros import decoders as ros
from formats.ros.wire import Body, Wire
from formats.sensing.scans import LASER, SENSORS
from formats.sensing.sensor import LOOK, Floats, Look, Motion
from formats.stream import frames
from replay import rescore, run
from replay.cli import _exit_code
from replay.localise.localising import LOCALISERS, Localiser
from replay.localise.tracking import Sighting, Track
from replay.scoring.count_metrics import METRICS
from replay.scoring.map_metrics import GAINS, MAP_METRICS
from replay.sensors.models import MODELS, Model, linear
from tests.memory_log import MemoryLog

ROOT = Path(__file__).resolve().parent.parent
LOG, PLAN = ROOT / "sample_logs" / "turtlebot.mcap", ROOT / "sample_logs" / "plan.png"
TABLE = re.compile(r"^\| [^|]+ \| [^|]+ \| `(\w+)`(?: in `\w+`)?, `([\w/.]+)\.py`", re.MULTILINE)


def test_every_table_of_the_page_is_there() -> None:
    text = (ROOT / "docs" / "extending.md").read_text()
    tables = TABLE.findall(text)
    assert len(tables) == text.count("\n| a ") > 8
    for name, path in tables:
        table = getattr(import_module(path.replace("/", ".").removesuffix(".__init__")), name)
        assert isinstance(table, dict | tuple), name


def test_a_log_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "drive.txt"
    path.write_text("# ranges\n1000000000 1.0 2.0 3.0\n1500000000 1.5 2.5 3.5\n")
    monkeypatch.setitem(READERS, "ranges", "tests.extending_log")
    found = list(frames(path, poses="odometry"))
    assert [frame.time_ns for frame in found] == [10**9, 1_500_000_000]
    assert [frame.scan.ranges.tolist() for frame in found] == [[1, 2, 3], [1.5, 2.5, 3.5]]
    assert found[0].scan.bearings.tolist() == pytest.approx([-np.pi / 2, 0, np.pi / 2])


def test_a_message_type_and_a_scan_like_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bumper of four switches, each of which closes at 0.3 m."""
    kind = "my_msgs/msg/Bumper"

    def bumper(wire: Wire, data: bytes | memoryview) -> LaserScan:
        body = Body(wire, data)
        stamp, frame = body.header()
        closed = np.array(body.read("4B"))
        body.end()
        ranges = np.where(closed, 0.3, np.inf).astype(np.float32)
        return LaserScan(stamp, frame, -0.75, 0.5, 0.0, 0.0, 0.3, ranges)

    def narrow(
        reading: LaserScan, matrix: Floats, motion: Motion | None = None, look: Look = LOOK
    ) -> Scan:
        scan = LASER.scan(reading, matrix, motion, look)
        return Scan(scan.bearings, scan.widths / 2, scan.ranges, scan.min_range, scan.max_range)

    monkeypatch.setitem(ros.DECODERS, kind, bumper)
    monkeypatch.setitem(SENSORS, kind, LASER._replace(scan=narrow))
    topic = Topic("/bumper", kind, "ros1")
    body = struct.pack("<III", 1, 7, 500) + struct.pack("<I", 4) + b"base" + bytes([0, 1, 0, 0])
    log = MemoryLog([Message(topic, 7_000_000_600, body)])
    (frame,) = frames(log, Notes(), poses="odometry")
    assert frame.time_ns == 7_000_000_500
    assert frame.scan.ranges.tolist() == [np.inf, np.float32(0.3), np.inf, np.inf]
    assert frame.scan.widths.tolist() == [0.25] * 4


def test_a_sensor_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODELS, "sure", Model("a beam, surer", 0.95, 0.05, 1, False, 0.5, linear))
    out = tmp_path / "out.replay.mcap"
    found = run(LOG, PLAN, output=out, sensor="sure", every=40)
    same = run(LOG, PLAN, output=tmp_path / "b.replay.mcap", p_hit=0.95, p_miss=0.05, every=40)
    assert found.facts["sensor"]["bayes"] == "0.95 / 0.05"
    assert (found.counts["bayes"] == same.counts["bayes"]).all()
    rows = rescore(out, p_wall=0.4).rows
    assert [row["result"] for row in rows] == ["out.replay.mcap"] * 3


def accuracy(counts: Counts) -> float:
    """Share of the cells that are right."""
    return (counts.tp + counts.tn) / sum(counts)


def doubt(grid: Grid, _wall: Any, scored: Any) -> float:
    """Share of the cells that nothing is known of."""
    return float(np.mean(grid.values[scored] == 0.0))


def test_a_metric(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In `run`, its help, `rescore` and `compare`."""
    monkeypatch.setitem(METRICS, "accuracy", accuracy)
    for table in (GAINS, MAP_METRICS):
        monkeypatch.setitem(table, "doubt", doubt)
    out = str(tmp_path / "out.replay.mcap")
    words = ["run", str(LOG), "--prior", str(PLAN), "-o", out, "--every", "40", "--json"]
    assert _exit_code([*words, "--metric", "accuracy,doubt"]) == 0
    told = json.loads(capsys.readouterr().out)
    for name in ("accuracy", "doubt"):
        assert _exit_code(["rescore", out, "--metric", name, "--json"]) == 0
        rows = json.loads(capsys.readouterr().out)["rows"]
        assert {row["curve"]: row[name] for row in rows} == {
            curve: values[name] for curve, values in told["metrics"].items()
        }
        assert _exit_code(["compare", out, "--curves", "none,bayes", "--metric", name]) == 0
        assert f"median {name}" in capsys.readouterr().out
    assert told["metrics"]["none"]["doubt"] > told["metrics"]["bayes"]["doubt"] == 0.0
    assert _exit_code(["run", "--help"]) == 0
    assert "accuracy" in capsys.readouterr().out


def test_a_localiser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One that believes the odometry from the start that it is given."""

    def blind(
        sightings: Iterable[Sighting], _field: Any, start: Any, _seed: int, _options: Any
    ) -> Track:
        seen = list(sightings)
        first = seen[0].odometry or Pose(0.0, 0.0, 0.0)
        begin = start.pose @ first.inverse()
        poses = np.array([begin @ (s.odometry or first) for s in seen])
        times = np.array([s.time_ns for s in seen])
        sure = np.tile(np.eye(3) * 1e-6, (len(seen), 1, 1))
        return Track(times, poses, sure, np.ones(len(seen), dtype=np.int64))

    monkeypatch.setitem(LOCALISERS, "blind", Localiser(blind, needs_plan=True))
    given: dict[str, Any] = {"initial_pose": Pose(2.0, 3.0, 0.5), "every": 40}
    out = tmp_path / "out.replay.mcap"
    with pytest.raises(UsageError, match="--poses blind needs a plan to be on"):
        run(LOG, output=out, poses="blind", **given)
    found = run(LOG, PLAN, output=out, poses="blind", **given)
    assert found.facts["poses"].startswith("blind on the plan (as asked for)")
    assert _exit_code(["run", "--help"]) == 0
    assert "fastslam, blind" in " ".join(capsys.readouterr().out.split())
