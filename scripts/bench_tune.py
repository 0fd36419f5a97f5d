"""Times of the search: surfaces from sorted tables against drawing and counting the map anew.

scripts/bench tune          a grid of 200 x 860 cells, beam counts of a long drive
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from time import perf_counter

import numpy as np

from formats.grid import Evidence, Geometry, Grid, logit
from replay.mapper import Mapper
from replay.prior import used
from replay.scoring.scorer import count
from replay.simulator.driving import drive
from replay.simulator.frames import frames
from replay.simulator.sensors import Lidar
from replay.simulator.site import Site
from replay.tuning.cases import ground
from replay.tuning.front import exact_front
from replay.tuning.genetic import evolve
from replay.tuning.objectives import exact
from replay.tuning.search import Search
from replay.tuning.surfaces import Tables, Values, grid

ROWS, COLS = 200, 860  # the paper's floor of 43 x 10 m at 5 cm


def best(work: Callable[[], object], times: int = 7) -> float:
    """Seconds of the fastest of several."""
    taken = []
    for _ in range(times):
        start = perf_counter()
        work()
        taken.append(perf_counter() - start)
    return min(taken)


def replay_seconds(walls: np.ndarray, scans: int = 500) -> float:
    """Mapping a drive of so many scans of 360 beams over this building, once."""
    site = Site.of(walls, 0.05)
    way = drive([(1.0, 1.2), (1.6, 1.2)], speed=0.6 * 10.0 / scans)
    read = list(islice(frames(site, way, Lidar()), scans))
    geometry = Geometry(ROWS, COLS, 0.05, 0.0, 0.0)

    def work() -> object:
        mapper = Mapper(geometry)
        for frame in read:
            mapper.insert(frame)
        return mapper

    work()
    return best(work, 3)


def main() -> None:
    random = np.random.default_rng(1)
    geometry = Geometry(ROWS, COLS, 0.05, 0.0, 0.0)
    walls = np.zeros(geometry.shape, dtype=np.bool_)
    walls[::50], walls[:, ::40] = True, True
    truth = walls ^ (random.random(walls.shape) < 0.01)
    seen = random.random(walls.shape) < 0.8
    passes = random.poisson(60.0, walls.shape) * seen
    hits = random.binomial(passes, np.where(truth, 0.7, 0.03))
    counts = np.stack([hits, passes - hits]).astype(np.uint32)
    evidence = Evidence(geometry, counts)
    nothing, one = np.zeros(walls.shape, dtype=np.bool_), np.ones(walls.shape, dtype=np.int64)
    classes = ground("bench", walls.astype(float), nothing, truth.astype(np.int64), one)
    mapped = replay_seconds(walls)
    print(f"mapping 500 scans of 360 beams: {1e3 * mapped:.0f} ms")
    for update, levels in (("bayes", (0.3, 0.6)), ("paper", (0.1, 0.9))):
        values = Values(levels, update)  # type: ignore[arg-type]
        case = classes.case(evidence)
        tables = Tables(case, values)

        def replayed(values: Values = values) -> object:
            l0 = np.where(walls, logit(used(0.2)), logit(used(0.9)))
            grown = evidence.on(Grid(geometry, l0), values.p_levels, values.update)
            return count(grown.occupied(), truth, ~nothing, seen)

        def surface(steps: int, tables: Tables = tables) -> Callable[[], object]:
            p = grid(steps)

            def work() -> object:
                scores = tables.surface(p, p)
                return scores.precision, scores.recall, scores.f2

            return work

        exact_front(tables)
        once = best(replayed)
        print(f"{update}: distinct cells {sum(c.counts.shape[1] for c in case.classes.values())}")
        print(
            f"  counting alike cells      {1e3 * best(lambda: classes.case(evidence), 3):9.2f} ms"
        )
        print(f"  sorting them              {1e3 * best(lambda: Tables(case, values)):9.2f} ms")  # noqa: B023
        for steps in (10, 1000):
            took = best(surface(steps))
            print(
                f"  {steps} x {steps} surface {'':<9}{1e3 * took:9.2f} ms, "
                f"{1e6 * took / steps**2:.3f} us a pair, "
                f"{(mapped + once) * steps**2 / took:,.0f} x as fast as by replay, "
                f"{once * steps**2 / took:,.0f} x as drawing and counting ({1e3 * once:.2f} ms)"
            )
        print(f"  exact front               {1e3 * best(lambda: exact_front(tables)):9.2f} ms")  # noqa: B023
        x = random.uniform(0.1, 1.0, (100, 2))
        f = exact(tables)
        print(f"  100 individuals           {1e3 * best(lambda: f(x)):9.3f} ms")  # noqa: B023
        found = evolve(f, Search())
        took = best(lambda: evolve(f, Search()), 1)  # noqa: B023
        print(f"  genetic search, {found.evaluations:,} evaluations {1e3 * took:.0f} ms")


if __name__ == "__main__":
    main()
