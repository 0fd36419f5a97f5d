"""Where a plan lies: the small JSON file that `replay align` writes and `replay run --align` takes.

    {"format": "replay placement", "version": 1, "unit": "metres", "matrix": [[a, b, x], [c, d, y]],
     "confident": true, "plan": {"name": "plan.png", "sha256": "..."}, "source": "drive.mcap"}

The matrix leads from a log's map frame (metres, y up) or a map picture (pixels) to the plan's
pixels: x right, y down, pixel centres at whole numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import atan2, hypot, isfinite
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.small_json import Kind, read_small_json, write_small_json

KIND = Kind(
    *("replay placement", 1, "is no placement of a plan"),
    hint="give the JSON file that `replay align` wrote",
)
LARGEST, FARTHEST = 1e6, 1e9  # scale and shift of a matrix
SKEWED = 1e-3  # of the scale: how far from a similarity a matrix may be


@dataclass(frozen=True)
class Placement:
    """A plan's place.

    Attributes:
        matrix: (2, 3), see above; a similarity, mirrored or not.
        unit: what the matrix leads from.
        confident: whether the place was clearly the best.
        plan: name of the plan's picture.
        plan_sha256: of that file, "" where it is not known.
        source: name of the log or map.
        facts: whatever else was said of it.
    """

    matrix: npt.NDArray[np.float64]
    unit: Literal["metres", "pixels"]
    confident: bool = True
    plan: str = ""
    plan_sha256: str = ""
    source: str = ""
    facts: dict[str, Any] = field(default_factory=dict, compare=False)

    @property
    def scale(self) -> float:
        """Plan pixels a metre or map pixel."""
        return hypot(self.matrix[0, 0], self.matrix[1, 0])

    @property
    def mirrored(self) -> bool:
        """Whether the plan shows the building mirrored; metres have y up, which is no mirror."""
        turned_over = bool(np.linalg.det(self.matrix[:, :2]) < 0)
        return turned_over != (self.unit == "metres")

    def origin(self, shape: tuple[int, int]) -> Pose:
        """Pose of the picture's lower left corner in the frame of the log: m, m, rad.

        A mirrored plan's picture is to be flipped left to right first (`numpy.fliplr`).

        Args:
            shape: (rows, cols) of the plan's picture.

        Raises:
            FormatError: the matrix is of a map picture, not of metres.
        """
        if self.unit != "metres":
            problem = "it places a map picture without a yaml, not a log"
            raise FormatError(self.source or "placement", problem, hint="align the log itself")
        rows, cols = shape
        left = cols - 0.5 if self.mirrored else -0.5
        back = np.linalg.inv(self.matrix[:, :2])
        x, y = back @ (np.array([left, rows - 0.5]) - self.matrix[:, 2])
        right = back @ np.array([-1.0 if self.mirrored else 1.0, 0.0])
        return Pose(float(x), float(y), atan2(right[1], right[0]))


def write_placement(
    path: AnyPath,
    placement: Placement,
    *,
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> None:
    """Write a placement; numbers read back to the same bits.

    Raises:
        FormatError: it cannot be written.
    """
    value = {
        **placement.facts,
        "unit": placement.unit,
        "matrix": placement.matrix.tolist(),
        "confident": placement.confident,
        "plan": {"name": placement.plan, "sha256": placement.plan_sha256},
        "source": placement.source,
    }
    write_small_json(path, KIND, value, force=force, inputs=inputs)


def read_placement(path: AnyPath) -> Placement:
    """Read a placement.

    Raises:
        FormatError: not readable, no placement, of a later version, or not a similarity.
    """
    value = read_small_json(path, KIND)
    if value.get("unit") not in ("metres", "pixels"):
        raise FormatError(path, f"its unit is {value.get('unit')!r}, not metres or pixels")
    plan = value.get("plan")
    said = plan if isinstance(plan, dict) else {}
    known = {"unit", "matrix", "confident", "plan", "source"}
    return Placement(
        _matrix(path, value.get("matrix")),
        value["unit"],
        value.get("confident") is True,
        str(said.get("name", "")),
        str(said.get("sha256", "")),
        str(value.get("source", "")),
        {name: v for name, v in value.items() if name not in known},
    )


def _matrix(path: AnyPath, rows: object) -> npt.NDArray[np.float64]:
    """A (2, 3) similarity.

    Raises:
        FormatError: it is none.
    """
    try:
        matrix = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape != (2, 3) or not all(map(isfinite, matrix.ravel())):
        raise FormatError(path, "its matrix is not two rows of three numbers")
    if np.abs(matrix[:, :2]).max() > LARGEST or np.abs(matrix[:, 2]).max() > FARTHEST:
        raise FormatError(path, "its matrix is beyond reason: no building is so large or so far")
    (a, b), (c, d) = matrix[:, :2]
    scale, flip = hypot(a, c), 1.0 if a * d - b * c > 0 else -1.0
    if scale < 1.0 / LARGEST or hypot(b + flip * c, d - flip * a) > SKEWED * scale:
        raise FormatError(path, "its matrix is not a turn, scale and shift")
    return matrix
