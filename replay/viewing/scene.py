"""What a picture of a run needs, whether the run goes on or lies in a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Particles, Pose
from formats.grid import Floats, Geometry
from formats.plans.plan import Extent
from formats.result import Curve
from formats.results.keyframes import Change
from formats.sensing.ends import MOST_POINTS, Beams, Points, ends_of
from replay.pictures import Bools

BATCH = 256  # frames a batch: small enough to look live, large enough to cost little
BUDGET = 150.0  # MB that are sent of a run, about
SCAN_SHARE, SCORE_SHARE, MAP_SHARE = 0.45, 0.15, 0.4  # of the budget
MOST_SCANS = 6000  # drawn of a run: ten minutes at 10 Hz; more cost time and show little
SCAN_BYTES, SCORE_BYTES = 8 * MOST_POINTS, 700  # of a frame, about
ARC, SURE = 25, 5.991  # points of an ellipse; 95 % of chi squared with two degrees of freedom


class Block(NamedTuple):
    """Consecutive frames of a run, as arrays.

    Attributes:
        frames: (n,) index of each, from 0.
        times_ns: (n,) int64.
        poses: (n, 3) m, m, rad in the plan's frame.
        counts: curve -> (n, 2, 4) observed / unobserved by tp, fp, fn, tn.
        points: by frame, where its beams ended, (m, 2) m; None where that is not known.
    """

    frames: npt.NDArray[np.int64]
    times_ns: npt.NDArray[np.int64]
    poses: Floats
    counts: dict[str, npt.NDArray[np.int64]]
    points: list[Points | None]


class Sighted(NamedTuple):
    """A block on its way to the process that draws, where its points are worked out.

    Attributes:
        block: without points.
        beams: by frame, of the scans that are drawn; None: not this one.
    """

    block: Block
    beams: list[Beams | None]

    def seen(self) -> Block:
        """The block with its points."""
        points = [
            None if beams is None else ends_of(beams, Pose(*pose))
            for beams, pose in zip(self.beams, self.block.poses.tolist(), strict=True)
        ]
        return self.block._replace(points=points)


class Keyframe(NamedTuple):
    """The evidence of a moment.

    Attributes:
        change: since the keyframe before.
        time_ns: of the last frame that it holds.
        explored: share of the scored cells that some reading observed.
    """

    change: Change
    time_ns: int
    explored: float


class Walls(NamedTuple):
    """The plan against the building, at the end of a run.

    Attributes:
        lines: state of `replay.pictures.WALL_COLOURS` -> (n, 2, 2) ends, m.
        metres: the same -> how much there is of it.
    """

    lines: dict[str, Floats]
    metres: dict[str, float]


class Outline(NamedTuple):
    """Where the plan's picture may lie under the log.

    Attributes:
        score: 0 to 1, how well it fits there.
        corners: (4, 2) m.
    """

    score: float
    corners: Floats


@dataclass(frozen=True, slots=True)
class Scene:
    """What does not change during a run; it travels between processes.

    Attributes:
        title: the recording's name.
        report: markdown for the text panel.
        geometry: of every grid.
        levels: that a reading may show.
        curves: name -> how its map is drawn.
        main: the curve that is the run's map.
        walls, doors, windows: cells of the plan, (rows, cols).
        truth, scored: cells that are wall in truth, and cells that count.
        extent: x0, y0, x1, y1 that is worth looking at, m.
        frames: how many will come, as far as known.
        spread: times (m,) ns, ascending, and covariances (m, 3, 3) of the pose in the plan's frame;
            None: the poses are taken as exact.
        particles: of a localiser now and then, in the plan's frame.
        places: where the plan may lie, the one taken first; none where it was not searched for.
    """

    title: str
    report: str
    geometry: Geometry
    levels: int
    curves: dict[str, Curve]
    main: str
    walls: Bools
    doors: Bools
    windows: Bools
    truth: Bools
    scored: Bools
    extent: Extent
    frames: int
    spread: tuple[npt.NDArray[np.int64], Floats] | None = None
    places: tuple[Outline, ...] = ()
    particles: tuple[Particles, ...] = ()

    @property
    def drawn(self) -> bool:
        """Whether there is a plan, so that a map with prior differs from one without."""
        return self.main != "none"


def label_corners(places: Sequence[Outline]) -> Floats:
    """(n, 2) m, a corner of each place for its label, far from the labels of those before."""
    taken: list[Floats] = []
    for place in places:
        apart = [min((np.hypot(*(c - t)) for t in taken), default=0.0) for c in place.corners]
        taken.append(place.corners[int(np.argmax(apart))])
    return np.array(taken).reshape(-1, 2)


def strides(frames: int, budget: float) -> tuple[int, int]:
    """Every how many frames a scan is sent, and the scores, so that they fit the budget (MB)."""
    size = budget * 1e6
    scans = max(round(frames * SCAN_BYTES / (size * SCAN_SHARE)), -(-frames // MOST_SCANS))
    scores = round(frames * SCORE_BYTES / (size * SCORE_SHARE))
    return max(1, scans), max(1, scores)


def explored(counts: npt.NDArray[np.int64]) -> Floats:
    """(n,) share of the scored cells that some reading observed; counts (n, 2, 4)."""
    cells = counts.sum(axis=2).astype(np.float64)
    every = cells.sum(axis=1)
    return np.divide(cells[:, 0], every, out=np.zeros_like(every), where=every > 0)


def ellipses(covariances: Floats, places: Floats) -> Floats:
    """(n, ARC, 2) outlines that hold a pose's place with 95 %.

    Args:
        covariances: (n, 3, 3) of x, y, yaw; m2.
        places: (n, 2) m, the centres.
    """
    values, vectors = np.linalg.eigh(covariances[:, :2, :2])
    axes = vectors * np.sqrt(SURE * np.maximum(values, 0.0))[:, None, :]
    angles = np.linspace(0.0, 2.0 * np.pi, ARC)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    outlines: Floats = places[:, None, :] + np.swapaxes(axes @ circle, 1, 2)
    return outlines
