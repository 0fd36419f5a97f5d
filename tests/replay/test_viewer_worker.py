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


def test_the_process_that_draws_is_without_pandas_and_pyarrow_bears_it() -> None:
    """pyarrow asks for pandas when it makes arrays of what it does not know."""
    code = (
        "import replay.viewing.no_pandas, sys, numpy, pyarrow; "
        "pyarrow.FixedSizeListArray.from_arrays(numpy.zeros(4, 'f4'), 2); "
        "pyarrow.FixedSizeListArray.from_arrays([0.0, 1.0], 2); "
        "assert 'pandas' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
