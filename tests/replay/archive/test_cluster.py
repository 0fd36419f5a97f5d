"""The same tables and bytes whoever works: one process, a local Dask cluster, a running one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from formats.errors import FormatError, UsageError
from replay import batch
from tests.faults_world import drive
from tests.replay.archive.test_batching import contents

ROOT = Path(__file__).resolve().parents[3]


@contextmanager
def running(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and its workers as processes of their own: its address, and the workers."""
    file = folder / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    begin = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0"]
    begin += ["--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", str(file)]
    started = [subprocess.Popen(begin, **quiet)]  # type: ignore[call-overload]
    try:
        for _ in range(600):
            if file.exists() and file.stat().st_size:
                break
            time.sleep(0.1)
        join = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1"]
        join += ["--scheduler-file", str(file), "--no-dashboard", "--no-nanny"]
        join += ["--memory-limit", "0", "--local-directory", str(folder)]
        for _ in range(workers):
            started.append(subprocess.Popen(join, **quiet))  # type: ignore[call-overload]
        yield json.loads(file.read_text())["address"], started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_the_same_bytes_whoever_works(home: Path, tmp_path: Path) -> None:
    (home / "logs" / "empty.bag").write_bytes(b"")
    one = batch("logs", "one", prior="plan.png")
    two = batch("logs", "two", prior="plan.png", jobs=2)
    (tmp_path / "dask").mkdir()
    with running(tmp_path / "dask", 2) as (address, _):
        far = batch("logs", "far", prior="plan.png", cluster=address)
    for other in (two, far):
        assert other.rows() == one.rows()
    notes = ("empty.failed.json",)  # they say how long it took
    expected = {name: data for name, data in contents(home / "one").items() if name not in notes}
    assert len(expected) == 4
    for folder in ("two", "far"):
        found = contents(home / folder)
        assert set(notes) < found.keys()
        assert {name: data for name, data in found.items() if name not in notes} == expected


@pytest.mark.slow
def test_the_logs_of_a_worker_that_is_killed_are_given_to_others(
    home: Path, tmp_path: Path
) -> None:
    for name in range(8):
        drive(20 + name).write(home / "logs" / f"more{name}.mcap")
    (tmp_path / "dask").mkdir()
    killed: list[int] = []
    with running(tmp_path / "dask", 2) as (address, workers):

        def watch(event: object) -> None:
            if getattr(event, "state", "") == "done" and not killed:
                killed.append(workers[0].pid)
                os.kill(workers[0].pid, signal.SIGKILL)

        found = batch("logs", "runs", prior="plan.png", cluster=address, watch=watch)
    assert killed
    assert (len(found.done), found.failed) == (12, {})
    assert batch("logs", "whole", prior="plan.png").rows() == found.rows()
    assert contents(home / "runs") == contents(home / "whole")


def test_what_is_said_where_there_is_no_cluster(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("replay.archive.cluster.PATIENCE", 1)
    with pytest.raises(FormatError, match="no scheduler answers; is it running"):
        batch("logs", "runs", prior="plan.png", cluster="tcp://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r'pip install "plan-replay\[cluster\]"'):
        batch("logs", "runs", prior="plan.png", jobs=2)
    assert threading.active_count() < 50
