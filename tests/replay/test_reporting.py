"""A report says what the result holds, is one file, and lets no text of a file become markup."""

from __future__ import annotations

import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, UsageError
from formats.results.file import ResultWriter
from replay import report, run
from replay.reporting.drawings import Curve, chart, window
from tests.runs import GEOMETRY, curves, layers, steps

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
EVIL = "<script>alert(1)</script>\x1b[31m\"'&"


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("report")
    return run(
        SAMPLES / "turtlebot.mcap",
        SAMPLES / "plan.png",
        truth=SAMPLES / "truth.png",
        output=folder / "run.replay.mcap",
        every=10,
    )


class Page(HTMLParser):
    """Tags, what they point to, and the text of a page; raises where tags do not match."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.targets: list[str] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(html)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.targets += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "link", "img"):
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.targets += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_it_says_what_the_result_holds_in_one_file(ran: Any, tmp_path: Path) -> None:
    path = report(ran.facts["result"], tmp_path / "run.html")
    html = path.read_text()
    page = Page(html)
    said = " ".join(page.words)
    for curve in ("none", "bayes", "paper"):
        assert f"{ran.facts['scores'][curve]['f2']:.2f}" in said
    for line in (line for lines in ran.facts["said"].values() for line in lines):
        assert line in said
    for word in ("Maps", "Scores over time", "The plan against the building", "Settings",
                 "Warnings and losses", "Versions and inputs", "not there", "SHA-256"):  # fmt: skip
        assert word in said
    assert page.tags.count("svg") == 6
    assert "script" not in page.tags
    assert all(target.startswith("data:") for target in page.targets)
    assert not re.search(r"https?://|url\(|@import", html)


def test_the_same_result_gives_the_same_report(ran: Any, tmp_path: Path) -> None:
    a, b = (report(ran.facts["result"], tmp_path / f"{name}.html") for name in "ab")
    assert a.read_text().replace("a: report", "") == b.read_text().replace("b: report", "")


def test_text_of_files_is_never_markup(tmp_path: Path) -> None:
    path = tmp_path / "a.replay.mcap"
    facts = {
        "said": {EVIL: [EVIL], "log": [f"scans from {EVIL}"]},
        "notes": [f"warning: {EVIL}"],
        "log": EVIL,
        "plan": EVIL,
        "inputs": {EVIL: EVIL},
        "versions": {EVIL: EVIL},
        "against": EVIL,
        "sensor": {"none": EVIL},
    }
    given: dict[str, Any] = {
        "geometry": GEOMETRY,
        "curves": curves(),
        "layers": layers(),
        "facts": facts,
    }
    with ResultWriter(path, settings={EVIL: EVIL}, **given) as writer:
        for step in steps(20):
            writer.write(step)
        writer.finish()
    html = report(path, tmp_path / "a.html").read_text()
    page = Page(html)
    assert "script" not in page.tags
    assert "\x1b" not in html
    assert " ".join(page.words).count("<script>alert(1)</script>") >= 8
    assert all(target.startswith("data:") for target in page.targets)


def test_several_results_have_a_table_of_all(ran: Any, tmp_path: Path) -> None:
    archive = tmp_path / "runs"
    archive.mkdir()
    for name in "ab":
        shutil.copy(ran.facts["result"], archive / f"{name}.replay.mcap")
    page = Page(report(archive, tmp_path / "all.html").read_text())
    assert page.tags.count("section") == 2
    assert page.tags.count("svg") == 12
    assert "2 results" in page.words


def test_a_run_without_a_plan_has_its_map_alone(tmp_path: Path) -> None:
    result = run(SAMPLES / "turtlebot.bag", output=tmp_path / "x.replay.mcap", every=50)
    page = Page(report(result.facts["result"], tmp_path / "x.html").read_text())
    assert page.tags.count("svg") == 1
    assert "Scores over time" not in page.words


def test_what_cannot_be_reported_is_said(ran: Any, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="does not exist"):
        report(tmp_path / "nothing.mcap")
    with pytest.raises(FormatError, match="holds no results"):
        report(SAMPLES, tmp_path / "x.html")
    with pytest.raises(FormatError, match="not a result"):
        report(SAMPLES / "turtlebot.mcap", tmp_path / "x.html")
    with pytest.raises(UsageError, match="too many"):
        report([ran.facts["result"]] * 51, tmp_path / "x.html")
    report(ran.facts["result"], tmp_path / "x.html")
    with pytest.raises(FormatError, match="--force"):
        report(ran.facts["result"], tmp_path / "x.html")


def test_a_chart_puts_values_where_they_belong() -> None:
    """0 lies on the lowest line, 1 on the highest, the last moment at the right edge."""
    line = Curve("a", (1, 2, 3), np.array([0.0, np.nan, 1.0]))
    svg = chart(np.array([5.0, 6.0, 7.0]), [line], "s", "a")
    found = re.search(r'polyline points="([^"]*)"', svg)
    assert found is not None
    assert found[1] == "34.0,204.0 412.0,10.0"  # of 420 x 230: left 34, right 8, top 10, bottom 26
    assert "5 s" in svg
    assert "7 s" in svg


def test_a_window_holds_its_extent() -> None:
    rows, cols = window((0.0, 0.5, 0.31, 0.7), GEOMETRY)  # origin -0.2, 0.35; cells of 0.05 m
    assert (rows.start, rows.stop) == (3, 7)
    assert (cols.start, cols.stop) == (4, 11)
    assert window((-9.0, -9.0, 9.0, 9.0), GEOMETRY) == (slice(0, 12), slice(0, 17))
