"""The camera behind a topic of depth images: its camera_info."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formats.depth.scans import camera_fault
from formats.errors import FormatError, Notes, Path, UsageError, printable
from formats.log import Log, Topic
from formats.messages import CameraInfo

CAMERA_TYPES = ("sensor_msgs/msg/CameraInfo", "foxglove.CameraCalibration")


@dataclass
class Camera:
    """What a topic says of its camera: the first calibration that can be used counts.

    Attributes:
        topic: of a type in CAMERA_TYPES.
        info: None as long as none can be used.
        fault: why the others cannot.
    """

    topic: Topic
    info: CameraInfo | None = None
    fault: str = ""

    def add(self, info: CameraInfo, notes: Notes, path: Path) -> None:
        """One more message."""
        fault = camera_fault(info)
        if fault:
            self.fault = fault
            notes.warn(path, f"{fault}: ignored", topic=self.topic.name)
        elif self.info is None:
            self.info = info
        elif not np.array_equal(info.k, self.info.k) or info[2:4] != self.info[2:4]:
            notes.warn(path, "camera_info changes: the first one counts", topic=self.topic.name)


def info_names(picture: str) -> list[str]:
    """Where the camera_info of a topic of pictures may be, likeliest first.

    image_transport's rule: beside the pictures; of compressed ones ("image_raw/compressedDepth")
    beside those that they are made of.
    """
    parts = picture.rstrip("/").split("/")
    names = ["/".join([*parts[:-depth], "camera_info"]) for depth in (1, 2) if depth < len(parts)]
    return names[::-1] if parts[-1].startswith("compressed") else names[:1]


def info_topic(log: Log, picture: Topic, wish: str = "") -> Topic | None:
    """The camera_info of a topic of pictures: where it ought to be, else the only one beside it.

    Raises:
        UsageError: the wished topic is not there or is of another type.
    """
    found = [t for t in log.topics() if t.type in CAMERA_TYPES and t.count != 0]
    if wish:
        for topic in found:
            if topic.name.lstrip("/") == wish.lstrip("/"):
                return topic
        there = ", ".join(printable(t.name) for t in found) or "none"
        raise UsageError(log.path, "no such camera_info", topic=wish, hint=f"there are: {there}")
    names = info_names(picture.name)
    for name in names:
        for topic in found:
            if topic.name == name:
                return topic
        space = name.rsplit("/", 1)[0]
        beside = [topic for topic in found if topic.name.rsplit("/", 1)[0] == space]
        if len(beside) == 1:
            return beside[0]
    return None


def calibration(log: Log, picture: Topic, camera: Camera | None) -> CameraInfo:
    """The camera of a topic of pictures.

    Raises:
        FormatError: it has none that can be used.
    """
    if camera is None:
        others = [printable(t.name) for t in log.topics() if t.type in CAMERA_TYPES]
        looked = " and ".join(info_names(picture.name))
        problem = f"no camera_info: looked for {looked}; found {', '.join(others) or 'none'}"
        hint = "name it with --camera-info TOPIC" if others else "record it with the depth images"
        raise FormatError(log.path, problem, topic=picture.name, hint=hint)
    if camera.info is None:
        problem = camera.fault or "no camera_info is readable"
        raise FormatError(log.path, problem, topic=camera.topic.name, hint="calibrate the camera")
    return camera.info
