"""The main job: logs and a plan in; steps, scores and a result out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import perf_counter

from formats.frame import Frame
from formats.result import Maps, Step
from replay.mapper import Mapper
from replay.scoring.predictive import Predictor
from replay.scoring.scorer import Scorer
from replay.world import World

EARLY = 8  # the first keyframes are 0, 1, 3, 7, ..., since most changes there
KEYFRAMES = 50


def keyframes(frames: int) -> set[int]:
    """Frames whose whole picture is kept: dense at first, then evenly, and the last."""
    early = {2**i - 1 for i in range(EARLY)}
    even = {round(i * (frames - 1) / KEYFRAMES) for i in range(1, KEYFRAMES + 1)}
    return {i for i in early | even if i < frames} | {frames - 1}


class Clock:
    """Where the time of a run goes."""

    def __init__(self) -> None:
        stages = ("reading", "localising", "mapping", "scoring", "writing")
        self.seconds = dict.fromkeys(stages, 0.0)
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """What passed since the last lap belongs to `stage`."""
        now = perf_counter()
        self.seconds[stage] += now - self._last
        self._last = now


def steps(
    frames: Iterator[Frame],
    expected: int,
    world: World,
    mapper: Mapper,
    *,
    predictor: Predictor | None = None,
    clock: Clock | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Step]:
    """Map and score, frame by frame; the algorithm on one screen.

    Args:
        frames: poses in the frame of the poses.
        expected: how many frames will come, as far as known.
        world: what stands before the first frame.
        mapper: counts the readings.
        predictor: sees each frame before it is mapped.
        clock: is told where the time goes.
        progress: is told (done, expected) now and then.
    """
    clock = clock or Clock()
    to_plan = world.map_to_plan.inverse()
    scorer = Scorer(world.wall, world.scored, world.curves)
    maps = Maps(world.curves, mapper.evidence)
    kept = keyframes(expected)
    for index, frame in enumerate(frames):
        clock.lap("reading")
        frame.pose = to_plan @ frame.pose
        if predictor is not None:
            predictor.see(frame, mapper.evidence)
            clock.lap("scoring")
        touched = mapper.insert(frame)
        clock.lap("mapping")
        counts = scorer.update(mapper.evidence, touched)
        clock.lap("scoring")
        yield Step(index, frame, maps, counts, index in kept, mapper.evidence)
        clock.lap("writing")
        if progress and index % 16 == 0:
            progress(index, expected)
