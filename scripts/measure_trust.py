"""How often the structural method is right, by kind of pixel: what confidence.SHARES holds.

    python -m scripts.measure_trust

Over the tuned half of CVC-FP: of pixels called wall the share that is wall, of the others the share
that is none.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from formats.errors import Notes
from formats.plans.annotations import read_truth
from formats.plans.file import open_plan
from replay.drawing import extract
from replay.drawing.confidence import SHARES, kinds
from scripts.score_drawings import ROOT, drawings


def main() -> None:
    data = Path(os.environ.get("REPLAY_SHARED_DATA", ROOT.parent / "shared" / "data"))
    right = dict.fromkeys(SHARES, 0)
    pixels = dict.fromkeys(SHARES, 0)
    for half, picture, annotation in drawings(data):
        if half == "cvc_fp tuned":
            grey = open_plan(picture, Notes()).grey
            truth = read_truth(annotation, (grey.shape[0], grey.shape[1]), picture).walls
            found = extract(grey)
            for name, where in kinds(found).items():
                pixels[name] += int(np.count_nonzero(where))
                right[name] += int(np.count_nonzero(where & (found.walls == truth)))
    for name, count in pixels.items():
        print(f"{name:20} {right[name] / max(count, 1):.3f} of {count:,}")


if __name__ == "__main__":
    main()
