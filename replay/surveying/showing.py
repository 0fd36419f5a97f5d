"""Deviations as a picture and as GeoJSON."""

from __future__ import annotations

import json
from math import isnan
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from formats.frame import Pose
from replay.pictures import WALL_COLOURS
from replay.surveying.compare import Wall
from replay.surveying.deviations import Deviations

Pixels = npt.NDArray[np.uint8]
SIDE = 1600  # px that the picture's longer side has at least
LABELLED = 0.5  # m: shorter walls get no number
HERE = Pose(0.0, 0.0, 0.0)
FREE, HIT, DRAWN = (232, 243, 232), (120, 120, 120), (225, 225, 225)


def picture(deviations: Deviations) -> Pixels:
    """The plan's walls in the colours of their states over the map that was seen; (h, w, 3) BGR.

    Walls that are not confirmed or have moved, and walls that were found, carry their numbers.
    """
    d = deviations
    rows, cols = _window(d)
    times = max(1, -(-SIDE // max(rows.stop - rows.start, cols.stop - cols.start)))
    image = np.full((rows.stop - rows.start, cols.stop - cols.start, 3), 255, np.uint8)
    image[d.seen.free[rows, cols]] = FREE
    image[d.wall[rows, cols]] = DRAWN
    image[d.seen.occupied[rows, cols]] = HIT
    image = image[::-1].repeat(times, axis=0).repeat(times, axis=1)
    image = np.ascontiguousarray(image)
    g = d.geometry

    def px(point: tuple[float, float]) -> list[int]:
        x = (point[0] - g.x) / g.resolution - cols.start
        y = rows.stop - (point[1] - g.y) / g.resolution
        return [round(float(x * times - 0.5)), round(float(y * times - 0.5))]

    thick = max(2, times // 2)
    for number, wall in d.numbered():
        colour = WALL_COLOURS[wall.state][::-1]
        a, b = px(wall.start), px(wall.end)
        cv2.line(image, a, b, colour, thick, cv2.LINE_AA)
        if wall.state == "moved":
            middle = np.add(wall.start, wall.end) / 2
            along = np.subtract(wall.end, wall.start) / max(wall.length, 1e-9)
            to = middle + wall.moved * np.array([-along[1], along[0]])
            cv2.arrowedLine(image, px(_pair(middle)), px(_pair(to)), colour, thick, cv2.LINE_AA)
        if wall.state in ("moved", "not there") and wall.length >= LABELLED:
            _label(image, f"W{number}", a, b, colour)
    for number, extra in enumerate(d.found, 1):
        colour = WALL_COLOURS["found"][::-1]
        a, b = px(extra.start), px(extra.end)
        cv2.line(image, a, b, colour, thick, cv2.LINE_AA)
        if extra.inside:
            _label(image, f"F{number}", a, b, colour)
    return np.vstack([image, _legend(image.shape[1], d)])


def _window(d: Deviations) -> tuple[slice, slice]:
    """Rows and columns that hold the plan and what was seen, with a margin."""
    shown = d.wall | d.seen.occupied
    rows, cols = (np.flatnonzero(shown.any(axis=axis)) for axis in (1, 0))
    margin = round(0.5 / d.geometry.resolution)
    return (
        slice(max(0, int(rows[0]) - margin), min(shown.shape[0], int(rows[-1]) + margin + 1)),
        slice(max(0, int(cols[0]) - margin), min(shown.shape[1], int(cols[-1]) + margin + 1)),
    )


def _pair(point: npt.NDArray[np.float64]) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def _label(image: Pixels, text: str, a: list[int], b: list[int], colour: tuple[int, ...]) -> None:
    at = [(a[0] + b[0]) // 2 + 8, (a[1] + b[1]) // 2 - 8]
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 4, cv2.LINE_AA)
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)


def _legend(wide: int, d: Deviations) -> Pixels:
    """What each colour is, with its metres; wide pictures are shrunk, so that letters grow."""
    k = max(1.0, wide / 1000)
    out = np.full((round(36 * k), wide, 3), 255, np.uint8)
    x, y, thick, font = 12 * k, round(18 * k), round(k), cv2.FONT_HERSHEY_SIMPLEX
    for name, (_, metres) in d.summary().items():
        ends = [round(x), y], [round(x + 30 * k), y]
        cv2.line(out, *ends, WALL_COLOURS[name][::-1], 4 * thick, cv2.LINE_AA)
        text = f"{name} {metres:.1f} m"
        at = [round(x + 38 * k), round(y + 5 * k)]
        cv2.putText(out, text, at, font, 0.5 * k, (0, 0, 0), thick, cv2.LINE_AA)
        x += (60 + 9 * len(text)) * k
    return out


def geojson(deviations: Deviations, frame: Pose = HERE) -> str:
    """Walls and what was found as lines, in metres.

    Args:
        deviations: what was found.
        frame: pose of the plan's frame in the frame that is written.
    """

    def line(*points: tuple[float, float]) -> dict[str, Any]:
        placed = frame.apply(np.array(points))
        at = [[round(x, 4), round(y, 4)] for x, y in placed.tolist()]
        return {"type": "LineString", "coordinates": at}

    features = [
        {
            "type": "Feature",
            "properties": {"kind": "wall", **wall_facts(number, wall)},
            "geometry": line(wall.start, wall.end),
        }
        for number, wall in deviations.numbered()
    ]
    for number, extra in enumerate(deviations.found, 1):
        facts = {
            "id": f"F{number}",
            "length": round(extra.length, 3),
            "thickness": round(extra.thickness, 3),
            "inside": extra.inside,
        }
        features.append(
            {
                "type": "Feature",
                "properties": {"kind": "found", **facts},
                "geometry": line(extra.start, extra.end),
            }
        )
    return json.dumps({"type": "FeatureCollection", "units": "m", "features": features})


def wall_facts(number: int, wall: Wall) -> dict[str, Any]:
    """What GeoJSON and `--json` say of a wall; None for what was not seen."""
    lengths = {
        name: None if isnan(value := getattr(wall, name)) else round(value, 3)
        for name in ("moved", "left", "right")
    }
    return {
        "id": f"W{number}",
        "state": wall.state,
        "length": round(wall.length, 3),
        "thickness": round(wall.thickness, 3),
        **lengths,
        "hidden": wall.hidden,
    }
