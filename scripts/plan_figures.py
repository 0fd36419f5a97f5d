"""Draws the docs' pictures of a plan on its log and against its building.

    python -m scripts.plan_figures

They are made from the sample logs, halved in size.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import cv2
import numpy as np

from formats.output import write_image
from replay import deviation, run
from replay.registration.aligning import align_files

ROOT = Path(__file__).resolve().parent.parent
SAMPLES, PICTURES = ROOT / "sample_logs", ROOT / "docs" / "pictures"
WIDE = 800  # px


def smaller(source: Path, target: Path) -> None:
    """A picture of WIDE px, in 32 colours, so that it is small."""
    image = cv2.imread(str(source))
    assert image is not None
    factor = WIDE / image.shape[1]
    small = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    write_image(target, np.asarray(small // 8 * 8 + 4, np.uint8), force=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = shutil.copy(SAMPLES / "plan.png", folder / "bare.png")
        log = SAMPLES / "turtlebot.mcap"
        align_files(log, plan, picture=folder / "align.png")
        smaller(folder / "align.png", PICTURES / "align.png")
        run(log, SAMPLES / "plan.png", output=folder / "a.replay.mcap")
        deviation(folder / "a.replay.mcap", folder)
        smaller(folder / "a_deviation.png", PICTURES / "deviation.png")


if __name__ == "__main__":
    main()
