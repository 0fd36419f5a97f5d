"""`run --metric` and `--intervals`: the same numbers as the functions, in JSON and table."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from formats.errors import UsageError
from replay import run
from replay.cli import _exit_code
from replay.cli.table import run_report
from replay.scoring.count_metrics import METRICS
from replay.scoring.map_metrics import MAP_METRICS
from replay.scoring.measuring import checked, names
from tests.replay.test_running import SAMPLES, sample


def test_names_come_alone_with_commas_and_once() -> None:
    assert checked(["iou,brier", "mcc", " iou"]) == ["iou", "brier", "mcc"]
    with pytest.raises(UsageError, match="no such metric; did you mean brier"):
        checked(["brir"])
    with pytest.raises(UsageError, match="there are precision, recall"):
        checked(["x,y"])


def test_every_metric_of_a_run(tmp_path: Path) -> None:
    found = sample(tmp_path, every=20, metrics=names(), intervals=True)
    facts = json.loads(json.dumps(found.facts, default=str, allow_nan=False))
    assert list(facts["metrics"]) == ["none", "bayes", "paper"]
    whole = found.split("bayes").whole
    for name in METRICS:
        assert facts["metrics"]["bayes"][name] == METRICS[name](whole)
    assert set(facts["metrics"]["none"]) == set(names())
    for name in MAP_METRICS:
        assert np.isfinite(facts["metrics"]["bayes"][name])
    assert facts["metrics"]["bayes"]["predictive"] > facts["metrics"]["none"]["predictive"]
    low, high = facts["intervals"]["bayes"]["f2"]
    assert low < facts["scores"]["bayes"]["f2"] < high
    gain = facts["gain"]["bayes"]["f2"]
    assert gain["difference"] == pytest.approx(
        facts["scores"]["bayes"]["f2"] - facts["scores"]["none"]["f2"]
    )
    assert gain["p"] < 0.01
    text = run_report(found)
    assert f"{facts['metrics']['paper']['chamfer']:.3f}" in text
    assert "over none" in text


def test_no_one_pays_for_what_he_did_not_ask(tmp_path: Path) -> None:
    facts = sample(tmp_path, every=20).facts
    assert not {"metrics", "intervals", "gain"} & set(facts)


def test_metrics_do_not_change_the_map(tmp_path: Path) -> None:
    plain = sample(tmp_path, every=20)
    more = sample(tmp_path, every=20, metrics=("predictive",), force=True)
    for name, grid in plain.grids.items():
        assert (grid.values == more.grids[name].values).all()


def test_where_nothing_is_scored_there_are_no_values(tmp_path: Path) -> None:
    found = run(
        SAMPLES / "turtlebot.mcap",
        output=tmp_path / "x.mcap",
        every=40,
        metrics=("brier", "f2", "predictive"),
        intervals=True,
    ).facts
    assert found["metrics"]["none"]["brier"] is None
    assert found["metrics"]["none"]["f2"] == 0.0
    assert found["metrics"]["none"]["predictive"] is not None
    assert found["intervals"] == {}


def test_the_command_line_lists_them_and_refuses_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _exit_code(["run", "--help"]) == 0
    words = capsys.readouterr().out.replace(",", " ").replace(".", " ").split()
    assert set(names()) <= set(words)
    log = str(SAMPLES / "turtlebot.mcap")
    assert _exit_code(["run", log, "-o", str(tmp_path / "x.mcap"), "--metric", "f3"]) == 2
    assert "no such metric" in capsys.readouterr().err
