"""One drive: which scans are used, where they were taken, and the second pass that streams them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from formats.choice import Choice
from formats.clock import Times
from formats.errors import Notes
from formats.frame import Frame, Pose
from formats.gathering import decoder_of
from formats.log import Log
from formats.ros import Undecodable
from formats.sensing import SENSORS, Motion
from formats.track import Floats


@dataclass(eq=False)
class Drive:
    """One drive: which scans are used, and where they were taken.

    Attributes:
        log: read from again by `frames`.
        notes: what was odd, skipped or lost.
        choice: of topics and frames, with reasons.
        total: scans in the log.
        posed: scans with a pose, before `every` and the gates.
        times_ns: (m,) int64 ascending, of the frames to come.
        poses: (m, 3) x y yaw of the sensor in `choice.map_frame`.
        limit: m, the longest range of the sensor; may be inf.
        zero_ns: the start of the log, on the clock of `times_ns`.
    """

    log: Log
    notes: Notes
    choice: Choice
    total: int
    posed: int
    times_ns: Times
    poses: Floats
    limit: float
    zero_ns: int
    _rows: npt.NDArray[np.intp] = field(repr=False)
    _matrices: Floats = field(repr=False)
    _sweeps: Floats | None = field(repr=False)

    def __len__(self) -> int:
        """How many frames are to come; fewer where a scan turns out to be unreadable."""
        return len(self.times_ns)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in m of the sensor's path."""
        low, high = self.poses[:, :2].min(axis=0), self.poses[:, :2].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def frames(self) -> Iterator[Frame]:
        """The scans with their poses, in the order of time; may be called again."""
        topic = self.choice.scan
        read, sensor = decoder_of(topic), SENSORS[topic.type]
        assert read is not None
        rank = dict(zip(self._rows.tolist(), range(len(self._rows)), strict=True))
        waiting: dict[int, Frame | None] = {}
        turn = 0
        for row, (_, _, data) in enumerate(self.log.messages([topic])):
            k = rank.get(row)
            if k is None:
                continue
            try:
                scan = sensor.scan(read(data), self._matrices[k], self._motion(k))
            except Undecodable:  # counted in the first pass
                waiting[k] = None
            else:
                pose = Pose(*self.poses[k].tolist())
                waiting[k] = Frame(int(self.times_ns[k]), pose, scan)
            while turn in waiting:
                frame = waiting.pop(turn)
                turn += 1
                if frame is not None:
                    yield frame

    def _motion(self, k: int) -> Motion | None:
        if self._sweeps is None or np.isnan(self._sweeps[k, 0]):
            return None
        numbers = self._sweeps[k].tolist()
        return Motion(Pose(*numbers[:3]), Pose(*numbers[3:]))
