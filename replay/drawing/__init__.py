"""An architectural drawing taken apart into walls, doors, outline and layers of removed ink."""

from __future__ import annotations

from typing import Literal

from replay.drawing.shapes import Door, Drawing, Gray

__all__ = ["Door", "Drawing", "Method", "extract", "shows_doors"]
Method = Literal["structural", "georgiou"]
LEAVES = 2  # one arc with a line may be chance


def extract(
    gray: Gray, *, resolution: float | None = None, method: Method = "structural"
) -> Drawing:
    """Walls, doors and outline of a drawing.

    Args:
        gray: (H, W) uint8.
        resolution: m / px where it is known; it bounds the size of doors. Else the drawing's own
            doors give the scale.
        method: "structural", or "georgiou": Algorithm 1 of the paper.

    Raises:
        ValueError: not a picture (H, W) of uint8.
    """
    if gray.ndim != 2 or gray.dtype != "uint8" or gray.size == 0:
        raise ValueError(f"a grey picture (H, W) of uint8 is needed, not {gray.shape} {gray.dtype}")
    if method == "georgiou":
        from replay.drawing.georgiou import georgiou

        return georgiou(gray, resolution)
    from replay.drawing.structural import structural

    return structural(gray, resolution)


def shows_doors(gray: Gray, resolution: float | None = None) -> bool:
    """Whether leaves of doors are drawn, by which drawings are told from structural plans."""
    from replay.drawing.structural import door_leaves

    return len(door_leaves(gray, resolution)) >= LEAVES
