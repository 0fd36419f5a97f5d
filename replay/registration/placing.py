"""What a map or log shows, where pins put a plan, and a plan put into its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Pose
from formats.grid import Geometry
from formats.plans.file import YAML_SUFFIXES, Plan, open_plan
from formats.plans.placement import Placement
from formats.plans.raster import is_picture
from formats.stream import open_log, survey
from replay.mapper import Mapper
from replay.registration.seen import Doubles, Seen, seen_in_log, seen_in_map

CELL = 0.05  # m
REACH = 25.0  # m, readings beyond do not tell walls apart
SCANS = 1500  # of a long log: more show no more of the building
MOST_CELLS = 50_000_000
LOOSE = 0.1  # of the pins' extent: one that is farther off contradicts the others
Pin = tuple[float, float, float, float]  # plan x, y; map x, y


def seen_in(path: str | PathLike[str], notes: Notes, **reading: Any) -> tuple[Seen, Plan | None]:
    """What a map picture or a log shows, and the map's plan where it is a picture.

    Args:
        path: a picture, a map yaml, or a log.
        notes: gets what was odd, skipped or lost.
        reading: options of `formats.stream.survey`, for logs.

    Raises:
        FormatError: not readable, or it shows too little.
    """
    if shows_pixels(Path(path)):
        picture = open_plan(path, notes)
        return seen_in_map(picture), picture
    log = open_log([Path(path)], notes)
    try:
        drive = survey(log, notes, **reading)
        reach = min(drive.limit if drive.limit > 0.0 else inf, REACH)
        x0, y0, x1, y1 = drive.bounds
        geometry = Geometry.covering(x0 - reach, y0 - reach, x1 + reach, y1 + reach, CELL)
        if geometry.rows * geometry.cols > MOST_CELLS:
            raise FormatError(path, "its poses spread too far to be aligned at once")
        mapper = Mapper(geometry, "beam", max_range=reach)
        every = max(1, len(drive) // SCANS)
        for index, frame in enumerate(drive.frames()):
            if index % every == 0:
                mapper.insert(frame)
    finally:
        log.close()
    return seen_in_log(mapper.evidence, str(path)), None


def shows_pixels(path: Path) -> bool:
    """Whether a file is a picture or a map yaml; everything else may be a log."""
    if path.suffix.lower() in YAML_SUFFIXES:
        return True
    try:
        with path.open("rb") as file:
            return is_picture(file.read(4096))
    except OSError:  # a folder, or nothing there, of which the reader of logs tells
        return False


def metres_of(picture: Plan) -> Doubles | None:
    """(2, 3) from metres of a map's frame to its pixels; None where its yaml does not say."""
    if not picture.placed or picture.resolution is None:
        return None
    to_origin = picture.origin.inverse()
    c, s, k = np.cos(to_origin.yaw), np.sin(to_origin.yaw), 1.0 / picture.resolution
    rows = picture.occupancy.shape[0]
    return np.array(
        [
            [c * k, -s * k, to_origin.x * k - 0.5],
            [-s * k, -c * k, rows - 0.5 - to_origin.y * k],
        ]
    )


def pinned(pins: Sequence[Pin], *, metres: bool, mirrored: bool | None = None) -> Doubles:
    """The similarity that brings pins of the map onto those of the plan, by least squares.

    Two pins fit either way round, so that two alone take the plan as not mirrored.

    Args:
        pins: plan x, y in pixels; map x, y in pixels or metres.
        metres: the map's y counts upwards.
        mirrored: None: whichever fits better.

    Raises:
        UsageError: fewer than two pins, all in one place, or some that contradict each other.
    """
    if len(pins) < 2:
        raise UsageError("", "one pin does not hold a plan", hint="give --pin twice or more")
    table = np.array(pins, dtype=np.float64)
    plan, seen = table[:, :2], table[:, 2:]
    a, b = plan - plan.mean(axis=0), seen - seen.mean(axis=0)
    if np.abs(a).max() < 1e-9 or np.abs(b).max() < 1e-9:
        raise UsageError("", "the pins are all in one place", hint="pin places far apart")
    found: list[tuple[float, Doubles]] = []
    for mirror in [False, True] if mirrored is None else [mirrored]:
        flip = -1.0 if mirror != metres else 1.0
        u, v = b[:, 0], flip * b[:, 1]
        size = (b**2).sum()
        c = float((u * a[:, 0] + v * a[:, 1]).sum() / size)
        s = float((u * a[:, 1] - v * a[:, 0]).sum() / size)
        linear = np.array([[c, -s * flip], [s, c * flip]])
        off = float(((b @ linear.T - a) ** 2).sum())
        shift = plan.mean(axis=0) - linear @ seen.mean(axis=0)
        found.append((off, np.column_stack([linear, shift])))
    tiny = 1e-9 * float((a**2).sum())
    matrix = found[0][1] if found[0][0] <= found[-1][0] + tiny else found[-1][1]
    if not np.hypot(matrix[0, 0], matrix[1, 0]) > 0:
        raise UsageError("", "the pins do not fit a turn and scale", hint="are they in order?")
    off = np.hypot(*(seen @ matrix[:, :2].T + matrix[:, 2] - plan).T)
    if off.max() > LOOSE * np.hypot(*np.ptp(plan, axis=0)):
        worst = int(off.argmax())
        x, y, u, v = table[worst]
        raise UsageError(
            "",
            f"the pins contradict each other: {x:g},{y:g}={u:g},{v:g} is {off[worst]:.0f} px off",
            hint="look whether each is the same corner in both",
        )
    return matrix


def posed(plan: Plan, pose: Pose) -> Doubles:
    """The matrix, metres -> pixels, of a plan whose yaml's frame has a pose in the log's frame.

    Raises:
        UsageError: the plan's resolution is not known.
    """
    k, rows = 1.0 / plan.scale, plan.occupancy.shape[0]
    x, y = plan.corner
    back = (pose @ plan.frame).inverse()
    c, s = np.cos(back.yaw), np.sin(back.yaw)
    return np.array(
        [
            [c * k, -s * k, (back.x - x) * k - 0.5],
            [-s * k, -c * k, rows - 0.5 - (back.y - y) * k],
        ]
    )


def placed(plan: Plan, placement: Placement) -> Plan:
    """The plan in the frame of the log; a mirrored one is turned over.

    Raises:
        FormatError: the placement is of a map picture, not of metres.
    """
    origin = placement.origin(plan.occupancy.shape)
    side = -1 if placement.mirrored else 1
    return replace(
        plan,
        grey=np.ascontiguousarray(plan.grey[:, ::side]),
        occupancy=np.ascontiguousarray(plan.occupancy[:, ::side]),
        resolution=1.0 / placement.scale,
        origin=origin,
        placed=True,
    )
