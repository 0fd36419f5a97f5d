"""`rescore`: an archive's tables under other priors and truths."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from formats.errors import FormatError, UsageError
from formats.plans.prior_values import PriorValues, write_prior_values
from formats.results.file import read_result
from formats.results.kept import read_kept
from replay import rescore, run
from replay.cli import _exit_code
from replay.scoring.count_metrics import METRICS
from replay.scoring.map_metrics import MAP_METRICS

ROOT = Path(__file__).resolve().parents[3]
SAMPLES = ROOT / "sample_logs"
LOG = SAMPLES / "turtlebot.mcap"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two results in folders, one of an earlier version, one cut, and a note of a failed log."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "a").mkdir()
    run(LOG, SAMPLES / "plan.png", output=folder / "a" / "1.replay.mcap", every=20)
    truth = SAMPLES / "truth.png"
    run(LOG, SAMPLES / "plan.png", truth=truth, output=folder / "a" / "2.replay.mcap", every=40)
    shutil.copy(ROOT / "tests" / "golden" / "result_1.mcap", folder / "old.replay.mcap")
    data = (folder / "a" / "1.replay.mcap").read_bytes()
    (folder / "cut.replay.mcap").write_bytes(data[: len(data) // 2])
    (folder / "b.failed.json").write_text(json.dumps({"error": "drive.bag: is empty"}))
    (folder / "notes.txt").write_text("not a result")
    return folder


def test_rows_and_what_failed(archive: Path) -> None:
    scored = rescore(archive, p_wall=0.3, p_space=0.8)
    assert scored.results == 3
    assert set(scored.failed) == {"cut.replay.mcap", "b"}
    assert "damaged" in scored.failed["cut.replay.mcap"]
    assert scored.failed["b"] == "drive.bag: is empty"
    names = [(row["result"], row["curve"]) for row in scored.rows]
    expected = ["a/1.replay.mcap", "a/2.replay.mcap", "old.replay.mcap"]
    assert names == [(name, curve) for name in expected for curve in ("none", "bayes", "paper")]
    row = scored.rows[1]
    tp, fp, fn = (row[f"observed_{n}"] + row[f"unobserved_{n}"] for n in ("tp", "fp", "fn"))
    assert row["f2"] == pytest.approx(5 * tp / (5 * tp + 4 * fn + fp), rel=1e-15)
    assert set(METRICS) <= row.keys()
    before = read_result(archive / "a" / "1.replay.mcap").facts["scores"]["bayes"]["f2"]
    assert row["was_f2"] == pytest.approx(before, rel=1e-15)
    assert len(scored.frame()) == 9
    assert "<td>a/1.replay.mcap</td>" in scored._repr_html_()


def test_every_metric_of_maps_is_that_of_the_run(tmp_path: Path) -> None:
    names = list(MAP_METRICS)
    out = tmp_path / "m.replay.mcap"
    made: dict[str, Any] = {"truth": SAMPLES / "truth.png", "every": 40, "metrics": names}
    told = run(LOG, SAMPLES / "plan.png", output=out, **made).facts["metrics"]
    other = tmp_path / "o.replay.mcap"
    fresh = run(LOG, SAMPLES / "plan.png", output=other, p_wall=0.45, **made).facts["metrics"]
    for name in names:
        rows = rescore(out, metric=name, p_wall=0.45).rows
        assert {row["curve"]: row[name] for row in rows} == {c: v[name] for c, v in fresh.items()}
        assert {row["curve"]: row[f"was_{name}"] for row in rows} == {
            c: v[name] for c, v in told.items()
        }
    last = rescore(out, metric="brier", over_time=True).rows[-3:]
    assert [row["brier"] for row in last] == [value["brier"] for value in told.values()]
    assert [row["f2"] for row in last] == [row["f2"] for row in rescore(out).rows]
    seen = rescore(out, metric="brier", region="observed").rows
    assert seen[0]["brier"] < last[0]["brier"]  # without a prior, what nobody saw is a half
    bare = rescore(out, metric="brier", truth=SAMPLES / "plan.png").rows
    assert [row["was_brier"] for row in bare] == [value["brier"] for value in told.values()]
    assert bare[0]["brier"] != told["none"]["brier"]


def test_the_table_knows_that_less_error_is_better(
    archive: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = str(archive / "a" / "1.replay.mcap")
    assert _exit_code(["rescore", one, "--metric", "brier", "--p-wall", "0.45"]) == 0
    line = next(row for row in capsys.readouterr().out.splitlines() if "prior, bayes" in row)
    now, then, better, worse = line.split()[2:]
    assert float(now) > float(then)
    assert (better, worse) == ("0", "1")
    for wrong, words in (
        ("predictive", "a result does not keep; `replay run --metric predictive` has it"),
        ("brir", "no such metric; did you mean brier?"),
        ("f2,f1", "one metric at a time"),
    ):
        assert _exit_code(["rescore", one, "--metric", wrong]) == 2
        assert words in capsys.readouterr().err


def test_another_truth_is_that_of_a_fresh_run(archive: Path, tmp_path: Path) -> None:
    """Also a truth that lies where the plan does because it has its size."""
    bare = tmp_path / "truth.png"
    shutil.copy(SAMPLES / "truth.png", bare)
    fresh = run(LOG, SAMPLES / "plan.png", truth=bare, output=tmp_path / "x.replay.mcap", every=20)
    expected = {name: counts[-1].tolist() for name, counts in fresh.counts.items()}
    for truth in (bare, SAMPLES / "truth.png"):
        scored = rescore(archive / "a" / "1.replay.mcap", truth=truth)
        found = {
            row["curve"]: [
                [row[f"{part}_{n}"] for n in ("tp", "fp", "fn", "tn")]
                for part in ("observed", "unobserved")
            ]
            for row in scored.rows
        }
        assert found == expected
    old = rescore(archive / "a" / "1.replay.mcap").rows[1]
    assert old["f2"] != rescore(archive / "a" / "1.replay.mcap", truth=bare).rows[1]["f2"]


def test_a_truth_that_cannot_be_used_is_an_error_of_its_own(archive: Path, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"nothing\.png"):
        rescore(archive, truth=tmp_path / "nothing.png")


def test_over_time_and_observed(archive: Path) -> None:
    scored = rescore(archive / "a" / "1.replay.mcap", over_time=True, region="observed")
    full = read_result(archive / "a" / "1.replay.mcap")
    rows = [row for row in scored.rows if row["curve"] == "paper"]
    assert [row["frame"] for row in rows] == [change.frame for change in full.changes]
    for row in rows:
        assert row["time_ns"] == full.times_ns[row["frame"]]
        seen = full.counts["paper"][row["frame"], 0].tolist()
        assert [row[f"observed_{n}"] for n in ("tp", "fp", "fn", "tn")] == seen
        assert row["f2"] == row["observed_f2"]


def test_priors_by_file_grid_and_label(archive: Path, tmp_path: Path) -> None:
    one = archive / "a" / "1.replay.mcap"
    write_prior_values(tmp_path / "tuned.json", PriorValues(0.1, 0.7, update="paper"))
    filed = rescore(one, prior_values=tmp_path / "tuned.json")
    assert list(filed.priors) == ["tuned.json"]
    said = rescore(one, p_wall=0.1, p_space=0.7, update="paper")
    skip = ("prior",)
    assert [{k: v for k, v in row.items() if k not in skip} for row in filed.rows] == [
        {k: v for k, v in row.items() if k not in skip} for row in said.rows
    ]
    grid = rescore(one, grid={"p_wall": [0.1, 0.3], "p_space": [0.7, 0.9]}, update="paper")
    assert len(grid.rows) == 4 * 3
    assert grid.rows[0]["f2"] == said.rows[0]["f2"]
    named = rescore(one, priors={"timid": {"p_wall": 0.4, "p_space": 0.6}, "as is": {}})
    assert {row["prior"] for row in named.rows} == {"timid", "as is"}


def test_refusals(archive: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="resolution: cannot be changed"):
        rescore(archive, resolution=0.1)
    with pytest.raises(UsageError, match="no such metric"):
        rescore(archive, metric="beauty")
    with pytest.raises(UsageError, match="region"):
        rescore(archive, region="image")
    with pytest.raises(FormatError, match="holds no results"):
        rescore(tmp_path)
    with pytest.raises(FormatError, match="does not exist"):
        rescore(tmp_path / "nowhere")


def test_the_command(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["rescore", str(archive), "--p-wall", "0.3", "-o", "t.csv", "-o", "t.parquet"]
    assert _exit_code(words) == 3
    said = capsys.readouterr()
    assert said.out.startswith("5 results: 3 scored, 2 failed\n")
    assert "failed  cut.replay.mcap: damaged" in said.out
    assert "failed  b: drive.bag: is empty" in said.out
    rows = list(csv.DictReader(Path("t.csv").read_text().splitlines()))
    table = pq.read_table("t.parquet").to_pylist()
    assert len(rows) == len(table) == 9
    assert [float(row["f2"]) for row in rows] == [row["f2"] for row in table]
    assert _exit_code(words) == 1  # they exist
    assert _exit_code(["rescore", str(archive), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert (found["schema"], found["results"], len(found["rows"])) == (1, 3, 9)
    one = str(archive / "a" / "1.replay.mcap")
    assert _exit_code(["rescore", one, "--grid", "p-wall=0.1:0.5:20"]) == 0
    assert "20 priors (was " in capsys.readouterr().out
    assert _exit_code(["rescore", one, "--grid", "p-wall=x"]) == 2
    assert _exit_code(["rescore", one, "-o", "t.xlsx"]) == 2


def test_poses_that_depend_on_more_than_the_log_are_said(
    archive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = read_kept

    def read(*words: Any, **options: Any) -> Any:
        kept = real(*words, **options)
        kept.facts["poses_depend_on"] = "log, plan, seed 1"
        return kept

    monkeypatch.setattr("replay.archive.rescored.read_kept", read)
    assert _exit_code(["rescore", str(archive / "a")]) == 0
    assert "poses   of 2 depend on plan, seed 1" in capsys.readouterr().out


NASTY = ("=cmd|'/c calc'!A1", "<script>alert(1)</script>", "[red]x[/red]", "/\x1b[31mscan\x07")


@pytest.mark.parametrize("name", NASTY)
def test_names_are_only_text(
    name: str, archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    safe = name.replace("/", "_")
    shutil.copy(archive / "a" / "1.replay.mcap", folder / f"{safe}.replay.mcap")
    (folder / f"{safe}.failed.json").write_text(json.dumps({"error": name}))
    table = tmp_path / "t.csv"
    assert _exit_code(["rescore", str(folder), "-o", str(table)]) == 3
    said = capsys.readouterr()
    assert all(line.isprintable() for line in (said.out + said.err).splitlines())
    for row in csv.reader(table.read_text().splitlines()):
        assert not [cell for cell in row if cell[:1] in ("=", "+", "@", "\x1b")]
    assert "<script>" not in rescore(folder)._repr_html_()
