"""A batch that is killed at random moments, itself or its workers, ends as if undisturbed."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from formats.results.file import read_result
from replay import batch
from tests.faults_world import drive
from tests.replay.archive.test_batching import command, contents
from tests.replay.archive.test_cluster import running

LOGS = 24
KILLS = 20


@pytest.fixture
def many(home: Path) -> Path:
    for number in range(LOGS - 4):
        drive(20 + number).write(home / "logs" / f"more{number}.mcap")
    return home


def sound(archive: Path) -> int:
    """How many results there are, all of them whole; the ledger, too."""
    results = list(archive.rglob("*.replay.mcap"))
    for path in results:
        assert not path.name.startswith(".") or ".part" in path.name
        if not path.name.startswith("."):
            read_result(path)
    ledger = archive / ".ledger.sqlite"
    if ledger.exists():
        data = sqlite3.connect(ledger)
        assert data.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        data.close()
    return len([path for path in results if not path.name.startswith(".")])


@pytest.mark.slow
def test_killed_twenty_times_and_resumed(many: Path) -> None:
    undisturbed = batch("logs", "whole", prior="plan.png")
    random, progress = np.random.default_rng(11), [0]
    for _ in range(KILLS):
        process = command("logs", "-o", "runs", "--prior", "plan.png")
        wait = float(random.uniform(0.0, 6.0))
        try:
            process.communicate(timeout=wait)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        progress.append(sound(many / "runs") if (many / "runs").exists() else 0)
    assert progress == sorted(progress)  # nothing that was done is lost
    resumed = batch("logs", "runs", prior="plan.png")
    assert resumed.rows() == undisturbed.rows()
    assert contents(many / "runs") == contents(many / "whole")


@pytest.mark.slow
def test_runs_are_killed_and_the_batch_goes_on(many: Path) -> None:
    """Their logs are named as failed, or done where the nursery died; --retry makes them good."""
    undisturbed = batch("logs", "whole", prior="plan.png")
    process = command("logs", "-o", "runs", "--prior", "plan.png")
    random, kills = np.random.default_rng(12), 0
    while process.poll() is None and kills < KILLS:
        time.sleep(float(random.uniform(0.2, 0.8)))
        below = descendants(process.pid)
        if below:
            kills += 1
            victim = below[int(random.integers(len(below)))]
            try:
                os.kill(victim, signal.SIGKILL)
            except ProcessLookupError:
                continue
    process.communicate(timeout=300)
    assert process.returncode in (0, 3)
    sound(many / "runs")
    assert batch("logs", "runs", prior="plan.png", retry=True).rows() == undisturbed.rows()
    assert contents(many / "runs") == contents(many / "whole")


@pytest.mark.slow
def test_workers_of_a_cluster_are_killed(many: Path, tmp_path: Path) -> None:
    undisturbed = batch("logs", "whole", prior="plan.png")
    (tmp_path / "dask").mkdir()
    killed: list[int] = []
    with running(tmp_path / "dask", 6) as (address, workers):

        def watch(event: object) -> None:
            state, done = getattr(event, "state", ""), getattr(event, "done", 0)
            if state == "done" and done % 4 == 0 and len(killed) < len(workers) - 1:
                victim = workers[len(killed)]
                victim.kill()
                killed.append(victim.pid)

        found = batch("logs", "runs", prior="plan.png", cluster=address, watch=watch)
    assert len(killed) == 5
    assert found.rows() == undisturbed.rows()
    assert contents(many / "runs") == contents(many / "whole")


def descendants(pid: int) -> list[int]:
    """The processes below one."""
    out: list[int] = []
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return out
    for child in map(int, children):
        out += [child, *descendants(child)]
    return out


if sys.platform != "linux":
    pytest.skip("processes are looked up in /proc", allow_module_level=True)
