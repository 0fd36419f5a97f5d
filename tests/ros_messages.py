"""ROS messages of any type, written by rosbags."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TFS = "geometry_msgs/TransformStamped[] transforms"
HUMBLE, NOETIC = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
HUMBLE.register(get_types_from_msg(TFS, "tf/msg/tfMessage"))
NOETIC.register(get_types_from_msg(TFS, "tf2_msgs/msg/TFMessage"))
NOETIC.register(get_types_from_msg(TFS, "tf/msg/tfMessage"))

ENCODINGS: dict[str, tuple[str, Any, Callable[[Any, str], bytes]]] = {
    "ros1": ("ros1", NOETIC, lambda m, t: bytes(NOETIC.serialize_ros1(m, t))),
    "cdr little": ("cdr", HUMBLE, lambda m, t: bytes(HUMBLE.serialize_cdr(m, t))),
    "cdr big": (
        "cdr",
        HUMBLE,
        lambda m, t: bytes(HUMBLE.serialize_cdr(m, t, little_endian=False)),
    ),
}
LASER = "sensor_msgs/msg/LaserScan"


def plain(value: Any) -> Any:
    """A noun as nested lists whose equality is exact, nan equal to nan."""
    if isinstance(value, np.ndarray):
        return [value.shape, [plain(v) for v in value.ravel().tolist()]]
    if isinstance(value, tuple | list):
        return [type(value).__name__ if hasattr(value, "_fields") else "", *map(plain, value)]
    if isinstance(value, float):
        return "nan" if value != value else value
    return value


# Messages of any type, drawn from its own fields.

TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)
DTYPES = {"byte": "uint8", "char": "uint8", "bool": "bool"}


def base(kind: str) -> st.SearchStrategy[Any]:
    if kind == "string":
        return TEXT
    if kind == "bool":
        return st.booleans()
    if kind.startswith("float"):
        return st.floats(width=32 if kind == "float32" else 64)
    limits = np.iinfo(DTYPES.get(kind, kind))
    return st.integers(int(limits.min), int(limits.max))


def field(store: Any, desc: Any) -> st.SearchStrategy[Any]:
    kind, inner = desc
    if kind == Nodetype.BASE:
        return base(inner[0])
    if kind == Nodetype.NAME:
        return message(store, inner)
    item, length = inner
    sizes = {"min_size": length, "max_size": length} if kind == Nodetype.ARRAY else {"max_size": 4}
    many = st.lists(field(store, item), **sizes)
    if item[0] == Nodetype.BASE:
        dtype = DTYPES.get(item[1][0], item[1][0])
        return many.map(lambda values: np.array(values, dtype=dtype))
    return many


def message(store: Any, name: str) -> st.SearchStrategy[Any]:
    made = store.types[name]
    if name == "builtin_interfaces/msg/Time":
        return st.builds(made, st.integers(0, 2**31 - 1), st.integers(0, 2**32 - 1))
    fields = store.fielddefs[name][1]
    return st.builds(made, *(field(store, desc) for _, desc in fields)).map(consistent)


def consistent(m: Any) -> Any:
    """Sizes that agree with the data, where a type has both."""
    if m.__msgtype__ == "sensor_msgs/msg/Image":
        m.height, m.step = len(m.data) and 1, len(m.data)
    elif m.__msgtype__ == "nav_msgs/msg/OccupancyGrid":
        m.info.width, m.info.height = len(m.data), 1
    elif m.__msgtype__ == "sensor_msgs/msg/PointCloud2":
        m.height = m.width = 0
    return m


def scan_message(store: Any = HUMBLE, frame: str = "laser", beams: int = 5, bright: int = 0) -> Any:
    t = store.types
    seq = [7] if store is NOETIC else []
    header = t["std_msgs/msg/Header"](*seq, t["builtin_interfaces/msg/Time"](12, 34), frame)
    ranges = np.arange(beams, dtype=np.float32) / 3
    floats = (-1.5, 1.5, 0.25, 0.5, 0.75, 0.125, 30.0)
    return t[LASER](header, *floats, ranges, np.ones(bright, dtype=np.float32))


def whole(name: str, encoding: str) -> bytes:
    """A message with something in every field."""
    _, store, write = ENCODINGS[encoding]

    def filled(kind: Any, inner: Any) -> Any:
        if kind == Nodetype.NAME:
            made = store.types[inner]
            return consistent(made(*(filled(*desc) for _, desc in store.fielddefs[inner][1])))
        if kind == Nodetype.BASE:
            return "text" if inner[0] == "string" else 1
        item, length = inner
        many = [filled(*item) for _ in range(length or 2)]
        return np.array(many, dtype=DTYPES.get(item[1][0], item[1][0])) if item[0] == 1 else many

    return write(filled(Nodetype.NAME, name), name)
