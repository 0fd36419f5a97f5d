"""Help, configuration files, completion and the demo: the command line as a habit."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import click
import pytest

from replay.cli import VERBS, cli
from replay.cli.config import settable
from tests.commands import replay

SAMPLES = Path(__file__).resolve().parent.parent / "sample_logs"
LOG = str(SAMPLES / "turtlebot.mcap")


def verb(name: str) -> click.Command:
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    return command


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_shows_examples_before_its_options(name: str) -> None:
    command = verb(name)
    text = command.get_help(click.Context(command, info_name=f"replay {name}"))
    assert text.index("Examples") < text.index("Options")
    assert f"replay {name}" in text[text.index("Examples") :]


@pytest.mark.parametrize("name", [name for name in VERBS if name != "completion"])
def test_every_verb_prints_a_file_that_it_reads(name: str, tmp_path: Path) -> None:
    done = replay(name, "--print-config", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    values = tomllib.loads(done.stdout)
    known = {flag.lstrip("-") for o in settable(verb(name)).values() for flag in o.opts}
    assert set(values) <= known
    (tmp_path / "all.toml").write_text(done.stdout)
    again = replay(name, "--config", "all.toml", "--print-config", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert tomllib.loads(again.stdout) == values


def test_a_flag_goes_before_the_file_and_the_file_before_the_default(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text(
        "p-hit = 0.8\nevery = 40\nplan_pose = [0.0, 0.0, 0.0]\n[run]\np-miss = 0.35\n"
        "[tune]\nnonsense = 1\n"
    )
    prior = ("--prior", str(SAMPLES / "plan.png"), "--config", "my.toml", "--p-hit", "0.9")
    done = replay("run", LOG, *prior, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["scans"] == 21
    assert facts["sensor"]["bayes"] == "0.9 / 0.35"
    from formats.results.file import read_result

    settings = read_result(tmp_path / "turtlebot.replay.mcap").settings
    assert (settings["p_hit"], settings["p_miss"], settings["every"]) == (0.9, 0.35, 40)
    assert settings["p_wall"] == 0.2
    assert settings["plan_pose"] == [0.0, 0.0, 0.0]


def test_the_printed_file_of_a_run_changes_nothing(tmp_path: Path) -> None:
    shown = replay("run", "--every", "40", "--print-config", cwd=tmp_path)
    (tmp_path / "same.toml").write_text(shown.stdout)
    plan = ("--prior", str(SAMPLES / "plan.png"), "--json", "--force")
    a = json.loads(replay("run", LOG, *plan, "--every", "40", cwd=tmp_path).stdout)
    b = json.loads(replay("run", LOG, *plan, "--config", "same.toml", cwd=tmp_path).stdout)
    assert a["scores"] == b["scores"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("p-wal = 0.3", "did you mean p-wall?"),
        ("p-wall = ", "is not TOML"),
        ("p-wall = 7", "is not in the range"),
        ("p-wall = 'x'", "not a valid float"),
    ],
)
def test_a_file_that_is_wrong_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text(text)
    done = replay("run", LOG, "--config", "my.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["my.toml"]


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    done = replay("run", LOG, "--config", "no.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "no.toml: cannot be read" in done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_printed_for_each_shell(shell: str, tmp_path: Path) -> None:
    done = replay("completion", shell, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"_REPLAY_COMPLETE={shell}_complete" in done.stdout


@pytest.mark.parametrize(
    ("words", "at", "expected"),
    [
        ("replay re", "1", {"report", "rescore"}),
        ("replay run --plan-m", "2", {"--plan-method"}),
        ("replay run --update ", "3", {"bayes", "paper"}),
    ],
)
def test_completion_answers(words: str, at: str, expected: set[str], tmp_path: Path) -> None:
    env = {"_REPLAY_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": at}
    done = replay(cwd=tmp_path, **env)
    assert {line.split(",")[1] for line in done.stdout.splitlines()} == expected


def test_the_demo_works_as_it_says(tmp_path: Path) -> None:
    done = replay("demo", "try", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    facts = json.loads(replay("demo", "again", "--json", cwd=tmp_path).stdout)
    for command in facts["commands"]:
        assert command in done.stdout
        if not command.startswith("replay view"):  # which opens a window
            ran = replay(*command.split()[1:], cwd=tmp_path / "try")
            assert ran.returncode == 0, f"{command}: {ran.stderr}"
    assert (tmp_path / "try" / "turtlebot.report.html").exists()
    refused = replay("demo", "try", cwd=tmp_path)
    assert refused.returncode == 1
    assert "--force" in refused.stderr
