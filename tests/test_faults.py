"""What a log, a map or a drawing can do to `replay run`, from the user's side: one case a fault.

Each case writes its own small files and runs the command line. Whatever comes, there is no
traceback, each distinct problem is one line that names the file, memory and time stay bounded, no
socket is opened, and nothing is written but the named output.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.grid import Evidence
from formats.result_file import read_result
from replay.cli import _exit_code
from tests import faults_mcap, faults_scans, faults_times
from tests.faults_case import Case, Given
from tests.faults_world import drive, write_plan

CASES: list[Case] = [*faults_mcap.table.cases, *faults_scans.table.cases, *faults_times.table.cases]
ROWS = range(1, 73)
MOST_MEMORY, MOST_SECONDS = 1 << 20, 20.0  # kB, s
MOST_CELLS = 1_000_000
KINDS = ("replay: ", "warning: ", "skipped: ", "lost: ")
Counted = dict[tuple[int, int], tuple[int, ...]]
_sockets: list[str] = []


def _listen(event: str, _arguments: Any) -> None:
    if event.startswith("socket.") and event != "socket.__new__":
        _sockets.append(event)


sys.addaudithook(_listen)


def sparse(evidence: Evidence) -> Counted:
    """Counts by the cell's number on the plane, so that evidence of other extents compares."""
    g = evidence.geometry
    row0, col0 = round(g.y / g.resolution), round(g.x / g.resolution)
    rows, cols = np.nonzero(evidence.counts.sum(axis=0))
    return {
        (r + row0, c + col0): tuple(evidence.counts[:, r, c].tolist())
        for r, c in zip(rows.tolist(), cols.tolist(), strict=True)
    }


def evidence_of(log: Path, plan: Path, out: Path) -> Counted:
    """What comes of a log without a fault."""
    words = ["run", str(log), "--prior", str(plan), "-o", str(out)]
    assert _exit_code(words) == 0
    return sparse(read_result(out).evidence())


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Counted:
    """Evidence of the drive without a fault."""
    folder = tmp_path_factory.mktemp("sound")
    return evidence_of(drive().write(folder / "a.mcap"), write_plan(folder), folder / "out")


def peak() -> int:
    """kB of memory at most since `forget_peak`."""
    text = Path("/proc/self/status").read_text(encoding="ascii")
    found = re.search(r"VmHWM:\s+(\d+)", text)
    assert found
    return int(found[1])


@pytest.fixture
def _bounded() -> Iterator[None]:
    """Memory and time of the test stay within limits, and it opens no socket."""
    _sockets.clear()
    start = time.perf_counter()
    measured = Path("/proc/self/clear_refs").exists()
    if measured:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    yield
    assert time.perf_counter() - start < MOST_SECONDS
    assert not measured or peak() < MOST_MEMORY
    assert _sockets == []


def arguments(given: Given, plan: Path) -> tuple[list[str], list[str]]:
    """Of `replay run`, and the names of the files that a message may speak of."""
    logs = given.log if isinstance(given.log, list | tuple) else [given.log]
    logs = [str(log) for log in logs if log is not None]
    prior = str(given.plan or plan)
    words = ["run", "--prior", prior, "--quiet", *logs, *map(str, given.options)]
    names = [*logs, prior, *map(str, given.options)]
    return words, [Path(name).name for name in names if not name.startswith("--")]


@pytest.mark.usefixtures("_bounded")
@pytest.mark.parametrize("case", CASES, ids=str)
def test_fault(
    case: Case,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    sound: Counted,
) -> None:
    monkeypatch.chdir(tmp_path)
    plan, given = write_plan(tmp_path), case.make(tmp_path)
    given = given if isinstance(given, Given) else Given(given)
    words, names = arguments(given, plan)
    if given.like:
        sound = evidence_of(given.like, plan, tmp_path / "like")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    capsys.readouterr()
    code = _exit_code([*words[:1], "-o", "out.replay.mcap", *words[1:]])
    out, err = capsys.readouterr()
    lines = err.splitlines()
    print(err, file=sys.stderr)  # for whoever reads a failure

    assert code == case.code
    assert "Traceback" not in out + err
    assert [line for line in lines if not line.startswith(KINDS)] == []
    assert len(lines) == len(set(lines)), "one line for each distinct problem"
    assert all(line.isprintable() and len(line) < 1000 for line in lines + out.splitlines())
    assert not case.quiet or lines == []
    for said in case.says:
        found = [line for line in lines if said in line]
        assert found, f"nothing says {said!r}"
        shown = [
            name.encode("unicode_escape").decode() if not name.isprintable() else name
            for name in names
        ]
        assert any(name in line for line in found for name in shown)

    result = tmp_path / "out.replay.mcap"
    new = {path for path in tmp_path.rglob("*") if path not in before}
    assert {path for path in before if path.stat().st_mtime_ns != before[path]} <= {tmp_path}
    if code in (1, 2):
        assert new == set()
        assert sum(line.startswith("replay: ") for line in lines) == 1
        return
    assert new == {result}
    evidence = read_result(result).evidence()
    assert evidence.geometry.rows * evidence.geometry.cols < MOST_CELLS
    compare(case, sparse(evidence), sound)
    if given.check:
        given.check(evidence)


def compare(case: Case, found: dict[Any, Any], sound: dict[Any, Any]) -> None:
    """The map is not silently another one."""
    if case.map == "same":
        assert found == sound
        return
    total = sum(sum(counts) for counts in sound.values())
    assert sum(sum(counts) for counts in found.values()) >= case.least * total
    if case.map == "part":
        nothing = (0,) * 2
        above = [c for c, n in found.items() if np.any(np.subtract(n, sound.get(c, nothing)) > 0)]
        assert above == []
