"""Short logs of the room of faults_world, and its plan."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults_world import drive, write_plan


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder, the current one, with plan.png and four logs of one room in logs/."""
    monkeypatch.chdir(tmp_path)
    write_plan(tmp_path)
    (tmp_path / "logs" / "b").mkdir(parents=True)
    for number, name in enumerate(["1", "2", "b/1", "b/3"]):
        drive(4 + number).write(tmp_path / "logs" / f"{name}.mcap")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    return tmp_path
