"""`batch`: what is done, left out, kept, and what failures cost."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from formats.errors import FormatError, UsageError
from formats.results.file import read_result
from replay import batch, rescore, run
from replay.archive import nursery, working
from replay.archive.ledger import Ledger
from replay.archive.manifest import FILES
from replay.cli import _exit_code
from replay.options import DEFAULTS
from tests.faults_world import drive

ALL = ["1", "2", "b/1", "b/3"]


def contents(archive: Path) -> dict[str, bytes]:
    """Results and notes by name."""
    files = [path for path in archive.rglob("*") if path.is_file()]
    return {
        path.relative_to(archive).as_posix(): path.read_bytes()
        for path in sorted(files)
        if not path.name.startswith(".ledger")
    }


def test_a_folder_of_logs_and_then_only_what_is_missing(home: Path) -> None:
    first = batch(home / "logs", "runs", prior="plan.png")
    assert (list(first.done), first.kept, first.failed) == (ALL, {}, {})
    before = contents(home / "runs")
    assert sorted(before) == [f"{name}.replay.mcap" for name in ALL]
    alone = run("logs/1.mcap", "plan.png", output="x.replay.mcap")
    kept = read_result(home / "runs" / "1.replay.mcap")
    assert kept.counts["bayes"].tolist() == alone.counts["bayes"].tolist()
    assert kept.facts["archive"]["name"] == "1"
    states = {path: path.stat().st_mtime_ns for path in (home / "runs").rglob("*.mcap")}
    (home / "runs" / "b" / "1.replay.mcap").unlink()
    second = batch(home / "logs", "runs", prior="plan.png")
    assert (list(second.done), sorted(second.kept)) == (["b/1"], ["1", "2", "b/3"])
    assert contents(home / "runs") == before
    assert second.frame().shape[0] == 4
    gone = home / "runs" / "b" / "1.replay.mcap"
    assert all(p.stat().st_mtime_ns == at for p, at in states.items() if p != gone)


def test_the_ledger_is_only_an_index(home: Path) -> None:
    first = batch("logs", "runs", prior="plan.png")
    for file in (home / "runs").glob(".ledger*"):
        file.unlink()
    second = batch("logs", "runs", prior="plan.png")
    assert (second.done, second.kept) == ({}, first.done)
    (home / "runs" / ".ledger.sqlite").write_bytes(b"nonsense" * 999)
    assert batch("logs", "runs", prior="plan.png").kept == first.done
    with sqlite3.connect(home / "runs" / ".ledger.sqlite") as data:
        (rows,) = data.execute("SELECT count(*) FROM results").fetchone()
        (hashes,) = data.execute("SELECT count(*) FROM hashes").fetchone()
    data.close()
    assert rows == 4
    assert hashes >= 4


def test_the_key_is_of_all_that_a_result_depends_on(home: Path) -> None:
    batch("logs/1.mcap", "runs", prior="plan.png")
    other: list[dict[str, Any]] = [
        {"prior": "plan.png", "p_wall": 0.3},
        {"prior": "plan.png", "every": 2},
        {"prior": "plan.png", "truth": "logs/truth.png"},
        {},
    ]
    shutil.copy("plan.png", "logs/truth.png")
    shutil.copy("plan.yaml", "logs/truth.yaml")
    for words in other:
        with pytest.raises(UsageError, match="its result 1 is of another log, option or version"):
            batch("logs/1.mcap", "runs", **words)
    # The same content elsewhere is the same; the yaml beside a plan belongs to it.
    shutil.copytree("logs", "moved")
    assert list(batch("moved/1.mcap", "runs", prior="plan.png", p_wall=0.2).kept) == ["1"]
    text = Path("plan.yaml").read_text()
    Path("plan.yaml").write_text(text.replace("0.05", "0.051"))
    with pytest.raises(UsageError, match="another log, option"):
        batch("logs/1.mcap", "runs", prior="plan.png")
    assert list(batch("logs/1.mcap", "runs", prior="plan.png", force=True).done) == ["1"]


def test_hashes_are_not_made_again(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch("logs", "runs", prior="plan.png")

    def hashed(path: Path) -> str:
        raise AssertionError(f"{path} is read again")

    monkeypatch.setattr("replay.archive.keys._of_file", hashed)
    assert len(batch("logs", "runs", prior="plan.png").kept) == 4
    os.utime(home / "logs" / "1.mcap", (1, 1))
    with pytest.raises(AssertionError, match=r"1\.mcap is read again"):
        batch("logs", "runs", prior="plan.png")


def test_what_is_not_a_log_is_passed_over_and_the_same_content_is_done_once(home: Path) -> None:
    run("logs/1.mcap", "plan.png", output="logs/old.replay.mcap")
    shutil.copy("logs/old.replay.mcap", "logs/renamed.mcap")  # a result all the same
    shutil.copy("plan.png", "logs/plan.png")
    Path("logs/readme.md").write_text("# logs")
    shutil.copy("logs/1.mcap", "logs/copy.mcap")
    Path("logs/again").symlink_to(home / "logs")
    Path("logs/circle").symlink_to("circle")
    Path("logs/packed.log.gz").write_bytes(gzip.compress(b"PARAM laser_front_laser 0\n"))
    Path("logs/plan.yaml.gz").write_bytes(gzip.compress(b"image: plan.png\n"))
    found = batch(["logs", "logs/2.mcap"], "runs", prior="plan.png")
    assert sorted(found.done) == ALL
    assert list(found.failed) == ["packed"]  # a log, but one without a scan
    assert [Path(log).name for log in found.same] == ["copy.mcap"]


def test_patterns_lists_and_names(home: Path) -> None:
    Path("list.txt").write_text("# two\nlogs/1.mcap\n\nlogs/b/*.mcap\n")
    found = batch("list.txt", "runs", prior="plan.png")
    assert sorted(found.done) == ["3", "b/1", "logs/1"]
    shutil.copy("logs/2.mcap", "logs/1.bag")
    again = batch(["logs/1.mcap", "logs/1.bag"], "more", prior="plan.png")
    assert sorted(again.done) == ["1.bag", "1.mcap"]
    Path("jobs.csv").write_text("log,p_wall\nlogs/1.mcap,0.3\nlogs/1.mcap,0.4\n")
    with pytest.raises(UsageError, match="1: several results would have this name"):
        batch("jobs.csv", "third", prior="plan.png")


def test_a_manifest_says_plan_truth_and_options(home: Path) -> None:
    shutil.copy("plan.png", "other.png")
    shutil.copy("plan.yaml", "other.yaml")
    text = "log,plan,p-wall,sensor_pose,name\nlogs/1.mcap,plan.png,0.3,,one\n"
    Path("jobs.csv").write_text(text + 'logs/2.mcap,other.png,,"0.1,0,0",two\n')
    assert list(batch("jobs.csv", "runs", every=2).done) == ["one", "two"]
    one, two = (read_result(home / "runs" / f"{name}.replay.mcap") for name in ("one", "two"))
    assert (one.settings["p_wall"], two.settings["p_wall"]) == (0.3, 0.2)
    assert one.settings["every"] == two.settings["every"] == 2
    assert two.settings["sensor_pose"] == [0.1, 0.0, 0.0]
    assert Path(two.settings["prior"]).name == "other.png"
    Path("jobs.yaml").write_text(
        "defaults: {prior: plan.png, every: 2}\n"
        "logs:\n- logs/b/1.mcap\n- {log: logs/b/3.mcap, p_wall: 0.1, scan_height: [0.1, 1]}\n"
    )
    assert sorted(batch("jobs.yaml", "more").done) == ["1", "3"]
    assert read_result(home / "more" / "3.replay.mcap").settings["p_wall"] == 0.1


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("log,p_wal\nlogs/1.mcap,0.3\n", "did you mean p_wall"),
        ("log,p_wall\nlogs/1.mcap,much\n", "p_wall is 'much'"),
        ("name,p_wall\none,0.3\n", "names no log"),
        ("log\n", "names no logs"),
        ("log,p_wall\nlogs/1.mcap,1.3\n", "not from 0 to 1"),
    ],
)
def test_manifests_that_cannot_be(text: str, problem: str, home: Path) -> None:
    Path("jobs.csv").write_text(text)
    with pytest.raises(FormatError, match=problem):
        batch("jobs.csv", "runs", prior="plan.png")


# What runs in place of a nursery: by their names, logs hang, crash, eat memory, or meet a bug.
BAD = """
import os, signal, time
from replay import running
real = running.run
def run(logs, *words, **options):
    name = os.path.basename(logs[0])
    if name.startswith("hang"):
        time.sleep(1000)
    if name.startswith("crash"):
        os.kill(os.getpid(), signal.SIGSEGV)
    if name.startswith("eat"):
        hoard = [bytearray(b"x") * (32 << 20) for _ in range(256)]  # 8 GB
    if name.startswith("bug"):
        raise ZeroDivisionError("a bug")
    return real(logs, *words, **options)
running.run = run
from replay.archive.nursery import main
main()
"""


def bad_logs(folder: Path) -> None:
    for number, name in enumerate(["bug", "crash", "eat", "hang"]):
        drive(9 + number).write(folder / f"{name}.mcap")
    (folder / "damaged.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    (folder / "empty.bag").write_bytes(b"")


def test_a_bad_log_costs_only_itself(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bad_logs(home / "logs")
    monkeypatch.setattr(working, "START", BAD)
    found = batch("logs", "runs", prior="plan.png", timeout=10.0, max_memory=700)
    assert sorted(found.done) == ALL
    assert sorted(found.failed) == ["bug", "crash", "damaged", "eat", "empty", "hang"]
    assert found.failed["bug"] == "internal error (ZeroDivisionError: a bug)"
    assert "ended by SIGSEGV" in found.failed["crash"]
    assert found.failed["hang"] == "took more than 10 s (--timeout)"
    assert "more than --max-memory" in found.failed["eat"]
    note = json.loads((home / "runs" / "bug.failed.json").read_text())
    assert "Traceback" in note["traceback"]
    # They are not tried again unasked.
    again = batch("logs", "runs", prior="plan.png", timeout=10.0, max_memory=700)
    assert (again.done, again.failed) == ({}, found.failed)
    assert sorted(rescore("runs").failed) == sorted(found.failed)
    monkeypatch.undo()
    monkeypatch.chdir(home)
    better = batch("logs", "runs", prior="plan.png", retry=True)
    assert sorted(better.done) == ["bug", "crash", "eat", "hang"]
    assert sorted(better.failed) == ["damaged", "empty"]
    assert not (home / "runs" / "bug.failed.json").exists()


@pytest.mark.skipif(not nursery.FORKS, reason="runs are forked on Linux alone")
def test_a_task_whose_batch_is_gone_is_not_begun(home: Path) -> None:
    task = {"logs": ["logs/0.mcap"], "output": "orphan.mcap", "options": {}, "files": {}}
    command = [sys.executable, "-c", working.START]
    done = subprocess.run(command, input=json.dumps(task).encode() + b"\n", stdout=subprocess.PIPE)
    assert b'"ready"' in done.stdout
    assert b'"pid"' not in done.stdout


# A run that hangs once it has told of its progress, for a batch that does not listen.
HANGING = """
import os, signal, time
from replay.archive import nursery
def perform(task, answers):
    time.sleep(1.0)  # until nobody listens
    nursery._say(answers, {"progress": [1, 2]})
    time.sleep(1000)
nursery.perform = perform
nursery.main()
"""


@pytest.mark.skipif(not nursery.FORKS, reason="runs are forked on Linux alone")
def test_a_run_that_nobody_listens_to_is_ended() -> None:
    command = [sys.executable, "-c", HANGING]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes) as process:  # type: ignore[call-overload]
        try:
            process.stdin.write(b"{}\n")  # and stays open
            process.stdin.flush()
            assert b'"ready"' in process.stdout.readline()
            run = json.loads(process.stdout.readline())["pid"]
            process.stdout.close()
            assert process.wait(timeout=60.0) != 0
            with pytest.raises(ProcessLookupError):
                os.kill(run, 0)
        finally:
            process.kill()


@pytest.mark.skipif(os.getuid() != 0, reason="only root may mount a small disk")
@pytest.mark.parametrize("size", ["12k", "96k"])
def test_a_full_disk_is_one_line_or_failed_logs(
    size: str, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    disk = home / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", disk]).returncode:
        pytest.skip("this machine lets nobody mount a disk")
    try:
        code = _exit_code(["batch", "logs", "-o", str(disk), "--prior", "plan.png", "--quiet"])
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        if code == 1:
            assert len(said.err.splitlines()) == 1
        else:
            assert code == 3
            assert "no space left" in said.out
        for path in disk.rglob("*.replay.mcap"):
            read_result(path)
        assert not [path for path in disk.rglob("*") if ".part" in path.name]
    finally:
        subprocess.run(["umount", disk], check=True)


def test_two_batches_on_one_archive(home: Path) -> None:
    with Ledger(str(home / "runs")), pytest.raises(FormatError, match="another batch works on it"):
        batch("logs", "runs", prior="plan.png")
    assert len(batch("logs", "runs", prior="plan.png").done) == 4


def test_a_damaged_result_is_made_again(home: Path) -> None:
    batch("logs", "runs", prior="plan.png")
    before = contents(home / "runs")
    path = home / "runs" / "2.replay.mcap"
    path.write_bytes(path.read_bytes()[:-3000])
    assert list(batch("logs", "runs", prior="plan.png").done) == ["2"]
    assert contents(home / "runs") == before


def test_refusals(home: Path) -> None:
    with pytest.raises(FormatError, match="no such file"):
        batch("nothing.mcap", "runs")
    (home / "bare").mkdir()
    with pytest.raises(FormatError, match="holds no logs"):
        batch("bare", "runs")
    with pytest.raises(FormatError, match="no file fits"):
        batch("*.nothing", "runs")
    with pytest.raises(FormatError, match=r"plan\.png: cannot be made"):
        batch("logs", "plan.png")
    with pytest.raises(UsageError, match="did you mean p_wall"):
        batch("logs", "runs", p_wal=0.3)


def command(*words: str) -> subprocess.Popen[str]:
    code = "from replay.cli import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, "batch", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])},
    )


def test_the_options_of_run_are_those_of_batch() -> None:
    """A new option of `run` is one of `Options`, a file, or named in NOT_HERE."""
    from replay.cli.batch import NOT_HERE
    from replay.cli.batch import command as verb
    from replay.cli.run import command as of_run

    own = [
        "logs",
        "archive",
        "retry",
        "force",
        "jobs",
        "cluster",
        "timeout",
        "max_memory",
        "as_json",
        "quiet",
        "config",
        "print_config",
    ]
    taken = {param.name for param in verb.params} - set(own)
    assert taken == {*DEFAULTS, *FILES}
    here = {*taken, *NOT_HERE, "config", "print_config"}  # of every verb, once it was called
    assert {param.name for param in of_run.params} <= here


def test_a_result_that_nothing_was_scored_against_has_no_score(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _exit_code(["batch", "logs/1.mcap", "-o", "runs", "--quiet"]) == 0
    assert capsys.readouterr().out == "1 log: 1 done, 0 there before\n"


def test_the_command(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (home / "logs" / "empty.bag").write_bytes(b"")
    words = ["batch", "logs", "-o", "runs", "--prior", "plan.png"]
    assert _exit_code(words) == 3
    said = capsys.readouterr()
    assert said.out.startswith("5 logs: 4 done, 0 there before, 1 failed\n")
    assert "failed  empty: " in said.out
    assert "done    b/3: F2 " in said.err
    assert _exit_code([*words, "--json"]) == 3
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["state"] for row in rows] == ["done", "done", "done", "done", "failed"]
    assert _exit_code([*words, "--p-wall", "0.4"]) == 2


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_and_resumed(number: int, home: Path) -> None:
    for name in range(12):
        drive(20 + name).write(home / "logs" / f"more{name}.mcap")
    process = command("logs", "-o", "runs", "--prior", "plan.png")
    assert process.stderr is not None
    line = process.stderr.readline()
    assert line.startswith("done"), line
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, "Traceback" in err) == (130, False), err
    assert "the same command goes on from here" in err
    assert not [path for path in (home / "runs").rglob("*") if ".part" in path.name]
    found = batch("logs", "runs", prior="plan.png")
    assert len(found.kept) >= 1
    assert len(found.done) + len(found.kept) == 16
    undisturbed = batch("logs", "whole", prior="plan.png")
    assert {n: f["f2"] for n, f in found.results.items()} == {
        n: f["f2"] for n, f in undisturbed.results.items()
    }


def test_nothing_is_left_running_when_the_batch_is_killed(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not Path("/proc").is_dir():
        pytest.skip("processes are looked up in /proc")
    process = command("logs", "-o", "runs", "--prior", "plan.png")
    assert process.stderr is not None
    process.stderr.readline()
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert children
    process.kill()
    process.communicate(timeout=60)
    for _ in range(200):
        if not any(_alive(pid) for pid in children):
            break
        time.sleep(0.05)
    assert not any(_alive(pid) for pid in children)
    assert len(batch("logs", "runs", prior="plan.png").results) == 4


def _alive(pid: str) -> bool:
    try:
        return "(zombie)" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
