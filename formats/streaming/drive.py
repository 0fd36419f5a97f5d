"""One drive: which scans are used, where they were taken, and the second pass that streams them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from formats.errors import Notes, UsageError
from formats.frame import Frame, Pose
from formats.log import Log
from formats.payload import Undecodable
from formats.sensing.scans import SENSORS
from formats.sensing.sensor import LOOK, Look, Motion, View
from formats.streaming.choice import Choice
from formats.streaming.clock import SECOND, Times
from formats.streaming.gating import gate
from formats.streaming.scanning import scanner
from formats.streaming.track import Floats
from formats.streaming.way import BLOCK, Rows, Swept, Way


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
        way: where the sensor was.
        rows: (m,) of the scans' topic, which message each frame is made of.
        sweeps_ns: (m,) how long the sensor took, 0 where that is not known.
        look: what the readings do not say: heights, echo, camera.
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
    way: Way = field(repr=False)
    rows: Rows = field(repr=False)
    sweeps_ns: Times = field(repr=False)
    look: Look = LOOK
    _told: set[str] = field(default_factory=set, repr=False)
    _lost: set[int] = field(default_factory=set, repr=False)
    _blocks: dict[int, Swept] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        """How many frames are to come; fewer where a scan turns out to be unreadable."""
        return len(self.times_ns)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 in m of the sensor's path."""
        low, high = self.poses[:, :2].min(axis=0), self.poses[:, :2].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def gated(
        self,
        *,
        every: int = 1,
        min_travel: float = 0.0,
        min_turn: float = 0.0,
        readings_per_pose: int | None = None,
    ) -> Drive:
        """Fewer of its scans, see `gating.gate`.

        Raises:
            UsageError: `every` or `readings_per_pose` is below 1, or a gate negative.
        """
        try:
            taken = gate(
                self.poses,
                every=every,
                min_travel=min_travel,
                min_turn=min_turn,
                readings_per_pose=readings_per_pose,
            )
        except ValueError as error:
            raise UsageError(self.log.path, str(error)) from None
        return self.only(taken)

    def only(self, taken: Rows) -> Drive:
        """Those of its scans, by their ascending numbers; the others are not decoded."""
        if len(taken) == len(self):
            return self
        return replace(
            self,
            times_ns=self.times_ns[taken],
            poses=self.poses[taken],
            rows=self.rows[taken],
            sweeps_ns=self.sweeps_ns[taken],
            _blocks={},
        )

    def placed(self, poses: Floats, choice: Choice) -> Drive:
        """The same scans at other poses (m, 3) of the sensor, and where these come from."""
        return replace(self, poses=poses, choice=choice)

    def frames(self) -> Iterator[Frame]:
        """The scans with their poses, in the order of time; may be called again."""
        topic = self.choice.scan
        scan_of = scanner(topic, self.look, self._remark)
        rank = np.full(self.total, -1, dtype=np.int64)
        rank[self.rows] = np.arange(len(self))
        waiting: dict[int, Frame | None] = {}
        turn, blind = 0, SENSORS[topic.type].solid
        for row, (_, _, data) in enumerate(self.log.messages([topic])):
            k = int(rank[row]) if row < self.total else -1
            if k < 0:
                continue
            matrix, motion = self._placed(k)
            try:
                scan = scan_of(data, matrix, motion)
            except Undecodable as error:  # what the first pass left packed: a picture's pixels
                self._lose(k, error.reason)
                waiting[k] = None
            else:
                blind = blind and not np.isfinite(scan.ranges).any()
                pose = Pose(*self.poses[k].tolist())
                waiting[k] = Frame(int(self.times_ns[k]), pose, scan)
            while turn in waiting:
                frame = waiting.pop(turn)
                turn += 1
                if frame is not None:
                    yield frame
        if blind and turn:
            low, high = self.look.slab
            self._remark(f"no return from {low:g} to {high:g} m above the floor: see --scan-height")

    def _remark(self, problem: str) -> None:
        if problem not in self._told:
            self._told.add(problem)
            self.notes.warn(self.log.path, problem, topic=self.choice.scan.name)

    def _lose(self, k: int, why: str) -> None:
        row = int(self.rows[k])
        if row not in self._lost:  # a second pass over the log loses nothing anew
            self._lost.add(row)
            at = f"{(int(self.times_ns[k]) - self.zero_ns) / SECOND:.2f} s"
            problem = f"message not readable: {why}"
            self.notes.lose(self.log.path, problem, topic=self.choice.scan.name, at=at)

    def _placed(self, k: int) -> tuple[Floats, Motion | View | None]:
        """Pose (4, 4) of the sensor and its motion during the sweep; worked out by blocks.

        Of the body, and what takes points there, for clouds whose frame does not move with it.
        """
        number, place = divmod(k, BLOCK)
        swept = self._blocks.get(number)
        if swept is None:
            part = slice(number * BLOCK, (number + 1) * BLOCK)
            swept = self.way.swept(self.rows[part], self.sweeps_ns[part])
            # Scans that are out of order reach into a neighbouring block.
            self._blocks = {n: b for n, b in self._blocks.items() if abs(n - number) < 2}
            self._blocks[number] = swept
        if swept.views is not None:
            return swept.matrices[place], View(swept.views[place])
        if not swept.sweeps_ns[place]:
            return swept.matrices[place], None
        numbers = swept.motions[place].tolist()
        return swept.matrices[place], Motion(Pose(*numbers[:3]), Pose(*numbers[3:]))
