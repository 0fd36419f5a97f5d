"""Pictures of maps and readings, for the viewer, reports and docs: colours and PNG."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from formats.grid import Grid

Bools = npt.NDArray[np.bool_]
Colour = tuple[int, int, int]
MOST_CELLS = 4_000_000  # a larger map is shown at a lower resolution
# Okabe and Ito's palette: told apart with any colour vision. Red, green, blue.
FOUND, MISSED, FALSE = (0, 114, 178), (230, 159, 0), (204, 121, 167)
WALL_COLOURS: dict[str, Colour] = {
    "confirmed": (0, 114, 178),
    "moved": (230, 159, 0),
    "not there": (213, 94, 0),
    "unseen": (150, 150, 150),
    "found": (0, 158, 115),
}
CURVE_COLOURS: dict[str, Colour] = {
    "none": (120, 120, 120),
    "bayes": (0, 114, 178),
    "paper": (213, 94, 0),
}
# Of runs side by side, in turn; from the same palette.
RUN_COLOURS: list[Colour] = [
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (230, 159, 0),
    (86, 180, 233),
]
CURVE_NAMES = {"none": "no prior", "bayes": "prior, bayes", "paper": "prior, paper"}


def thinning(shape: tuple[int, int]) -> int:
    """Every how many cells are shown, so that no picture has over MOST_CELLS."""
    return max(1, int(np.ceil(np.sqrt(shape[0] * shape[1] / MOST_CELLS))))


def png(cells: npt.NDArray[np.uint8]) -> bytes:
    """PNG bytes of cells (rows, cols) or (rows, cols, 4 RGBA), thinned where they are too many."""
    import cv2

    thin = thinning((cells.shape[0], cells.shape[1]))
    shown = cells[::thin, ::thin]
    if shown.ndim == 3:
        shown = shown[..., [2, 1, 0, 3]]  # OpenCV's order
    done, data = cv2.imencode(".png", np.ascontiguousarray(shown))
    if not done:
        raise ValueError(f"a picture of {cells.shape} cells could not be made")
    return bytes(data.tobytes())


def gray(grid: Grid) -> npt.NDArray[np.uint8]:
    """A map as shades: white surely empty, black surely occupied; (rows, cols)."""
    return np.rint((1.0 - grid.p_occupied()) * 255).astype(np.uint8)


def coloured(
    shape: tuple[int, int], layers: Iterable[tuple[Bools, tuple[int, ...]]]
) -> npt.NDArray[np.uint8]:
    """Cells in colours, red green blue and perhaps alpha, clear elsewhere; (rows, cols, 4)."""
    out = np.zeros((*shape, 4), dtype=np.uint8)
    for mask, colour in layers:
        out[mask] = colour if len(colour) == 4 else (*colour, 255)
    return out


def error_kinds(occupied: Bools, truth: Bools, scored: Bools) -> npt.NDArray[np.uint8]:
    """Walls found (1), missed (2) and false (3) inside the scored region, else 0; (rows, cols)."""
    wall, claimed = truth & scored, occupied & scored
    two, three = np.uint8(2), np.uint8(3)  # bytes throughout, many times as fast as np.where
    kinds: npt.NDArray[np.uint8] = two * wall + three * claimed - np.uint8(4) * (wall & claimed)
    return kinds


def errors(occupied: Bools, truth: Bools, scored: Bools) -> npt.NDArray[np.uint8]:
    """The same in colours; (rows, cols, 4)."""
    kinds = error_kinds(occupied, truth, scored)
    return coloured(truth.shape, [(kinds == i, c) for i, c in enumerate((FOUND, MISSED, FALSE), 1)])
