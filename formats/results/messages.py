"""The messages of a result file: types, definitions, and bytes of all but the small ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from formats.frame import Pose
from formats.grid import Geometry
from formats.mcap.write_records import block
from formats.mcap.writing import McapWriter
from formats.results.groups import Groups
from formats.results.keyframes import Change
from formats.results.records import MAP, PLAN, numbers

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

METRICS = "replay_msgs/msg/MapMetrics"
EVIDENCE = "replay_msgs/msg/Evidence"
CELLS = "replay_msgs/msg/CellLayers"
GROUPS = "replay_msgs/msg/CellGroups"
GROUPS_TOPIC = "/cells/groups"
GRID = "nav_msgs/msg/OccupancyGrid"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TF = "tf2_msgs/msg/TFMessage"

OWN = {
    METRICS: """\
# Scores of one map after one frame. Occupied is positive; cells are those of the scored region.
builtin_interfaces/Time stamp
uint32 frame                 # from 0
float64 explored             # share of the scored cells that some reading observed
float64 precision
float64 recall
float64 f2                   # 5 p r / (4 p + r)
float64 observed_precision   # inside the cells that some reading observed
float64 observed_recall
float64 observed_f2
float64 unobserved_precision # in all the others
float64 unobserved_recall
float64 unobserved_f2
uint64[4] observed           # cells: true positive, false positive, false negative, true negative
uint64[4] unobserved
""",
    EVIDENCE: """\
# Readings of cells by level since the message before: add up all of them from the first.
builtin_interfaces/Time stamp
uint32 frame    # the last frame that it holds, from 0
uint32 levels   # what a reading shows: see "levels" and "curves" in the metadata record "replay"
uint32 rows     # row 0 has the lowest y
uint32 cols
uint32[] steps  # entry i is at flat index steps[0] + ... + steps[i] of (levels, rows, cols)
uint32[] added  # readings at entry i
""",
    CELLS: """\
# What re-scoring needs of each cell, row by row from the lowest y; absent layers are empty.
uint32 rows
uint32 cols
float64[] wall            # share of the cell
float64[] door
float64[] window
uint8[] outside           # 1 where the plan says nothing
float64[] clutter
uint32[] truth_wall       # pixels of the truth
uint32[] truth_scored
float64[] prior_log_odds  # of occupied
""",
    GROUPS: """\
# The scored cells after the last frame, counted by what they are and what was seen of them: their
# score under any other prior or sensor depends on nothing else.
uint32 levels
uint8[] kind     # 1 some wall + 2 mostly wall + 4 outside + 8 door + 16 window + 32 wall in truth
uint32[] counts  # readings of each cell of the group: level by level, group by group
uint32[] cells   # how many cells the group has
""",
}
LAYERS: dict[str, type[np.generic]] = {
    "wall": np.float64,
    "door": np.float64,
    "window": np.float64,
    "outside": np.uint8,
    "clutter": np.float64,
    "truth_wall": np.uint32,
    "truth_scored": np.uint32,
    "prior_log_odds": np.float64,
}
LATCHED = {"/tf_static", "/cells", "/prior", "/map", "/map_without_prior"}
LATCHED |= {"/truth_map", "/plan_map", "/simulation"}
SENSOR = {"/particle_cloud"}  # best effort, as nav2 offers it
NEVER = "{sec: 9223372036, nsec: 854775807}"


@cache
def store() -> Typestore:
    """ROS 2 Humble's types and ours."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in OWN.items():
        types.register(get_types_from_msg(text, name))
    return types


def definition(name: str) -> str:
    """A type's definition with those that it is made of, as an MCAP schema "ros2msg" has it."""
    whole = store().generate_msgdef(name, ros_version=2)[0]
    if name not in OWN:
        return whole
    _, mark, others = whole.partition("=" * 80)
    return OWN[name] + mark + others  # our own text keeps its comments


def qos(topic: str) -> str:
    """What rosbag2 writes into a channel's metadata "offered_qos_profiles": keep last."""
    latched, sensor = topic in LATCHED, topic in SENSOR
    return f"""\
- history: 1
  depth: {1 if latched else 5 if sensor else 100}
  reliability: {2 if sensor else 1}
  durability: {1 if latched else 2}
  deadline: {NEVER}
  lifespan: {NEVER}
  liveliness: 1
  liveliness_lease_duration: {NEVER}
  avoid_ros_namespace_conventions: false
"""


def make(name: str, /, **fields: Any) -> Any:
    """A message or a part of one: "std_msgs/msg/Header"."""
    return store().types[name](**fields)


def encode(message: Any) -> bytes:
    """A message's CDR."""
    return bytes(store().serialize_cdr(message, message.__msgtype__))


def decode(data: bytes | memoryview, name: str) -> Any:
    """A message from its CDR. Raises whatever rosbags raises on damage."""
    return store().deserialize_cdr(bytes(data), name)


def header(time_ns: int, frame: str) -> Any:
    """std_msgs/Header."""
    return make("std_msgs/msg/Header", stamp=stamp(time_ns), frame_id=frame)


def stamp(time_ns: int) -> Any:
    """builtin_interfaces/Time. Seconds past 2038 wrap; the log time of the message does not."""
    seconds, rest = divmod(time_ns, 10**9)
    wrapped = (seconds + 2**31) % 2**32 - 2**31
    return make("builtin_interfaces/msg/Time", sec=wrapped, nanosec=rest)


def ros_pose(pose: Pose) -> Any:
    """geometry_msgs/Pose."""
    x, y, _, _, _, z, w = numbers(np.array([pose]))[0]
    return make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
        orientation=make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w),
    )


def occupancy_grid(time_ns: int, geometry: Geometry, cells: npt.NDArray[np.int8]) -> bytes:
    """nav_msgs/OccupancyGrid in the plan's frame; cells (rows * cols,) 0..100."""
    info = make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=stamp(time_ns),
        resolution=geometry.resolution,
        width=geometry.cols,
        height=geometry.rows,
        origin=ros_pose(Pose(geometry.x, geometry.y, 0.0)),
    )
    return encode(make(GRID, header=header(time_ns, PLAN), info=info, data=cells))


def static_transform(time_ns: int, map_to_plan: Pose) -> bytes:
    """tf2_msgs/TFMessage: map -> plan."""
    x, y, _, _, _, z, w = numbers(np.array([map_to_plan]))[0]
    transform = make(
        "geometry_msgs/msg/Transform",
        translation=make("geometry_msgs/msg/Vector3", x=x, y=y, z=0.0),
        rotation=make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w),
    )
    one = make(
        "geometry_msgs/msg/TransformStamped",
        header=header(time_ns, MAP),
        child_frame_id=PLAN,
        transform=transform,
    )
    return encode(make(TF, transforms=[one]))


def evidence_message(time_ns: int, geometry: Geometry, levels: int, change: Change) -> bytes:
    """replay_msgs/Evidence."""
    steps = np.diff(change.where, prepend=0).astype(np.uint32)
    message = make(
        EVIDENCE,
        stamp=stamp(time_ns),
        frame=change.frame,
        levels=levels,
        rows=geometry.rows,
        cols=geometry.cols,
        steps=steps,
        added=change.added,
    )
    return encode(message)


def checked_layers(
    layers: Mapping[str, npt.NDArray[Any]], geometry: Geometry
) -> dict[str, npt.NDArray[Any]]:
    """Layers in the types of replay_msgs/CellLayers; ValueError where that loses anything."""
    out = {}
    for name, layer in layers.items():
        if name not in LAYERS or layer.shape != geometry.shape:
            raise ValueError(f"the layer {name!r} and the grid do not fit together")
        out[name] = np.ascontiguousarray(layer, dtype=LAYERS[name])
        if not np.array_equal(out[name], layer):
            raise ValueError(f"the layer {name!r} does not fit into {LAYERS[name].__name__}")
    return out


def cells_message(geometry: Geometry, layers: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """replay_msgs/CellLayers of `checked_layers`."""
    absent = {name: np.zeros(0, kind) for name, kind in LAYERS.items()}
    fields = absent | {name: layer.reshape(-1) for name, layer in layers.items()}
    return encode(make(CELLS, rows=geometry.rows, cols=geometry.cols, **fields))


def groups_message(groups: Groups) -> bytes:
    """replay_msgs/CellGroups."""
    fields = {"kind": groups.kind, "counts": groups.counts.reshape(-1), "cells": groups.cells}
    return encode(make(GROUPS, levels=len(groups.counts), **fields))


class Channels:
    """Adds messages, registering each topic and type when it first comes.

    Maps and what holds once are offered as transient_local, so that late joiners get them; every
    other topic is volatile. Log time = publish time.
    """

    def __init__(self, writer: McapWriter) -> None:
        self._writer = writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.kinds: dict[str, str] = {}  # by topic, in the order of the channels

    def add(self, topic: str, kind: str, time: int, data: bytes, sequence: int = 0) -> None:
        """One message of a ROS 2 type."""
        self._writer.message(self._number(topic, kind), time, data, time, sequence)

    def block(
        self,
        times_ns: npt.NDArray[np.int64],
        first: int,
        streams: Sequence[tuple[str, str, npt.NDArray[Any]]],
    ) -> npt.NDArray[np.void]:
        """Frames `first`, ... with a message on each topic, for `add_frames`.

        Args:
            times_ns: (n,) of the frames.
            first: index of the first, the sequence number of its messages.
            streams: topic, type and records (n,), in the order of a frame's messages.
        """
        numbered = [(self._number(topic, kind), data) for topic, kind, data in streams]
        return block(times_ns, first, numbered)

    def add_frames(self, frames: npt.NDArray[np.void]) -> None:
        """Frames of a `block`."""
        self._writer.block(frames)

    def close_chunk(self) -> None:
        """What comes next begins a chunk, so that a reader need not open those before it."""
        self._writer.close_chunk()

    def _number(self, topic: str, kind: str) -> int:
        if topic not in self._channels:
            if kind not in self._schemas:
                text = definition(kind).encode()
                self._schemas[kind] = self._writer.schema(kind, "ros2msg", text)
            metadata = {"offered_qos_profiles": qos(topic)}
            number = self._writer.channel(topic, "cdr", self._schemas[kind], metadata)
            self._channels[topic], self.kinds[topic] = number, kind
        return self._channels[topic]
