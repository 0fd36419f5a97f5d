"""Draws the pictures of the docs from the sample logs: `python -m scripts.figures`.

Rerun renders them without a screen, which needs a Vulkan driver (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from replay import report, run, view

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "sample_logs"
PICTURES = ROOT / "docs" / "pictures"


def main() -> None:
    """Every picture of the docs."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result, recording = folder / "turtlebot.replay.mcap", folder / "turtlebot.rrd"
        plan, truth = SAMPLES / "plan.png", SAMPLES / "truth.png"
        run(SAMPLES / "turtlebot.mcap", plan, truth=truth, output=result, rrd=recording)
        view(recording, screenshot=PICTURES / "run.png", at=60.0, force=True)
        paper = folder / "paper.replay.mcap"
        run(SAMPLES / "turtlebot.mcap", plan, truth=truth, output=paper, update="paper")
        view([result, paper], screenshot=PICTURES / "several.png", force=True)
        _printed(report(result, folder / "turtlebot.html"), PICTURES / "report.png")


def _printed(page: Path, picture: Path) -> None:
    """The upper part of a page, as Chromium shows it; nothing where there is none."""
    chromium = shutil.which("chromium")
    if chromium is None:
        print(f"{picture.name}: no chromium to draw it")
        return
    words = "--headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=1100,1500"
    command = [chromium, *words.split(), f"--screenshot={picture}", page.as_uri()]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
