"""Scripts that measure: they run, and what they measure holds."""

from __future__ import annotations

import pytest

from scripts import score_damage


@pytest.mark.slow
def test_cut_recordings(capsys: pytest.CaptureFixture[str]) -> None:
    assert score_damage.main(["--cuts", "4"]) == 0
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines()[2:]]
    assert [row[1].strip() for row in rows] == list(score_damage.CASES)
    assert all(int(row[2]) > score_damage.SCANS for row in rows)
