"""Draws the pictures of the docs from the sample logs: `python -m scripts.figures`.

Rerun renders them without a screen, which needs a Vulkan driver (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from replay import run, view

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


if __name__ == "__main__":
    main()
