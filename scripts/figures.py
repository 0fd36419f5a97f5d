"""Draws the pictures of the docs from the sample logs: `python -m scripts.figures`.

Rerun renders them without a screen, which needs a Vulkan driver (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import cv2
import numpy as np

from formats.errors import Notes
from formats.plans.file import open_plan
from replay import report, run, view
from replay.simulator.building import build
from replay.simulator.options import Options, effective

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
        _simulated(PICTURES / "simulate.png")
        _printed(report(result, folder / "turtlebot.html"), PICTURES / "report.png")


def _simulated(picture: Path) -> None:
    """What `replay simulate` makes of the plan: drawn and standing black, gone grey, new red."""
    options: Options = {"clutter": 0.06, "remove_walls": 0.2, "collapse_walls": 0.15}
    plan = open_plan(SAMPLES / "plan.png", Notes())
    drive, _ = build(plan, None, effective({**options, "deviation": 0.05}), Notes())
    g, solid, drawn = drive.site.geometry, drive.site.solid, drive.drawn
    colours = np.full((*solid.shape, 3), 255, dtype=np.uint8)
    for cells, colour in (
        (drawn & ~solid, (190, 190, 190)),
        (solid & ~drawn, (40, 40, 220)),
        (drawn & solid, (0, 0, 0)),
    ):
        colours[cells] = colour
    way = (drive.way.poses[:, :2] - [g.x, g.y]) / g.resolution
    cv2.polylines(colours, [np.rint(way).astype(np.int32)], False, (200, 120, 0), 2, cv2.LINE_AA)
    cv2.imwrite(str(picture), colours[::-1])


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
