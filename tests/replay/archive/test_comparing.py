"""`compare`: differences against counts by hand, wins and losses, the page."""

from __future__ import annotations

import base64
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from formats.errors import FormatError, UsageError
from replay import batch, compare, rescore
from replay.cli import _exit_code
from replay.scoring.count_metrics import METRICS


@pytest.fixture
def two(home: Path) -> Path:
    """Archives one and other of the same logs; the latter misses one and has one more."""
    batch("logs", "one", prior="plan.png")
    batch("logs", "other", prior="plan.png", p_hit=0.9, p_miss=0.1, every=2)
    Path("other/b/3.replay.mcap").unlink()
    return home


def test_two_archives_on_their_common_logs(two: Path) -> None:
    found = compare(["one", "other"])
    assert found.names == ["1", "2", "b/1"]
    assert found.alone == {"one": ["b/3.replay.mcap"]}
    by_name = [
        {row["result"].removesuffix(".replay.mcap"): row for row in rescore(place).rows[1::3]}
        for place in ("one", "other")
    ]
    for i, name in enumerate(found.names):
        for side in (0, 1):
            row = by_name[side][name]
            assert row["curve"] == "bayes"
            assert found.values[side, i] == row["f2"]
    less = found.values[1] - found.values[0]
    (versus,) = found.versus
    assert (versus.wins, versus.losses) == (int((less > 0).sum()), int((less < 0).sum()))
    assert versus.wins + versus.losses + versus.ties == 3
    assert versus.median == float(np.median(less))
    sums = found.counts.sum(axis=1)
    f2 = [5 * tp / (5 * tp + 4 * fn + fp) for tp, fp, fn, _ in sums.tolist()]
    assert versus.paired.difference == pytest.approx(f2[1] - f2[0], abs=1e-12)
    assert versus.paired.low <= versus.paired.difference <= versus.paired.high
    assert [name for name, _ in versus.worst] == [
        found.names[k] for k in np.argsort(less, kind="stable") if less[k] < 0
    ]
    assert found.frame().shape == (3, 4)


def test_logs_are_known_by_their_content(two: Path) -> None:
    shutil.copytree("logs", "moved")
    Path("moved/1.mcap").rename("moved/first.mcap")
    batch("moved", "renamed", prior="plan.png")
    found = compare(["one", "renamed"])
    assert len(found.names) == 4
    assert (found.values[0] == found.values[1]).all()
    assert found.versus[0].ties == 4
    assert found.found["renamed"]["1"] == "first.replay.mcap"


def test_priors_and_curves_of_one_archive(two: Path) -> None:
    prior = {"p_wall": 0.45, "p_space": 0.55}
    found = compare("one", priors={"timid": prior}, metric="iou")
    assert [side.label for side in found.sides] == ["as it was", "timid"]
    rows = [row for row in rescore("one", **prior).rows if row["curve"] == "bayes"]
    assert found.values[1].tolist() == [row["iou"] for row in rows]
    curves = compare("one", curves=["none", "bayes", "paper"])
    assert len(curves.versus) == 2
    rows = [row for row in rescore("one").rows if row["curve"] == "none"]
    assert curves.values[0].tolist() == [row["f2"] for row in rows]
    assert curves.versus[0].wins == 4


def test_a_metric_of_maps_is_compared_by_its_means_and_less_error_wins(two: Path) -> None:
    found = compare("one", curves=["none", "bayes"], metric="brier", html="brier.html")
    for side, curve in zip(found.values, ("none", "bayes"), strict=True):
        rows = [row for row in rescore("one", metric="brier").rows if row["curve"] == curve]
        assert side.tolist() == [row["brier"] for row in rows]
    (versus,) = found.versus
    means = found.values.mean(axis=1)
    assert means[1] < means[0]
    assert versus.paired.difference == pytest.approx(means[1] - means[0], rel=1e-12)
    assert (versus.wins, versus.losses, versus.worst) == (4, 0, [])
    assert "is of the means over all logs" in Path("brier.html").read_text()
    back = compare("one", curves=["bayes", "none"], metric="brier").versus[0]
    assert (back.wins, back.losses, len(back.worst)) == (0, 4, 4)


def test_refusals(two: Path, home: Path) -> None:
    cases: list[tuple[Any, dict[str, Any], str]] = [
        ("one", {}, "nothing to compare it with"),
        (["one", "other"], {"priors": {"x": {"p_wall": 0.3}}}, "too much"),
        ("one", {"priors": {"x": {}}, "curves": ["none", "bayes"]}, "too much"),
        ("one", {"priors": {"x": {}}, "metric": "beauty"}, "no such metric"),
        (["one", "other"], {"labels": ["a"]}, "as many different labels"),
    ]
    for archives, words, problem in cases:
        with pytest.raises(UsageError, match=problem):
            compare(archives, **words)
    batch("logs/b/3.mcap", "third", prior="plan.png")
    with pytest.raises(FormatError, match="no log in common"):
        compare(["other", "third"])


class Inside(HTMLParser):
    """Tags, text, and addresses of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.words: list[str] = []
        self.sources: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_the_page_needs_nothing_else_and_shows_maps(two: Path) -> None:
    nasty = "<script>alert(1)</script>"
    for folder in ("one", "other"):
        Path(folder, "1.replay.mcap").rename(Path(folder, f"{nasty.replace('/', '_')}.replay.mcap"))
    compare(["one", "other"], html="page.html", labels=["one", "[red]&<b>"])
    text = Path("page.html").read_text()
    page = Inside()
    page.feed(text)
    assert not {"script", "link", "b"} & set(page.tags) - {"link"}
    assert all(source.startswith("data:") for source in page.sources)
    assert not re.findall(r"https?://", text)
    assert any("<script>" in word for word in page.words)  # as text
    assert any("[red]&<b>" in word for word in page.words)
    pictures = [s for s in page.sources if s.startswith("data:image/png")]
    # The overview; of each of the three logs F2 through time, and a map and errors of both sides.
    assert len(pictures) == 1 + 3 * (1 + 4)
    for source in pictures:
        data = np.frombuffer(base64.b64decode(source.split(",")[1]), dtype=np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert image.std() > 1
    again = compare(["one", "other"], html="again.html", labels=["one", "[red]&<b>"])
    assert Path("again.html").read_text() == text
    assert f"<td>{again.names[0].replace('<', '&lt;').replace('>', '&gt;')}" in again._repr_html_()


def test_the_command(two: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["compare", "one", "other", "-o", "p.html", "--csv", "t.csv"]
    assert _exit_code(words) == 0
    out = capsys.readouterr().out
    assert re.match(r"3 logs +median F2 +difference +95 % interval +p +better +worse\n", out)
    assert "alone   1 logs of one are not in all" in out
    assert Path("t.csv").read_text().startswith("log,one,other,other - one\n")
    assert _exit_code(words) == 1
    assert _exit_code(["compare", "one", "--p", "p_wall=0.3,p-space=0.8", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["versus"][0]["label"] == "p_wall 0.3, p_space 0.8"
    assert found["logs"] == 4
    assert _exit_code(["compare", "one", "--p", "p_wall"]) == 2
    assert _exit_code(["compare", "one", "--curves", "none,bayes", "--metric", "mcc"]) == 0
    assert set(METRICS) >= {"mcc"}
