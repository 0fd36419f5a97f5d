"""How well maps find their places: real maps on real plans, and random ones for calibration.

    python -m scripts.score_align halmstad            18 maps of two buildings, nothing given
    python -m scripts.score_align uji [FOLDER]        three maps on an architect's sheet; overlays
    python -m scripts.score_align random 0 100        reliability on random buildings

Real data are read from $REPLAY_SHARED_DATA, ../shared/data by default.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
import numpy.typing as npt

from formats.errors import Notes
from formats.frame import Pose
from formats.output import write_image
from formats.plans.file import Plan, open_plan
from formats.plans.ink import drawn
from replay.registration.overlay import overlay
from replay.registration.register import SURE, align
from replay.registration.seen import Seen, points_of, seen_in_map
from scripts.random_flats import KINDS, case

ROOT = Path(__file__).resolve().parent.parent
Doubles = npt.NDArray[np.float64]
NEAR = 0.05  # of the map's diagonal: a place that is right
RIGHT = 30.0  # px of Halmstad's pictures
SIDE = 1585  # px of them
BINS = (0.0, 0.3, 0.5, 0.7, 0.85, 0.95, 1.01)
UJI = {
    "map_TD": "maps_pablomatilla/map_TD.pgm",
    "map7": "maps_diegomarzaa_cartographer/map7.pgm",
    "irl_map6": "maps_jordialt/irl_map6.pgm",
}


def folder() -> Path:
    """Of the real plans with maps."""
    data = Path(os.environ.get("REPLAY_SHARED_DATA", ROOT.parent / "shared" / "data"))
    return data / "plans_with_logs"


def halmstad_maps() -> Iterator[tuple[str, str]]:
    """(building, map) of all 18."""
    for building, count in (("E5", 14), ("HIH", 4)):
        for i in range(1, count + 1):
            yield building, f"{building}_{i:02d}"


def halmstad_pairs(data: Path, building: str, name: str) -> tuple[Doubles, Doubles]:
    """(n, 2) keypoints of a map, and those of its layout that people associated, y down."""
    notes = data / "halmstad" / "annotations"
    pairs = np.load(notes / f"association_{name}_{building}_layout.npy")
    seen = np.load(notes / f"keypoints_{name}.npy")[pairs[:, 0]]
    drawn = np.load(notes / f"keypoints_{building}_layout.npy")[pairs[:, 1]]
    for points in (seen, drawn):
        points[:, 1] = SIDE - 1 - points[:, 1]  # their y counts upwards
    return seen, drawn


def halmstad_off(data: Path, building: str, name: str, matrix: Doubles) -> float:
    """Median distance in px of the keypoints that people associated, after alignment."""
    seen, drawn = halmstad_pairs(data, building, name)
    return float(np.median(np.hypot(*(seen @ matrix[:, :2].T + matrix[:, 2] - drawn).T)))


def halmstad() -> int:
    data = folder()
    took, right, wrong = [], 0, 0
    print(
        f"{'map':<8}{'off px':>8}{'scale':>8}{'turn':>8}{'conf':>7}{'score':>7}{'next':>7}{'s':>6}"
    )
    for building, name in halmstad_maps():
        maps = data / "halmstad" / "maps" / building
        plan = open_plan(maps / "layout" / f"{building}_layout.png", Notes())
        seen = seen_in_map(open_plan(maps / "pseudo_occupancy" / f"{name}.png", Notes()))
        found = align(seen, plan.wall)
        off = halmstad_off(data, building, name, found.best.matrix)
        took.append(found.seconds)
        right += off < RIGHT
        wrong += found.confident and off >= RIGHT
        best, second = found.best, found.places[1].score if len(found.places) > 1 else 0.0
        print(
            f"{name:<8}{off:>8.1f}{best.scale:>8.3f}{best.turn_deg:>8.1f}{found.confidence:>7.2f}"
            f"{best.score:>7.2f}{second:>7.2f}{found.seconds:>6.1f}"
            f"{'' if found.confident else '  refused'}",
            flush=True,
        )
    print(f"{right} of {len(took)} within {RIGHT:.0f} px, {wrong} wrong but confident, ", end="")
    print(f"median {median(took):.1f} s")
    return 0 if right == len(took) and not wrong else 1


def uji(pictures: Path | None) -> int:
    data = folder() / "uji_tech_building"
    plan = open_plan(data / "plan" / "TD_n1.png", Notes())
    print(f"{'map':<10}{'scale':<7}{'found':>7}{'turn':>7}{'at the middle':>15}{'conf':>6}{'s':>6}")
    for name, path in UJI.items():
        seen = seen_in_map(open_plan(data / path, Notes()))
        assert seen.resolution is not None
        for told in ("yaml", "free"):
            scale = seen.resolution / plan.scale if told == "yaml" else None
            given = seen if told == "yaml" else replace(seen, resolution=None)
            found = align(given, plan.wall, scale=scale)
            best = found.best
            x, y = best.matrix @ [seen.free.shape[1] / 2, seen.free.shape[0] / 2, 1.0]
            others = " ".join(
                f"{p.score:.2f}{'m' if p.mirrored else ''}@{p.turn_deg:.0f}" for p in found.places
            )
            print(
                f"{name:<10}{told:<7}{best.scale:>7.3f}{best.turn_deg % 360:>7.1f}"
                f"{x:>9.0f}{y:>6.0f}{found.confidence:>6.2f}{found.seconds:>6.1f}  {others}",
                flush=True,
            )
            if pictures:
                image = overlay(plan.grey, seen, best.matrix)
                write_image(pictures / f"{name}_{told}.png", image, force=True)
    return 0


def random(first: int, last: int) -> int:
    rows: list[tuple[str, float, bool, float]] = []
    for seed in range(first, last):
        try:
            one = case(seed)
        except ValueError:  # no room for the robot
            continue
        used = process_time()
        seen = seen_in_map(as_plan("map.png", one.map))
        found = align(seen, as_plan("plan.png", one.plan).wall, scale=one.scale)
        used = process_time() - used
        off = 9.0 if one.matrix is None else _off(seen, found.best.matrix, one.matrix)
        rows.append((one.kind, found.confidence, off < NEAR, used))
        if (off >= NEAR and found.confident) or (off >= NEAR and one.matrix is not None):
            word = "wrong but confident" if found.confident else "not found"
            print(f"seed {seed} {one.kind}: {word}, {found.confidence:.2f}, off {off:.2f}")
    said, right = np.array([row[1] for row in rows]), np.array([row[2] for row in rows])
    print(f"{'kind':<10}{'cases':>6}{'right':>7}{'confident':>11}{'wrong of them':>15}{'s':>6}")
    for kind in KINDS:
        some = np.array([row[0] == kind for row in rows])
        if some.any():
            sure = some & (said >= SURE)
            took = median(row[3] for row in rows if row[0] == kind)
            print(
                f"{kind:<10}{some.sum():>6}{right[some].mean():>7.2f}{sure[some].mean():>11.2f}"
                f"{(sure & ~right).sum():>15}{took:>6.1f}"
            )
    print(f"{'said':>12}{'cases':>7}{'mean said':>11}{'right':>7}")
    for low, high in pairwise(BINS):
        some = (said >= low) & (said < high)
        if some.any():
            bounds = f"{low:.2f}-{min(high, 1.0):.2f}"
            row = f"{bounds:>12}{some.sum():>7}{said[some].mean():>11.2f}"
            print(f"{row}{right[some].mean():>7.2f}")
    brier = float(np.square(said - right).mean())
    print(f"{len(rows)} cases, Brier score {brier:.3f}, median {median(r[3] for r in rows):.1f} s")
    return 0


def as_plan(name: str, grey: npt.NDArray[np.uint8]) -> Plan:
    """A plain picture, read as from a file."""
    shown, occupancy = drawn(Path(name), grey, None, Notes())
    return Plan(Path(name), shown, occupancy, None, Pose(0.0, 0.0, 0.0), False, {})


def _off(seen: Seen, found: Doubles, true: Doubles) -> float:
    """Median distance of the occupied cells, as a share of the map's diagonal."""
    points = points_of(seen.occupied)
    change = points @ (found - true)[:, :2].T + (found - true)[:, 2]
    diagonal = np.hypot(*np.ptp(points, axis=0)) * np.hypot(*true[:, 0])
    return float(np.median(np.hypot(*change.T)) / diagonal)


def main(arguments: list[str]) -> int:
    """The exit code."""
    match arguments:
        case ["halmstad"]:
            return halmstad()
        case ["uji", *rest]:
            return uji(Path(rest[0]) if rest else None)
        case ["random", first, last]:
            return random(int(first), int(last))
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
