"""The command line as a user meets it: answers, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands import REPLAY, replay

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "sample_logs"
PLAN = ("--prior", str(SAMPLES / "plan.png"))


def test_help_shows_examples_and_loads_no_heavy_library(tmp_path: Path) -> None:
    done = replay("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.index("Examples") < done.stdout.index("Options")
    code = (
        "import sys, replay.cli; from click.testing import CliRunner;"
        "CliRunner().invoke(replay.cli.cli, ['--help']);"
        "print([m for m in ('numpy','numba','cv2','rerun','pandas','rosbags','rich') "
        "if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_run_prints_the_table_and_writes_the_result(tmp_path: Path) -> None:
    done = replay("run", str(SAMPLES / "turtlebot.mcap"), *PLAN, "--every", "40", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for word in ("no prior", "prior, bayes", "prior, paper", "against the plan", "observed F2"):
        assert word in done.stdout
    assert "next: replay view turtlebot.replay.mcap" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["turtlebot.replay.mcap"]


def test_without_a_plan_the_log_is_mapped_all_the_same(tmp_path: Path) -> None:
    done = replay("run", str(SAMPLES / "turtlebot.bag"), "--every", "40", "--json", cwd=tmp_path)
    facts = json.loads(done.stdout)
    assert facts["plan"] is None
    assert list(facts["scores"]) == ["none"]
    truth = ("--truth", str(SAMPLES / "truth.png"), "--every", "40", "--json", "--force")
    done = replay("run", str(SAMPLES / "turtlebot.bag"), *truth, cwd=tmp_path)
    assert json.loads(done.stdout)["scores"]["none"]["f2"] > 0.2


def test_json_is_one_object_with_the_scores(tmp_path: Path) -> None:
    done = replay(
        "run", str(SAMPLES / "turtlebot.bag"), *PLAN, "--json", "--every", "40", cwd=tmp_path
    )
    facts = json.loads(done.stdout)
    for part in ("scores", "observed", "unobserved"):
        assert list(facts[part]) == ["none", "bayes", "paper"]
        assert {"precision", "recall", "f2"} <= set(facts[part]["bayes"])
    assert facts["scans"] == 21
    assert facts["skipped"] == facts["lost"] == 0
    assert facts["result"] == "turtlebot.replay.mcap"
    assert facts["schema"] == 1


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("run",), 2, "Missing argument"),
        (("rum", "x"), 2, "Did you mean run?"),
        (("run", "nothing.bag", *PLAN), 1, "nothing.bag"),
        (("run", str(SAMPLES / "turtlebot.bag"), *PLAN, "--plan-pose", "1,b"), 2, "X,Y,YAW"),
        (("run", str(SAMPLES / "turtlebot.bag"), *PLAN, "--sensor", "sonar"), 2, "beam, eq10"),
        (("run", str(SAMPLES / "turtlebot.bag"), *PLAN, "--scan", "/tf"), 2, "not a scan"),
        (("run", str(SAMPLES / "plan.png"), *PLAN), 1, "PNG"),
        (("run", str(SAMPLES / "turtlebot.bag"), "--prior", "no.png"), 1, "does not exist"),
        (("export", str(SAMPLES / "turtlebot.mcap")), 1, "not a result"),
    ],
)
def test_what_is_wrong_is_one_line_and_a_code(
    words: tuple[str, ...], code: int, said: str, tmp_path: Path
) -> None:
    done = replay(*words, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert not list(tmp_path.iterdir())


def test_export_writes_what_it_names(tmp_path: Path) -> None:
    replay("run", str(SAMPLES / "turtlebot.mcap"), *PLAN, "--every", "40", cwd=tmp_path)
    done = replay("export", "turtlebot.replay.mcap", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    written = json.loads(done.stdout)["written"]
    assert len(written) >= 6
    assert all((tmp_path / name).stat().st_size > 0 for name in written)


def test_a_closed_pipe_is_no_traceback(tmp_path: Path) -> None:
    command = f"{REPLAY} run {SAMPLES / 'turtlebot.mcap'} {' '.join(PLAN)} --every 80 | head -c 5"
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr
    assert "Error" not in done.stderr


def test_from_python_it_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from replay import export, run

    monkeypatch.chdir(tmp_path)
    result = run(SAMPLES / "turtlebot.mcap", SAMPLES / "plan.png", every=40)
    assert export(result.facts["result"])
    done = replay("run", str(SAMPLES / "turtlebot.mcap"), *PLAN, "--every", "40", "--json",
                  "--force", cwd=tmp_path)  # fmt: skip
    assert json.loads(done.stdout)["scores"] == json.loads(json.dumps(result.facts["scores"]))
