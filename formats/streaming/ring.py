"""A ring of ultrasonic or infrared sensors, each on a topic of its own, read as one topic."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import takewhile

from formats.errors import Notes
from formats.log import Container, Log, Message, Topic
from formats.streaming.robots import of_others

RANGE = "sensor_msgs/msg/Range"


class Ring:
    """A log in which the topics of a ring are one, named by what their names share."""

    def __init__(self, log: Log, ring: list[Topic]) -> None:
        self._log, self._ring, self.path = log, ring, log.path
        self._names = {topic.name for topic in ring}
        counts = [topic.count for topic in ring]
        total = None if None in counts else sum(count or 0 for count in counts)
        self.joined = replace(ring[0], name=shared([t.name for t in ring]), count=total)

    @property
    def container(self) -> Container:
        """Of the log."""
        return self._log.container

    def topics(self) -> list[Topic]:
        """Those of the log, the ring as one."""
        rest = [topic for topic in self._log.topics() if not self._joins(topic)]
        return sorted([*rest, self.joined], key=lambda topic: (topic.name, topic.type))

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """As the log gives them."""
        wanted = self.topics() if topics is None else topics
        inner = [topic for topic in wanted if topic != self.joined]
        if len(inner) < len(wanted):
            inner += self._ring
        for message in self._log.messages(inner):
            yield message._replace(topic=self.joined) if self._joins(message.topic) else message

    def close(self) -> None:
        """Close the log."""
        self._log.close()

    def _joins(self, topic: Topic) -> bool:
        return topic.type == RANGE and topic.name in self._names


def ringed(log: Log, scans: list[Topic], notes: Notes) -> tuple[Log, list[Topic]]:
    """The log with its sonars as one topic, where the scans to choose from are one robot's sonars.

    Otherwise the log and the scans as they are.
    """
    kinds = {(topic.type, topic.encoding, topic.definition) for topic in scans}
    several = len(scans) > 1 and len(kinds) == 1 and scans[0].type == RANGE
    if not several or any(of_others(log, [topic]) for topic in scans):
        return log, scans
    ring = Ring(log, scans)
    notes.info(log.path, f"{len(scans)} Range topics are one ring: {ring.joined.name}")
    return ring, [ring.joined]


def shared(names: list[str]) -> str:
    """What names begin with, a star for the rest, and whole parts that they end with."""
    start = _alike(names)
    end = _alike([name[len(start) :][::-1] for name in names])[::-1]
    return f"{start}*{end[end.find('/') :] if '/' in end else ''}"


def _alike(words: list[str]) -> str:
    """What all words begin with."""
    return "".join(c[0] for c in takewhile(lambda c: len(set(c)) == 1, zip(*words, strict=False)))
