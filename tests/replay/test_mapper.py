from __future__ import annotations

from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

from formats.frame import Frame, Pose, Scan
from formats.grid import Geometry, Grid
from replay.mapper import Mapper
from replay.sensors.observer import MODELS, Touched

ROOM = Geometry(60, 60, 0.1, -3.0, -3.0)


def frames(n: int, seed: int = 0) -> list[Frame]:
    """A turning robot in a square room, with range noise."""
    rng = np.random.default_rng(seed)
    bearings = -pi + (np.arange(180) + 0.5) * 2 * pi / 180
    widths = np.full(180, 2 * pi / 180)
    found = []
    for k in range(n):
        x, y, yaw = (float(v) for v in rng.uniform((-0.5, -0.5, -3), (0.5, 0.5, 3)))
        pose = Pose(x, y, yaw)
        c, s = np.cos(bearings + pose.yaw), np.sin(bearings + pose.yaw)
        walls = [(2.5 * np.sign(c) - pose.x) / c, (2.5 * np.sign(s) - pose.y) / s]
        ranges = np.minimum(*walls) + rng.normal(0, 0.02, 180)
        found.append(Frame(k, pose, Scan(bearings, widths, ranges, 0.1, 8.0)))
    return found


def mapper_of(name: str) -> Mapper:
    """A mapper of any model; what it may need to know of the truth is a chequered room."""
    model = MODELS[name]
    truth = np.arange(ROOM.rows * ROOM.cols).reshape(ROOM.shape) % model.levels
    return Mapper(ROOM, name, **({"truth": truth} if model.of_truth else {}))


def test_every_reading_counts_once_in_each_cell() -> None:
    mapper, [frame] = Mapper(ROOM), frames(1)
    for k in range(1, 4):
        cells, levels = mapper.insert(frame).shown()
        assert np.unique(cells).size == cells.size
        counts = mapper.evidence.counts.reshape(2, -1)
        assert (counts[levels, cells] == k).all()
        assert int(counts.sum()) == k * cells.size


def test_touched_is_what_changed_in_every_model() -> None:
    for name in MODELS:
        mapper = mapper_of(name)
        for frame in frames(5):
            before = mapper.evidence.visits().ravel()
            touched = mapper.insert(frame)
            changed = mapper.evidence.visits().ravel() - before
            assert np.flatnonzero(changed).tolist() == touched.cells.tolist()
            assert set(changed.tolist()) <= {0, 1}
            assert touched.levels.max() <= mapper.model.levels - 1


def test_the_last_touched_is_a_view_on_a_reused_buffer() -> None:
    mapper, (one, two) = Mapper(ROOM), frames(2)
    runs = mapper.insert(one).runs
    assert np.shares_memory(runs, mapper.insert(two).runs)


def test_touched_by_hand() -> None:
    touched = Touched(np.array([[7, 8, 0], [7, 8, 0], [2, 4, 1], [6, 9, 1]], dtype=np.int32))
    assert touched.cells.tolist() == [2, 3, 6, 7, 8]
    assert touched.levels.tolist() == [1, 1, 1, 0, 1]
    assert Touched(np.empty((0, 3), dtype=np.int32)).cells.tolist() == []


def test_same_frames_same_bits() -> None:
    once, again = (Mapper(ROOM, "eq15") for _ in range(2))
    for frame in frames(8):
        once.insert(frame)
    for frame in frames(8):
        again.insert(frame)
    assert once.evidence.counts.tobytes() == again.evidence.counts.tobytes()


def test_parts_of_a_log_mapped_apart_add_up_to_the_whole() -> None:
    drive = frames(9)
    whole, parts = Mapper(ROOM), [Mapper(ROOM) for _ in range(3)]
    for k, frame in enumerate(drive):
        whole.insert(frame)
        parts[k % 3].insert(frame)
    a, b, c = (part.evidence for part in parts)
    for merged in ((a + b) + c, c + (b + a)):
        assert merged.counts.tobytes() == whole.evidence.counts.tobytes()


def test_a_room_is_found() -> None:
    mapper = Mapper(ROOM)
    for frame in frames(30):
        mapper.insert(frame)
    grid = mapper.evidence.on(Grid(ROOM, np.zeros(ROOM.shape)), MODELS["beam"].p_levels())
    rows, cols = np.nonzero(grid.occupied())
    x, y = (cols + 0.5) * 0.1 - 3.0, (rows + 0.5) * 0.1 - 3.0
    assert (np.maximum(np.abs(x), np.abs(y)) > 2.4).all()
    assert (np.maximum(np.abs(x), np.abs(y)) < 2.65).all()
    inside = np.s_[7:53, 7:53]  # more than two cells from the walls
    assert (grid.values[inside] > 0).all()


def test_no_wall_ring_where_nothing_returned() -> None:
    # range_max, or range_max + 1, stood for "no return" before REP-117.
    for r in (8.0, 9.0, inf):
        mapper, [frame] = Mapper(ROOM), frames(1)
        frame.scan.ranges = np.full(180, r, dtype=np.float32)
        mapper.insert(frame)
        assert mapper.evidence.counts[0].sum() == 0
        assert mapper.evidence.counts[1].sum() > 0


def test_recorded_ranges_are_read_as_they_lie_in_the_file() -> None:
    mapper, [frame] = Mapper(ROOM), frames(1)
    expected = mapper.insert(frame).cells
    exact = frame.scan.ranges.astype(np.float64)
    raw = b"x" + exact.tobytes()
    view = np.frombuffer(raw, dtype=np.float64, offset=1)
    assert not view.flags.writeable
    frame.scan.ranges = view
    assert mapper.insert(frame).cells.tolist() == expected.tolist()
    frame.scan.ranges = np.repeat(exact, 2)[::2]
    assert mapper.insert(frame).cells.tolist() == expected.tolist()


def test_a_scan_of_unequal_lengths_is_refused() -> None:
    mapper, [frame] = Mapper(ROOM), frames(1)
    frame.scan.ranges = frame.scan.ranges[:-1]
    with pytest.raises(ValueError, match="broadcast"):
        mapper.insert(frame)


def test_a_large_lattice_costs_what_is_seen() -> None:
    status = Path("/proc/self/statm")
    if not status.exists():
        pytest.skip("resident memory is read from /proc")
    [frame] = frames(1)
    Mapper(ROOM, "eq15").insert(frame)  # compiled before the count
    before = int(status.read_text().split()[1])
    mapper = Mapper(Geometry(5000, 4000, 0.05, -100.0, -100.0), "eq15")
    mapper.insert(frame)
    assert mapper.evidence.counts.nbytes > 2e9
    # Pages may be of 2 MB: one or two for each of 26 levels.
    assert (int(status.read_text().split()[1]) - before) * 4096 < 200e6
