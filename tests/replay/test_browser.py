"""What a browser makes of reports and of the web viewer: Chromium, driven by playwright-core."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from replay import report, run, view
from replay.viewing.web import Web

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def playwright(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with playwright-core, installed by npm; it drives the Chromium that is there."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None or shutil.which("chromium") is None:
        pytest.skip("npm, node and chromium are needed to look with a browser")
    folder = tmp_path_factory.mktemp("browser")
    for name in ("package.json", "package-lock.json"):
        shutil.copy(ROOT / "tests/browser" / name, folder)
    command = [npm, "ci", "--prefer-offline", "--no-audit", "--no-fund", "--ignore-scripts"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"npm could not install playwright-core: {done.stderr.strip()[-200:]}")
    return folder


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ran") / "run.replay.mcap"
    log, plan, truth = (SAMPLES / name for name in ("turtlebot.mcap", "plan.png", "truth.png"))
    run(log, plan, truth=truth, output=path, every=10)
    return path


def looked_at(url: str, picture: Path, seconds: float, folder: Path) -> dict[str, Any]:
    """Title, errors on the console, and requests, of a page."""
    chromium = shutil.which("chromium")
    words = ["node", ROOT / "tests/browser/look.js", url, picture, str(seconds), chromium]
    done = subprocess.run(
        [str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_a_report_opens_without_an_error_or_a_request(
    ran: Path, playwright: Path, tmp_path: Path
) -> None:
    page = report(ran, tmp_path / "run.html")
    found = looked_at(page.as_uri(), tmp_path / "report.png", 1.0, playwright)
    assert found["title"] == "run: report"
    assert found["errors"] == []
    assert {url.split(":")[0] for url in found["requests"]} <= {"file", "data"}
    assert [url for url in found["requests"] if url.startswith("file:")] == [page.as_uri()]


@pytest.mark.parametrize("kind", ["result", "recording"])
def test_the_web_viewer_shows_the_run(
    kind: str, ran: Path, playwright: Path, tmp_path: Path
) -> None:
    import cv2

    source = ran
    if kind == "recording":
        source = tmp_path / "run.rrd"
        view(ran, rrd=source)
    found: dict[str, Any] = {}

    def look(served: Web) -> None:
        url = f"{served.page}&renderer=webgl"
        found.update(looked_at(url, tmp_path / "web.png", 25.0, playwright))

    said: list[str] = []
    view(source, web=True, hold=look, say=said.append)
    assert said[0].startswith("web     http://127.0.0.1:")
    hosts = {url.split("/")[2].split(":")[0] for url in found["requests"] if "://" in url}
    assert hosts == {"127.0.0.1"}  # Rerun's page asks others, which the policy refuses
    shown = cv2.imread(str(tmp_path / "web.png"))
    assert shown is not None
    blue = (abs(shown.astype(int) - [178, 114, 0]).max(axis=2) < 12).mean()
    assert blue > 0.002  # walls found, in the colour of the errors' panel
    first = shown[66:530, :460].reshape(-1, 3).astype(int)  # the map with prior
    assert (first.max(axis=1) < 90).mean() > 0.02  # walls
    assert (abs(first - 128).max(axis=1) < 4).mean() > 0.2  # what nobody knows
