"""`replay run` and `replay export` as processes: full disks, signals, pipes, changing files."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from formats.results.file import read_result
from replay.cli import _exit_code
from tests.faults_world import BEAMS, STEPS, drive, path, ranges_at, scans, write_plan

ROOT = Path(__file__).resolve().parent.parent
ROOTLESS = os.getuid() != 0
PROGRAM = [sys.executable, "-c", "from replay.cli import main; main()"]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plan, a short drive, and one of 3,000 scans that takes a while."""
    folder = tmp_path_factory.mktemp("home")
    write_plan(folder)
    drive().write(folder / "drive.mcap")
    long = drive(STEPS)
    log = drive(0)
    for k in range(3000):
        t = (k % STEPS) / 10
        log.tf(k / 10, "map", "odom", (0.0, 0.0, 0.0))
        log.tf(k / 10, "odom", "base_link", path(t))
        log.scan(k / 10, ranges_at(t), **_fields(long))
    log.write(folder / "long.mcap")
    return folder


def _fields(log: Any) -> dict[str, Any]:
    first = scans(log)[0]
    step = first["angle_increment"]
    assert len(first["ranges"]) == BEAMS
    return {"angle_min": first["angle_min"], "increment": step, "range_max": first["range_max"]}


def begin(home: Path, *words: str | Path, **options: Any) -> subprocess.Popen[str]:
    """The program, started in `home` unless said otherwise."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **options.pop("env", {})}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    given: dict[str, Any] = {"cwd": home, **pipes, **options}
    return subprocess.Popen([*PROGRAM, *map(str, words)], env=environment, **given)


def done(home: Path, *words: str | Path, **options: Any) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of the program."""
    process = begin(home, *words, **options)
    out, err = process.communicate(timeout=60)
    assert "Traceback" not in err
    return process.returncode, out, err


def run(log: str, out: Path, *more: str) -> list[str | Path]:
    return ["run", log, "--prior", "plan.png", "-o", out, *more]


# ---------------------------------------------------------------------------- 73: outputs


@pytest.mark.skipif(ROOTLESS, reason="only root may mount a small disk")
@pytest.mark.parametrize("kind", ["result", "recording", "export", "table"])
def test_a_full_disk_is_one_line_and_leaves_nothing(kind: str, home: Path, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    size = "40k" if kind != "result" else "12k"
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", disk]).returncode:
        pytest.skip("this machine lets nobody mount a disk")
    try:
        old = disk / "old.mcap"
        old.write_bytes(b"an older result")
        words: list[str | Path] = run("drive.mcap", old, "--force")
        if kind == "recording":
            words = run("drive.mcap", tmp_path / "x.mcap", "--rrd", str(disk / "x.rrd"))
        elif kind == "export":
            assert done(home, *run("drive.mcap", tmp_path / "x.mcap"))[0] == 0
            (disk / "fill").write_bytes(bytes(16_000))
            words = ["export", tmp_path / "x.mcap", "-o", disk]
        elif kind == "table":
            assert done(home, *run("drive.mcap", tmp_path / "x.mcap"))[0] == 0
            (disk / "fill").write_bytes(bytes(36_000))
            words = ["rescore", tmp_path / "x.mcap", "--over-time", "-o", disk / "t.csv"]
        code, _, err = done(home, *words)
        assert code == 1, err
        assert "no space left" in err or "is the disk full?" in err
        assert len([line for line in err.splitlines() if line.startswith("replay:")]) == 1
        assert old.read_bytes() == b"an older result"
        assert {item.name for item in disk.iterdir()} <= {"old.mcap", "fill"}
    finally:
        subprocess.run(["umount", disk], check=True)


@pytest.mark.slow  # without a home, kernels are compiled anew
@pytest.mark.skipif(sys.platform == "win32", reason="folders have no permissions there")
def test_a_read_only_folder(home: Path, tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    if ROOTLESS:
        code, _, err = done(home, *run("drive.mcap", folder / "x.mcap"))
        assert (code, "cannot be written" in err) == (1, True)
    else:  # permissions do not bind root; a read-only mount does
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", folder]).returncode:
            pytest.skip("this machine lets nobody mount a disk")
        try:
            code, _, err = done(home, *run("drive.mcap", folder / "x.mcap"))
            assert code == 1, err
            assert "read-only" in err or "cannot be written" in err
            # And as the current folder, with the output elsewhere and no home.
            words: list[str | Path] = [home / "drive.mcap", "--prior", home / "plan.png"]
            words += ["-o", tmp_path / "y.mcap"]
            env = {"HOME": "/dev/null", "XDG_CACHE_HOME": ""}
            code, _, err = done(folder, "run", *words, env=env)
            assert code == 0, err
        finally:
            subprocess.run(["umount", folder], check=True)


# ---------------------------------------------------------------------------- 74: processes


def wait_for_part(process: subprocess.Popen[str], folder: Path) -> None:
    """Until the run has begun to write."""
    for _ in range(2000):
        if any(".part" in item.name for item in folder.iterdir()) or process.poll() is not None:
            return
        time.sleep(0.005)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_leaves_no_half_file(number: int, home: Path, tmp_path: Path) -> None:
    old = tmp_path / "out.mcap"
    old.write_bytes(b"old")
    rrd = tmp_path / "x.rrd"
    process = begin(home, *run("long.mcap", old, "--force", "--rrd", str(rrd)))
    wait_for_part(process, tmp_path)
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, "Traceback" in err) == (130, False), err
    assert "interrupted" in err
    assert [(item.name, item.read_bytes()) for item in tmp_path.iterdir()] == [("out.mcap", b"old")]


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2, 0.5])
def test_killed_shows_no_torn_result(delay: float, home: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    process = begin(home, *run("long.mcap", out))
    wait_for_part(process, tmp_path)
    time.sleep(delay)
    process.kill()
    process.communicate(timeout=30)
    if out.exists():  # it was done before
        assert len(read_result(out).times_ns) == 3000
    code, _, err = done(home, *run("drive.mcap", out, "--force"))
    assert code == 0, err


def test_a_closed_pipe_is_quiet(home: Path, tmp_path: Path) -> None:
    """Like `| head -0`: nobody reads stdout."""
    read, write = os.pipe()
    os.close(read)
    words = run("drive.mcap", tmp_path / "x.mcap", "--json")
    process = begin(home, *words, stdout=write)
    os.close(write)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")
    assert read_result(tmp_path / "x.mcap").facts["scans"] == STEPS


def test_no_colour_and_no_progress_where_nobody_looks(home: Path, tmp_path: Path) -> None:
    code, out, err = done(home, *run("drive.mcap", tmp_path / "x.mcap"), env={"NO_COLOR": "1"})
    assert code == 0
    assert "\x1b" not in out + err
    assert re.search(r"12 scans", out)


def test_a_circle_of_links_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.mcap").symlink_to("b.mcap")
    (tmp_path / "b.mcap").symlink_to("a.mcap")
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "again").symlink_to(folder)
    plan = write_plan(tmp_path)
    for log in (tmp_path / "a.mcap", folder):
        code = _exit_code(["run", str(log), "--prior", str(plan), "-o", str(tmp_path / "x.mcap")])
        err = capsys.readouterr().err
        assert (code, len(err.splitlines())) == (1, 1)
        assert str(log) in err
    code = _exit_code(["run", str(tmp_path / "log.mcap"), "--prior", str(tmp_path / "a.mcap")])
    assert (code, len(capsys.readouterr().err.splitlines())) == (1, 1)


def test_a_log_that_changes_while_it_is_read_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its size and time of change are those of the beginning, or a line says otherwise."""
    plan, log = write_plan(tmp_path), drive().write(tmp_path / "drive.mcap")
    from replay import pipeline, running

    def steps(*words: Any, **options: Any) -> Any:
        yield from real(*words, **options)
        with log.open("ab") as file:
            file.write(bytes(10))

    real = pipeline.steps
    monkeypatch.setattr(running, "steps", steps)
    code = _exit_code(["run", str(log), "--prior", str(plan), "-o", str(tmp_path / "x.mcap")])
    assert code == 0
    assert "drive.mcap: changed while it was read" in capsys.readouterr().err


# ---------------------------------------------------------------------------- 75: reports

NASTY = ("=cmd|'/c calc'!A1", "<script>alert(1)</script>", "[red]x[/red]", "/\x1b[31mscan\x07")


@pytest.mark.parametrize("name", NASTY)
def test_names_from_a_log_are_only_text(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = drive()
    log.happened = [
        (row[0], name if row[1] == "/scan" else row[1], *row[2:]) for row in log.happened
    ]
    made, plan = log.write(tmp_path / "drive.mcap"), write_plan(tmp_path)
    out = tmp_path / "x.replay.mcap"
    rrd = tmp_path / "x.rrd"
    words = ["run", str(made), "--prior", str(plan), "-o", str(out), "--rrd", str(rrd)]
    assert _exit_code(words) == 0
    assert _exit_code([*words, "--json", "--force"]) == 0
    assert _exit_code(["export", str(out), "-o", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert all(line.isprintable() for line in (said.out + said.err).splitlines())
    shown = json.loads(next(line for line in said.out.splitlines() if line.startswith("{")))
    assert shown["scan"] == name
    for table in tmp_path.glob("*.csv"):
        cells = re.split(r"[,\n]", table.read_text(encoding="utf-8"))
        assert not [cell for cell in cells if cell[:1] in ("=", "+", "@")]
