"""What sensors of different kinds see of the flat of scripts/flat.py, its walls 2.5 m high."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scripts.flat import cast, drive
from scripts.kinect import AHEAD, FAR, HEIGHT, PITCH, ROOM, SHIFT, boxes, sensor_xy
from tests.depth_worlds import camera_at
from tests.ros_logs import RosLog, seven

Floats = npt.NDArray[np.float64]
COLUMNS, ROWS, FOCAL = 80, 60, 65.625  # a Kinect (640 x 480, 525 px), each 8th pixel


def poses(step: int = 25) -> tuple[Floats, Floats]:
    """Times (n,) and poses (n, 3) of the base, `step` of them 50 Hz apart."""
    way = drive()
    return way.times[::step], way.poses[::step] + np.array([SHIFT, SHIFT, 0.0])


def mount() -> tuple[float, ...]:
    """The optical frame on the base, as x y z and a quaternion."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(camera_at(HEIGHT, pitch=PITCH)[:3, :3])
    return (AHEAD, 0.0, HEIGHT, *(float(number) for number in turn.as_quat()))


def rays(columns: int = COLUMNS) -> Floats:
    """(ROWS, columns, 3): for 1 m of depth, in the base's axes."""
    u, v = np.meshgrid(np.arange(columns), np.arange(ROWS))
    focal = FOCAL * columns / COLUMNS
    seen = [(u - (columns - 1) / 2) / focal, (v - (ROWS - 1) / 2) / FOCAL, np.ones(u.shape)]
    found: Floats = np.stack(seen, axis=-1) @ camera_at(HEIGHT, pitch=PITCH)[:3, :3].T
    return found


def half_view(columns: int = COLUMNS) -> float:
    """Rad from the middle to the outermost column."""
    return float(np.arctan((columns - 1) / 2 / (FOCAL * columns / COLUMNS)))


def depth(pose: Floats, columns: int = COLUMNS) -> Floats:
    """(ROWS, columns) m along the optical axis: walls, floor and ceiling, pixel by pixel."""
    ahead, left, up = np.moveaxis(rays(columns), -1, 0)
    angles = (pose[2] + np.arctan2(left, ahead)).ravel()
    wall = cast(boxes(), *sensor_xy(pose), angles, 20.0).reshape(ahead.shape)
    with np.errstate(divide="ignore"):
        flat = np.where(up < 0, -HEIGHT / up, (ROOM - HEIGHT) / up)
    return np.minimum(wall / np.hypot(ahead, left), flat)


def drive_of(kind: str, step: int = 25, columns: int = COLUMNS) -> RosLog:
    """The drive as "laser", "depth" or "cloud", of so many columns or beams."""
    frame = "camera_depth_optical_frame"
    log = RosLog()
    log.static("base_footprint", frame, mount())
    log.static("base_footprint", "laser", (AHEAD, 0.0, HEIGHT, *seven((0, 0, 0))[3:]))
    wide = half_view(columns)
    angles = np.linspace(-wide, wide, columns)
    for t, pose in zip(*poses(step), strict=True):
        log.tf(t, "map", "base_footprint", pose.tolist())
        if kind == "laser":
            ranges = cast(boxes(), *sensor_xy(pose), pose[2] + angles, FAR)
            ranges[~np.isfinite(ranges)] = np.nan
            log.scan(t, ranges, angle_min=-wide, increment=angles[1] - angles[0])
            continue
        metres = depth(pose, columns)
        if kind == "depth":
            picture(log, t, metres, frame)
        else:
            cloud(log, t, (rays(columns) * metres[..., None]).reshape(-1, 3))
    return log


def picture(
    log: RosLog, t: float, metres: Floats, frame: str, *, info: bool = True, **fields: Any
) -> None:
    """A depth image in mm, and its camera_info."""
    header = log.header(t, frame, None)
    rows, columns = metres.shape
    made: dict[str, Any] = {
        "header": header,
        "height": rows,
        "width": columns,
        "encoding": "16UC1",
        "step": 2 * columns,
        "data": np.round(metres * 1000).astype("<u2").view(np.uint8).ravel(),
    }
    name = "/camera/depth/image_raw"
    log.say(t, name, "sensor_msgs/msg/Image", **{**made, **fields})
    if info:
        focal = FOCAL * columns / COLUMNS
        k = [focal, 0, (columns - 1) / 2, 0, FOCAL, (rows - 1) / 2, 0, 0, 1]
        camera_info(log, t, header, width=columns, k=k)


def camera_info(log: RosLog, t: float, header: Any, **fields: Any) -> None:
    k = [FOCAL, 0, (COLUMNS - 1) / 2, 0, FOCAL, (ROWS - 1) / 2, 0, 0, 1]
    made: dict[str, Any] = {"header": header, "height": ROWS, "width": COLUMNS, "k": k}
    made["distortion_model"] = "plumb_bob"
    name = "/camera/depth/camera_info"
    log.say(t, name, "sensor_msgs/msg/CameraInfo", **{**made, **fields})


def cloud(log: RosLog, t: float, points: Floats) -> None:
    """A PointCloud2 in the frame "laser", level and at the camera's place."""
    fields = [
        {"name": name, "offset": 4 * i, "datatype": 7, "count": 1} for i, name in enumerate("xyz")
    ]
    log.say(
        t,
        "/points",
        "sensor_msgs/msg/PointCloud2",
        header=log.header(t, "laser", None),
        height=1,
        width=len(points),
        fields=fields,
        point_step=12,
        row_step=12 * len(points),
        data=np.ascontiguousarray(points, dtype="<f4").view(np.uint8).ravel(),
    )
