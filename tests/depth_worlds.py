"""Depth images of known worlds, and a slow way from depth to scan."""

from __future__ import annotations

from math import ceil, floor, hypot, inf, isfinite, nan

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from formats.depth.scans import levelled
from formats.messages import CameraInfo, Image

Floats = npt.NDArray[np.float64]
SLAB, LIMITS = (0.1, 1.2), (0.2, 10.0)
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # x right, y down, z ahead (REP-103)


def camera_at(height: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Floats:
    """An optical frame at (2, 3, height) in a level frame; positive pitch looks down."""
    matrix = np.eye(4)
    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    matrix[:3, :3], matrix[:3, 3] = turn @ OPTICAL, (2.0, 3.0, height)
    return matrix


def camera_info(height: int, width: int, focal: float) -> CameraInfo:
    k = np.array([[focal, 0, width / 2 - 0.5], [0, focal * 1.01, height / 2 - 0.5], [0, 0, 1]])
    return CameraInfo(0, "camera", height, width, "plumb_bob", np.zeros(5), k)


def as_image(metres: Floats, encoding: str = "16UC1", big: bool = False, padding: int = 0) -> Image:
    kind = np.dtype((">" if big else "<") + ("f4" if encoding == "32FC1" else "u2"))
    mm = np.round(np.nan_to_num(metres, posinf=0.0) * 1000)
    rows = (metres if encoding == "32FC1" else np.where(mm > 65535, 0, mm)).astype(kind)
    raw = np.full((len(rows), rows.shape[1] * kind.itemsize + padding), 0x5A, dtype=np.uint8)
    raw[:, : rows.shape[1] * kind.itemsize] = np.ascontiguousarray(rows).view(np.uint8)
    height, width = metres.shape
    return Image(0, "camera", height, width, encoding, big, raw.shape[1], raw.ravel())


def oracle(metres: Floats, info: CameraInfo, transform: Floats) -> dict[int, float]:
    """Nearest horizontal distance by column of a level camera, pixel by pixel."""
    level = np.array(levelled(transform, 2))
    (fx, _, cx), (_, fy, cy), _ = info.k.tolist()
    rays = {}
    least = inf
    for v, u in np.ndindex(*metres.shape):
        ahead, left, up = level[:, :3] @ ((u - cx) / fx, (v - cy) / fy, 1.0)
        flat = hypot(ahead, left)
        if ahead <= 0 or abs(left) > 5.67 * ahead:
            continue
        rays[v, u] = ahead, left, up, flat
        # Pixels that see into the slab at some depth set how wide a beam must be.
        ends = [(h - level[2, 3]) / (up or 1e-9) for h in SLAB]
        start, end = max(min(ends), LIMITS[0] / flat), min(max(ends), LIMITS[1] / flat)
        if ceil(start * 1000) <= floor(end * 1000):
            least = min(least, ahead)
    focal = fx * min(max(least, 0.25), 1.0)
    found: dict[int, float] = {}
    for (v, u), (ahead, left, up, flat) in rays.items():
        z = float(metres[v, u])
        if not isfinite(z) or z <= 0:
            continue
        if SLAB[0] <= level[2, 3] + z * up <= SLAB[1] and LIMITS[0] <= z * flat <= LIMITS[1]:
            column = floor(left / ahead * focal - cx + 0.5)
            found[column] = min(found.get(column, inf), z * flat)
    return found


def rendered(
    info: CameraInfo, transform: Floats, walls: list[tuple[float, float, float]]
) -> Floats:
    """Depth by pixel of a floor and of walls: planes x = distance, from one height to another."""
    (fx, _, cx), (_, fy, cy), _ = info.k.tolist()
    metres = np.full((info.height, info.width), nan)
    for v, u in np.ndindex(*metres.shape):
        ray = transform[:3, :3] @ ((u - cx) / fx, (v - cy) / fy, 1.0)
        start = transform[:3, 3]
        depths = [-start[2] / ray[2]] if ray[2] < 0 else []
        for distance, low, high in walls:
            z = (distance - start[0]) / ray[0] if ray[0] else inf
            if z > 0 and low <= start[2] + z * ray[2] <= high:
                depths.append(z)
        metres[v, u] = min(depths, default=nan)
    return metres
