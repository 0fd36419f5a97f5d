"""How far an extraction is to be believed, pixel by pixel: the share that was right, by kind.

The shares are those of the 15 drawings of CVC-FP that the structural method was tuned on, measured
by `python -m scripts.measure_trust`: of pixels called wall how many are wall, of the others how
many are none; none of them is taken for more than 0.999. A share of 0.5 says nothing, so the
confidence is 2 x share - 1: the factor by which a prior's log-odds are scaled.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.drawing.ink import distance
from replay.drawing.shapes import Drawing, Mask

Floats = npt.NDArray[np.float32]
EDGE = 2.5  # px: nearer to a wall's edge it is not sure which side a pixel is on
SHARES = {
    "wall": 0.984,
    "wall between lines": 0.916,
    "wall's edge": 0.785,
    "beside a wall": 0.696,
    "doors": 0.992,
    "windows": 0.929,
    "furniture": 0.954,
    "stairs": 0.952,
    "text": 0.999,
    "dimensions": 0.991,
    "space": 0.999,
    "other ink": 0.999,
}


def kinds(drawing: Drawing) -> dict[str, Mask]:
    """Every pixel in one of the kinds of SHARES: masks (H, W)."""
    walls = drawing.walls
    inked = drawing.layers.get("walls", walls)
    deep = distance(walls.astype(np.uint8))
    near = distance((~walls).astype(np.uint8)) if walls.any() else np.full(walls.shape, np.inf)
    left = np.ones_like(walls)
    out: dict[str, Mask] = {}

    def take(name: str, where: Mask) -> None:
        out[name] = where & left
        left[where] = False

    take("wall's edge", walls & (deep <= EDGE))
    take("wall", walls & inked)
    take("wall between lines", walls)
    for name in ("doors", "windows", "furniture", "stairs", "text", "dimensions"):
        take(name, drawing.layers.get(name, np.zeros_like(walls)))
    for name, layer in drawing.layers.items():
        if name not in out and name != "walls":
            out["other ink"] = out.get("other ink", np.zeros_like(walls)) | (layer & left)
    left &= ~out.setdefault("other ink", np.zeros_like(walls))
    take("beside a wall", near <= EDGE)
    out["space"] = left
    return out


def confidence(drawing: Drawing) -> Floats:
    """(H, W), 0 to 1: the factor by which the log-odds of a prior are to be scaled."""
    out = np.zeros(drawing.walls.shape, dtype=np.float32)
    for name, where in kinds(drawing).items():
        out[where] = 2.0 * SHARES[name] - 1.0
    return out
