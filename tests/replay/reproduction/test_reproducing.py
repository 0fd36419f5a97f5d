"""`replay paper`: its rows, its page, and a few claims recomputed by hand."""

from __future__ import annotations

import csv
import re
from base64 import b64decode
from pathlib import Path

import cv2
import numpy as np
import pytest

from formats.errors import FormatError, UsageError
from replay import paper
from replay.reproduction import floor, real, stale
from replay.reproduction.claims import Section
from replay.reproduction.course import KINECT, drawn_course
from replay.reproduction.drawings import g2
from replay.reproduction.optimising import unbeaten
from replay.reproduction.page import page
from replay.reproduction.reproducing import ROWS
from replay.reproduction.studies import Study
from replay.reproduction.tables import TENTHS, best_pairs, said
from replay.tuning.simulated import Setup
from replay.tuning.surfaces import Scores

COARSE = Setup(spacing=2.0, headings=6)
SMALL = Study(letters="d", cells=(10,), setup=COARSE)


def test_every_experiment_of_the_paper_has_its_row() -> None:
    assert set(ROWS) == {
        *(f"G{k}" for k in range(2, 9)),
        *("T1", "T2"),
        *(f"X{k}" for k in range(1, 9)),
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("paper")
    rows = ["X8", "G3", "G4", "T1", "T2", "X6", "G5", "G6", "X4", "X5", "X7"]
    facts = paper(folder / "out", rows=rows, study=SMALL)
    assert {claim["row"] for claim in facts["claims"]} == set(rows)
    return folder / "out"


def test_the_page_holds_every_figure_and_needs_nothing_else(made: Path) -> None:
    text = (made / "report.html").read_text()
    assert not re.search(r"(?:src|href)=['\"](?!data:|#)", text)
    pictures = [b64decode(found) for found in re.findall(r"base64,([^']+)'", text)]
    files = sorted(made.glob("*.png"))
    assert len(pictures) == len(files) >= 15
    assert {file.read_bytes() for file in files} == set(pictures)
    for data in pictures:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        assert np.ptp(picture) > 200


def test_claims_come_with_numbers_and_reasons(made: Path) -> None:
    with (made / "claims.csv").open() as file:
        claims = list(csv.DictReader(file))
    assert len(claims) >= 18
    for claim in claims:
        assert claim["verdict"] in ("holds", "does not hold", "cannot be tested")
        if claim["verdict"] != "cannot be tested":
            assert re.search(r"\d", claim["numbers"])


def test_the_same_study_gives_the_same_figures(made: Path, tmp_path: Path) -> None:
    paper(
        tmp_path / "again", rows=["G3", "T1"], study=Study(letters="d", cells=(10,), setup=COARSE)
    )
    for file in sorted((tmp_path / "again").glob("*.png")):
        assert file.read_bytes() == (made / file.name).read_bytes()


def test_outputs_are_not_replaced_unasked(made: Path, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="exists already"):
        paper(made, rows=["G5"])
    (tmp_path / "file").write_text("mine")
    with pytest.raises(UsageError, match="not a folder"):
        paper(tmp_path / "file", rows=["G5"])
    with pytest.raises(UsageError, match="no row 'G9'"):
        paper(tmp_path / "new", rows=["G9"])


def test_text_of_a_page_cannot_become_markup() -> None:
    section = Section("G5", "<script>", "a & b")
    section.claim("<b>", True, '"1"')
    section.table("<i>", ("<u>",), (("<s>",),))
    section.figure("'><script>", b"\x89PNG")
    text = page("<title>", [section])
    assert not re.search(r"<(script|b|i|u|s)>", text.replace("<i>Constructing", ""))


def test_best_pairs_are_said_as_in_the_tables() -> None:
    surface = np.zeros((10, 10))
    surface[1, 9] = surface[2, 9] = 0.5
    assert best_pairs(surface).tolist() == [[0.2, 1.0], [0.3, 1.0]]
    assert said(best_pairs(surface)) == "(0.2:0.3, 1)"
    assert TENTHS.tolist() == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]


def test_unbeaten_pairs() -> None:
    # precision .5 .5 .8, recall .4 .5 .2: the first is beaten by the second
    scores = Scores(np.array([[4, 5, 2]]), np.array([[4, 5, 0]]), 10)
    assert unbeaten(scores).tolist() == [[False, True, True]]


def test_a_wall_is_gone_and_rubble_is_new() -> None:
    walls = SMALL.drawn["d"].walls
    now, opened, rubble = stale.changed(walls)
    assert (opened & walls).sum() == opened.sum() > 1000
    assert not (now & opened).any()
    assert (rubble & ~walls).sum() > 1000
    assert np.array_equal(now, (walls & ~opened) | rubble)


def test_the_floor_has_sixteen_rooms_and_two_doors_read_as_wall() -> None:
    built, read = floor.drawn_floor()
    assert built.walls.shape == (240, 900)
    extra = read.walls & ~built.walls
    assert not (built.walls & ~read.walls).any()
    count, _ = cv2.connectedComponents(extra.view(np.uint8))
    assert count - 1 == 2
    rooms, _ = cv2.connectedComponents((~read.walls).view(np.uint8), connectivity=4)
    assert rooms - 1 == 4  # outside, the corridor with its rooms, and the two that are shut
    assert (floor.furnished(built.walls) & ~built.walls).sum() > 500


def test_the_course_and_its_sensor() -> None:
    assert drawn_course().walls.any()
    assert np.degrees(KINECT.field_of_view) == pytest.approx(57.0)


def test_symbols_are_looked_for_at_every_turn_and_width() -> None:
    section = g2(turns=(0.0,), widths=(60.0,))
    found = {str(row[0]): row[1] for row in section.tables[0].rows}
    assert len(found) == 10
    assert found["single"] == "1 of 1"
    assert section.claims[0].verdict == "does not hold"  # sliding doors have no such triangle
    assert "sliding" in section.claims[0].why


def test_without_recorded_logs_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("REPLAY_SHARED_DATA", raising=False)
    monkeypatch.chdir(tmp_path)
    sections = {row: Section(row, row) for row in ("G7", "X1", "X2", "G8")}
    real.add_real(sections, None)
    for section in sections.values():
        assert [claim.verdict for claim in section.claims] == ["cannot be tested"]
        assert "--logs" in section.claims[0].why


@pytest.mark.slow
def test_a_real_robot_on_its_plan(shared_data: Path) -> None:
    sections = {row: Section(row, row) for row in ("G7", "X1", "X2", "G8")}
    real.add_real(sections, shared_data)
    curves = {claim.text: claim for claim in sections["G7"].claims}
    assert len(curves) == 8  # two lasers, two ways of taking scans, two rules
    for text, claim in curves.items():
        # The consistent update stays above no prior; the printed one falls below it (A1).
        if "bayes" in text or "lower" in text:
            assert claim.verdict == "holds"
        elif "upper" in text:
            assert claim.verdict == "does not hold"
    assert len(sections["X1"].claims) == len(sections["X2"].claims) == 8
