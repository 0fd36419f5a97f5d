"""Scan points in a result file: clouds in the plan's frame."""

from __future__ import annotations

import numpy as np

from formats.results import messages as ros
from formats.results.records import PLAN
from formats.sensing.ends import Points

CLOUD = "sensor_msgs/msg/PointCloud2"


def point_cloud(time_ns: int, points: Points) -> bytes:
    """sensor_msgs/PointCloud2 of points (n, 2) m in the plan's frame, on the ground."""
    field = "sensor_msgs/msg/PointField"
    fields = [
        ros.make(field, name=name, offset=4 * i, datatype=7, count=1)  # 7: FLOAT32
        for i, name in enumerate("xyz")
    ]
    data = np.zeros((len(points), 3), dtype="<f4")
    data[:, :2] = points
    cloud = ros.make(
        CLOUD,
        header=ros.header(time_ns, PLAN),
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=12,
        row_step=12 * len(points),
        data=data.reshape(-1).view(np.uint8),
        is_dense=True,
    )
    return ros.encode(cloud)


def cloud_points(data: bytes) -> Points:
    """The inverse of `point_cloud`. Raises anything on what does not fit."""
    cloud = ros.decode(data, CLOUD)
    return cloud.data.view("<f4").reshape(cloud.width, 3)[:, :2]


def add_cloud(channels: ros.Channels, time_ns: int, points: Points) -> None:
    """The cloud of a keyframe on its topic, in a chunk with no other cloud.

    Rerun makes one chunk of the frames of all clouds in a chunk and one of each cloud's points:
    with two clouds these overlap in time, which `rerun mcap check --full` calls a problem.
    """
    channels.close_chunk()
    channels.add("/scan_points", CLOUD, time_ns, point_cloud(time_ns, points))
