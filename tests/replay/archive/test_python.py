"""The same from Python: what docs/python.md names, and the notebook of docs/ from end to end."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import replay
from formats.result import Counts, ratios
from replay import batch, results, run
from replay.scoring.count_metrics import METRICS

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_page_names_what_there_is() -> None:
    page = (DOCS / "python.md").read_text()
    (names,) = re.findall(r"from replay import (.+)", page)
    assert all(callable(getattr(replay, name)) for name in names.split(", "))
    assert set(names.split(", ")) <= set(replay.__all__)


def test_results_as_a_frame(home: Path) -> None:
    (home / "logs" / "empty.bag").write_bytes(b"")
    batch("logs", "runs", prior="plan.png", p_wall=0.3)
    (home / "runs" / "torn.replay.mcap").write_bytes(b"\x89MCAP0\r\n")
    table = results("runs")
    assert table.result.tolist() == [
        *("1.replay.mcap", "2.replay.mcap", "b/1.replay.mcap", "b/3.replay.mcap"),
        *("torn.replay.mcap", "empty"),
    ]
    assert table.scans[:4].tolist() == [4, 5, 6, 7]
    assert (table.p_wall[:4] == 0.3).all()
    assert table.error[:4].tolist() == [""] * 4
    assert all(table.error[4:])
    fresh = run("logs/1.mcap", "plan.png", output="x.replay.mcap", p_wall=0.3)
    assert table.f2_bayes[0] == fresh.facts["scores"]["bayes"]["f2"]


def test_a_result_in_a_notebook(home: Path) -> None:
    shown = run("logs/1.mcap", "plan.png", output="x.replay.mcap")
    text = shown._repr_html_()
    assert text.count("<tr>") == 4
    assert f"<td>{shown.facts['scores']['paper']['f2']:.3f}</td>" in text
    for counts in (Counts(3, 2, 1, 9), Counts(0, 4, 0, 1)):
        assert ratios(counts) == tuple(
            METRICS[name](counts) for name in ("precision", "recall", "f2")
        )


@pytest.mark.filterwarnings("ignore")  # of the notebook's own libraries
def test_the_notebook(tmp_path: Path) -> None:
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(DOCS / "notebooks" / "archives.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    assert not [cell for cell in notebook.cells if cell.get("outputs")]  # made anew by each reader
    client = NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(DOCS)}})
    client.execute()
    outputs = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
    html = ["text/html" in out.get("data", {}) for found in outputs for out in found]
    assert sum(html) >= 5
    said = "".join(out.get("text", "") for found in outputs for out in found)
    assert re.search(r"p_wall 0\.\d+, p_space 0\.\d+: F2 0\.\d{3}, was 0\.\d{3}", said)
