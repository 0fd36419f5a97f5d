"""Re-scored results: to the bit the counts of a fresh run with that prior."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, UsageError
from formats.grid import Evidence
from formats.results.file import read_result
from formats.results.groups import Groups, grouped, scored_cells
from formats.results.kept import read_kept
from replay import run
from replay.archive.rescoring import at_the_end, cell_by_cell, through_time
from tests.faults_world import drive, write_plan

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
SAMPLES = Path(__file__).resolve().parents[3] / "sample_logs"
# The room of tests/faults_world.py at p_wall 0.3, p_space 0.6 and 0.9 / 0.2.
OTHERWISE = {
    "none": [[157, 0, 5, 1519], [0, 0, 198, 57]],
    "bayes": [[158, 0, 4, 1519], [198, 0, 0, 57]],
    "paper": [[145, 0, 17, 1519], [198, 0, 0, 57]],
}
DRAWN: dict[str, Any] = {"plan": "drawing.png", "region": "image"}  # cells outside are scored, too
PRIORS: list[dict[str, Any]] = [
    {},
    {"p_wall": 0.4, "p_space": 0.6},
    {"p_wall": 0.05, "p_space": 0.99, "prior_scale": 1.0, "p_outside": 0.3},
    {"p_hit": 0.9, "p_miss": 0.1},
    {"p_hit": 0.9, "p_miss": 0.1, "update": "paper", "p_wall": 0.3},
    {"update": "paper"},
    {"p_door": 0.35, "p_window": 0.7},
    {"p_wall": 0.0, "p_space": 1.0},
]


def made(folder: Path, name: str = "a", **options: Any) -> Path:
    path = folder / f"{name}.replay.mcap"
    given = {"truth": SAMPLES / "truth.png", "every": 16, **options}
    plan = given.pop("plan", "plan.png")
    run(SAMPLES / "turtlebot.mcap", plan and SAMPLES / plan, output=path, **given)
    return path


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def drawn(home: Path) -> Path:
    """Over a drawing with doors, so that every kind of cell occurs."""
    return made(home, "drawn", **DRAWN)


@pytest.mark.parametrize("number", range(len(PRIORS)))
def test_the_counts_of_a_fresh_run(number: int, drawn: Path, home: Path) -> None:
    values = PRIORS[number]
    fresh = read_result(made(home, f"fresh{number}", **DRAWN, **values))
    (found,) = at_the_end(read_kept(drawn), [values])
    assert found.keys() == fresh.counts.keys() == {"none", "bayes", "paper"}
    for name, counts in found.items():
        assert counts.tolist() == fresh.counts[name][-1].tolist()
    kept = list(through_time(read_kept(drawn, whole=True), [values]))
    assert [frame for frame, _, _ in kept] == [change.frame for change in fresh.changes]
    for frame, time, (each,) in kept:
        assert time == fresh.times_ns[frame]
        for name, counts in each.items():
            assert counts.tolist() == fresh.counts[name][frame].tolist()


def test_the_priors_differ_and_doors_count(drawn: Path) -> None:
    """Else the test above would say nothing."""
    kept = read_kept(drawn)
    assert kept.groups is not None
    kinds = {bit for kind in kept.groups.kind for bit in range(6) if kind >> bit & 1}
    assert kinds == {0, 1, 2, 3, 5}
    found = at_the_end(kept, PRIORS)
    everything = {b"".join(counts.tobytes() for counts in each.values()) for each in found}
    assert len(everything) == len(PRIORS) - 1  # `paper` takes 0.9 / 0.1, which the fourth says


def test_many_priors_at_once_are_each_of_them(drawn: Path) -> None:
    grid = [{"p_wall": w / 20, "p_space": s / 20} for w in range(1, 20, 2) for s in range(2, 20, 2)]
    kept = read_kept(drawn, whole=True)
    together = at_the_end(kept, grid)
    for values, found in list(zip(grid, together, strict=True))[::11]:
        alone = cell_by_cell(kept, values, kept.evidence())
        assert {n: c.tolist() for n, c in found.items()} == {
            n: c.tolist() for n, c in alone.items()
        }
    *_, (_, _, last) = through_time(kept, grid)
    assert [{n: c.tolist() for n, c in each.items()} for each in last] == [
        {n: c.tolist() for n, c in each.items()} for each in together
    ]


def test_windows_and_doors_by_kind_are_those_cell_by_cell(drawn: Path) -> None:
    """The drawing has no windows: put some anywhere, also where walls, doors and nothing are."""
    kept = read_kept(drawn, whole=True)
    random = np.random.default_rng(3)
    for name in ("door", "window"):
        kept.layers[name] = np.where(random.random(kept.geometry.shape) < 0.3, 0.5, 0.0)
    evidence = kept.evidence()
    cells = scored_cells(kept.layers, evidence.counts)
    assert cells is not None
    kept.groups = grouped(cells)
    for values in ({"p_door": 0.2}, {"p_window": 0.8}, {"p_door": 0.1, "p_window": 0.9}):
        slow = cell_by_cell(kept, values, evidence)
        (fast,) = at_the_end(kept, [values])
        assert {n: c.tolist() for n, c in fast.items()} == {n: c.tolist() for n, c in slow.items()}


@pytest.mark.parametrize("rule", ["majority", "fraction"])
def test_other_rules_of_cells(rule: Any, home: Path) -> None:
    kept = read_kept(made(home, rule, cell_rule=rule), whole=True)
    values = {"p_wall": 0.3, "p_space": 0.7}
    fresh = read_result(made(home, f"{rule}2", cell_rule=rule, **values))
    (found,) = at_the_end(kept, [values])
    *_, (_, _, (last,)) = through_time(kept, [values])
    for name, counts in fresh.counts.items():
        assert found[name].tolist() == counts[-1].tolist()
        assert last[name].tolist() == counts[-1].tolist()


def test_a_sensor_with_many_levels(home: Path) -> None:
    kept = read_kept(made(home, "eq15", sensor="eq15", every=40))
    fresh = read_result(made(home, "eq15b", sensor="eq15", every=40, p_hit=0.8, p_miss=0.3))
    (found,) = at_the_end(kept, [{"p_hit": 0.8, "p_miss": 0.3}])
    for name, counts in fresh.counts.items():
        assert found[name].tolist() == counts[-1].tolist()


def test_without_a_plan_there_is_one_curve(home: Path) -> None:
    kept = read_kept(made(home, "bare", plan=""))
    (found,) = at_the_end(kept, [{"p_hit": 0.9}])
    fresh = read_result(made(home, "bare2", plan="", p_hit=0.9))
    assert found["none"].tolist() == fresh.counts["none"][-1].tolist()


def test_without_a_truth_there_is_no_score(home: Path) -> None:
    path = home / "unscored.replay.mcap"
    run(SAMPLES / "turtlebot.mcap", output=path, every=80)
    kept = read_kept(path)
    assert kept.groups is not None  # of no cell
    (found,) = at_the_end(kept, [{}])
    assert found["none"].sum() == 0


def test_a_result_of_an_earlier_version() -> None:
    """Written before results kept groups; its log and plan are those of tests/faults_world.py."""
    path = GOLDEN / "result_1.mcap"
    kept, full = read_kept(path), read_result(path)
    (found,) = at_the_end(kept, [{}])
    for name, counts in full.counts.items():
        assert found[name].tolist() == counts[-1].tolist()
    (other,) = at_the_end(kept, [{"p_wall": 0.3, "p_space": 0.6, "p_hit": 0.9, "p_miss": 0.2}])
    assert {name: counts.tolist() for name, counts in other.items()} == OTHERWISE


def test_an_earlier_result_is_scored_as_a_fresh_run(tmp_path: Path) -> None:
    log, plan = drive().write(tmp_path / "drive.mcap"), write_plan(tmp_path)
    values = {"p_wall": 0.3, "p_space": 0.6, "p_hit": 0.9, "p_miss": 0.2}
    fresh = run(log, plan, output=tmp_path / "x.replay.mcap", **values)
    assert {name: counts[-1].tolist() for name, counts in fresh.counts.items()} == OTHERWISE


def test_read_in_a_moment_or_whole_the_same(drawn: Path) -> None:
    quick, whole = read_kept(drawn), read_kept(drawn, whole=True)
    assert not quick.layers
    assert whole.layers
    assert quick.groups is not None
    assert whole.groups is not None
    for name in ("kind", "counts", "cells"):
        assert np.array_equal(getattr(quick.groups, name), getattr(whole.groups, name))
    assert (quick.settings, quick.facts, quick.geometry) == (
        whole.settings,
        whole.facts,
        whole.geometry,
    )


def test_every_damage_is_seen(drawn: Path, tmp_path: Path) -> None:
    data = bytearray(drawn.read_bytes())
    random = np.random.default_rng(5)
    for at in random.integers(0, len(data), 60):
        hurt = bytes(data[:at]) + bytes([data[at] ^ 0x10]) + bytes(data[at + 1 :])
        (tmp_path / "x.mcap").write_bytes(hurt)
        try:
            kept = read_kept(tmp_path / "x.mcap")
        except FormatError:
            continue
        # Behind the data, in what only repeats it: nothing is lost.
        assert (
            at_the_end(kept, [{}])[0]["bayes"].tolist()
            == at_the_end(read_kept(drawn), [{}])[0]["bayes"].tolist()
        )
    for cut in random.integers(0, len(data), 20):
        (tmp_path / "x.mcap").write_bytes(data[:cut])
        with pytest.raises(FormatError):
            read_kept(tmp_path / "x.mcap")


def test_values_that_need_the_log_or_make_no_sense(drawn: Path) -> None:
    kept = read_kept(drawn)
    with pytest.raises(UsageError, match="resolution cannot be changed"):
        at_the_end(kept, [{"resolution": 0.1}])
    with pytest.raises(UsageError, match=r"p-wall 1\.5 is not from 0 to 1"):
        at_the_end(kept, [{"p_wall": 1.5}])


@pytest.mark.parametrize("most", [3, 1 << 13, (1 << 32) - 1])
@pytest.mark.parametrize("levels", [1, 2, 9])
def test_groups_are_the_cells(most: int, levels: int) -> None:
    """Against a dictionary; also where readings do not fit into 64 bits together."""
    random = np.random.default_rng(levels)
    shape = (20, 31)
    layers = {
        "wall": random.choice([0.0, 0.3, 0.5, 0.7], shape),
        "outside": random.integers(0, 2, shape),
        "truth_wall": random.integers(0, 2, shape),
        "truth_scored": random.integers(0, 2, shape),
        "door": random.choice([0.0, 0.1], shape),
        "window": random.choice([0.0, 1.0], shape),
    }
    counts = random.choice([0, 1, most], (levels, *shape)).astype(np.uint32)
    expected: dict[tuple[int, ...], int] = {}
    for r in range(shape[0]):
        for c in range(shape[1]):
            if layers["truth_scored"][r, c]:
                wall = layers["wall"][r, c]
                kind = (wall > 0) + 2 * (wall > 0.5) + 4 * layers["outside"][r, c]
                kind += 8 * (layers["door"][r, c] > 0) + 16 * (layers["window"][r, c] > 0)
                kind += 32 * layers["truth_wall"][r, c]
                key = (int(kind), *map(int, counts[:, r, c]))
                expected[key] = expected.get(key, 0) + 1
    cells = scored_cells(layers, counts)
    assert cells is not None
    found = grouped(cells)
    assert isinstance(found, Groups)
    keys = list(zip(found.kind.tolist(), *found.counts.tolist(), strict=True))
    assert dict(zip(keys, found.cells.tolist(), strict=True)) == expected
    assert keys == sorted(keys)
    assert scored_cells({"wall": layers["wall"]}, counts) is None


def test_evidence_of_what_was_kept_is_that_of_the_run(drawn: Path) -> None:
    kept, full = read_kept(drawn, whole=True), read_result(drawn)
    assert isinstance(kept.evidence(), Evidence)
    assert np.array_equal(kept.evidence().counts, full.evidence().counts)
