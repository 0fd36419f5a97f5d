"""The fields of the ROS messages that we decode, as every distribution defines them.

A "?" marks fields that no noun of ours needs. In ROS 1 a Header begins with `uint32 seq`.
"""

from __future__ import annotations

Fields = dict[str, list[tuple[str, str]]]  # "package/Type" -> (type, name) of each field

_SCAN = (
    "Header header; float32 angle_min; float32? angle_max; float32 angle_increment; "
    "float32? time_increment; float32? scan_time; float32 range_min; float32 range_max; "
)
_TEXT = {
    "builtin_interfaces/Time": "int32 sec; uint32 nanosec",
    "geometry_msgs/Point": "float64 x; float64 y; float64 z",
    "geometry_msgs/Point32": "float32 x; float32 y; float32 z",
    "geometry_msgs/Pose": "Point position; Quaternion orientation",
    "geometry_msgs/PoseStamped": "Header header; Pose pose",
    "geometry_msgs/PoseWithCovariance": "Pose pose; float64[36]? covariance",
    "geometry_msgs/PoseWithCovarianceStamped": "Header header; PoseWithCovariance pose",
    "geometry_msgs/Quaternion": "float64 x; float64 y; float64 z; float64 w",
    "geometry_msgs/Transform": "Vector3 translation; Quaternion rotation",
    "geometry_msgs/TransformStamped": "Header header; string child_frame_id; Transform transform",
    "geometry_msgs/Twist": "Vector3 linear; Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "Twist twist; float64[36] covariance",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
    "nav_msgs/MapMetaData": "Time? map_load_time; float32 resolution; uint32 width; "
    "uint32 height; geometry_msgs/Pose origin",
    "nav_msgs/OccupancyGrid": "Header header; MapMetaData info; int8[] data",
    "nav_msgs/Odometry": "Header header; string? child_frame_id; "
    "geometry_msgs/PoseWithCovariance pose; geometry_msgs/TwistWithCovariance? twist",
    "sensor_msgs/CameraInfo": "Header header; uint32 height; uint32 width; "
    "string? distortion_model; float64[]? d; float64[9] k; float64[9]? r; float64[12]? p; "
    "uint32? binning_x; uint32? binning_y; RegionOfInterest? roi",
    "sensor_msgs/ChannelFloat32": "string name; float32[] values",
    "sensor_msgs/CompressedImage": "Header header; string format; uint8[] data",
    "sensor_msgs/Image": "Header header; uint32 height; uint32 width; string encoding; "
    "uint8 is_bigendian; uint32 step; uint8[] data",
    "sensor_msgs/LaserEcho": "float32[] echoes",
    "sensor_msgs/LaserScan": _SCAN + "float32[] ranges; float32[]? intensities",
    "sensor_msgs/MultiEchoLaserScan": _SCAN + "LaserEcho[] ranges; LaserEcho[]? intensities",
    "sensor_msgs/PointCloud": "Header header; geometry_msgs/Point32[] points; "
    "ChannelFloat32[]? channels",
    "sensor_msgs/PointCloud2": "Header header; uint32 height; uint32 width; PointField[] fields; "
    "bool is_bigendian; uint32 point_step; uint32 row_step; uint8[] data; bool? is_dense",
    "sensor_msgs/PointField": "string name; uint32 offset; uint8 datatype; uint32 count",
    "sensor_msgs/Range": "Header header; uint8? radiation_type; float32 field_of_view; "
    "float32 min_range; float32 max_range; float32 range",
    "sensor_msgs/RegionOfInterest": "uint32 x_offset; uint32 y_offset; uint32 height; "
    "uint32 width; bool do_rectify",
    "std_msgs/Header": "Time stamp; string frame_id",
    "tf/tfMessage": "geometry_msgs/TransformStamped[] transforms",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}


def _fields(text: str) -> list[tuple[str, str]]:
    found = [field.split() for field in text.replace("?", "").split("; ")]
    return [(kind, name) for kind, name in found]


STANDARD: Fields = {name: _fields(text) for name, text in _TEXT.items()}
NEEDLESS = {
    (owner, field.split()[1])
    for owner, text in _TEXT.items()
    for field in text.split("; ")
    if "?" in field
}
