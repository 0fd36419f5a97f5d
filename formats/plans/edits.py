"""Edits of a plan by hand: a plain text file, one edit a line, replayed in its order.

What follows `unit px` (as at the start) is in pixels from the upper left corner, y down, pixel
centres at whole numbers; what follows `unit m` in metres of the plan's frame, y up. `#` begins a
remark. Points are X,Y:

    add wall POINT POINT ... THICK        a wall along a way; likewise `add window`
    remove wall POINT POINT ... THICK     what of walls lies in such a band; likewise `window`
    add door HINGE SHUT-END [left|right]  opens the wall; the side as seen from the hinge
    remove door POINT
    add region POINT POINT POINT ...      this is building; `remove region`: this is not
    clear region POINT POINT POINT ...    nothing stands there, but it is building
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, pi
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, printable
from formats.errors import Path as AnyPath
from formats.plans.plan import Plan

Verb = Literal["add", "remove", "clear"]
Thing = Literal["wall", "window", "door", "region"]
Points = npt.NDArray[np.float64]
LARGEST = 1_000_000  # bytes
FARTHEST = 1e6  # px or m
SWINGS = {"left": -pi / 2, "right": pi / 2}  # y down: a turn to the left is negative


@dataclass(frozen=True, slots=True)
class Edit:
    """One edit.

    Attributes:
        line: of the file, from 1.
        verb, thing: what is done to what.
        points: (n, 2) px or m: a way, a hinge and a shut end, a place, or the corners of a region.
        thick: of walls and windows, px or m.
        swing: rad, of a door, from shut to open; positive turns x towards y on the picture.
        metres: whether points and thickness are in m of the plan's frame, y up.
    """

    line: int
    verb: Verb
    thing: Thing
    points: Points
    thick: float = 0.0
    swing: float = 0.0
    metres: bool = False


@dataclass(frozen=True, slots=True)
class PlanEdits:
    """A file of edits.

    Attributes:
        path: of the file.
        edits: in the order of its lines.
        sha256: of the file.
    """

    path: Path
    edits: tuple[Edit, ...]
    sha256: str

    def on(self, plan: Plan) -> tuple[Edit, ...]:
        """The edits in the plan's pixels.

        Raises:
            FormatError: one is in metres, and nothing says how large a pixel is; one lies outside
                of the picture.
        """
        return tuple(self._in_pixels(edit, plan) for edit in self.edits)

    def fault(self, line: int, problem: str, hint: str = "") -> FormatError:
        """What is wrong with a line."""
        return FormatError(self.path, f"line {line}: {problem}", hint=hint)

    def _in_pixels(self, edit: Edit, plan: Plan) -> Edit:
        points, thick = edit.points, edit.thick
        rows, cols = plan.occupancy.shape
        if edit.metres:
            if plan.resolution is None:
                problem = "is in metres, and nothing says how large a pixel is"
                raise self.fault(edit.line, problem, "give --plan-resolution, or edit in px")
            x, y = plan.corner
            points = np.column_stack(
                (
                    (points[:, 0] - x) / plan.resolution - 0.5,
                    rows - 0.5 - (points[:, 1] - y) / plan.resolution,
                )
            )
            thick = thick / plan.resolution
        low, high = points.min(axis=0), points.max(axis=0)
        if high[0] < -0.5 or high[1] < -0.5 or low[0] > cols - 0.5 or low[1] > rows - 0.5:
            problem = f"lies outside of the plan ({cols} x {rows} px)"
            raise self.fault(edit.line, problem, "is its unit right?")
        return Edit(edit.line, edit.verb, edit.thing, points, thick, edit.swing)


def read_plan_edits(path: AnyPath) -> PlanEdits:
    """Read a file of edits; every line is checked.

    Raises:
        FormatError: not readable, not text, or a line that is no edit; with the line's number.
    """
    data = _bytes(Path(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise FormatError(path, "is not a text file of plan edits")
    metres, edits = False, []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            if words[0] == "unit":
                metres = _unit(words)
            else:
                edits.append(_edit(words, number, metres))
        except ValueError as error:
            raise FormatError(path, f"line {number}: {error}") from None
    return PlanEdits(Path(path), tuple(edits), hashlib.sha256(data).hexdigest())


def _bytes(path: Path) -> bytes:
    try:
        if not path.is_file():
            raise FormatError(path, "is a folder" if path.is_dir() else "does not exist")
        if path.stat().st_size > LARGEST:
            raise FormatError(path, f"over {LARGEST:,} bytes are too many for plan edits")
        return path.read_bytes()
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None


def _unit(words: list[str]) -> bool:
    """Whether what follows is in metres."""
    if words[1:] not in (["px"], ["m"]):
        raise ValueError(f"{_shown(words)} is not `unit px` or `unit m`")
    return words[1] == "m"


def _edit(words: list[str], line: int, metres: bool) -> Edit:
    """One line; ValueError says what is wrong with it."""
    form = FORMS.get((words[0], words[1] if len(words) > 1 else ""))
    if form is None:
        known = ", ".join(f"`{verb} {thing}`" for verb, thing in FORMS)
        raise ValueError(f"{_shown(words[:2])} is no edit; there are {known}, `unit`")
    verb, thing, take = form
    points, thick, swing = take(words[2:])
    return Edit(line, verb, thing, np.array(points, dtype=np.float64), thick, swing, metres)


Taken = tuple[list[tuple[float, float]], float, float]
"""Points, thickness, swing."""


def _band(words: list[str]) -> Taken:
    """Two points or more, and a thickness."""
    if len(words) < 3 or "," in words[-1]:
        raise ValueError("wants two points X,Y or more, then a thickness")
    thick = _number(words[-1])
    if thick <= 0:
        raise ValueError(f"a thickness of {printable(words[-1])} is not above 0")
    points = [_point(word) for word in words[:-1]]
    if all(point == points[0] for point in points):
        raise ValueError("its points are one and the same")
    return points, thick, 0.0


def _leaf(words: list[str]) -> Taken:
    """A hinge, a shut end, and perhaps a side."""
    if len(words) not in (2, 3):
        raise ValueError("wants hinge X,Y, shut end X,Y and perhaps left or right")
    side = words[2] if len(words) == 3 else "left"
    if side not in SWINGS:
        raise ValueError(f"{_shown([side])} is not left or right, seen from the hinge")
    points = [_point(word) for word in words[:2]]
    if points[0] == points[1]:
        raise ValueError("its hinge and its shut end are one point")
    return points, 0.0, SWINGS[side]


def _place(words: list[str]) -> Taken:
    """One point."""
    if len(words) != 1:
        raise ValueError("wants one point X,Y")
    return [_point(words[0])], 0.0, 0.0


def _corners(words: list[str]) -> Taken:
    """Three points or more."""
    if len(words) < 3:
        raise ValueError("wants three corners X,Y or more")
    return [_point(word) for word in words], 0.0, 0.0


FORMS: dict[tuple[str, str], tuple[Verb, Thing, Callable[[list[str]], Taken]]] = {
    ("add", "wall"): ("add", "wall", _band),
    ("remove", "wall"): ("remove", "wall", _band),
    ("add", "window"): ("add", "window", _band),
    ("remove", "window"): ("remove", "window", _band),
    ("add", "door"): ("add", "door", _leaf),
    ("remove", "door"): ("remove", "door", _place),
    ("add", "region"): ("add", "region", _corners),
    ("remove", "region"): ("remove", "region", _corners),
    ("clear", "region"): ("clear", "region", _corners),
}
"""The first two words of a line -> what they mean, and what takes the others."""


def _point(word: str) -> tuple[float, float]:
    parts = word.split(",")
    if len(parts) != 2:
        raise ValueError(f"{_shown([word])} is not a point X,Y")
    return _number(parts[0]), _number(parts[1])


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise ValueError(f"{_shown([word])} is not a number") from None
    if not isfinite(value) or abs(value) > FARTHEST:
        raise ValueError(f"{_shown([word])} is out of range")
    return value


def _shown(words: list[str]) -> str:
    return repr(printable(" ".join(words), 60))
