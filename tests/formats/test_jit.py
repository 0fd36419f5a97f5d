"""Kernels compile and are cached wherever we may write, and compile where we may not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KERNEL = """
from formats.jit import njit
import os
namespace = {"__name__": "__main__"}
exec(compile("def double(x): return 2 * x", %r, "exec"), namespace)
double = njit(namespace["double"])
twice, place = double(21), os.environ.get("NUMBA_CACHE_DIR", "nowhere")
print(twice, place, sum(double.stats.cache_hits.values()))
"""


def run(source: Path, **environment: str) -> list[str]:
    """What a kernel of this source file, in a process of its own, returned and was cached in."""
    keep = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", KERNEL % str(source)],
        env={**keep, **environment, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "kernel.py"
    path.write_text("def double(x): return 2 * x")
    return path


def test_second_process_finds_the_machine_code(source: Path, tmp_path: Path) -> None:
    place = str(tmp_path / "plan-replay" / "numba")
    assert run(source, XDG_CACHE_HOME=str(tmp_path)) == ["42", place, "0"]
    assert run(source, XDG_CACHE_HOME=str(tmp_path)) == ["42", place, "1"]


def test_the_user_s_choice_is_kept(source: Path, tmp_path: Path) -> None:
    place = str(tmp_path / "mine")
    assert run(source, NUMBA_CACHE_DIR=place)[1] == place
    assert any(Path(place).rglob("*.nbi"))


def test_temporary_folder_where_home_is_unwritable(source: Path, tmp_path: Path) -> None:
    found = run(source, XDG_CACHE_HOME="/dev/null/cache", TMPDIR=str(tmp_path))
    assert found[0] == "42"
    assert Path(found[1]).parent == tmp_path


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs an unwritable /proc")
def test_kernels_run_where_nothing_is_writable() -> None:
    nowhere = {"XDG_CACHE_HOME": "/proc/no", "HOME": "/proc/no", "NUMBA_CACHE_DIR": "/proc/no"}
    assert run(Path("/proc/version"), **nowhere)[::2] == ["42", "0"]
