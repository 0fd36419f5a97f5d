"""`tune` on results of real runs: what it promises is what `run` then gives."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from formats.errors import FormatError, UsageError
from formats.plans.prior_values import read_prior_values
from formats.result import Result
from formats.results.file import read_result
from replay import run, tune
from replay.reproduction.example_plans import PX_PER_M, plan
from replay.tuning.reading import ground_of, values_of
from replay.tuning.surfaces import Tables
from tests.tuning_worlds import UPDATES

SAMPLES = Path(__file__).resolve().parents[3] / "sample_logs"
QUICK: dict[str, Any] = {"generations": 10, "steps": 10, "figures": False, "sensors": False}


def sample(folder: Path, name: str = "out", **options: Any) -> Result:
    given = {"prior": SAMPLES / "plan.png", "truth": SAMPLES / "truth.png", "every": 20}
    output = folder / f"{name}.replay.mcap"
    return run(SAMPLES / "turtlebot.mcap", output=output, **{**given, "resolution": 0.1, **options})


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return sample(tmp_path_factory.mktemp("tune"))


def made(result: Result) -> Path:
    return Path(result.facts["result"])


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"cell_rule": "majority", "p_outside": 0.4},
        {"cell_rule": "fraction", "p_wall": 0.3, "p_space": 0.7},
        {"region": "observed", "prior_scale": 1.0},
        {"region": "image"},
        {"sensor": "eq15"},
        {"sensor": "gaussian"},
        {"sensor": "eq10-true"},
        {"prior": SAMPLES / "drawing.png", "p_door": 0.6, "p_window": 0.3},
    ],
    ids=lambda options: "-".join(map(str, options)) or "plain",
)
def test_the_tables_score_a_run_as_the_run_did(tmp_path: Path, options: dict[str, Any]) -> None:
    result = sample(tmp_path, **options)
    kept = read_result(made(result))
    case = ground_of(kept).case(kept.evidence())
    for update in UPDATES:
        tables = Tables(case, values_of(kept, update))
        p = result.settings["p_wall"], result.settings["p_space"]
        scores = tables.at([p[0]], [p[1]])
        assert scores.tp[0] == result.facts["scores"][update]["tp"]
        assert scores.fp[0] == result.facts["scores"][update]["fp"]
        assert scores.walls - scores.tp[0] == result.facts["scores"][update]["fn"]
    none = Tables(case, values_of(kept, "bayes")).without_prior()
    if "p_outside" not in options and "p_door" not in options:
        assert none.tp == result.facts["scores"]["none"]["tp"]
        assert none.fp == result.facts["scores"]["none"]["fp"]


def test_a_run_with_the_chosen_values_scores_as_promised(played: Result, tmp_path: Path) -> None:
    facts = tune(made(played), output=tmp_path / "t", **QUICK)
    chosen = facts["rules"]["bayes"]["picks"]["f2"]
    again = sample(tmp_path, prior_values=tmp_path / "t_prior.json")
    assert again.facts["scores"]["bayes"]["f2"] == chosen["f2"]
    assert chosen["f2"] >= facts["rules"]["bayes"]["picks"]["paper"]["f2"]
    assert facts["rules"]["bayes"]["picks"]["paper"]["f2"] == played.facts["scores"]["bayes"]["f2"]
    values = read_prior_values(tmp_path / "t_prior.json")
    assert (values.p_hit, values.p_miss, values.update) == (0.7, 0.4, "bayes")


def test_its_files_are_the_same_every_time(played: Result, tmp_path: Path) -> None:
    all_of_it = {"figures": True, "sensors": True, "update": "bayes"}
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        tune(made(played), output=tmp_path / name, **{**QUICK, **all_of_it})
    first, second = (sorted((tmp_path / name).iterdir()) for name in ("a", "b"))
    assert [path.name for path in first] == [path.name for path in second]
    assert len(first) == 7
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes()
    pictures = [cv2.imread(str(path)) for path in first if path.suffix == ".png"]
    assert all(picture is not None and np.ptp(picture) > 200 for picture in pictures)


def test_the_front_as_a_table(played: Result, tmp_path: Path) -> None:
    facts = tune(made(played), output=tmp_path / "t", update="paper", **QUICK)
    with (tmp_path / "t_front.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == facts["rules"]["paper"]["front"]["points"]
    best = max(rows, key=lambda row: float(row["f2"]))
    assert float(best["f2"]) == pytest.approx(
        facts["rules"]["paper"]["picks"]["f2"]["f2"], abs=1e-6
    )
    assert int(best["tp"]) + int(best["fn"]) == facts["rules"]["paper"]["walls"]
    recalls = [float(row["recall"]) for row in rows]
    assert recalls == sorted(recalls)


def test_several_runs_choose_the_best_worst_case(played: Result, tmp_path: Path) -> None:
    other = sample(tmp_path, "other", start_offset=40.0)
    facts = tune([made(played), made(other)], output=tmp_path / "t", **QUICK)
    found = facts["rules"]["bayes"]["picks"]
    assert facts["chosen"]["pick"] == "robust"
    tens = [row for name, row in found.items() if name in ("paper", "shortlist", "early")]
    assert all(found["robust"]["worst_f2"] >= row["worst_f2"] for row in tens)
    assert (
        facts["rules"]["bayes"]["walls"]
        == 2 * played.facts["scores"]["none"]["fn"] + 2 * (played.facts["scores"]["none"]["tp"])
    )


def test_another_sensor_needs_no_other_run(played: Result, tmp_path: Path) -> None:
    facts = tune(made(played), output=tmp_path / "t", p_hit=0.9, p_miss=0.1, **QUICK)
    again = sample(tmp_path, p_hit=0.9, p_miss=0.1)
    mine = facts["rules"]["bayes"]["picks"]["paper"]["f2"]
    assert mine == again.facts["scores"]["bayes"]["f2"]
    assert facts["chosen"]["p_hit"] == 0.9


def test_a_prior_that_breaks_equation_13_is_warned_of(played: Result, tmp_path: Path) -> None:
    from formats.errors import Notes

    notes = Notes()
    tune(
        *(made(played),), output=tmp_path / "t", update="paper", p_hit=0.7, p_miss=0.4,
        pick="paper", notes=notes, **QUICK,
    )  # fmt: skip
    assert any("Equation 13" in note.problem for note in notes.of("warning"))


def test_what_poses_depend_on_is_said(tmp_path: Path) -> None:
    from replay.tuning.telling import report

    placed = sample(tmp_path, poses="amcl", every=1, duration=20.0)
    facts = tune(made(placed), output=tmp_path / "t", **QUICK)
    assert list(facts["poses_depend_on"]) == [str(made(placed))]
    assert "plan" in facts["poses_depend_on"][str(made(placed))]
    assert "poses   of out.replay.mcap depend on more than its log: plan" in report(facts)


def test_a_plan_is_explored_by_the_papers_robot(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), plan("d").gray)
    scale = 1 / PX_PER_M
    facts = tune(tmp_path / "d.png", output=tmp_path / "t", plan_resolution=scale, cell=10, **QUICK)
    assert facts["rules"]["paper"]["sensor"] == "0.9 / 0.1"
    assert facts["rules"]["bayes"]["picks"]["f2"]["f2"] > 0.9
    assert facts["rules"]["bayes"]["no_prior"]["f2"] < 0.8


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"pick": "luck"}, "no pick 'luck'"),
        ({"algorithm": "moea"}, "no algorithm 'moea'"),
        ({"steps": 1}, "--steps"),
        ({"update": "mean"}, "no update"),
    ],
)
def test_what_is_not_possible_is_refused(
    played: Result, tmp_path: Path, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        tune(made(played), output=tmp_path / "t", **{**QUICK, **options})


def test_files_that_cannot_be_tuned_are_refused(played: Result, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot be read"):
        tune(tmp_path / "none.replay.mcap", output=tmp_path / "t", **QUICK)
    with pytest.raises(FormatError, match="not a result of replay"):
        tune(SAMPLES / "turtlebot.mcap", output=tmp_path / "t", **QUICK)
    bare = sample(tmp_path, "bare", prior=None, truth=None)
    with pytest.raises(FormatError, match="nothing to tune"):
        tune(made(bare), output=tmp_path / "t", **QUICK)
    other = sample(tmp_path, "other", sensor="eq15")
    with pytest.raises(UsageError, match="another sensor"):
        tune([made(played), made(other)], output=tmp_path / "t", **QUICK)
    (tmp_path / "t_front.csv").write_text("mine")
    with pytest.raises(FormatError, match="exists already"):
        tune(made(played), output=tmp_path / "t", **QUICK)
    assert not (tmp_path / "t_prior.json").exists()


def test_the_command_line_prints_json(played: Result, tmp_path: Path) -> None:
    command = ["-m", "replay.cli", "tune", str(made(played)), "-o", str(tmp_path / "t"), "--json"]
    code = "import sys; from replay.cli import main; main(sys.argv[1:])"
    done = subprocess.run(
        [sys.executable, "-c", code, *command[2:], "--generations", "5", "--no-figures"],
        capture_output=True,
        text=True,
        check=True,
    )
    answer = json.loads(done.stdout)
    assert answer["schema"] == 1
    assert answer["rules"]["paper"]["search"]["evaluations"] == 300
    assert len(answer["rules"]["bayes"]["surfaces"]["f2"]) == 10
