"""A result file is read back to the bit, by us and by readers that are not ours."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import struct
import subprocess
from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta, tzinfo
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError
from formats.frame import Frame, Pose
from formats.grid import Evidence, Geometry, Grid
from formats.result import Counts, Curve, Split, Step
from formats.results import messages as ros
from formats.results import records
from formats.results.file import ResultWriter, read_result
from tests.conftest import ROOT
from tests.runs import GEOMETRY, SCAN, START, curves, forge, layers, prior, steps, write_run


def test_everything_comes_back(tmp_path: Path) -> None:
    run = read_result(write_run(tmp_path / "a.replay.mcap", 30))
    expected = list(steps(30))
    assert run.geometry == GEOMETRY
    assert (run.levels, run.main) == (2, "bayes")
    assert run.settings == {"p-hit": 0.7, "max-range": "inf", "prior": "plan.png"}
    assert run.facts == {"scans": 30, "skipped": 2}
    assert run.map_to_plan == Pose(1.0, 2.0, 0.5)
    assert run.attachments == {
        "plan.png": b"\x89PNG not really",
        "plan.yaml": b"resolution: 0.05\n",
    }
    assert run.times_ns.tolist() == [step.frame.time_ns for step in expected]
    assert np.allclose(run.poses, [step.frame.pose for step in expected], rtol=0, atol=1e-12)
    for name in ("none", "bayes", "paper"):
        counts = [[step.counts[name].observed, step.counts[name].unobserved] for step in expected]
        assert np.array_equal(run.counts[name], np.array(counts))
        assert run.curves[name].p_levels == curves()[name].p_levels
        assert run.curves[name].update == curves()[name].update
        assert np.array_equal(run.curves[name].prior.values, curves()[name].prior.values)
    for name, layer in layers().items():
        assert run.layers[name].dtype == layer.dtype
        assert np.array_equal(run.layers[name], layer)
    assert sorted(run.layers) == ["outside", "prior_log_odds", "truth_wall", "wall"]
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", run.written)


@pytest.mark.parametrize(
    ("frames", "every"), [(1, 1), (2, 5), (98, 1), (99, 1), (100, 1), (777, 3)]
)
def test_evidence_at_keyframes_is_the_evidence_of_that_time(
    tmp_path: Path, frames: int, every: int
) -> None:
    path = tmp_path / "a.mcap"
    seen = {}
    with ResultWriter(path, geometry=GEOMETRY, curves=curves()) as writer:
        for step in steps(frames, every=every):
            assert step.evidence is not None
            seen[step.index] = step.evidence.counts.copy()
            writer.write(step)
        writer.finish()
    run = read_result(path)
    kept = []
    for frame, time_ns, evidence in run.keyframes():
        assert np.array_equal(evidence.counts, seen[frame])
        assert time_ns == START + frame * 100_000_001
        kept.append(frame)
    assert np.array_equal(run.evidence().counts, seen[frames - 1])
    assert kept[0] == 0
    assert kept[-1] == frames - 1
    assert len(kept) <= 100
    offers = (frames - 1) // every + 1
    assert len(kept) >= min(offers, 50)
    assert len(set(np.diff(kept[:-1]))) <= 1  # evenly spaced but for the last


def test_the_same_run_gives_the_same_bytes_but_for_the_time_of_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = write_run(tmp_path / "a.mcap").read_bytes()
    monkeypatch.setattr("formats.plain_json.datetime", Tomorrow)
    second = write_run(tmp_path / "b.mcap").read_bytes()
    assert len(first) == len(second)
    where = [i for i in range(len(first)) if first[i] != second[i]]
    stamp = first.index(b"\x04\0\0\0time") + 12
    end = stamp + len("2026-01-01T00:00:00+00:00")
    (summary,) = struct.unpack_from("<Q", first, len(first) - 28)  # from the footer
    assert where  # in the stamp, and in the data section's checksum, which ends that section
    assert all(stamp <= i < end or summary - 4 <= i < summary for i in where)


def test_blocks_and_the_temporary_file_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = read_result(write_run(tmp_path / "a.mcap", 30))
    monkeypatch.setattr("formats.results.file.BLOCK", 7)
    monkeypatch.setattr("formats.results.file.IN_MEMORY", 500)
    parts = read_result(write_run(tmp_path / "b.mcap", 30))
    assert np.array_equal(parts.times_ns, whole.times_ns)
    assert np.array_equal(parts.poses, whole.poses)
    assert np.array_equal(parts.counts["paper"], whole.counts["paper"])
    assert [m.frame for _, m in by_rosbags(tmp_path / "b.mcap")["/metrics/none"]] == list(range(30))


def test_a_frames_messages_follow_each_other_and_then_its_keyframes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mcap.reader import NonSeekingReader

    monkeypatch.setattr("formats.results.file.BLOCK", 7)
    path = tmp_path / "a.mcap"
    with ResultWriter(path, geometry=GEOMETRY, curves=curves()) as writer:
        for step in steps(30, every=3):
            writer.write(step)
        writer.finish()
    small = ["/pose", "/tf", "/metrics/none", "/metrics/bayes", "/metrics/paper"]
    large = ["/scan_points", "/map", "/map_without_prior"]
    kept = [i for i in range(30) if i % 3 == 0 or i == 29]
    # What re-scoring needs comes first, in chunks of its own.
    expected = [("/cells", START), *(("/evidence", START + i * 100_000_001) for i in kept)]
    expected += [("/tf_static", START), ("/prior", START)]
    for i in range(30):
        topics = [*small, *(large if i % 3 == 0 or i == 29 else ())]
        expected += [(topic, START + i * 100_000_001) for topic in topics]
    with path.open("rb") as file:
        read = NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False)
        found = [(channel.topic, message.log_time) for _, channel, message in read]
    assert found == expected


class Tomorrow(datetime):
    """A clock that is a day ahead."""

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Tomorrow:
        return super().now(tz) + timedelta(days=1)


def test_the_map_at_the_end_is_the_curve_of_all_evidence(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a.mcap", 40)
    shown = {topic: messages[-1] for topic, messages in by_rosbags(path).items()}
    *_, last = steps(40)
    assert last.evidence is not None
    for topic, name in (("/map", "bayes"), ("/map_without_prior", "none")):
        p_occupied = curves()[name].of(last.evidence).p_occupied()
        assert np.array_equal(shown[topic][1].data, np.rint(100 * p_occupied).ravel())
    assert np.array_equal(shown["/prior"][1].data, np.rint(100 * prior().p_occupied()).ravel())


def test_paper_as_the_main_curve_is_drawn_right(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a.mcap", 40, main="paper")
    *_, last = steps(40)
    assert last.evidence is not None
    p_occupied = curves()["paper"].of(last.evidence).p_occupied()
    _, shown = by_rosbags(path)["/map"][-1]
    assert np.array_equal(shown.data, np.rint(100 * p_occupied).ravel())


def by_rosbags(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Topic -> (log time, message), read by rosbags alone."""
    from rosbags.highlevel import AnyReader

    out: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([path]) as reader:
        for connection, time_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            out.setdefault(connection.topic, []).append((time_ns, message))
    return out


def test_rosbags_reads_every_channel(tmp_path: Path) -> None:
    found = by_rosbags(write_run(tmp_path / "a.mcap", 30))
    frames = list(steps(30))
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/scan_points": 30,
        "/tf_static": 1,
        "/cells": 1,
        "/prior": 1,
        "/pose": 30,
        "/tf": 30,
        "/metrics/none": 30,
        "/metrics/bayes": 30,
        "/metrics/paper": 30,
        "/evidence": 30,
        "/map": 30,
        "/map_without_prior": 30,
    }
    for (time_ns, message), step in zip(found["/pose"], frames, strict=True):
        stamp = message.header.stamp
        assert time_ns == stamp.sec * 10**9 + stamp.nanosec == step.frame.time_ns
        assert message.header.frame_id == "plan"
        assert (message.pose.position.x, message.pose.position.y) == step.frame.pose[:2]
        q = message.pose.orientation
        assert q.z == pytest.approx(np.sin(step.frame.pose.yaw / 2), abs=1e-15)
        assert q.w == pytest.approx(np.cos(step.frame.pose.yaw / 2), abs=1e-15)
    (sensor,) = found["/tf"][3][1].transforms
    assert (sensor.header.frame_id, sensor.child_frame_id) == ("plan", "sensor")
    assert sensor.transform.translation.y == frames[3].frame.pose.y
    (place,) = found["/tf_static"][0][1].transforms
    assert (place.header.frame_id, place.child_frame_id) == ("map", "plan")
    assert (place.transform.translation.x, place.transform.translation.y) == (1.0, 2.0)
    info = found["/map"][0][1].info
    assert (info.width, info.height, info.resolution) == (17, 12, pytest.approx(0.05))
    assert (info.origin.position.x, info.origin.position.y) == (-0.2, 0.35)
    assert np.array_equal(found["/cells"][0][1].wall, layers()["wall"].ravel())
    assert len(found["/cells"][0][1].door) == 0


def test_metrics_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    split = Split(Counts(tp=8, fp=2, fn=4, tn=6), Counts(tp=0, fp=0, fn=5, tn=15))
    with ResultWriter(path, geometry=GEOMETRY, curves=curves()) as writer:
        writer.write(Step(0, Frame(5, Pose(0, 0, 0), SCAN), {}, {"bayes": split}))
        writer.finish()
    found = by_rosbags(path)
    assert "/metrics/none" not in found
    ((_, m),) = found["/metrics/bayes"]
    assert m.frame == 0
    assert m.explored == 0.5  # 20 of 40 cells
    assert (m.precision, m.recall) == (0.8, pytest.approx(8 / 17))
    assert m.f2 == pytest.approx(5 * 0.8 * (8 / 17) / (4 * 0.8 + 8 / 17))
    assert (m.observed_precision, m.observed_recall) == (0.8, pytest.approx(2 / 3))
    assert m.observed_f2 == pytest.approx(5 * 0.8 * (2 / 3) / (4 * 0.8 + 2 / 3))
    assert (m.unobserved_precision, m.unobserved_recall, m.unobserved_f2) == (0.0, 0.0, 0.0)
    assert m.observed.tolist() == [8, 2, 4, 6]
    assert m.unobserved.tolist() == [0, 0, 5, 15]
    assert read_result(path).result().split("bayes") == split


def test_small_records_are_what_rosbags_would_write() -> None:
    times = np.array([START, 5, (2**31 + 7) * 10**9 + 1])  # the last one lies past 2038
    poses = np.array([[1.0, -2.0, 3.0], [0.0, 0.0, 0.0], [5.0, 6.0, -3.1]])
    counts = np.arange(24).reshape(3, 2, 4)
    header = ros.header(int(times[2]), "plan")
    pose = ros.make(ros.POSE, header=header, pose=ros.ros_pose(Pose(*poses[2])))
    assert records.pose_records(times, poses)[2].tobytes() == ros.encode(pose)
    tf = records.tf_records(times, poses)
    for i in range(3):
        message = ros.decode(tf[i].tobytes(), ros.TF)
        assert ros.encode(message) == tf[i].tobytes()
        assert message.transforms[0].child_frame_id == "sensor"
        assert message.transforms[0].transform.rotation.w == np.cos(poses[i, 2] / 2)
    metrics = records.metrics_records(times, 41, counts)
    for i in range(3):
        message = ros.decode(metrics[i].tobytes(), ros.METRICS)
        assert ros.encode(message) == metrics[i].tobytes()
        assert message.frame == 41 + i
        assert message.unobserved.tolist() == counts[i, 1].tolist()


@pytest.fixture(scope="module")
def foxglove(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with Foxglove's parsers, installed by npm."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("npm and node are needed to read a result with Foxglove's parsers")
    folder = tmp_path_factory.mktemp("npm")
    for name in ("package.json", "package-lock.json"):
        shutil.copy(ROOT / "tests/npm" / name, folder)
    command = [npm, "ci", "--prefer-offline", "--no-audit", "--no-fund", "--ignore-scripts"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=90)
    except subprocess.TimeoutExpired:
        pytest.skip("npm did not answer within 90 s")
    if done.returncode:
        pytest.skip(f"npm could not install Foxglove's parsers: {done.stderr.strip()[-200:]}")
    return folder


def test_foxgloves_parsers_read_every_message(tmp_path: Path, foxglove: Path) -> None:
    path = write_run(tmp_path / "a.mcap", 150)
    command = ["node", str(ROOT / "tests/npm/read.js"), str(path)]
    done = subprocess.run(command, cwd=foxglove, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    read = json.loads(done.stdout)
    assert read["profile"] == "ros2"
    assert read["attachments"] == {"plan.png": 15, "plan.yaml": 17}
    assert json.loads(read["metadata"]["replay"]["settings"])["p-hit"] == 0.7
    ours = by_rosbags(path)
    assert {k: v["count"] for k, v in read["topics"].items()} == {
        k: len(v) for k, v in ours.items()
    }
    for topic, messages in ours.items():
        assert read["topics"][topic]["first"] == as_json(messages[0][1]), topic
        assert read["topics"][topic]["last"] == as_json(messages[-1][1]), topic


def as_json(value: Any) -> Any:
    """A message of rosbags' as tests/npm/read.js prints it."""
    if isinstance(value, np.ndarray):
        return [
            str(n) if value.dtype.itemsize == 8 and value.dtype.kind in "iu" else n.item()
            for n in value
        ]
    if isinstance(value, list):
        return [as_json(item) for item in value]
    if hasattr(value, "__msgtype__"):
        fields = {k: v for k, v in vars(value).items() if k != "__msgtype__"}
        return {k: as_json(v) for k, v in fields.items() if not k.isupper()}  # no constants
    return value


def test_reruns_check_has_no_complaint(tmp_path: Path) -> None:
    rerun_cli = pytest.importorskip("rerun_cli")
    binary = Path(rerun_cli.__file__).parent / "rerun"
    path = write_run(tmp_path / "a.mcap", 150)
    command = [str(binary), "mcap", "check", "--full", str(path)]
    home = {"HOME": str(tmp_path), "PATH": os.environ["PATH"], "NO_COLOR": "1"}
    done = subprocess.run(command, env=home, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    verdicts = re.findall(r"^(\w+) +\d+ +\d+ +(/\S+) +(.*)$", done.stdout, re.MULTILINE)
    assert sorted(topic for _, topic, _ in verdicts) == sorted(by_rosbags(path))
    assert {(verdict, issues.strip()) for verdict, _, issues in verdicts} == {("ok", "\N{EM DASH}")}


def test_channels_say_how_they_were_offered(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    with AnyReader([write_run(tmp_path / "a.mcap")]) as reader:
        kept = {}
        for connection in reader.connections:
            (qos,) = connection.ext.offered_qos_profiles  # type: ignore[union-attr]
            assert qos.reliability.name == "RELIABLE"
            kept[connection.topic] = qos.durability.name == "TRANSIENT_LOCAL"
    latched = {"/tf_static", "/cells", "/prior", "/map", "/map_without_prior"}
    assert {topic for topic, yes in kept.items() if yes} == latched


def test_the_header_says_who_wrote_it(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    with write_run(tmp_path / "a.mcap").open("rb") as file:
        header = make_reader(file, validate_crcs=True).get_header()
    assert header.profile == "ros2"
    assert header.library == f"plan-replay/{version('plan-replay')}"


def test_a_broken_off_run_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"

    def interrupted() -> Iterator[Step]:
        yield from steps(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_steps(path, interrupted())
    with pytest.raises(FormatError, match="no frames"):
        write_steps(path, iter(()))
    with (
        pytest.raises(ValueError, match="not finished"),
        ResultWriter(path, geometry=GEOMETRY, curves=curves()),
    ):
        pass
    assert list(tmp_path.iterdir()) == []


def write_steps(path: Path, frames: Iterable[Step]) -> None:
    with ResultWriter(path, geometry=GEOMETRY, curves=curves()) as writer:
        for step in frames:
            writer.write(step)
        writer.finish()


def test_an_existing_file_is_replaced_only_by_force(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("old")
    with pytest.raises(FormatError, match="exists already"):
        write_run(path)
    assert path.read_text() == "old"
    write_run(path, force=True)
    assert len(read_result(path).times_ns) == 30
    with pytest.raises(FormatError, match="also an input"):
        write_run(path, force=True, inputs=[path])


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a file system of 16 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True).returncode:
        pytest.skip("a full disk needs the right to mount one")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_full_disk_is_one_line_and_no_file(tiny_disk: Path) -> None:
    with pytest.raises(FormatError, match="no space left on the disk") as caught:
        write_run(tiny_disk / "a.mcap", 300)
    assert "\n" not in str(caught.value)
    assert list(tiny_disk.iterdir()) == []


def test_a_cut_result_names_the_byte(tmp_path: Path) -> None:
    whole = write_run(tmp_path / "a.mcap", 30).read_bytes()
    path = tmp_path / "cut.mcap"
    for size in [*range(0, len(whole) - 1, len(whole) // 60), len(whole) - 1]:
        path.write_bytes(whole[:size])
        with pytest.raises(FormatError) as caught:
            read_result(path)
        assert "\n" not in str(caught.value)
        if size > 1000:
            byte = int(re.search(r"byte ([\d]+)", str(caught.value))[1])  # type: ignore[index]
            assert byte <= size


def test_a_flipped_byte_never_changes_what_is_read(tmp_path: Path) -> None:
    whole = write_run(tmp_path / "a.mcap", 30).read_bytes()
    true = read_result(tmp_path / "a.mcap")
    path = tmp_path / "b.mcap"
    for place in np.random.default_rng(0).integers(0, len(whole), 150).tolist():
        damaged = bytearray(whole)
        damaged[place] ^= 0x10
        path.write_bytes(damaged)
        with contextlib.suppress(FormatError):
            run = read_result(path)  # only the summary was hit, which is not needed
            assert np.array_equal(run.evidence().counts, true.evidence().counts)
            assert np.array_equal(run.counts["bayes"], true.counts["bayes"])
            assert np.array_equal(run.poses, true.poses)
            assert (run.settings, run.facts, run.attachments) == (
                true.settings,
                true.facts,
                true.attachments,
            )


def test_a_changed_setting_is_noticed(tmp_path: Path) -> None:
    path = write_run(tmp_path / "a.mcap", 30)
    whole = path.read_bytes()
    assert whole.count(b'"p-hit": 0.7') == 1
    path.write_bytes(whole.replace(b'"p-hit": 0.7', b'"p-hit": 0.9'))
    with pytest.raises(FormatError, match=r"a\.mcap: damaged: the checksum of its data"):
        read_result(path)


def other_mcap(path: Path, records: dict[str, dict[str, str]]) -> Path:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for name, data in records.items():
            writer.add_metadata(name, data)
        writer.finish()
    return path


def test_what_is_no_result_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with pytest.raises(FormatError, match=r"not a result of replay.*`replay run` writes results"):
        read_result(other_mcap(path, {"rosbag2": {}}))
    with pytest.raises(FormatError, match=r"format 2; this replay reads up to 1; update replay"):
        read_result(other_mcap(path, {"replay": {"format": "2", "anything": "{"}}))
    with pytest.raises(FormatError, match="malformed"):
        read_result(other_mcap(path, {"replay": {"format": "1", "settings": "{"}}))
    with pytest.raises(FormatError, match="does not fit together"):
        read_result(other_mcap(path, {"replay": {"format": "1", "settings": "{}"}}))
    size = {"geometry": "[100000, 100000, 0.05, 0, 0]", "levels": "2", "frames": "1"}
    with pytest.raises(FormatError, match="100000 rows"):  # and nothing is allocated
        read_result(other_mcap(path, {"replay": {"format": "1"} | size}))
    path.write_text("hello, I am no MCAP at all")
    with pytest.raises(FormatError, match=r"a\.mcap: is not an MCAP file"):
        read_result(path)
    with pytest.raises(FormatError, match="No such file"):
        read_result(tmp_path / "none.mcap")


@pytest.mark.parametrize(
    ("key", "old", "new"),
    [
        ("format", "1", "-"),
        ("geometry", "[12", '["x"'),
        ("geometry", "0.05", "NaN"),
        ("geometry", "-0.2", "1e999"),
        ("geometry", "12", "1e400"),
        ("geometry", "17", "16"),
        ("levels", "2", "3"),
        ("levels", "2", "0"),
        ("frames", "3", "4"),
        ("frames", "3", "900000000000"),
        ("keyframes", "3", "2"),
        ("curves", "0.3", "1.0"),
        ("curves", '"paper"}', '"best"}'),
        ("curves", "{", "[" * 5000 + "{"),
        ("main", "bayes", "best"),
        ("scored", "bayes", "best"),
        ("map_to_plan", "0.5", "Infinity"),
        ("map_to_plan", "1.0, ", ""),
        ("settings", "{", "[1, {"),
    ],
)
def test_a_forged_record_is_one_line(tmp_path: Path, key: str, old: str, new: str) -> None:
    source = write_run(tmp_path / "a.mcap", 3)
    assert read_result(forge(source, tmp_path / "b.mcap", {})).facts["scans"] == 3
    forge(source, tmp_path / "c.mcap", {key: (old, new)})
    with pytest.raises(FormatError, match=r"c\.mcap: ") as caught:
        read_result(tmp_path / "c.mcap")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 3000


@pytest.mark.parametrize("topic", ["/pose", "/metrics/bayes", "/evidence", "/cells"])
@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", bytes(80), b"\0\1\0\0" + b"\xff" * 84])
def test_a_forged_payload_is_one_line(tmp_path: Path, topic: str, payload: bytes) -> None:
    source = write_run(tmp_path / "a.mcap", 3)
    forge(source, tmp_path / "b.mcap", {}, payloads={topic: payload})
    with pytest.raises(
        FormatError, match=r"b\.mcap: a result that does not fit together"
    ) as caught:
        read_result(tmp_path / "b.mcap")
    assert "\n" not in str(caught.value)


def test_what_does_not_fit_together_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    other = Geometry(3, 4, 0.05, 0.0, 0.0)
    elsewhere = {"bayes": Curve(Grid(other, np.zeros(other.shape)), (0.3, 0.6))}
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"main": "best"}, "main curve"),
        ({"curves": elsewhere}, "another lattice"),
        ({"curves": curves() | {"no good": curves()["none"]}}, "topic"),
        (
            {"curves": curves() | {"b": Curve(Grid(GEOMETRY, prior().values + 1), (0.3, 0.6))}},
            "one",
        ),
        ({"layers": {"wall": np.zeros((2, 2))}}, "fit together"),
        ({"layers": {"roof": np.zeros(GEOMETRY.shape)}}, "roof"),
        ({"layers": {"truth_wall": np.full(GEOMETRY.shape, 0.5)}}, "truth_wall"),
    ]
    for options, problem in wrong:
        with pytest.raises(ValueError, match=problem):
            write_run(path, **options)
    step = next(steps(1))
    step.evidence = Evidence.empty(other, 2)
    with pytest.raises(ValueError, match="fit together"):
        write_steps(path, [step])
    with pytest.raises(FormatError, match="before 1970"):
        write_steps(path, steps(1, start=-5))
    assert list(tmp_path.iterdir()) == []


def test_ros2_bag_finds_its_metadata(tmp_path: Path) -> None:
    """The record "rosbag2" says of the file what rosbags counts in it, and rosbags reads it."""
    import yaml
    from mcap.reader import make_reader
    from rosbags.rosbag2 import Reader

    path = write_run(tmp_path / "result.replay.mcap", 30)
    with path.open("rb") as file:
        records = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    told = yaml.safe_load(records["rosbag2"]["serialized_metadata"])
    found = by_rosbags(path)
    counts = {
        t["topic_metadata"]["name"]: t["message_count"] for t in told["topics_with_message_count"]
    }
    assert counts == {topic: len(messages) for topic, messages in found.items()}
    assert told["message_count"] == sum(counts.values())
    times = [time for messages in found.values() for time, _ in messages]
    assert told["starting_time"]["nanoseconds_since_epoch"] == min(times)
    assert told["duration"]["nanoseconds"] == max(times) - min(times)
    assert (told["storage_identifier"], told["relative_file_paths"]) == ("mcap", [path.name])
    # The same text below its root is a metadata.yaml with which rosbags opens the folder.
    (tmp_path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": told}))
    with Reader(tmp_path) as reader:
        assert reader.message_count == told["message_count"]
        assert {c.topic: c.msgtype for c in reader.connections} == {
            t["topic_metadata"]["name"]: t["topic_metadata"]["type"]
            for t in told["topics_with_message_count"]
        }


def test_definitions_are_the_official_ones(tmp_path: Path) -> None:
    """Each ROS type's fields in the file are those of Humble, as rosbags ships them."""
    from mcap.reader import make_reader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    official = get_typestore(Stores.ROS2_HUMBLE)
    with write_run(tmp_path / "a.mcap", 5).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    compared = set()
    for schema in summary.schemas.values():
        assert schema.encoding == "ros2msg"
        for name, definition in get_types_from_msg(schema.data.decode(), schema.name).items():
            if not name.startswith("replay_msgs/"):
                assert definition[1] == official.fielddefs[name][1], name
                compared.add(name)
    assert {"nav_msgs/msg/OccupancyGrid", "tf2_msgs/msg/TFMessage", "std_msgs/msg/Header",
            "sensor_msgs/msg/PointCloud2", "geometry_msgs/msg/PoseStamped"} <= compared  # fmt: skip


@pytest.mark.slow
def test_a_large_building_comes_back(tmp_path: Path) -> None:
    """What re-scoring needs of 130 by 130 m at 5 cm is one message of 280 MB."""
    geometry = Geometry(2600, 2600, 0.05, 0.0, 0.0)
    share = np.zeros(geometry.shape)
    share[5, 7] = 0.25
    evidence = Evidence.empty(geometry, 2)
    evidence.counts[1, 3, 4] = 2
    plan = Grid(geometry, np.where(share > 0.0, -1.0, 1.0))
    large = dict.fromkeys(("wall", "door", "window", "clutter"), share)
    out = tmp_path / "a.mcap"
    drawn = {"bayes": Curve(plan, (0.3, 0.6))}
    with ResultWriter(out, geometry=geometry, curves=drawn, layers=large) as writer:
        writer.write(Step(0, Frame(START, Pose(0.0, 0.0, 0.0), SCAN), {}, {}, True, evidence))
        writer.finish()
    back = read_result(out)
    assert np.array_equal(back.layers["clutter"], share)
    assert np.array_equal(back.evidence().counts, evidence.counts)
