"""The process that draws a run, when the run itself ends before it has said so."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
START = "from replay.viewing.worker import main; main()"


@pytest.mark.parametrize("said", [b"", pickle.dumps("a report")[:-4]], ids=["nothing", "torn"])
def test_a_run_that_was_killed_leaves_its_drawing_without_a_word(said: bytes) -> None:
    asked = json.dumps({"path": None, "view": False, "connect": None, "budget": 1 << 20})
    done = subprocess.run(
        [sys.executable, "-c", START, asked], cwd=ROOT, input=said, capture_output=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
