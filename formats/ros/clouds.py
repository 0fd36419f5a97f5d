"""The two clouds of ROS: points out of a message body."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formats.messages import Cloud
from formats.payload import Payload, Undecodable
from formats.ros.wire import Body, Wire

FIELD_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def point_cloud2(wire: Wire, data: Payload) -> Cloud:
    """sensor_msgs/PointCloud2: the fields x, y, z."""
    body = Body(wire, data)
    stamp, frame = body.header()
    height, width = body.read("2I")
    fields: dict[str, tuple[int, int]] = {}
    for _ in range(body.count("fields")):
        name, (offset,), (kind,), _ = body.text(), body.read("I"), body.read("B"), body.read("I")
        fields[name] = offset, kind
    (big,) = body.read("B")
    step, row_step = body.read("2I")
    content = body.array("u1", "bytes of points")
    body.read("B")
    body.end()
    order = ">" if big else "<"
    return Cloud(stamp, frame, points(content, (height, width), (row_step, step), fields, order))


def points(
    content: npt.NDArray[np.uint8],
    shape: tuple[int, int],
    strides: tuple[int, int],
    fields: dict[str, tuple[int, int]],
    order: str,
) -> npt.NDArray[np.floating]:
    """The (n, 3) points in a PointCloud2's bytes, float32 unless a field is float64.

    Where x, y and z are floats in a row, as nearly always, they are a view of the bytes' copy.

    Args:
        content: the bytes.
        shape: rows, points a row.
        strides: bytes a row, bytes a point.
        fields: name -> offset in a point, PointField datatype.
        order: "<" or ">".
    """
    if shape[0] * shape[1] == 0:
        return np.empty((0, 3), dtype=np.float32)
    if any(axis not in fields or fields[axis][1] not in FIELD_KINDS for axis in "xyz"):
        raise Undecodable("cloud without x, y and z", ", ".join(fields))
    axes = [(fields[axis][0], np.dtype(order + FIELD_KINDS[fields[axis][1]])) for axis in "xyz"]
    row_step, step = strides
    inside = all(offset + kind.itemsize <= step for offset, kind in axes)
    if not inside or (shape[0] > 1 and shape[1] * step > row_step):
        raise Undecodable("cloud whose points overlap", f"{step} bytes a point")
    needed = (shape[0] - 1) * row_step + shape[1] * step
    if needed > len(content):
        raise Undecodable("too few points", f"{len(content)} of {needed} bytes")
    begin, step4 = axes[0][0] // 4, step // 4
    in_a_row = [(4 * (begin + axis), np.dtype("<f4")) for axis in range(3)]
    if axes == in_a_row and step % 4 == 0 and (shape[0] == 1 or row_step == shape[1] * step):
        whole = content[: shape[0] * shape[1] * step].copy()  # in one go, and aligned from here on
        return whole.view(np.float32).reshape(-1, step4)[:, begin : begin + 3]
    double = any(kind.itemsize == 8 for _, kind in axes)
    found = np.empty((*shape, 3), dtype=np.float64 if double else np.float32)
    for axis, (offset, kind) in enumerate(axes):
        found[..., axis] = np.ndarray(shape, kind, content, offset, strides)
    return found.reshape(-1, 3)


def point_cloud(wire: Wire, data: Payload) -> Cloud:
    """sensor_msgs/PointCloud; channels are passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    count = body.count("points", most=1 << 32)
    found = body.array("f4", "points", 3 * count).reshape(-1, 3)
    for _ in range(body.count("channels")):
        body.text()
        body.array("f4", "channel values")
    body.end()
    return Cloud(stamp, frame, found)
