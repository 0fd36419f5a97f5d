"""Depth image or point cloud and where the sensor is -> Scan: the nearest return by bearing.

Only what lies in a slab between two heights above the floor counts, so that the floor is left out
by geometry. Every range is a hit; a bearing without a return in the slab is no reading (nan), since
an invalid depth is not a far one.

The scan's frame is level: at the sensor, its x axis along the sensor's forward axis (the optical
axis of a camera, x of a cloud's frame) as seen from above; `level_pose` says where that is.
"""

from __future__ import annotations

from functools import lru_cache
from math import atan2, cos, hypot, isfinite, pi, sin
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from formats.frame import Pose, Scan
from formats.messages import CameraInfo, Cloud, Image

Floats = npt.NDArray[np.float64]
SLAB = (0.1, 1.0)  # m above the floor
LIMITS = (0.2, 10.0)  # m, horizontal distances that count
BEAMS = 720  # of a scan from a cloud
MOST_PIXELS = 1 << 25
Level = tuple[tuple[float, float, float, float], ...]  # three rows
# Encoding -> type of a pixel, metres a unit (REP-118); mono16 is 16UC1 under another name.
ENCODINGS = {"16UC1": ("u2", 0.001), "mono16": ("u2", 0.001), "32FC1": ("f4", 1.0)}


class Lens(NamedTuple):
    """Focal lengths and principal point in px of the image at hand."""

    fx: float
    fy: float
    cx: float
    cy: float


class View(NamedTuple):
    """What each pixel of a camera sees of the slab: rows `first` to `last` (exclusive).

    Attributes:
        low, high: (n,) depths, in the image's units and type, at which a pixel sees into the slab.
        away: (n,) float32 m of horizontal distance for one unit of depth.
        bins: (n,) int32 beam of the pixel.
        bearings, widths: (beams,) rad, ascending.
    """

    first: int
    last: int
    low: npt.NDArray[Any]
    high: npt.NDArray[Any]
    away: npt.NDArray[np.float32]
    bins: npt.NDArray[np.int32]
    bearings: Floats
    widths: Floats


def level_pose(transform: Floats, forward: int) -> Pose:
    """Where the scan of a sensor is: its place and its heading seen from above.

    Args:
        transform: (4, 4), the sensor in a level frame.
        forward: the sensor's axis that points forward: 2 of a camera, 0 of a cloud. Where it is
            vertical, the direction that is then up in the image, or the cloud's y axis.
    """
    x, y = float(transform[0, forward]), float(transform[1, forward])
    if hypot(x, y) < 1e-6:
        sign = -1.0 if forward == 2 else 1.0
        x, y = sign * float(transform[0, 1]), sign * float(transform[1, 1])
    return Pose(float(transform[0, 3]), float(transform[1, 3]), atan2(y, x))


def levelled(transform: Floats, forward: int) -> Level:
    """The sensor in its scan's frame: (3, 4), its height above the floor.

    Rounded to 0.1 mm and 0.1 mrad, so that a sensor fixed to its robot stays where it is on a drive
    through a map.
    """
    yaw = level_pose(transform, forward).yaw
    c, s = cos(yaw), sin(yaw)
    (ax, bx, cx, _), (ay, by, cy, _), (az, bz, cz, height), _ = transform.tolist()
    return (
        (round(c * ax + s * ay, 4), round(c * bx + s * by, 4), round(c * cx + s * cy, 4), 0.0),
        (round(c * ay - s * ax, 4), round(c * by - s * bx, 4), round(c * cy - s * cx, 4), 0.0),
        (round(az, 4), round(bz, 4), round(cz, 4), round(height, 4)),
    )


def depth_fault(image: Image) -> str:
    """Why a depth image cannot be used, "" where it can."""
    kind = ENCODINGS.get(image.encoding)
    if kind is None:
        return f"encoding {image.encoding!r} is no depth (16UC1, 32FC1 or mono16 are)"
    if image.width == 0 or image.height == 0:
        return "image without pixels"
    if image.width * image.height > MOST_PIXELS:
        return f"implausible image of {image.width} x {image.height} pixels"
    if image.step < image.width * int(kind[0][1]):
        return f"step of {image.step} bytes is short of {image.width} pixels"
    if len(image.data) < image.height * image.step:
        return "too few pixels"
    return ""


def camera_fault(info: CameraInfo) -> str:
    """Why a camera's calibration cannot be used, "" where it can."""
    numbers = [float(info.k[i, j]) for i, j in ((0, 0), (1, 1), (0, 2), (1, 2))]
    if not all(isfinite(number) for number in numbers):
        return "camera matrix K is not finite"
    if numbers[0] <= 0.0 or numbers[1] <= 0.0:
        return "camera matrix K has no focal length (camera not calibrated)"
    if max(numbers) > 1e6 or min(numbers[2:]) < -1e6:
        return "camera matrix K is implausible"
    return ""


def camera_remarks(image: Image, info: CameraInfo) -> list[str]:
    """What is odd about an image and its calibration, and was handled."""
    found = []
    if image.encoding == "mono16":
        found.append("mono16 taken as depth in mm")
    if scaled(info, image.height, image.width)[1]:
        size = f"{image.width} x {image.height}"
        found.append(f"camera_info of {info.width} x {info.height} scaled to {size} pixels")
    if np.any(info.d):
        found.append(f"lens distortion ({info.model or 'unnamed'}) ignored")
    if image.frame != info.frame:
        found.append(f"image in frame {image.frame!r}, its camera_info in {info.frame!r}")
    return found


def scaled(info: CameraInfo, height: int, width: int) -> tuple[Lens, bool]:
    """The camera matrix for an image of this size; True where the sizes do not fit.

    A camera that gives a part of its picture, or thins it, says so (`roi`, `binning`); what size is
    left over is taken as one more scaling.
    """
    k = info.k
    fx, fy, cx, cy = float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2])
    rows, columns = info.height or height, info.width or width
    x, y, part_width, part_height = info.roi
    across, down = (max(number, 1) for number in info.binning)
    if (rows, columns) != (height, width):
        # Pixel centres are whole numbers, so that scaling keeps the picture's edge at -0.5.
        part_width, part_height = part_width or columns, part_height or rows
        if (part_height // down, part_width // across) == (height, width):
            cx, cy, columns, rows = cx - x, cy - y, part_width, part_height
    by_x, by_y = width / columns, height / rows
    odd = (by_x, by_y) != (1.0, 1.0) and (round(1 / by_x), round(1 / by_y)) != (across, down)
    return Lens(fx * by_x, fy * by_y, (cx + 0.5) * by_x - 0.5, (cy + 0.5) * by_y - 0.5), odd


def depth_scan(
    image: Image,
    info: CameraInfo,
    transform: Floats,
    slab: tuple[float, float] = SLAB,
    limits: tuple[float, float] = LIMITS,
) -> Scan:
    """The scan that a depth image holds, in the frame `level_pose(transform, 2)`.

    Its beams are the columns of a level camera of the same focal length (wider ones where the
    camera looks down, so that no beam falls between two pixels). Lens distortion is ignored.

    Args:
        image: with no depth_fault; depth along the optical axis (REP-118).
        info: of the same camera, with no camera_fault.
        transform: (4, 4), the optical frame (x right, y down, z forward) in a level frame whose
            z = 0 is the floor.
        slab: m above the floor.
        limits: m, horizontal distances that count.

    Raises:
        ValueError: the image or the calibration cannot be used.
    """
    problem = depth_fault(image) or camera_fault(info)
    if problem:
        raise ValueError(problem)
    from formats.depth.kernels import nearest_by_table

    lens, (kind, unit) = scaled(info, image.height, image.width)[0], ENCODINGS[image.encoding]
    level = levelled(transform, 2)
    view = view_of(lens, image.height, image.width, level, slab, limits, kind, unit)
    ranges = np.empty(len(view.bearings), dtype=np.float32)
    order = ">" if image.big_endian else "<"
    shape, start = (view.last - view.first, image.width), view.first * image.step
    strides = image.step, int(kind[1])
    seen = np.ndarray(shape, order + kind, image.data, start, strides)
    # One copy of these rows: aligned, of the machine's byte order, without padding.
    depth = np.array(seen, dtype=kind, order="C").ravel()
    nearest_by_table(depth, view.low, view.high, view.away, view.bins, ranges)
    return Scan(view.bearings, view.widths, ranges, 0.0, limits[1])


@lru_cache(8)
def view_of(
    lens: Lens,
    height: int,
    width: int,
    level: Level,
    slab: tuple[float, float],
    limits: tuple[float, float],
    kind: str,
    unit: float,
) -> View:
    """What the pixels of a camera see: it is the same for image after image.

    Args:
        lens: in px.
        height, width: px.
        level: (3, 4), the optical frame in the scan's level frame.
        slab: m above the floor.
        limits: m, horizontal distances that count.
        kind: numpy type of a pixel.
        unit: m of one unit of depth.
    """
    from formats.depth.kernels import see_slab

    shape = height, width
    low, high = np.empty(shape, dtype=kind), np.empty(shape, dtype=kind)
    away, tangent = np.empty(shape, dtype=np.float32), np.empty(shape)
    ahead = see_slab(
        lens, np.array(level), slab, limits, unit, kind == "u2", low, high, away, tangent
    )
    seen = low <= high
    rows = np.flatnonzero(seen.any(axis=1))
    if not len(rows):
        none, empty = np.zeros(0), np.zeros(0, dtype=np.float32)
        nothing = np.zeros(0, dtype=kind)
        return View(0, 0, nothing, nothing, empty, np.zeros(0, dtype=np.int32), none, none)
    first, last = int(rows[0]), int(rows[-1]) + 1
    part, seen = slice(first, last), seen[first:last]
    # Beams as columns of a level camera; coarser where pixels lie farther apart than its columns.
    focal = lens.fx * min(max(ahead, 0.25), 1.0)
    spread = float(np.ptp(tangent[part][seen]))
    focal = min(focal, 4.0 * (width + height) / max(spread, 1e-9))
    column = np.floor(tangent[part] * focal - lens.cx + 0.5)
    start, stop = int(column[seen].min()), int(column[seen].max()) + 1
    edges = np.arctan((np.arange(start, stop + 1) - 0.5 + lens.cx) / focal)
    bearings = np.arctan((np.arange(start, stop) + lens.cx) / focal)
    bins = np.where(seen, column - start, 0).astype(np.int32)
    seen_at = low[part].ravel(), high[part].ravel(), away[part].ravel()
    return View(first, last, *seen_at, bins.ravel(), bearings, np.diff(edges))


def moved(cloud: Cloud, matrix: Floats) -> Cloud:
    """The points of a cloud in another frame, which `matrix` (4, 4) takes them to."""
    with np.errstate(invalid="ignore", over="ignore"):  # points that are none stay none
        points = cloud.points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return cloud._replace(points=points)


def cloud_scan(
    cloud: Cloud,
    transform: Floats,
    slab: tuple[float, float] = SLAB,
    limits: tuple[float, float] = LIMITS,
    beams: int = BEAMS,
) -> Scan:
    """The scan that a point cloud holds, in the frame `level_pose(transform, 0)`.

    Args:
        cloud: points that are not finite are left out.
        transform: (4, 4), the cloud's frame in a level frame whose z = 0 is the floor.
        slab: m above the floor.
        limits: m, horizontal distances that count.
        beams: all around, of equal width.
    """
    from formats.depth.kernels import nearest_of_points

    level = np.array(levelled(transform, 0))
    ranges = np.empty(beams, dtype=np.float32)
    kind = np.float64 if cloud.points.dtype == np.float64 else np.float32
    points = np.require(cloud.points, dtype=kind, requirements=["A"])
    nearest_of_points(points, level, *slab, *limits, ranges)
    width = 2.0 * pi / beams
    bearings = width * np.arange(0.5, beams) - pi
    return Scan(bearings, np.full(beams, width), ranges, 0.0, limits[1])
