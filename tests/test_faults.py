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
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.grid import Evidence
from formats.results.file import RunFile, read_result
from replay.cli import _exit_code
from tests import (
    faults_containers,
    faults_depth,
    faults_mcap,
    faults_plans,
    faults_poses,
    faults_scans,
    faults_times,
)
from tests.faults_case import Case, Given
from tests.faults_world import drive, plan_pixels, write_plan

MODULES = (
    faults_mcap,
    faults_scans,
    faults_times,
    faults_poses,
    faults_depth,
    faults_containers,
    faults_plans,
)
CASES: list[Case] = [case for module in MODULES for case in module.table.cases]
ROWS = range(1, 76)
# Rows of processes and reports are no files that a run is given: file -> tests.
ELSEWHERE: dict[int, dict[str, tuple[str, ...]]] = {
    73: {
        "tests/test_processes.py": (
            "test_a_full_disk_is_one_line_and_leaves_nothing",
            "test_a_read_only_folder",
        ),
        "tests/formats/test_output.py": (
            "test_existing_output_is_kept_without_force",
            "test_an_input_is_never_replaced",
            "test_a_failing_block_leaves_the_old_output",
        ),
    },
    74: {
        "tests/test_processes.py": (
            "test_interrupted_leaves_no_half_file",
            "test_killed_shows_no_torn_result",
            "test_a_closed_pipe_is_quiet",
            "test_a_circle_of_links_is_one_line",
            "test_a_log_that_changes_while_it_is_read_is_said",
        ),
        "tests/replay/archive/test_batching.py": (
            "test_a_bad_log_costs_only_itself",
            "test_two_batches_on_one_archive",
            "test_interrupted_and_resumed",
        ),
        "tests/test_usage.py": ("test_one_log_twice_and_two_different_ones",),
    },
    75: {
        "tests/test_processes.py": ("test_names_from_a_log_are_only_text",),
        "tests/replay/test_reporting.py": ("test_text_of_files_is_never_markup",),
    },
}
MOST_MEMORY, MOST_SECONDS = 1 << 20, 20.0  # kB, s
USUAL_MEMORY = 300_000  # kB of a process that has mapped a small log before
MOST_CELLS = 1_100_000
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


def walls(run: RunFile) -> set[tuple[int, int]]:
    """Cells of the prior that are wall, by their numbers on the plane."""
    g, prior = run.geometry, run.curves["bayes"].prior
    row0, col0 = round(g.y / g.resolution), round(g.x / g.resolution)
    return {(r + row0, c + col0) for r, c in np.argwhere(prior.occupied()).tolist()}


# The plan's pixels are cells of the default resolution; its lower left corner is (-1.1, -1.1) m.
SOUND_WALLS = {(21 - r, c - 22) for r, c in np.argwhere(plan_pixels() == 0).tolist()}


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
    """kB of memory at most since it was last forgotten."""
    text = Path("/proc/self/status").read_text(encoding="ascii")
    found = re.search(r"VmHWM:\s+(\d+)", text)
    assert found
    return int(found[1])


@contextmanager
def bounded() -> Iterator[None]:
    """What happens inside stays within limits of memory and time, and opens no socket."""
    _sockets.clear()
    measured = Path("/proc/self/clear_refs").exists()
    if measured:  # forget the peak so far
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    # What earlier tests left in this process is not the fault's.
    start, before = time.process_time(), peak() if measured else 0
    yield
    assert time.process_time() - start < MOST_SECONDS
    assert not measured or peak() - before < MOST_MEMORY - USUAL_MEMORY
    assert _sockets == []


def arguments(given: Given, plan: Path) -> tuple[list[str], list[str]]:
    """Of `replay run`, and the names of the files that a message may speak of."""
    logs = given.log if isinstance(given.log, list | tuple) else [given.log]
    logs = [str(log) for log in logs if log is not None]
    prior = str(given.plan or plan)
    words = ["run", "--prior", prior, "--quiet", *logs, *map(str, given.options)]
    names = [*logs, prior, prior.replace(".yaml", ".pgm"), *map(str, given.options)]
    return words, [Path(name).name for name in names if not name.startswith("--")]


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
    with bounded():
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
    run = read_result(result)
    evidence = run.evidence()
    assert evidence.geometry.rows * evidence.geometry.cols < MOST_CELLS
    compare(case, sparse(evidence), sound)
    assert walls(run) == SOUND_WALLS
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


def test_every_row_of_the_table_has_its_cases() -> None:
    assert sorted({case.row for case in CASES} | set(ELSEWHERE)) == list(ROWS)
    root = Path(__file__).resolve().parent.parent
    for file, names in (item for row in ELSEWHERE.values() for item in row.items()):
        defined = re.findall(r"^def (test_\w+)\(", (root / file).read_text(), re.MULTILINE)
        assert set(names) <= set(defined), file
    assert len({str(case) for case in CASES}) == len(CASES)
