"""What a kind of sensor is: how its readings become scans, and what they do not say themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from formats.depth.scans import SLAB
from formats.frame import Pose, Scan
from formats.messages import CameraInfo
from formats.sensing.echo import Echo

Floats = npt.NDArray[np.float64]


class Motion(NamedTuple):
    """The sensor's poses at the first and the last beam of a sweep, in its pose at the middle."""

    first: Pose
    last: Pose


class View(NamedTuple):
    """What takes the points of a cloud, whose frame stays where it is, to the robot's body."""

    matrix: Floats


class Look(NamedTuple):
    """What readings alone do not say.

    Attributes:
        slab: m above the floor, of depth images and clouds.
        echo: of scanners with several echoes a beam.
        camera: of depth images.
    """

    slab: tuple[float, float] = SLAB
    echo: Echo = "first"
    camera: CameraInfo | None = None


LOOK = Look()


class Sense(Protocol):
    """Reading, pose of its sensor (4, 4) in the map frame, motion during it -> Scan."""

    def __call__(
        self, reading: Any, matrix: Floats, motion: Motion | None = None, look: Look = LOOK, /
    ) -> Scan:
        """The scan, in the frame `level_pose(matrix, forward)`."""
        ...


class Sensor(NamedTuple):
    """How one message type is read.

    Attributes:
        rank: of several kinds in one log the lowest rank is taken.
        fault: why a reading cannot be used, "" where it can; it may raise Undecodable.
        scan: see Sense.
        sweep: s, how long the sensor took from the first beam to the last.
        limit: m, the longest range of the sensor.
        forward: the axis of its frame that points forward: 2 of a camera's optical frame, else 0.
        solid: it sees heights, so that its readings are cut at a slab above the floor.
    """

    rank: int
    fault: Callable[[Any], str]
    scan: Sense
    sweep: Callable[[Any], float]
    limit: Callable[[Any], float]
    forward: int = 0
    solid: bool = False
