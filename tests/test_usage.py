"""What a user may type by mistake: odd values, odd names, one file for two purposes."""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path

import pytest

from replay.cli import _exit_code
from replay.options import DEFAULTS, RANGES
from tests.faults_world import drive, plan_pixels, write_plan
from tests.pictures import png


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a drive and its plan, which no test here may change."""
    folder = tmp_path_factory.mktemp("user")
    write_plan(folder)
    drive().write(folder / "drive.mcap")
    (folder / "white.png").write_bytes(png(plan_pixels() * 0 + 255))
    (folder / "small.png").write_bytes(png(plan_pixels()[:20, :20]))
    return folder


@pytest.fixture(autouse=True)
def _unchanged(home: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    before = {path: path.read_bytes() for path in home.iterdir()}
    monkeypatch.chdir(home)
    yield
    assert {path: path.read_bytes() for path in home.iterdir()} == before


def told(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command line."""
    capsys.readouterr()
    code = _exit_code([str(word) for word in words])
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return code, out, err


RUN = ("run", "drive.mcap", "--prior", "plan.png", "--quiet")
WHOLE = ("every", "readings_per_pose", "plan_page")
NUMBERS = [name for name in RANGES if name not in WHOLE]


def flag(name: str) -> str:
    return "--" + name.replace("_", "-")


@pytest.mark.parametrize("value", ["nan", "-inf", "-1e300", "1e300"])
@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_out_of_range(
    name: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = told(capsys, *RUN, "-o", tmp_path / "x.mcap", f"{flag(name)}={value}")
    assert code == 2
    assert flag(name) in err
    assert list(tmp_path.iterdir()) == []


def test_every_number_has_a_range() -> None:
    numbers = [n for n, value in DEFAULTS.items() if type(value) in (int, float) or n[:2] == "p_"]
    open_ended = ("plan_resolution", "plan_dpi", "drawing_scale", "readings_per_pose")
    assert {*numbers, *open_ended} == set(RANGES)


WRONG = [
    ("--resolution 0", 2, "--resolution"),
    ("--resolution inf", 2, "--resolution"),
    ("--resolution 1e-4", 1, "too many"),
    ("--max-range 0", 2, "--max-range"),
    ("--p-hit 1.5", 2, "--p-hit"),
    ("--prior-scale 0", 2, "--prior-scale"),
    ("--every 0", 2, "--every"),
    ("--every x", 2, "--every"),
    ("--readings-per-pose 0", 2, "--readings-per-pose"),
    ("--duration 0", 2, "--duration"),
    ("--start-offset 1e6", 1, "no scans between"),
    ("--start-offset -1", 2, "--start-offset"),
    ("--plan-pose abc", 2, "is not X,Y or X,Y,YAW"),
    ("--plan-pose 1", 2, "is not X,Y or X,Y,YAW"),
    ("--plan-pose nan,0,0", 2, "is not X,Y or X,Y,YAW"),
    ("--plan-pose 1e300,0", 2, "is not X,Y or X,Y,YAW"),
    ("--plan-pose 1000,0", 1, "do not overlap"),
    ("--plan-origin 1,2,3,4", 2, "is not X,Y or X,Y,YAW"),
    ("--scan /nope", 2, "scans here: /scan"),
    ("--scan /tf", 2, "is not a scan"),
    ("--pose /nope", 2, "no such topic"),
    ("--pose /scan", 2, "has no poses"),
    ("--map-frame nope", 2, "frames: base_link, laser, map, odom"),
    ("--base-frame nope", 2, "no frame nope"),
    ("--sensor nope", 2, "there are beam"),
    ("--update nope", 2, "nope"),
    ("--cell-rule nope", 2, "nope"),
    ("--truth white.png", 1, "white.png: every pixel is white"),
    ("--truth small.png", 1, "size is not the plan's"),
    ("--truth drive.mcap", 1, "is a log, not a plan"),
    ("--truth nope.png", 1, "nope.png: does not exist"),
    ("--prior drive.mcap", 1, "is a log, not a plan"),
    ("--prior nope.png", 1, "nope.png: does not exist"),
    ("--prior .", 1, "."),
    ("--connect nonsense", 2, "nonsense: not the address of a viewer"),
    ("--nonsense", 2, "No such option"),
    ("--rrd drive.mcap --force", 1, "also an input"),
    ("--rrd plan.yaml --force", 1, "plan.yaml: the output is also an input"),
    ("--rrd small.png", 1, "exists already"),
    ("--rrd /dev/none/x.rrd", 1, "does not exist; make it first"),
    ("--rrd . --force", 1, "is a folder"),
    ("-o drive.mcap --force", 1, "also an input"),
    ("-o ./plan.yaml --force", 1, "also an input"),
    ("-o plan.png", 1, "also an input"),
    ("-o small.png", 1, "exists already"),
    ("-o /dev/none/x.mcap", 1, "does not exist; make it first"),
    ("-o /dev/null --force", 1, "not an ordinary file"),
    ("-o '' --force", 1, "is a folder"),
    ("-o plan.png/x.mcap", 1, "not a folder"),
    (f"-o {'x' * 300}", 1, "name"),
]


@pytest.mark.parametrize(("words", "code", "said"), WRONG, ids=[w[0][:40] for w in WRONG])
def test_run_refuses(words: str, code: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    found, out, err = told(capsys, *RUN, *shlex.split(words))
    assert (found, out) == (code, "")
    assert said in err
    assert len(err.splitlines()) == 1 or err.startswith("Usage: ")


ALONE = [
    ("run", 2, "Missing argument"),
    ("run ''", 1, ""),
    ("run nope.mcap --prior plan.png", 1, "nope.mcap: no such file"),
    ("run plan.png --prior plan.png", 1, "plan.png: is a PNG picture, not a log"),
    ("run drive.mcap --prior drive.mcap", 1, "drive.mcap: is a log, not a plan"),
    ("run drive.mcap plan.png --prior plan.png", 1, "plan.png: is a PNG picture, not a log"),
    ("run drive.mcap --prior plan.png -o x.mcap --rrd ./x.mcap", 2, "one file"),
    ("rnu drive.mcap", 2, "Did you mean run?"),
    ("''", 2, "No such verb"),
    ("export", 2, "Missing argument"),
    ("export nope.mcap", 1, "nope.mcap"),
    ("export drive.mcap", 1, "not a result of replay"),
    ("export plan.png", 1, "is not an MCAP file"),
    ("info plan.png", 1, "is a PNG picture, not a log"),
]


@pytest.mark.parametrize(("words", "code", "said"), ALONE, ids=[w[0] for w in ALONE])
def test_refused(words: str, code: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    found, out, err = told(capsys, *shlex.split(words))
    assert (found, out) == (code, "")
    assert said in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--p-hit 0.3 --p-miss 0.7", "--p-hit is below --p-miss"),
        ("--p-wall 0.9 --p-space 0.2", "--p-wall is above --p-space"),
    ],
)
def test_probabilities_the_wrong_way_round_are_said(
    words: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = told(capsys, *RUN, "-o", tmp_path / "x.mcap", *words.split())
    assert code == 0
    assert said in err


@pytest.mark.parametrize(
    "words",
    [
        "--max-range inf",
        "--duration inf",
        "--duration 0.001",
        "--every 1000000",
        "--resolution 1000",
        "--p-hit 1 --p-miss 0",
        "--p-wall 0 --p-space 1 --p-outside 1",
        "--min-travel 1e6",
        "--truth plan.png",
        "--pose tf --map-frame /map --base-frame /base_link --scan scan",
        "--region observed --update paper --cell-rule fraction",
    ],
)
def test_odd_but_right(words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = told(capsys, *RUN, "-o", tmp_path / "x.mcap", "--json", *words.split())
    assert code == 0, err
    assert json.loads(out)["scans"] >= 1
    assert [path.name for path in tmp_path.iterdir()] == ["x.mcap"]


def test_one_log_twice_and_two_different_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = drive(8).write(tmp_path / "other.mcap")
    options = ("--prior", "plan.png", "--json", "-o", tmp_path / "x.mcap", "--force")
    code, out, err = told(capsys, "run", "drive.mcap", "./drive.mcap", *options)
    assert (code, json.loads(out)["scans"]) == (0, 12)
    assert "read once" in err
    code, out, err = told(capsys, "run", "drive.mcap", more, *options)
    assert (code, json.loads(out)["scans"]) == (0, 12)
    assert "8 x same stamp" in err


@pytest.mark.parametrize("name", ["Büro 2.png", "-plan.png", "  .png", "100%.png", "a'b\"c.png"])
def test_odd_names(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of plan, log, result and recording."""
    folder = tmp_path / "Grüße aus [dim]Köln"
    folder.mkdir()
    os.chdir(folder)
    Path(name).write_bytes(png(plan_pixels()))
    log = Path(name).with_suffix(".mcap")
    drive().write(log)
    place = ["--plan-resolution=0.05", "--plan-origin=-1.1,-1.1", f"--rrd={name}.rrd"]
    code, _, err = told(capsys, "run", f"--prior={name}", *place, "--", log)
    assert code == 0, err
    result = f"{log.stem}.replay.mcap"
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [name, log.name, result, f"{name}.rrd"]
    )
    code, out, err = told(capsys, "export", "--", result)
    assert code == 0, err
    assert f"{log.stem}_map.yaml" in out


def test_export_replaces_nothing_unasked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = tmp_path / "x.mcap"
    assert told(capsys, *RUN, "-o", result)[0] == 0
    os.chdir(tmp_path)
    assert told(capsys, "export", result)[0] == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    code, _, err = told(capsys, "export", result)
    assert code == 1
    assert "exists already" in err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert told(capsys, "export", result, "--force")[0] == 0
    assert told(capsys, "export", result, "--only", "nope")[0] == 2
    assert told(capsys, "export", result, "-o", "/dev/none/y")[0] == 1
