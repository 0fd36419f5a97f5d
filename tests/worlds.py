"""Worlds drawn as text: # is wall, . is free."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.pictures import drawn, png


def world_png(path: Path, text: str) -> Path:
    """A drawing as a picture, black walls on white; the first line is the top."""
    rows = [line for line in text.splitlines() if line]
    path.write_bytes(png(np.asarray(drawn(rows, {"#": 0, ".": 255}))))
    return path
