"""`LOG:/map`: the last OccupancyGrid on a topic of a log as a plan, validated as nav2 does."""

from __future__ import annotations

from hashlib import sha256
from math import atan2, hypot, isfinite, sqrt
from pathlib import Path

import numpy as np

from formats.errors import FormatError, Notes, UsageError, printable
from formats.frame import Pose
from formats.log import Log, Topic
from formats.messages import OccupancyGrid
from formats.plans.plan import Plan

GRID = "nav_msgs/msg/OccupancyGrid"
UNKNOWN_GREY = 205
MOST_CELLS = 200_000_000
UNIT = 1e-2  # a quaternion whose norm is off by more turns nothing
LEVEL = 1e-3


def topic_in(path: Path) -> tuple[Path, str] | None:
    """The log and the topic of LOG:/TOPIC; None where the name is that of a file, or of neither."""
    log, colon, topic = str(path).rpartition(":")
    try:
        if not (colon and log and topic) or path.exists() or not Path(log).exists():
            return None
    except (OSError, ValueError):  # a name too long, or with a NUL
        return None
    return Path(log), topic


def plan_of_log(
    path: Path,
    name: str,
    notes: Notes,
    *,
    resolution: float | None = None,
    origin: Pose | None = None,
) -> Plan:
    """The last map on a topic of a log, a result of ours among them.

    Args:
        path: of the log.
        name: of the topic.
        notes: losses in the log.
        resolution: m a cell; overrules the map's.
        origin: pose of its lower left corner; overrules the map's.

    Raises:
        UsageError: no such map in the log.
        FormatError: not a log, no message, or a map that cannot be right.
    """
    from formats.opening import open_log

    log = open_log(path, notes)
    try:
        topic = _topic(log, name)
        last, count = b"", 0
        for message in log.messages([topic]):
            last, count = bytes(message.data), count + 1
        grid = decoded(path, topic, last, count)
    finally:
        log.close()
    if count > 1:
        notes.info(path, f"the last of {count} maps is taken", topic=topic.name)
    cells = np.ascontiguousarray(grid.cells[::-1])
    grey = np.where(cells < 0, UNKNOWN_GREY, np.rint(255 - 2.55 * cells)).astype(np.uint8)
    return Plan(
        path=Path(f"{path}:{topic.name.lstrip('/')}"),
        grey=grey,
        occupancy=cells,
        # The message has 32 bits of it: 0.05 came as 0.0500000007.
        resolution=float(f"{grid.resolution:.7g}") if resolution is None else resolution,
        origin=placed(grid) if origin is None else origin,
        placed=True,
        inputs={str(file): _digest(file) for file in _files(path)},
        in_log=True,
    )


def _topic(log: Log, name: str) -> Topic:
    from formats.decoding import decoder_of
    from formats.log import listing, named

    topics = log.topics()
    maps = [topic for topic in topics if topic.type == GRID and decoder_of(topic) is not None]
    if found := named(maps, name):
        return found[0]
    other = named(topics, name)
    problem = f"is a {printable(other[0].type)}, not a map" if other else "no such topic"
    raise UsageError(log.path, problem, topic=name, hint=f"maps here: {listing(maps) or 'none'}")


def decoded(path: Path, topic: Topic, data: bytes, count: int) -> OccupancyGrid:
    """The map, when it can be right.

    Raises:
        FormatError: there is none, or it cannot be read or used.
    """
    from formats.decoding import decoder_of
    from formats.payload import Undecodable

    if not count:
        raise FormatError(path, "no map was recorded", topic=topic.name)
    read = decoder_of(topic)
    assert read is not None
    try:
        grid: OccupancyGrid = read(data)
    except Undecodable as error:
        raise FormatError(path, f"map not readable: {error}", topic=topic.name) from None
    if problem := fault(grid):
        raise FormatError(path, problem, topic=topic.name)
    return grid


def fault(grid: OccupancyGrid) -> str:
    """Why a map cannot be used, "" where it can: what nav2's validateMsg asks, and its values."""
    rows, cols = grid.cells.shape
    if not rows * cols:
        return f"a map of {cols} x {rows} cells"
    if rows * cols > MOST_CELLS:
        return f"a map of {cols} x {rows} cells is too large"
    if not (isfinite(grid.resolution) and grid.resolution > 0):
        return f"a map whose resolution is {grid.resolution:g} m"
    if not all(map(isfinite, grid.origin)):
        return "a map whose origin is not finite"
    x, y, z, w = grid.origin[3:]
    norm = sqrt(x * x + y * y + z * z + w * w)
    if abs(norm - 1) > UNIT:
        return f"a map whose origin has a quaternion of norm {norm:g}"
    if hypot(x, y) > LEVEL:
        return "a map whose origin is tilted"
    low, high = int(grid.cells.min()), int(grid.cells.max())
    if low < -1 or high > 100:
        return f"a map with values from {low} to {high}; -1 and 0 to 100 are known"
    return ""


def placed(grid: OccupancyGrid) -> Pose:
    """Pose of the lower left corner."""
    x, y, _, _, _, qz, qw = grid.origin
    return Pose(x, y, 2 * atan2(qz, qw) if qz else 0.0)


def _files(path: Path) -> list[Path]:
    return sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]


def _digest(path: Path) -> str:
    digest = sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
