"""Several robots in one log: whose transforms and poses are whose, by the namespaces of topics.

Robots that run the same nodes say the same under names of their own: /robot1/tf and /robot2/tf,
/robot1/odom and /robot2/odom, with frames that are often called the same.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Literal

from formats.errors import Notes, printable
from formats.log import Log, Topic
from formats.sensing.scans import SENSORS
from formats.streaming.gathering import POSE_TYPES, TF_TYPES

Name = tuple[str, ...]
Role = Literal["scan", "way", "fixed", ""]  # what says where the robot is; what is mounted on it


def of_others(log: Log, scans: Collection[Topic], notes: Notes | None = None) -> set[Topic]:
    """Transforms and poses that belong to none of the robots that scans are of, and are noted."""
    each = [strangers(log.topics(), scan) for scan in scans]
    others = set.intersection(*each) if each else set()
    if others and notes is not None:
        names = ", ".join(sorted(printable(topic.name) for topic in others))
        notes.info(log.path, f"of other robots, left out: {names}")
    return others


def strangers(topics: Iterable[Topic], scan: Topic) -> set[Topic]:
    """Transforms and poses that belong to other robots than the scan does.

    A namespace is another robot's where the same is said in it, and by the same kind of topic, as
    in one that the scan lies in. Where one of the two robots has no namespace, it must be both
    scans and transforms or poses.
    """
    told = [topic for topic in topics if _role(topic)]
    known = {(parts(topic), topic.type) for topic in told}
    own = parts(scan)[:-1]
    twins: dict[tuple[Name, Name], set[Role]] = {}
    for topic in told:
        name = parts(topic)
        for home, space in _compared(own, name):
            if ((*home, *name[len(space) :]), topic.type) in known:
                twins.setdefault((home, space), set()).add(_role(topic))
    spaces = {
        space
        for (home, space), roles in twins.items()
        if "way" in roles and ((home and space) or "scan" in roles)
    }
    return {
        topic
        for topic in told
        if _role(topic) != "scan" and any(_inside(parts(topic), space) for space in spaces)
    }


def parts(topic: Topic) -> Name:
    """The parts of a name: namespaces, and its own last."""
    return tuple(topic.name.strip("/").split("/"))


def _compared(own: Name, name: Name) -> Iterator[tuple[Name, Name]]:
    """Namespaces of the scan, and those of a topic that may be another robot's in its stead."""
    if len(name) == 1:
        if own:
            yield own[:1], ()
        return
    for depth in range(1, min(len(own) + 1, len(name))):
        if name[:depth] != own[:depth]:
            yield own[:depth], name[:depth]
    if name[:1] != own[:1]:
        yield (), name[:1]


def _inside(name: Name, space: Name) -> bool:
    """Whether a topic is of a namespace; of the robot without one those that stand in none."""
    return name[: len(space)] == space if space else len(name) == 1


def _role(topic: Topic) -> Role:
    if topic.type in SENSORS:
        return "scan"
    if topic.type in POSE_TYPES:
        return "way"
    if topic.type in TF_TYPES:
        return "fixed" if topic.name.rstrip("/").endswith("tf_static") else "way"
    return ""
