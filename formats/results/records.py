"""A run's small messages as numpy records: a block of frames is encoded in one go.

CDR, little endian, of a fixed size: pose, tf and metrics hold no text but the frames' names.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from formats.grid import Floats

MAP, PLAN, SENSOR = "map", "plan", "sensor"


def numbers(poses: Floats) -> Floats:
    """Poses (n, 3) as x y z qx qy qz qw (n, 7)."""
    out = np.zeros((len(poses), 7))
    out[:, :2] = poses[:, :2]
    out[:, 5], out[:, 6] = np.sin(poses[:, 2] / 2), np.cos(poses[:, 2] / 2)
    return out


def poses(numbers: Floats) -> Floats:
    """The inverse of `numbers` for turns about z alone: (n, 7) -> (n, 3)."""
    yaw = 2.0 * np.arctan2(numbers[:, 5], numbers[:, 6])
    return np.column_stack([numbers[:, 0], numbers[:, 1], np.arctan2(np.sin(yaw), np.cos(yaw))])


def ratios(counts: npt.NDArray[np.int64]) -> Floats:
    """Precision, recall, F2 (..., 3) of tp, fp, fn, tn (..., 4); 0/0 is 0 (Equation 14)."""
    tp, fp, fn = (counts[..., i].astype(np.float64) for i in range(3))
    parts = [(tp, tp + fp), (tp, tp + fn), (5.0 * tp, 5.0 * tp + 4.0 * fn + fp)]
    return np.stack([np.divide(a, b, out=np.zeros_like(b), where=b > 0) for a, b in parts], -1)


def record(fields: list[tuple[str, int, Any]], size: int) -> np.dtype[np.void]:
    """A fixed-size CDR message: (field, offset after the 4 encapsulation bytes, type)."""
    spec = {
        "names": ["cdr", *(name for name, _, _ in fields)],
        "offsets": [0, *(4 + offset for _, offset, _ in fields)],
        "formats": ["<u4", *(kind for _, _, kind in fields)],
        "itemsize": 4 + size,
    }
    return np.dtype(spec)  # type: ignore[call-overload]


STAMP = [("sec", 0, "<u4"), ("nanosec", 4, "<u4")]
TEXT = [("length", 8, "<u4"), ("frame", 12, "S5")]
POSE_RECORD = record([*STAMP, *TEXT, ("pose", 24, ("<f8", 7))], 80)
COVARIANCE_RECORD = record(
    [*STAMP, *TEXT, ("pose", 24, ("<f8", 7)), ("covariance", 80, ("<f8", (6, 6)))], 368
)
TF_RECORD = record(
    [
        ("transforms", 0, "<u4"),
        *((name, 4 + offset, kind) for name, offset, kind in STAMP + TEXT),
        ("child_length", 24, "<u4"),
        ("child", 28, "S7"),
        ("pose", 40, ("<f8", 7)),
    ],
    96,
)
METRICS_RECORD = record(
    [
        *STAMP,
        ("frame", 8, "<u4"),
        ("explored", 16, "<f8"),
        ("ratios", 24, ("<f8", (3, 3))),
        ("counts", 96, ("<i8", (2, 4))),
    ],
    160,
)
LITTLE_ENDIAN = 0x100  # the encapsulation bytes 00 01 00 00


def stamped(kind: np.dtype[np.void], times_ns: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    """Empty records of a kind, with their encapsulation and stamps."""
    out = np.zeros(len(times_ns), dtype=kind)
    out["cdr"] = LITTLE_ENDIAN
    out["sec"], out["nanosec"] = times_ns // 10**9, times_ns % 10**9
    return out


def pose_records(times_ns: npt.NDArray[np.int64], poses: Floats) -> npt.NDArray[Any]:
    """geometry_msgs/PoseStamped of the sensor in the plan's frame."""
    out = stamped(POSE_RECORD, times_ns)
    out["length"], out["frame"] = len(PLAN) + 1, PLAN.encode()
    out["pose"] = numbers(poses)
    return out


def covariance_records(
    times_ns: npt.NDArray[np.int64], poses: Floats, covariances: Floats
) -> npt.NDArray[Any]:
    """geometry_msgs/PoseWithCovarianceStamped likewise; covariances (n, 3, 3) of x, y, yaw."""
    out = stamped(COVARIANCE_RECORD, times_ns)
    out["length"], out["frame"] = len(PLAN) + 1, PLAN.encode()
    out["pose"] = numbers(poses)
    rows = np.array([0, 1, 5])
    out["covariance"][:, rows[:, None], rows] = covariances
    return out


def covariances(rows: npt.NDArray[Any]) -> Floats:
    """(n, 3, 3) of x, y, yaw from COVARIANCE_RECORDs."""
    some = np.array([0, 1, 5])
    found: Floats = rows["covariance"][:, some[:, None], some].astype(np.float64)
    return found


def tf_records(times_ns: npt.NDArray[np.int64], poses: Floats) -> npt.NDArray[Any]:
    """tf2_msgs/TFMessage: one transform, plan -> sensor."""
    out = stamped(TF_RECORD, times_ns)
    out["transforms"] = 1
    out["length"], out["frame"] = len(PLAN) + 1, PLAN.encode()
    out["child_length"], out["child"] = len(SENSOR) + 1, SENSOR.encode()
    out["pose"] = numbers(poses)
    return out


def metrics_records(
    times_ns: npt.NDArray[np.int64], first: int, counts: npt.NDArray[np.int64]
) -> npt.NDArray[Any]:
    """replay_msgs/MapMetrics of frames `first`, ...; counts (n, 2, 4) observed, unobserved."""
    out = stamped(METRICS_RECORD, times_ns)
    out["frame"] = first + np.arange(len(times_ns))
    cells = counts.sum(axis=2).astype(np.float64)
    every = cells.sum(axis=1)
    out["explored"] = np.divide(cells[:, 0], every, out=np.zeros_like(every), where=every > 0)
    whole = counts.sum(axis=1, keepdims=True)
    out["ratios"] = ratios(np.concatenate([whole, counts], axis=1))
    out["counts"] = counts
    return out
