"""Draws the pictures of the docs from the sample logs: `python -m scripts.figures`.

Rerun renders them without a screen, which needs a Vulkan driver (Debian: mesa-vulkan-drivers).
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from replay import run
from replay.viewer_process import free_port

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "sample_logs"


def screenshot(recording: Path, picture: Path, at_s: float, settle_s: float = 2.0) -> list[str]:
    """What the viewer shows of a recording at a moment, as PNG; the views' complaints.

    Raises:
        ConnectionError: the viewer could not start, as without a Vulkan driver.
    """
    # Rerun looks for its viewer on PATH, where an environment that is not activated is not.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with ViewerClient.spawn(headless=True, port=free_port(), hide_welcome_screen=True) as viewer:
        viewer.open(f"file://{recording.resolve()}")
        time.sleep(settle_s)
        viewer.set_time("log_time_s", duration=at_s, play_state="paused")
        time.sleep(settle_s)
        viewer.save_screenshot(str(picture.resolve()))
        return [f"{view.name}: {view.reports}" for view in viewer.get_state().views if view.reports]


def main() -> None:
    """Every picture of the docs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(
            SAMPLES / "turtlebot.mcap",
            SAMPLES / "plan.png",
            truth=SAMPLES / "truth.png",
            output=folder / "turtlebot.replay.mcap",
            rrd=folder / "turtlebot.rrd",
        )
        pictures = ROOT / "docs" / "pictures"
        pictures.mkdir(exist_ok=True)
        for problem in screenshot(folder / "turtlebot.rrd", pictures / "run.png", at_s=60.0):
            print(problem)


if __name__ == "__main__":
    main()
