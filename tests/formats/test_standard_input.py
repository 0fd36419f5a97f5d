"""A log that comes through a pipe."""

from __future__ import annotations

import gzip
import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.log import Log
from formats.opening import open_log
from formats.standard_input import copied
from formats.stream import frames
from tests.drives import drive

REPLAY = Path(sys.executable).with_name("replay")


class Pipe(io.TextIOWrapper):
    """Standard input with these bytes in it."""

    def __init__(self, data: bytes) -> None:
        super().__init__(io.BytesIO(data))


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def piped(data: bytes, monkeypatch: pytest.MonkeyPatch, *others: Any) -> tuple[Log, Notes]:
    monkeypatch.setattr(sys, "stdin", Pipe(data))
    notes = Notes()
    return open_log(["-", *others], notes), notes


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_log_from_a_pipe_is_the_log(
    name: str, packed: bool, tmp_path: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = drive().write(tmp_path / name)
    data = gzip.compress(path.read_bytes()) if packed else path.read_bytes()
    log, notes = piped(data, monkeypatch)
    assert str(log.path) == "-"
    assert log.container.size == len(data)
    there = [(m.topic.name, m.time_ns, bytes(m.data)) for m in log.messages()]
    log.close()
    with_name = open_log(path, Notes())
    assert there == [(m.topic.name, m.time_ns, bytes(m.data)) for m in with_name.messages()]
    assert list(temporary.iterdir()) == []
    assert notes.of("lost") == []


def test_losses_and_errors_speak_of_the_pipe(
    tmp_path: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = drive().write(tmp_path / "a.bag").read_bytes()
    log, notes = piped(data[: len(data) // 2], monkeypatch)
    list(log.messages())
    log.close()
    assert {note.path for note in notes.of("lost")} == {"-"}
    for wrong, what in ((b"", "is empty"), (b"hello world\n", "is text, not a log")):
        with pytest.raises(FormatError, match=rf"^-: {what}"):
            piped(wrong, monkeypatch)
    with pytest.raises(FormatError, match=r"^-: holds text, not a log|^-: is text, not a log"):
        piped(gzip.compress(b"hello world\n"), monkeypatch)
    assert list(temporary.iterdir()) == []


def test_a_pipe_may_stand_beside_files_but_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = drive(5).write(tmp_path / "b.mcap")
    log, _ = piped(drive().write(tmp_path / "a.mcap").read_bytes(), monkeypatch, other)
    scans = sum(1 for message in log.messages() if message.topic.name == "/scan")
    log.close()
    assert scans == 20 + 5
    with pytest.raises(UsageError, match="standard input is given twice"):
        piped(b"", monkeypatch, "-")


def test_a_pipe_that_does_not_end_is_left(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", Pipe(bytes(5_000_000)))
    with pytest.raises(FormatError, match=r"^-: is larger than 3000000 bytes; give a file"):
        copied(3_000_000)
    assert list(temporary.iterdir()) == []


def test_a_terminal_or_nothing_is_wrong_usage(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = Pipe(b"")
    monkeypatch.setattr(pipe, "isatty", lambda: True)
    for stdin in (pipe, None):
        monkeypatch.setattr(sys, "stdin", stdin)
        with pytest.raises(UsageError, match="nothing comes from standard input"):
            copied()


def test_run_and_info_read_a_pipe(tmp_path: Path) -> None:
    path = drive().write(tmp_path / "a.mcap")
    assert len(list(frames(path))) == 20
    for words, made in ((["info", "-"], []), (["run", "-"], ["stdin.replay.mcap"])):
        with path.open("rb") as stdin:
            done = subprocess.run(
                [REPLAY, *words],
                stdin=stdin,
                cwd=tmp_path,
                capture_output=True,
                text=True,
                check=False,
                env={**os.environ, "NO_COLOR": "1"},
            )
        assert done.returncode == 0, done.stderr
        assert "20 of 20 scans" in done.stdout
        assert [item.name for item in tmp_path.iterdir() if item != path] == made
