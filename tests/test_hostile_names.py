"""Names and numbers at which a verb stumbled or waited for ever: one line for each, and an end."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from formats.output import is_folder, is_there
from formats.streaming.gating import gate
from replay.archive.sources import jobs_of
from replay.cli import _exit_code
from tests.commands import REPLAY
from tests.faults_world import drive, write_plan
from tests.runs import write_run

LONG = "x" * 300
UNREAD = "...: cannot be read: File name too long"


def told(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """Exit code and the last line on stderr."""
    capsys.readouterr()
    code = _exit_code(list(words))
    lines = capsys.readouterr().err.strip().splitlines()
    return code, lines[-1] if lines else ""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_plan(tmp_path)
    drive().write(tmp_path / "drive.mcap")
    write_run(tmp_path / "run.replay.mcap")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("words", ["rescore {}", "compare {} {}", "export {}", "report {}"])
def test_a_pipe_is_no_result(home: Path, words: str) -> None:
    os.mkfifo(home / "pipe.replay.mcap")
    command = [str(REPLAY), *words.format("pipe.replay.mcap", "pipe.replay.mcap").split()]
    done = subprocess.run(
        command, cwd=home, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode in (1, 3)
    assert "Traceback" not in done.stderr
    # Of two archives none has a result, so what is said is that they share no log.
    expected = "no log in common" if words.startswith("compare") else "is not a regular file"
    assert expected in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (f"export run.replay.mcap -o {LONG}", "the name is too long"),
        (f"plan plan.png -o {LONG}", "the name is too long"),
        (f"tune run.replay.mcap -o {LONG}", "the name is too long"),
        (f"rescore {LONG}", "does not exist"),
        (f"compare {LONG} run.replay.mcap", "does not exist"),
        (f"batch {LONG} -o archive", "no such file"),
        (f"batch [x]{LONG} -o archive", "no file fits this pattern"),
        (f"run drive.mcap --prior {LONG}", UNREAD),
        (
            f"run drive.mcap --prior plan.png --align {LONG}",
            "...: cannot be read: File name too long",
        ),
    ],
)
def test_names_that_are_too_long(
    home: Path, capsys: pytest.CaptureFixture[str], words: str, said: str
) -> None:
    before = sorted(home.iterdir())
    code, line = told(capsys, *words.split())
    assert code == 1
    assert said in line
    assert sorted(home.iterdir()) == before


def test_nothing_is_under_a_name_that_is_too_long(tmp_path: Path) -> None:
    assert is_folder(tmp_path)
    assert is_there(tmp_path)
    assert not is_folder(tmp_path / LONG)
    assert not is_there(tmp_path / LONG)
    (tmp_path / "file").touch()
    assert not is_folder(tmp_path / "file")
    assert is_there(tmp_path / "file")


def test_a_text_whose_first_line_is_long_is_no_list_of_logs(tmp_path: Path) -> None:
    path = tmp_path / "drive.txt"
    path.write_text("FLASER 180 " + "1.25 " * 180 + "0 0 0 0 0 0 0.0 host 0.0\n")
    assert [job.logs for job in jobs_of([path], {}, {})] == [(str(path),)]


@pytest.mark.parametrize(
    "words",
    [
        "align drive.mcap --prior plan.png --plan-resolution nan",
        "run drive.mcap --prior plan.png --viewer-budget nan",
        "simulate plan.png -o sim.mcap --clutter nan",
    ],
)
def test_nan_is_no_number(home: Path, capsys: pytest.CaptureFixture[str], words: str) -> None:
    code, line = told(capsys, *words.split())
    assert code == 2
    assert "nan" in line


def test_only_the_first_scan_of_a_step_beyond_all_integers() -> None:
    poses = np.zeros((5, 3))
    assert gate(poses, every=10**30).tolist() == [0]
    assert gate(poses, every=5).tolist() == [0]
    assert gate(poses, every=4).tolist() == [0, 4]
    assert gate(poses[:0], every=10**30).tolist() == []
